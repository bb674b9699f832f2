//! The positions of the recorded quantities in a loop's state and in a record.

use super::problem::Problem;
use crate::plant::PlantKind;
use std::ops::Range;

/// The sizes of the parts of a loop's state.
#[derive(Clone, Copy, Debug)]
pub struct Columns {
    pub kind: PlantKind,
    pub n: usize,
    /// The size of the law's state.
    pub p: usize,
    /// The number of bristles of LuGre friction.
    pub bristles: usize,
}

/// The ranges of the quantities in a record `[x, tau, monitors]`.
pub struct SampleColumns {
    pub q: Range<usize>,
    pub v: Range<usize>,
    pub tau: Range<usize>,
    pub theta: Range<usize>,
    pub theta_dot: Range<usize>,
    pub z: Range<usize>,
    pub bristles: Range<usize>,
    /// The index of the first monitor.
    pub monitors: usize,
}

/// The parts of one state or record.
pub struct Parts<'a, S> {
    pub q: &'a [S],
    pub v: &'a [S],
    pub theta: &'a [S],
    pub theta_dot: &'a [S],
    pub z: &'a [S],
    pub bristles: &'a [S],
}

impl Columns {
    pub fn of(problem: &Problem) -> Self {
        let plant = problem.plant(0);
        Columns { kind: plant.kind(), n: plant.n(), p: problem.law(0).initial_state().len(), bristles: plant.bristles() }
    }

    /// The number of motor positions per record. It is zero without elastic joints.
    pub fn motors(&self) -> usize {
        if self.kind.has_motors() { self.n } else { 0 }
    }

    /// The ranges in a record. `size` is the size of the state `x = [plant, z, ..]`. For a velocity-controlled plant, the velocities are
    /// the input.
    pub fn places(&self, size: usize) -> SampleColumns {
        let (n, states, motors) = (self.n, self.kind.states(self.n), self.motors());
        SampleColumns {
            q: 0..n,
            v: if self.kind.has_speeds() { n..2 * n } else { size..size + n },
            tau: size..size + n,
            theta: states - 2 * motors..states - motors,
            theta_dot: states - motors..states,
            bristles: states..states + self.bristles,
            z: states + self.bristles..states + self.bristles + self.p,
            monitors: size + n,
        }
    }

    /// The ranges of the quantities in a record: positions, velocities, inputs, motor positions and velocities, the law's state, bristles,
    /// and each monitor.
    pub fn series(&self, size: usize, monitors: usize) -> Vec<Range<usize>> {
        let SampleColumns { q, v, tau, theta, theta_dot, z, bristles, monitors: first } = self.places(size);
        let own = [q, v, tau, theta, theta_dot, z, bristles].into_iter();
        own.chain((first..first + monitors).map(|k| k..k + 1)).collect()
    }

    /// Divide a state `x` into its parts. `tau` is the input.
    pub fn split<'a, S>(&self, x: &'a [S], tau: &'a [S]) -> Parts<'a, S> {
        let SampleColumns { q, v, theta, theta_dot, z, bristles, .. } = self.places(x.len());
        let v = if self.kind.has_speeds() { &x[v] } else { tau };
        Parts { q: &x[q], v, theta: &x[theta], theta_dot: &x[theta_dot], z: &x[z], bristles: &x[bristles] }
    }
}
