//! The requests of the caller for observations of a run, and their results: events, modes of the contacts, and polynomials of the steps.

use super::event::{Crossings, Event};
use crate::error::{Error, Result};
use crate::memory;
use crate::plant::Touch;

/// The polynomials of the steps of a run, given by their values at the Chebyshev points of each step.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # use std::sync::atomic::AtomicBool;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Polynomials, Problem, RunObserver, simulate_observed};
///
/// let mut observer = RunObserver { polynomials: Some(Polynomials::default()), ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(2.0))?;
/// let run = simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// let Polynomials { degree, ends, nodes } = observer.polynomials.unwrap_or_default();
/// assert_eq!((ends.len() as u64, ends.last()), (run.steps, Some(&2.0)));
/// // Each step has `degree + 1` values of both states.
/// assert_eq!(nodes.len(), ends.len() * (degree + 1) * 2);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Polynomials {
    /// The degree of each polynomial.
    pub degree: usize,
    /// The end of each step, s.
    pub ends: Vec<f64>,
    /// The values, shape `(steps, degree + 1, states)`. The states are the states of plant and law.
    pub nodes: Vec<f64>,
}

/// Identifies a function whose change of sign changes the mode of a contact: the penetration depth or the push.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec, Stops}};
/// # use nalgebra::dvector;
/// # use std::sync::atomic::AtomicBool;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let stops = Some(Stops::new(vec![-0.5], vec![f64::INFINITY], vec![1e3], vec![0.0])?);
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec { stops, ..RigidSpec::new(model.clone()) }));
/// use armlet_core::simulate::{Guard, Options, Problem, RunObserver, simulate_observed};
///
/// // The joint swings against its stop, which is contact 0.
/// let mut observer = RunObserver { contacts: Some(Vec::new()), ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(2.2))?;
/// simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// let contacts = observer.contacts.unwrap_or_default();
/// // The penetration depth, not the push, changed its sign.
/// assert_eq!(contacts[1].by, Some(Guard { contact: 0, by_push: false }));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guard {
    /// The index of the contact. The wall is first, then the stops.
    pub contact: usize,
    /// Whether the function is the push; otherwise it is the penetration depth.
    pub by_push: bool,
}

/// The modes of all contacts from the time `t`, s, on.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec, Stops, Touch}};
/// # use nalgebra::dvector;
/// # use std::{f64::consts::PI, sync::atomic::AtomicBool};
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let stops = Some(Stops::new(vec![-0.5], vec![f64::INFINITY], vec![1e3], vec![0.0])?);
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec { stops, ..RigidSpec::new(model.clone()) }));
/// use armlet_core::simulate::{Options, Problem, RunObserver, Switched, simulate_observed};
///
/// // The joint moves with q = cos t, up to its stop at -0.5 rad.
/// let mut observer = RunObserver { contacts: Some(Vec::new()), ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(2.1))?;
/// simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// let Switched { t, touches, .. } = &observer.contacts.unwrap_or_default()[1];
/// assert!((t - 2.0 * PI / 3.0).abs() < 1e-6 && *touches == [Touch::Pressed]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Switched {
    /// Time of the change, s.
    pub t: f64,
    /// The function that changed its sign. `None` if the modes are computed from the state at `t`.
    pub by: Option<Guard>,
    /// The mode of each contact. The wall is first, then the stops.
    pub touches: Vec<Touch>,
}

/// The requests for events, contact modes and polynomials of a run, and their results.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # use std::f64::consts::PI;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Event, EventFunction, Options, Problem, RunObserver, simulate_observed};
/// use std::{sync::Arc, sync::atomic::AtomicBool};
///
/// // The joint oscillates with v = -sin t. It slows below 0.5 rad/s at the time 5/6 pi, and again at 11/6 pi.
/// let fast = EventFunction::Function(Arc::new(|_, x| Some(x[1].abs() - 0.5)));
/// let mut observer = RunObserver { events: vec![Event { function: fast, direction: -1.0, stop_after: 0 }], ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(6.0))?;
/// simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// assert_eq!(observer.crossings.t.len(), 2);
/// assert!((observer.crossings.t[0] - 5.0 * PI / 6.0).abs() < 1e-6 && observer.full.is_none());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Default)]
pub struct RunObserver {
    /// The modes of the contacts at the start and after each change; `None` if they are not requested.
    pub contacts: Option<Vec<Switched>>,
    /// The requested events.
    pub events: Vec<Event>,
    /// The crossings of all events.
    pub crossings: Crossings,
    /// The polynomials of the steps; `None` if they are not requested.
    pub polynomials: Option<Polynomials>,
    /// The error after which no more results are stored, because the memory is full.
    pub full: Option<Error>,
}

impl RunObserver {
    /// Store the modes of the contacts from time `t` on.
    pub(in crate::simulate) fn store_contacts(&mut self, t: f64, by: Option<Guard>, touches: &[Touch]) {
        self.store(|observer| {
            let Some(contacts) = &mut observer.contacts else { return Ok(()) };
            if contacts.len() == contacts.capacity() {
                memory::more(contacts, contacts.len().max(1))?;
            }
            contacts.push(Switched { t, by, touches: memory::collected(touches.iter().copied())? });
            Ok(())
        });
    }

    /// Store a result, unless the memory is already full.
    pub(in crate::simulate) fn store(&mut self, answer: impl FnOnce(&mut Self) -> Result<()>) {
        if self.full.is_none() {
            self.full = answer(self).err();
        }
    }
}
