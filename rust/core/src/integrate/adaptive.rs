//! Adaptive methods: common definitions. A method chooses its steps from `t` towards `t_end`, each with an error estimate
//!
//! `error = sqrt(1/m sum ((x_new - x_embedded)_i / (atol_i + rtol_i max(|x_i|, |x_new_i|)))^2)`
//!
//! from the state `x` to `x_new`, with `m` components with error control. The method `dop853` combines two such estimates. A step with
//! `error < 1` is accepted (`radau5` also accepts 1). The method has a polynomial over the last step (Hairer, Norsett and Wanner, Solving
//! Ordinary Differential Equations I, sections II.4 to II.6).

use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// The number of accepted and rejected steps together after which a run ends.
pub const MAX_STEPS: u64 = 10_000_000;

/// The numbers of evaluations, steps and decompositions of an adaptive method since the start of the run.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Dopri5, Tolerance, Work};
/// # use armlet_core::integrate::System;
/// # struct Decay;
/// # impl System<f64> for Decay {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = -x[0]; }
/// # }
///
/// /// The work for `x' = -x` over 1 s.
/// fn work(rtol: f64) -> Work {
///     let tolerance = Tolerance { rtol, atol: 1e-12, controlled: 1 };
///     let mut method = Dopri5::new(tolerance, [1.0], ());
///     method.begin(&mut Decay, 0.0, 1.0, 1.0).expect("finite");
///     while !method.step(&mut Decay).expect("smooth") {}
///     Adaptive::<f64, Decay, _>::work(&method)
/// }
/// let (coarse, fine) = (work(1e-4), work(1e-9));
/// assert!(coarse.steps < fine.steps && fine.evaluations >= 6 * fine.steps && fine.jacobians == 0);
/// ```
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
///
/// ```
/// use armlet_core::integrate::Accuracy;
///
/// /// The first component, a position, has an absolute tolerance of 1 mm. Other components have none.
/// struct Millimetre;
/// impl Accuracy for Millimetre {
///     fn controlled(&self) -> usize {
///         1
///     }
///     fn rtol(&self) -> f64 {
///         1e-6
///     }
///     fn scale(&self, _: usize, x: f64) -> f64 {
///         1e-3 + self.rtol() * x
///     }
/// }
/// assert!((Millimetre.scale(0, 100.0) - 1.1e-3).abs() < 1e-18);
/// ```
pub trait Accuracy {
    /// The number of leading components with error control, at least one. Other components, such as quadratures, have no error control.
    fn controlled(&self) -> usize;
    /// The smallest relative tolerance of all components, dimensionless.
    fn rtol(&self) -> f64;
    /// The allowed error of component `i`, in its unit: `atol_i + rtol_i x`, where `x` is the magnitude of the component.
    fn scale(&self, i: usize, x: f64) -> f64;
}

/// The same relative and absolute tolerance for the first `controlled` components of the state.
///
/// ```
/// use armlet_core::integrate::{Accuracy, Tolerance};
///
/// // The state has one more component, a quadrature without error control.
/// let tolerance = Tolerance { rtol: 1e-3, atol: 1e-6, controlled: 2 };
/// assert_eq!((tolerance.controlled(), tolerance.rtol()), (2, 1e-3));
/// assert!((tolerance.scale(0, 2.0) - 2.001e-3).abs() < 1e-18);
/// ```
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
///
/// ```
/// use armlet_core::integrate::{Accuracy, Tolerances};
///
/// let tolerances = Tolerances { rtol: vec![1e-3, 1e-6], atol: vec![1e-4, 1e-2] };
/// assert_eq!((tolerances.controlled(), tolerances.rtol()), (2, 1e-6));
/// assert!(tolerances.scale(0, 0.0) == 1e-4 && (tolerances.scale(1, 1e6) - 1.01).abs() < 1e-15);
/// ```
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
/// The initial state is the argument `state` of the constructor, or is set through `x_mut`. Then call `begin` for a segment, and `step`
/// until it returns `true`. A segment ends where the input or the state jumps. The next segment begins there. A jump of the state is
/// applied through `x_mut`.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Dop853, Tolerance};
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
/// let (mut method, mut at) = (Dop853::new(tolerance, [1.0, 0.0], ()), [0.0; 2]);
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
    /// Set the largest step size, s, before `begin`. It is infinite at first. A method of fixed step size ignores it.
    fn limit_step(&mut self, h_max: f64);
    /// Set the first step size of all later segments, s. At zero, the initial value, the method estimates this size. A method of fixed step
    /// size ignores it.
    fn first_step(&mut self, h: f64);
}
