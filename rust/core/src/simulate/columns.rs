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
pub struct Parts<'a, S> {
    pub q: &'a [S],
    pub v: &'a [S],
    pub theta: &'a [S],
    pub theta_dot: &'a [S],
    pub z: &'a [S],
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
    pub fn split<'a, S>(&self, x: &'a [S], tau: &'a [S]) -> Parts<'a, S> {
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
