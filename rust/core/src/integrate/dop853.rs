//! The explicit Runge-Kutta method of order 8 with step-size control and dense output of order 7 (Dormand and Prince 1980).
//!
//! See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10.
//!
//! The error of a step is `|h| e5^2 / sqrt(m (e5^2 + 0.01 e3^2))`. `e5` and `e3` are the Euclidean norms of the two error estimates divided
//! by the allowed errors, over the `m` components with error control. A step with an error below 1 is accepted. The step size then changes
//! by the factor `0.9 error^(-1/8)`, within [0.2, 10].

use super::dop853_tableau as tableau;
use super::step_controller::Control;
use super::{Buffer, Scheme};
use crate::scalar::Real;

/// The tableau of DOP853, the method of order 8 of Dormand and Prince, for [`Embedded`](super::Embedded).
///
/// ```
/// use armlet_core::integrate::{Dop853, Dopri5, Scheme};
///
/// // The times of the stages are the sums of their weights.
/// for (weights, c) in Dop853::A.iter().zip(Dop853::C) {
///     assert!((weights.iter().sum::<f64>() - c).abs() < 1e-13);
/// }
/// assert!(Dop853::STAGES == 12 && Dop853::DEGREE > Dopri5::DEGREE);
/// ```
pub struct Dop853;

impl Scheme for Dop853 {
    const STAGES: usize = 12;
    const C: &'static [f64] = tableau::C;
    const A: &'static [&'static [f64]] = tableau::A;
    const E: &'static [&'static [f64]] = tableau::E;
    const D: &'static [&'static [f64]] = tableau::D;
    const DEGREE: usize = 7;
    const CONTROL: Control = Control { safety: 0.9, alpha: 0.125, beta: 0.0, shrink: 0.2, grow: 10.0 };

    fn error<S: Real, B: Buffer<S>>((controlled, scale): (usize, impl Fn(usize, S) -> S), h: S, x: &[S], y: &[S], estimates: &[B]) -> S {
        let (mut e3, mut e5) = (S::zero(), S::zero());
        for c in 0..controlled {
            let scale = scale(c, x[c].abs().max(y[c].abs()));
            let (s3, s5) = (estimates[0].as_ref()[c] / scale, estimates[1].as_ref()[c] / scale);
            e3 += s3 * s3;
            e5 += s5 * s5;
        }
        let error = h.abs() * e5 / ((e5 + S::splat(0.01) * e3) * S::splat(controlled.max(1) as f64)).sqrt();
        // The quotient of two zeros is zero here.
        S::select((e5 + e3).lt(S::splat(f64::from_bits(1))), S::zero(), error)
    }

    fn dense<S: Real>((r, q): (S, S), h: S, delta: S, [f0, f1]: [S; 2], row: impl Fn(usize) -> S) -> S {
        let row1 = h.mul_add(f0, -delta);
        let row2 = delta + delta - h * (f1 + f0);
        let tail = row(3) * r + row(2);
        let tail = tail * q + row(1);
        let tail = tail * r + row(0);
        let tail = tail * q + row2;
        let tail = tail * r + row1;
        tail * q + delta
    }
}
