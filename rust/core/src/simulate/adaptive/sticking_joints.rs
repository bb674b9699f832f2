//! The joints of a run that stick and slip, with their modes.

use crate::plant::LoopStickSlip;
use crate::simulate::problem::Problem;

/// The joints or motors of a plant that stick and slip.
pub struct StickingJoints {
    pub friction: LoopStickSlip<f64>,
    /// The index in the state of the first speed.
    pub first: usize,
    /// Memory for the numbers of [`LoopStickSlip::loads`].
    pub loads: Vec<f64>,
    pub margins: Vec<f64>,
}

impl StickingJoints {
    /// Return the joints of the plant of run `run`; `None` if they do not stick.
    pub fn of(problem: &Problem, run: usize) -> Option<Self> {
        let (friction, first) = problem.plant(run).sticking_friction()?;
        let loads = friction.loads();
        let n = friction.sides().len();
        Some(StickingJoints { friction, first, loads, margins: vec![0.0; n] })
    }

    /// The mode of each joint: 0 is stuck, and 1 or -1 is the direction in which the joint slides.
    pub fn sides(&self) -> &[i8] {
        self.friction.sides()
    }

    pub fn speeds<'a>(&self, x: &'a [f64]) -> &'a [f64] {
        &x[self.first..self.first + self.margins.len()]
    }

    pub fn speeds_mut<'a>(&self, x: &'a mut [f64]) -> &'a mut [f64] {
        &mut x[self.first..self.first + self.margins.len()]
    }
}
