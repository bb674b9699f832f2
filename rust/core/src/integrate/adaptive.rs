//! The common part of adaptive methods. A method chooses its steps from `t` towards `t_end`, each with an error estimate
//!
//! `error = sqrt(1/m sum ((x - x_embedded)_i / (atol_i + rtol_i max(|x_i|, |x_new_i|)))^2)`, accepted below 1,
//!
//! and a polynomial over the last step (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
//! sections II.4 to II.6).

use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// Steps, accepted or not, after which a run ends.
pub const MAX_STEPS: u64 = 10_000_000;

/// Work done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Evaluations of the right-hand side.
    pub evaluations: u64,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejections: u64,
    /// For an implicit method: evaluations of the Jacobian.
    pub jacobians: u64,
    /// Decompositions of matrices.
    pub factorisations: u64,
    /// For a run that ended with [`Status::ExcessAccuracy`]: the factor that makes both tolerances feasible; else zero.
    pub coarsen: f64,
}

/// The error allowed per step.
pub trait Accuracy {
    /// The number of components, from the first on, whose error counts; at least one. Others, such as quadratures, have no error control.
    fn controlled(&self) -> usize;
    /// The smallest relative error.
    fn rtol(&self) -> f64;
    /// The error allowed in component `i`, of magnitude `x`: `atol_i + rtol_i x`.
    fn scale(&self, i: usize, x: f64) -> f64;
}

/// The relative and absolute error allowed per step, over the first `controlled` components of the state.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance.
    pub atol: f64,
    /// Number of components, from the first on, whose error counts.
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

/// The relative and absolute error allowed per step in each component.
#[derive(Clone, Debug)]
pub struct Tolerances {
    /// Relative tolerance per component.
    pub rtol: Vec<f64>,
    /// Absolute tolerance per component.
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

/// An adaptive method on a system. Time runs forward; a decreasing span is a system with its time reversed.
///
/// Set the initial state through `x_mut`. Then `begin` a segment, and `step` until it returns `true`. A segment ends
/// where the input or the state jumps. The next one begins there, with a jump of the state made through `x_mut`.
pub trait Adaptive<S: Real, F: System<S>, B: Buffer<S>> {
    /// Begin a segment from the state `x` at `t < t_end`. `input_end` is the latest time at which the input is taken:
    /// `t_end`, or just before it if the input jumps there. Fails if the state or its derivative is not finite.
    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status>;
    /// One accepted step; `true` at the end of the segment.
    fn step(&mut self, system: &mut F) -> Result<bool, Status>;
    /// The state at `t` within the last step.
    fn interpolate(&mut self, system: &mut F, t: f64, out: &mut B);
    /// Degree of the polynomial that `interpolate` follows over one step.
    fn dense_degree(&self) -> usize;
    /// The time reached.
    fn t(&self) -> f64;
    /// The start of the last step.
    fn t_old(&self) -> f64;
    /// The state reached.
    fn x(&self) -> &B;
    /// The state, to be set before `begin`.
    fn x_mut(&mut self) -> &mut B;
    /// The work done so far.
    fn work(&self) -> Work;
    /// Set the largest step from now on (infinite at first).
    fn limit_step(&mut self, h_max: f64);
    /// Set the first step of the next segment, instead of a guess.
    fn first_step(&mut self, h: f64);
}
