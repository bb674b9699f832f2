//! The explicit Euler method, order 1: `x += h f(t, x)`.

use super::{Advance, Buffer, FixedStep, System};
use crate::scalar::Real;

/// The instants of the inputs, as parts of the step.
pub(super) const INSTANTS: &[f64] = &[0.0];

/// The explicit Euler method.
pub struct Euler<B, U> {
    k: B,
    u: U,
}

impl<B: Clone, U: Clone> Euler<B, U> {
    /// The method; `state` and `input` give the sizes.
    pub fn new(state: B, input: U) -> Self {
        Euler { k: state, u: input }
    }
}

impl<S: Real, F: System<S>, B: Buffer<S>> FixedStep<S, F, B> for Euler<B, F::Input> {
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        self.advance_anew(system, t, h, end, x);
    }

    fn restart(&mut self) {}
}

impl<S: Real, F: System<S>, B: Buffer<S>> Advance<S, F, B> for Euler<B, F::Input> {
    const INSTANTS: &'static [f64] = INSTANTS;

    fn input(&mut self, _: usize) -> &mut F::Input {
        &mut self.u
    }

    fn advance(&mut self, system: &mut F, h: S, x: &mut B) {
        let (x, k) = (x.as_mut(), self.k.as_mut());
        system.rhs(&self.u, x, k);
        for i in 0..x.len() {
            x[i] = h.mul_add(k[i], x[i]);
        }
    }
}
