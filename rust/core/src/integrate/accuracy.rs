//! Error tolerances of adaptive methods, and counts of their evaluations and steps.

/// The maximum number of attempts of a run, accepted or rejected.
pub const MAX_STEPS: u64 = 10_000_000;

/// The numbers of evaluations, steps and decompositions of an adaptive method since the start of the run.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Dopri5, Embedded, Tolerance, Work};
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
///     let mut method = Embedded::<Dopri5, _, _, _>::new(tolerance, [1.0], ());
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
    /// The factor by which both tolerances must be multiplied to become feasible, dimensionless. It is zero unless the run ended with
    /// [`Status::ExcessAccuracy`](crate::status::Status::ExcessAccuracy).
    pub coarsen: f64,
}

/// The error tolerances of an adaptive method.
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
