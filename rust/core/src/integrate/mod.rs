//! Initial-value problems `x' = f(u(t), x)`: one method per file, each generic over the number it runs on.
//!
//! The exogenous input `u(t)` (desired motion, applied force) is asked for once per distinct stage time; for
//! a plain `x' = f(t, x)` it is the time itself.

pub mod dop853;
mod dop853_tableau;
mod rk4;

pub use rk4::Rk4;

use crate::scalar::Real;

/// What is integrated.
pub trait System<S: Real> {
    /// The exogenous signal at one instant.
    type Input: Clone;

    fn input(&mut self, t: f64, u: &mut Self::Input);
    /// Called with the state at the start of a step: what `rhs` may reuse at nearby states.
    fn anchor(&mut self, x: &[S]);
    fn rhs(&mut self, u: &Self::Input, x: &[S], dx: &mut [S]);
    /// Called with the state at every sample of a sampled loop: what is held until the next one.
    fn sample(&mut self, _t: f64, _x: &[S]) {}
}

/// Where a state lives: an array for small closed-form systems, the heap for any other.
pub trait Buffer<S>: Clone + AsRef<[S]> + AsMut<[S]> {}
impl<S, B: Clone + AsRef<[S]> + AsMut<[S]>> Buffer<S> for B {}

/// A method of fixed step.
pub trait FixedStep<S: Real, F: System<S>, B: Buffer<S>> {
    /// Advance `x` from `t` to `t + h`. `end` is the time at which the input at the end is taken: `t + h`, or
    /// just before it where the input jumps there.
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B);
    /// Forget what was kept of the previous step: the input or the state has jumped.
    fn restart(&mut self);
}
