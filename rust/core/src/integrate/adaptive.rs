//! Adaptive methods: common definitions. A method integrates from `t` to `t_end`, and chooses the size of each step. A step from the
//! state `x` to the state `x_new` has the error estimate
//!
//! `error = sqrt(1/m sum ((x_new - x_embedded)_i / (atol_i + rtol_i max(|x_i|, |x_new_i|)))^2)`,
//!
//! where `m` is the number of components with error control, and `x_embedded` is a second solution of lower order. The method `dop853`
//! combines two such estimates. A step is accepted if `error < 1`. The method `radau5` also accepts `error = 1`. The dense output of a
//! method is a polynomial over the last step.
//!
//! See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6.

use super::accuracy::Work;
use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// An adaptive method for a system. Time runs forward. A decreasing time span requires a system with reversed time.
///
/// The initial state is the argument `state` of the constructor, or is set through `x_mut`. Then call `begin` for a segment, and `step`
/// until it returns `true`. A segment ends where the input or the state jumps. The next segment begins there. A jump of the state is
/// applied through `x_mut`.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Dop853, Embedded, Tolerance};
/// # use armlet_core::integrate::System;
/// # struct Oscillator;
/// # impl System<f64> for Oscillator {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { (dx[0], dx[1]) = (x[1], -x[0]); }
/// # }
///
/// // `x'' = -x` from 1 at rest: `x = cos t`.
/// let tolerance = Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 2 };
/// let (mut method, mut at) = (Embedded::<Dop853, _, _, _>::new(tolerance, [1.0, 0.0], ()), [0.0; 2]);
/// method.begin(&mut Oscillator, 0.0, 2.0, 2.0).expect("finite");
/// while !method.step(&mut Oscillator).expect("smooth") {}
/// // A time within the last step.
/// let t = 0.5 * (Adaptive::<f64, Oscillator, _>::t_old(&method) + 2.0);
/// method.interpolate(&mut Oscillator, t, &mut at);
/// assert!((at[0] - t.cos()).abs() < 1e-8);
/// ```
pub trait Adaptive<S: Real, F: System<S>, B: Buffer<S>> {
    /// Begin a segment from the state `x` at time `t < t_end`, s. `input_end` is the latest time at which the input is evaluated. It is
    /// `t_end`, or just before `t_end` if the input jumps there. Error: [`Status::Diverged`] if the state or its derivative is not finite.
    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status>;
    /// Compute steps until one is accepted. Return `true` at the end of the segment. The error is the reason why no step is accepted.
    fn step(&mut self, system: &mut F) -> Result<bool, Status>;
    /// Write the state at time `t`, s, within the last step to `out`.
    fn interpolate(&mut self, system: &mut F, t: f64, out: &mut B);
    /// The degree of the polynomial of `interpolate` over one step.
    fn dense_degree(&self) -> usize;
    /// The time at the end of the last step, s.
    fn t(&self) -> f64;
    /// The time at the start of the last step, s.
    fn t_old(&self) -> f64;
    /// The state at the end of the last step.
    fn x(&self) -> &B;
    /// The state, which the caller may set before `begin`.
    fn x_mut(&mut self) -> &mut B;
    /// The numbers of evaluations, steps and decompositions since the start of the run.
    fn work(&self) -> Work;
    /// Set the largest size of the next steps, s, before `begin` or `step`. It is infinite at first. A method of fixed step size ignores it.
    fn limit_step(&mut self, h_max: f64);
    /// Set the first step size of all later segments, s. If `h` is zero, which is the default, the method estimates this size. A method of
    /// fixed step size ignores it.
    fn first_step(&mut self, h: f64);
}
