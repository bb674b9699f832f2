//! Events of a run: zero crossings of functions of time and the plant's state.

use super::probe::Probe;
use crate::error::Result;
use crate::memory::append;
use crate::spatial::{Vector, Vector3};
use std::sync::Arc;

/// A function `g(t, x)` of the user. `t`: time, s. `x`: state of the plant. The result `None` stops the run.
pub type Signal = Arc<dyn Fn(f64, &[f64]) -> Option<f64> + Send + Sync>;

/// The function `g` whose zero is the event.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # use std::{f64::consts::PI, sync::Arc, sync::atomic::AtomicBool};
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Event, EventFunction, Options, Problem, RunObserver, simulate_observed};
///
/// // The joint oscillates with q = cos t.
/// let functions = [
///     EventFunction::Joint { joint: 0, value: 0.0, below: false },
///     EventFunction::Function(Arc::new(|_, x| Some(x[0] - 0.5))),
/// ];
/// let events = functions.map(|function| Event { function, direction: 0.0, stop_after: 0 }).to_vec();
/// let mut observer = RunObserver { events, ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(2.0))?;
/// simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// let t = observer.crossings.t;
/// assert!((t[0] - PI / 3.0).abs() < 1e-6 && (t[1] - PI / 2.0).abs() < 1e-6);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub enum EventFunction {
    /// `g = q_i - value`, or `g = value - q_i` if `below` is true.
    Joint {
        /// Index of the joint.
        joint: usize,
        /// Position, rad or m.
        value: f64,
        /// Whether `g = value - q_i`.
        below: bool,
    },
    /// `g = v_i - value`, the velocity of a joint or motor relative to a value.
    Speed {
        /// Index of `v_i` in the plant's state.
        at: usize,
        /// Velocity, rad/s or m/s.
        value: f64,
    },
    /// `g = normal . (p - point)`, where `p` is the origin of a frame, m. All vectors are in world axes.
    Plane {
        /// Index of the frame.
        frame: usize,
        /// A point of the plane, in world axes, m.
        point: [f64; 3],
        /// Normal of the plane, in world axes.
        normal: [f64; 3],
    },
    /// A function `g(t, x)` that the user supplies.
    Function(Signal),
}

impl EventFunction {
    /// Return the value of `g` at time `t`, s, and plant state `x`.
    pub fn value(&self, probe: &mut Probe, t: f64, x: &[f64]) -> f64 {
        match self {
            EventFunction::Joint { joint, value, below: false } => x[*joint] - value,
            EventFunction::Joint { joint, value, below: true } => value - x[*joint],
            EventFunction::Speed { at, value } => x[*at] - value,
            EventFunction::Plane { frame, point, normal } => Vector3::from(*normal).dot(probe.frame(*frame, x).0 - Vector3::from(*point)),
            EventFunction::Function(call) => call(t, x).unwrap_or(f64::NAN),
        }
    }
}

/// An event of a run.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}, status::Status};
/// # use nalgebra::dvector;
/// # use std::{f64::consts::PI, sync::atomic::AtomicBool};
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Event, EventFunction, Options, Problem, RunObserver, simulate_observed};
///
/// // The joint oscillates with q = cos t. Its first rising crossing of zero ends the run.
/// let function = EventFunction::Joint { joint: 0, value: 0.0, below: false };
/// let mut observer = RunObserver { events: vec![Event { function, direction: 1.0, stop_after: 1 }], ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(8.0))?;
/// let run = simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// assert!(run.status == Status::Event && (run.ended - 1.5 * PI).abs() < 1e-6);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct Event {
    /// The function whose zero is the event.
    pub function: EventFunction,
    /// Positive: only rising crossings count. Negative: only falling crossings count. Zero: both count.
    pub direction: f64,
    /// The number of crossings after which the run ends. Zero: the run does not end.
    pub stop_after: usize,
}

/// All crossings of a run, in order of time.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # use std::{f64::consts::PI, sync::atomic::AtomicBool};
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Crossings, Event, EventFunction, Options, Problem, RunObserver, simulate_observed};
///
/// // The joint oscillates with q = cos t.
/// let function = EventFunction::Joint { joint: 0, value: 0.0, below: false };
/// let mut observer = RunObserver { events: vec![Event { function, direction: 0.0, stop_after: 0 }], ..RunObserver::default() };
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::adaptive(6.0))?;
/// simulate_observed(&problem, &AtomicBool::new(false), Some(&mut observer))?;
/// let Crossings { index, t, x } = observer.crossings;
/// assert!(index == [0, 0] && (t[1] - 1.5 * PI).abs() < 1e-6);
/// // The states `[q, v]` at both crossings: first it falls, then it rises.
/// assert!((x[1] + 1.0).abs() < 1e-6 && (x[3] - 1.0).abs() < 1e-6);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Crossings {
    /// Index of the event of each crossing, shape `(m,)`.
    pub index: Vec<usize>,
    /// Times of the crossings, shape `(m,)`, s.
    pub t: Vec<f64>,
    /// States of the plant at the crossings, shape `(m, states)`.
    pub x: Vec<f64>,
}

impl Crossings {
    /// Append a crossing of event `index` at time `t`, s, and plant state `x`. Errors: [`Error::Memory`](crate::error::Error::Memory).
    pub fn add(&mut self, index: usize, t: f64, x: &[f64]) -> Result<()> {
        append(&mut self.index, &[index])?;
        append(&mut self.t, &[t])?;
        append(&mut self.x, x)
    }
}
