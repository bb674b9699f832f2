//! Where the recorded quantities stand in a loop's state.

use super::problem::Problem;
use crate::plant::PlantKind;

/// The sizes of a loop's records.
#[derive(Clone, Copy, Debug)]
pub struct Columns {
    pub kind: PlantKind,
    pub n: usize,
    /// Size of the law's state.
    pub p: usize,
}

/// The parts of one record.
pub struct Parts<'a> {
    pub q: &'a [f64],
    pub v: &'a [f64],
    pub theta: &'a [f64],
    pub theta_dot: &'a [f64],
    pub z: &'a [f64],
}

impl Columns {
    pub fn of(problem: &Problem) -> Self {
        let plant = problem.plant(0);
        Columns { kind: plant.kind(), n: plant.n(), p: problem.law(0).initial_state().len() }
    }

    /// Motor positions per record: none without elastic joints.
    pub fn motors(&self) -> usize {
        if self.kind == PlantKind::Elastic { self.n } else { 0 }
    }

    /// The parts of a state `x = [plant, z, ..]` under the input `tau`, which is the velocity where it is commanded.
    pub fn split<'a>(&self, x: &'a [f64], tau: &'a [f64]) -> Parts<'a> {
        let (n, states, motors) = (self.n, self.kind.states(self.n), self.motors());
        Parts {
            q: &x[..n],
            v: if self.kind == PlantKind::Velocity { tau } else { &x[n..2 * n] },
            theta: &x[states - 2 * motors..states - motors],
            theta_dot: &x[states - motors..states],
            z: &x[states..states + self.p],
        }
    }
}
