//! The tableau of an explicit method with an embedded error estimate, and one attempt of such a method.

use super::accuracy::Accuracy;
use super::buffer::Buffer;
use super::step_controller::Control;
use crate::scalar::Real;

/// One attempt of an explicit method: arguments and results of [`System::attempt`](super::System::attempt).
///
/// ```
/// use armlet_core::integrate::{Attempt, Dopri5, Scheme};
///
/// // The stages of one step of `x' = -x` from 1 to `exp(-1/2)`.
/// let (mut slopes, mut estimates, mut y) = (vec![[-1.0]; 7], vec![[0.0]], [0.0]);
/// let mut attempt = Attempt { h: 0.5, times: &[], x: &[1.0], slopes: &mut slopes, y: &mut y, estimates: &mut estimates };
/// Dopri5::stages(&mut attempt, |_, x, dx| dx[0] = -x[0]);
/// assert!((y[0] - (-0.5f64).exp()).abs() < 1e-5);
/// assert!((0.5 * estimates[0][0]).abs() < 1e-4);
/// ```
pub struct Attempt<'a, S, B> {
    /// The step size, s, one per lane.
    pub h: S,
    /// The times of the inputs of all stages but the first, s.
    pub times: &'a [f64],
    /// The state at the start of the step, one entry per state.
    pub x: &'a [S],
    /// The slopes of all stages, one buffer per stage. The first slope is an argument, and the other slopes are results.
    pub slopes: &'a mut [B],
    /// The new state, a result, one entry per state.
    pub y: &'a mut [S],
    /// The error estimates divided by `h`, results, one buffer per estimate.
    pub estimates: &'a mut [B],
}

/// The tableau of an explicit method whose first slope is known, with its error norm and its dense output. Coefficients are dimensionless.
/// Step sizes `h` are in s.
///
/// ```
/// use armlet_core::integrate::{Dopri5, Scheme};
///
/// // The error estimate of a constant slope is zero.
/// let estimate = |slopes: [f64; 7]| Dopri5::E[0].iter().zip(slopes).map(|(e, k)| e * k).sum::<f64>();
/// assert!(estimate([3.0; 7]).abs() < 1e-15);
/// assert!(estimate([3.0, 3.0, 3.0, 3.0, 3.0, 3.0, 4.0]).abs() > 0.01);
/// ```
pub trait Scheme {
    /// The number of stages after the first one. The argument of the last stage is the new state.
    const STAGES: usize;
    /// The times of all stages, as fractions of the step. The stages of the dense output are last.
    const C: &'static [f64];
    /// Row `i` has the weights of earlier slopes in the argument of stage `i`.
    const A: &'static [&'static [f64]];
    /// Each row has the weights of the slopes in one error estimate.
    const E: &'static [&'static [f64]];
    /// Each row has the weights of the slopes in one row of the dense output.
    const D: &'static [&'static [f64]];
    /// The degree of the dense output.
    const DEGREE: usize;
    /// The constants of the step-size control.
    const CONTROL: Control;

    /// Return the estimated error of a step of size `h` from the state `x` to the state `y`, divided by the allowed error. A step with an
    /// error below 1 is accepted. `allowed` has the number of components with error control. Its second part returns the allowed error of a
    /// component from its index and its magnitude.
    fn error<S: Real, B: Buffer<S>>(allowed: (usize, impl Fn(usize, S) -> S), h: S, x: &[S], y: &[S], estimates: &[B]) -> S;

    /// Return the error of a step with the tolerances `tolerance`. Only lane 0 counts.
    fn error_within<S: Real, B: Buffer<S>>(tolerance: &impl Accuracy, h: f64, x: &[S], y: &[S], estimates: &[B]) -> f64 {
        let scale = |i: usize, magnitude: S| S::splat(tolerance.scale(i, magnitude.lane(0)));
        Self::error((tolerance.controlled().min(x.len()), scale), S::splat(h), x, y, estimates).lane(0)
    }

    /// Return the dense output of one component: `(x(t) - x_old) / r`. Here `at = (r, 1 - r)` with `r = (t - t_old) / h`.
    ///
    /// `delta` is the change of the component over the step. `f` are its slopes at both ends. `row(i)` is the component's value in row `i`
    /// of the dense output.
    fn dense<S: Real>(at: (S, S), h: S, delta: S, f: [S; 2], row: impl Fn(usize) -> S) -> S;

    /// Compute the results of an attempt. `slope(k, y, dx)` writes the slope of stage `k + 1` at the state `y` to `dx`.
    fn stages<S: Real, B: Buffer<S>>(attempt: &mut Attempt<S, B>, mut slope: impl FnMut(usize, &[S], &mut [S])) {
        let Attempt { h, x, slopes, y, estimates, .. } = attempt;
        for i in 1..=Self::STAGES {
            Self::argument(i, *h, x, slopes, y);
            slope(i - 1, y, slopes[i].as_mut());
        }
        Self::estimates(slopes, estimates);
    }

    /// Compute the argument of stage `i`: `y = x + h sum_j a_ij k_j`, where `k` are the `slopes`.
    fn argument<S: Real, B: Buffer<S>>(i: usize, h: S, x: &[S], slopes: &[B], y: &mut [S]) {
        combine(Self::A[i], slopes, y);
        for (y, &x) in y.iter_mut().zip(x) {
            *y = h.mul_add(*y, x);
        }
    }

    /// Compute the error estimates divided by `h`: `sum_j e_j k_j`, one buffer per estimate.
    fn estimates<S: Real, B: Buffer<S>>(slopes: &[B], estimates: &mut [B]) {
        for (estimate, weights) in estimates.iter_mut().zip(Self::E) {
            combine(weights, slopes, estimate.as_mut());
        }
    }

    /// Compute the rows of the dense output over a step of size `h`: `h sum_j d_j k_j`, one buffer per row.
    fn rows<S: Real, B: Buffer<S>>(h: S, slopes: &[B], rows: &mut [B]) {
        for (row, weights) in rows.iter_mut().zip(Self::D) {
            let row = row.as_mut();
            combine(weights, slopes, row);
            row.iter_mut().for_each(|sum| *sum = h * *sum);
        }
    }
}

/// Compute `out = sum_j w_j k_j`.
fn combine<S: Real, B: Buffer<S>>(weights: &[f64], k: &[B], out: &mut [S]) {
    let first = S::splat(weights[0]);
    for (out, &k) in out.iter_mut().zip(k[0].as_ref()) {
        *out = first * k;
    }
    for (&weight, k) in weights.iter().zip(k).skip(1).filter(|(weight, _)| **weight != 0.0) {
        let weight = S::splat(weight);
        for (out, &k) in out.iter_mut().zip(k.as_ref()) {
            *out = weight.mul_add(k, *out);
        }
    }
}
