//! The explicit Runge-Kutta method of order 8 with step-size control and dense output of order 7 (Dormand and Prince 1980).
//!
//! See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10.
//!
//! The error of a step is `|h| e5^2 / sqrt(m (e5^2 + 0.01 e3^2))`. `e5` and `e3` are the Euclidean norms of the two error estimates divided
//! by the allowed errors, over the `m` components with error control. A step with an error below 1 is accepted. The step size then changes
//! by the factor `0.9 error^(-1/8)`, within [0.2, 10].

use super::accuracy::Accuracy;
use super::dop853_tableau as tableau;
use super::step_controller::{Control, StepController};
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

    fn error<S: Real, B: Buffer<S>, T: Accuracy>(controller: &StepController<T>, h: f64, x: &[S], y: &[S], estimates: &[B]) -> f64 {
        let (mut e3, mut e5) = (0.0, 0.0);
        let m = controller.tolerance.controlled().min(x.len());
        for c in 0..m {
            let scale = controller.tolerance.scale(c, x[c].lane(0).abs().max(y[c].lane(0).abs()));
            let [s3, s5] = [0, 1].map(|k| estimates[k].as_ref()[c].lane(0) / scale);
            e3 += s3 * s3;
            e5 += s5 * s5;
        }
        if e5 == 0.0 && e3 == 0.0 { 0.0 } else { h.abs() * e5 / ((e5 + 0.01 * e3) * m.max(1) as f64).sqrt() }
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
