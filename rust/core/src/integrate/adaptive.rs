//! Adaptive methods: common definitions. A method chooses its steps from `t` towards `t_end`, each with an error estimate
//!
//! `error = sqrt(1/m sum ((x_new - x_embedded)_i / (atol_i + rtol_i max(|x_i|, |x_new_i|)))^2)`
//!
//! from the state `x` to `x_new`, with `m` components with error control. The method `dop853` combines two such estimates. A step with
//! `error < 1` is accepted. The method has a polynomial over the last step (Hairer, Norsett and Wanner, Solving Ordinary Differential
//! Equations I, sections II.4 to II.6).

use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// The number of accepted and rejected steps after which a run ends.
pub const MAX_STEPS: u64 = 10_000_000;

/// The numbers of evaluations, steps and decompositions of an adaptive method since the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// The number of evaluations of the right-hand side.
    pub evaluations: u64,
    /// The number of accepted steps.
    pub steps: u64,
    /// The number of rejected steps.
    pub rejections: u64,
    /// The number of evaluations of the Jacobian, by an implicit method.
    pub jacobians: u64,
    /// The number of matrix decompositions.
    pub factorisations: u64,
    /// The factor that makes both tolerances feasible, dimensionless, for a run that ended with [`Status::ExcessAccuracy`]. It is zero for
    /// other runs.
    pub coarsen: f64,
}

/// The allowed error per step.
pub trait Accuracy {
    /// The number of leading components with error control, at least one. Other components, such as quadratures, have no error control.
    fn controlled(&self) -> usize;
    /// The smallest relative tolerance of all components, dimensionless.
    fn rtol(&self) -> f64;
    /// The allowed error of component `i`, in its unit: `atol_i + rtol_i x`, where `x` is the magnitude of the component.
    fn scale(&self, i: usize, x: f64) -> f64;
}

/// The same relative and absolute tolerance for the first `controlled` components of the state.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Relative tolerance, dimensionless.
    pub rtol: f64,
    /// Absolute tolerance, in the units of the state.
    pub atol: f64,
    /// The number of leading components with error control.
    pub controlled: usize,
}

impl Accuracy for Tolerance {
    fn controlled(&self) -> usize {
        self.controlled
    }
    fn rtol(&self) -> f64 {
        self.rtol
    }
    fn scale(&self, _: usize, x: f64) -> f64 {
        self.atol + self.rtol * x
    }
}

/// Separate relative and absolute tolerances for each component.
#[derive(Clone, Debug)]
pub struct Tolerances {
    /// Relative tolerances, dimensionless, one per component.
    pub rtol: Vec<f64>,
    /// Absolute tolerances, in the units of the components, one per component.
    pub atol: Vec<f64>,
}

impl Accuracy for Tolerances {
    fn controlled(&self) -> usize {
        self.atol.len()
    }
    fn rtol(&self) -> f64 {
        self.rtol.iter().copied().fold(f64::INFINITY, f64::min)
    }
    fn scale(&self, i: usize, x: f64) -> f64 {
        self.atol[i] + self.rtol[i] * x
    }
}

/// An adaptive method for a system. Time runs forward. A decreasing time span requires a system with reversed time.
///
/// First set the initial state through `x_mut`. Then call `begin` for a segment, and `step` until it returns `true`. A segment ends where
/// the input or the state jumps. The next segment begins there. A jump of the state is applied through `x_mut`.
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
    /// The state, which the caller sets before `begin`.
    fn x_mut(&mut self) -> &mut B;
    /// The numbers of evaluations, steps and decompositions since the start of the run.
    fn work(&self) -> Work;
    /// Set the largest step size, s, before `begin`. It is infinite at first. A method of fixed step size ignores it.
    fn limit_step(&mut self, h_max: f64);
    /// Set the first step size of all later segments, s. At zero, the initial value, the method estimates this size. A method of fixed step
    /// size ignores it.
    fn first_step(&mut self, h: f64);
}
