//! Events of a run: zero crossings of functions of time and the plant's state. All functions except functions of the user are compiled
//! code.

use super::switching::Probe;
use crate::error::Result;
use crate::memory::append;
use crate::spatial::{Vector, Vector3};
use std::sync::Arc;

/// A function `g(t, x)` of the user. `t`: time, s. `x`: state of the plant. The result `None` stops the run.
pub type Signal = Arc<dyn Fn(f64, &[f64]) -> Option<f64> + Send + Sync>;

/// The function `g` whose zero is the event.
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
