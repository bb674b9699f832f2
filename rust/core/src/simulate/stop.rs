//! Requests to stop a run: from another thread, or from a function that the run calls regularly.

use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The shortest time between two checks.
const SLICE: Duration = Duration::from_millis(20);
/// The number of calls between two readings of the clock. Each block of fixed steps and each adaptive step makes one call.
const CALLS_PER_CLOCK: u32 = 16;

/// A source of requests to stop, which a run checks regularly.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}, status::Status};
/// # use nalgebra::dvector;
/// # use std::sync::atomic::AtomicBool;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, Stop, simulate};
///
/// struct Never;
/// impl Stop for Never {
///     fn requested(&self) -> bool {
///         false
///     }
/// }
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(1.0, 1e-3))?;
/// assert_eq!(simulate(&problem, &Never)?.status, Status::Success);
/// // Another thread can set this flag.
/// assert_eq!(simulate(&problem, &AtomicBool::new(true))?.status, Status::Interrupted);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Stop {
    /// Whether the run must stop.
    fn requested(&self) -> bool;
}

impl Stop for AtomicBool {
    fn requested(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}

/// Calls `poll` on the thread of the run, at most once per 20 ms. So Ctrl-C requires no other thread.
///
/// ```
/// use armlet_core::simulate::{Poller, Stop};
///
/// let mut polls = 0;
/// let mut poll = || {
///     polls += 1;
///     polls == 2
/// };
/// let stop = Poller::new(&mut poll);
/// while !stop.requested() {}
/// // The second call requested the stop, after 40 ms.
/// assert_eq!(polls, 2);
/// ```
pub struct Poller<'a> {
    poll: RefCell<&'a mut dyn FnMut() -> bool>,
    questions: Cell<u32>,
    next: Cell<Option<Instant>>,
    stopped: Cell<bool>,
}

impl<'a> Poller<'a> {
    /// Create a check that calls `poll`.
    pub fn new(poll: &'a mut dyn FnMut() -> bool) -> Self {
        Poller { poll: RefCell::new(poll), questions: Cell::new(0), next: Cell::new(None), stopped: Cell::new(false) }
    }

    #[cold]
    #[inline(never)]
    fn poll(&self) -> bool {
        let now = Instant::now();
        match self.next.get() {
            Some(next) if now < next => {}
            Some(_) => {
                if (self.poll.borrow_mut())() {
                    self.stopped.set(true);
                }
                self.next.set(Some(now + SLICE));
            }
            None => self.next.set(Some(now + SLICE)),
        }
        self.stopped.get()
    }
}

impl Stop for Poller<'_> {
    fn requested(&self) -> bool {
        let questions = self.questions.get() + 1;
        self.questions.set(questions % CALLS_PER_CLOCK);
        if questions < CALLS_PER_CLOCK { self.stopped.get() } else { self.poll() }
    }
}
