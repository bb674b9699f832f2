//! The system of a Python callable `f(t, y)`, and its derivatives. The time `s` always increases: `dy/ds = f` with `s = t`, or
//! `dy/ds = -f` with `s = -t` if the span decreases.

use super::jacobian::Jacobian;
use super::slope::Slope;
use armlet_core::integrate::{Differentiable, System};
use pyo3::prelude::*;

pub struct Field {
    pub slope: Slope,
    jacobian: Jacobian,
    /// Start and end of the time `s`.
    span: (f64, f64),
    /// The number of positions. They are the first components of the state, and the same number of velocities follows.
    positions: usize,
    /// The number of evaluations of the Jacobian. A constant Jacobian has none.
    pub jacobians: u64,
    /// The number of evaluations of `f` for difference quotients.
    pub differenced: u64,
    down: Vec<f64>,
}

impl Field {
    pub fn new(slope: Slope, jacobian: Jacobian, span: (f64, f64), positions: usize, n: usize) -> Self {
        Field { slope, jacobian, span, positions, jacobians: 0, differenced: 0, down: vec![0.0; n] }
    }
}

impl System<f64> for Field {
    /// The input of the right-hand side is the time `s`.
    type Input = f64;

    fn input(&mut self, t: f64, u: &mut f64) {
        *u = t;
    }
    fn rhs(&mut self, t: &f64, x: &[f64], dx: &mut [f64]) {
        self.slope.at(*t, x, 1, dx);
    }
    fn rate_of(&self, i: usize) -> Option<usize> {
        (i < self.positions).then_some(i + self.positions)
    }
    fn is_reversed(&self) -> bool {
        self.slope.direction < 0.0
    }
    /// The number of attempted steps at a jump of `f` after which the run ends. It is a hundredth of the default, because evaluations in
    /// Python are slow.
    fn chatter_budget(&self) -> u64 {
        5_000
    }
}

impl Differentiable<f64> for Field {
    fn linearise(&mut self, t: f64, _: &f64, x: &[f64], dx: &mut [f64], j: &mut [f64]) {
        self.slope.at(t, x, 1, dx);
        let before = self.slope.evaluations;
        self.jacobians += u64::from(self.jacobian.at(&mut self.slope, t, x, dx, j));
        self.differenced += self.slope.evaluations - before;
    }

    /// The difference quotient is central, and one-sided at the ends of the span, because `f` may be undefined outside of the span.
    fn time_derivative(&mut self, t: f64, _: &f64, x: &[f64], dft: &mut [f64]) {
        let step = (f64::EPSILON * t.abs().max(1e-5)).sqrt();
        let (above, below) = ((t + step).min(self.span.1), (t - step).max(self.span.0));
        let before = self.slope.evaluations;
        self.slope.at(above, x, 1, dft);
        self.slope.at(below, x, 1, &mut self.down);
        self.differenced += self.slope.evaluations - before;
        let width = above - below;
        for (up, down) in dft.iter_mut().zip(&self.down) {
            *up = if width > 0.0 { (*up - down) / width } else { 0.0 };
        }
    }

    fn stopped(&mut self) -> bool {
        if self.slope.error.is_none() {
            self.slope.error = Python::attach(|py| py.check_signals()).err();
        }
        self.slope.error.is_some()
    }
}
