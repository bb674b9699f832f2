//! Events of a run: zero crossings of functions of time and the plant's state, evaluated natively, except functions of the user.

use super::switching::Probe;
use crate::error::Result;
use crate::memory::append;
use crate::spatial::{Vector, Vector3};
use std::sync::Arc;

/// A function `g(t, x)` of the caller; `None` stops the run.
pub type Signal = Arc<dyn Fn(f64, &[f64]) -> Option<f64> + Send + Sync>;

/// The function whose zero is the event.
#[derive(Clone)]
pub enum EventFunction {
    /// `q_i - value`, or `value - q_i`.
    Joint {
        /// Index of the joint.
        joint: usize,
        /// Position, rad or m.
        value: f64,
        /// Take `value - q_i`.
        below: bool,
    },
    /// `v_i - value`; `at` is the index of `v_i` in the plant's state.
    Speed {
        /// Index in the plant's state.
        at: usize,
        /// Speed, rad/s or m/s.
        value: f64,
    },
    /// `normal . (p - point)` of the origin of a frame, world axes.
    Plane {
        /// Index of the frame.
        frame: usize,
        /// A point of the plane, world axes, m.
        point: [f64; 3],
        /// Normal of the plane, world axes.
        normal: [f64; 3],
    },
    /// A function of the caller.
    Function(Signal),
}

impl EventFunction {
    /// Value at time `t` and plant state `x`.
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

/// The functions of the events.
#[derive(Clone)]
pub struct Event {
    /// The function.
    pub function: EventFunction,
    /// Rising crossings only where positive, falling only where negative, both where zero.
    pub direction: f64,
    /// End the run at this many crossings; zero to record them alone.
    pub stop_after: usize,
}

/// The crossings found, in order of time.
#[derive(Clone, Debug, Default)]
pub struct Crossings {
    /// Which event.
    pub index: Vec<usize>,
    /// Times of the crossings, s.
    pub t: Vec<f64>,
    /// States of the plant, `(m, states)`.
    pub x: Vec<f64>,
}

impl Crossings {
    /// Append a crossing.
    pub fn add(&mut self, index: usize, t: f64, x: &[f64]) -> Result<()> {
        append(&mut self.index, &[index])?;
        append(&mut self.t, &[t])?;
        append(&mut self.x, x)
    }
}
