//! Tasks that need a method: each task is generic over the methods of one kind.

use super::{Adaptive, Advance, FixedStep, Scheme, System};
use crate::scalar::Real;

/// A task that needs a method of fixed steps.
///
/// ```
/// use armlet_core::integrate::{ExplicitSteps, FixedStep, System, WithSteps};
/// # struct Growth;
/// # impl System<f64> for Growth {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = x[0]; }
/// # }
///
/// /// One step of 0.5 s.
/// struct OneStep;
/// impl<F: System<f64>> WithSteps<f64, F> for OneStep {
///     type Output = f64;
///     fn with<M: FixedStep<f64, F, Vec<f64>> + Send + Sync + 'static>(self, mut system: F, mut x: Vec<f64>, mut method: M) -> f64 {
///         method.step(&mut system, 0.0, 0.5, 0.5, &mut x);
///         x[0]
///     }
/// }
/// // `x' = x` from 1.
/// assert_eq!(ExplicitSteps::Euler.apply(Growth, vec![1.0], (), OneStep)?, 1.5);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait WithSteps<S: Real, F: System<S>> {
    /// The result of the task.
    type Output;

    /// Run the task with `method`, from the state `x` of `system`.
    fn with<M: FixedStep<S, F, Vec<S>> + Send + Sync + 'static>(self, system: F, x: Vec<S>, method: M) -> Self::Output;
}

/// A task that needs an explicit method of fixed steps, whose stages can be recorded. Every [`WithSteps`] task is such a task.
///
/// ```
/// use armlet_core::integrate::{Advance, ExplicitSteps, FixedStep, System, WithExplicitSteps};
/// # struct Growth;
/// # impl System<f64> for Growth {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = x[0]; }
/// # }
///
/// /// The fractions of a step at which the method reads its inputs.
/// struct Instants;
/// impl WithExplicitSteps<f64, Growth> for Instants {
///     type Output = &'static [f64];
///     fn with_explicit<M>(self, _: Growth, _: Vec<f64>, _: M) -> &'static [f64]
///     where
///         M: FixedStep<f64, Growth, Vec<f64>> + Advance<f64, Growth, Vec<f64>> + Send + Sync + 'static,
///     {
///         M::INSTANTS
///     }
/// }
/// assert_eq!(ExplicitSteps::Rk4.apply(Growth, vec![1.0], (), Instants)?, [0.0, 0.5, 1.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait WithExplicitSteps<S: Real, F: System<S>> {
    /// The result of the task.
    type Output;

    /// Run the task with `method`, from the state `x` of `system`.
    fn with_explicit<M: FixedStep<S, F, Vec<S>> + Advance<S, F, Vec<S>> + Send + Sync + 'static>(
        self,
        system: F,
        x: Vec<S>,
        method: M,
    ) -> Self::Output;
}

impl<S: Real, F: System<S>, T: WithSteps<S, F>> WithExplicitSteps<S, F> for T {
    type Output = T::Output;

    fn with_explicit<M: FixedStep<S, F, Vec<S>> + Advance<S, F, Vec<S>> + Send + Sync + 'static>(
        self,
        system: F,
        x: Vec<S>,
        method: M,
    ) -> T::Output {
        self.with(system, x, method)
    }
}

/// A task that needs an adaptive method.
///
/// ```
/// use armlet_core::integrate::{Adaptive, ExplicitAdaptive, System, Tolerance, WithAdaptive};
/// # struct Decay;
/// # impl System<f64> for Decay {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = -x[0]; }
/// # }
///
/// /// The state after 1 s.
/// struct Second;
/// impl<F: System<f64>> WithAdaptive<f64, F> for Second {
///     type Output = f64;
///     fn with<M: Adaptive<f64, F, Vec<f64>> + Send + Sync + 'static>(self, mut system: F, mut method: M) -> f64 {
///         method.begin(&mut system, 0.0, 1.0, 1.0).expect("finite");
///         while !method.step(&mut system).expect("smooth") {}
///         method.x()[0]
///     }
/// }
/// let tolerance = Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 1 };
/// let x = ExplicitAdaptive::Dop853.apply(Decay, tolerance, vec![1.0], (), Second);
/// assert!((x - (-1.0f64).exp()).abs() < 1e-8);
/// ```
pub trait WithAdaptive<S: Real, F: System<S>> {
    /// The result of the task.
    type Output;

    /// Run the task with `method` on `system`.
    fn with<M: Adaptive<S, F, Vec<S>> + Send + Sync + 'static>(self, system: F, method: M) -> Self::Output;
}

/// A task that needs the tableau of an adaptive explicit method.
///
/// ```
/// use armlet_core::integrate::{ExplicitAdaptive, Scheme, WithScheme};
///
/// struct Stages;
/// impl WithScheme for Stages {
///     type Output = usize;
///     fn with<C: Scheme>(self) -> usize {
///         C::STAGES
///     }
/// }
/// assert_eq!((ExplicitAdaptive::Dopri5.scheme(Stages), ExplicitAdaptive::Dop853.scheme(Stages)), (6, 12));
/// ```
pub trait WithScheme {
    /// The result of the task.
    type Output;

    /// Run the task with the tableau `C`.
    fn with<C: Scheme>(self) -> Self::Output;
}
