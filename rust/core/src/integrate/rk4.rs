//! The classical Runge-Kutta method of order 4 (Kutta 1901):
//!
//! `k1 = f(t, x)`, `k2 = f(t + h/2, x + h/2 k1)`, `k3 = f(t + h/2, x + h/2 k2)`, `k4 = f(t + h, x + h k3)`,
//! `x += h/6 (k1 + 2 k2 + 2 k3 + k4)`.

use super::{EqualSteps, Stage};

/// The tableau of the classical Runge-Kutta method, for [`Explicit`](super::Explicit).
///
/// ```
/// use armlet_core::integrate::{EqualSteps, Rk4};
///
/// // Simpson's rule: `1/6, 4/6, 1/6` at the start, the middle and the end of the step.
/// let mut weights = [0.0; 3];
/// for stage in Rk4::STAGES {
///     weights[stage.instant] += stage.weight;
/// }
/// assert_eq!((weights, Rk4::DIVISOR), ([1.0, 4.0, 1.0], 6.0));
/// ```
///
/// ```
/// use armlet_core::integrate::{Explicit, FixedStep, Rk4, System};
/// use armlet_core::scalar::Real;
///
/// /// `x' = t`, whose input is the time.
/// struct Ramp;
/// impl<S: Real> System<S> for Ramp {
///     type Input = f64;
///     fn input(&mut self, t: f64, u: &mut f64) {
///         *u = t;
///     }
///     fn rhs(&mut self, u: &f64, _: &[S], dx: &mut [S]) {
///         dx[0] = S::splat(*u);
///     }
/// }
/// let (mut method, mut x) = (Explicit::<Rk4, _, _>::new([0.0], 0.0), [0.0]);
/// for k in 0..10 {
///     let t = 0.1 * f64::from(k);
///     method.step(&mut Ramp, t, 0.1, t + 0.1, &mut x);
/// }
/// assert!((x[0] - 0.5f64).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Rk4;

impl EqualSteps for Rk4 {
    const INSTANTS: &'static [f64] = &[0.0, 0.5, 1.0];
    const STAGES: &'static [Stage] = &[
        Stage { instant: 0, part: 0.0, weight: 1.0 },
        Stage { instant: 1, part: 0.5, weight: 2.0 },
        Stage { instant: 1, part: 0.5, weight: 2.0 },
        Stage { instant: 2, part: 1.0, weight: 1.0 },
    ];
    const DIVISOR: f64 = 6.0;
}
