//! The explicit Runge-Kutta pair of orders 5 and 4, first same as last, with dense output of order 4 (Dormand and Prince 1980).
//!
//! See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6.

use super::step_controller::Control;
use super::{Buffer, Scheme};
use crate::scalar::Real;

/// The tableau of the pair of orders 5 and 4 of Dormand and Prince, for [`Embedded`](super::Embedded).
///
/// ```
/// use armlet_core::integrate::{Dopri5, Scheme};
///
/// // Order 2: `sum b_i c_i = 1/2`, with the weights of the last stage.
/// let weights = Dopri5::A[Dopri5::STAGES];
/// let sum: f64 = weights.iter().zip(Dopri5::C).map(|(b, c)| b * c).sum();
/// assert!((sum - 0.5).abs() < 1e-15);
/// ```
pub struct Dopri5;

impl Scheme for Dopri5 {
    const STAGES: usize = 6;
    const C: &'static [f64] = &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
    const A: &'static [&'static [f64]] = &[
        &[],
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ];
    /// The weights of the difference of the two solutions of orders 5 and 4, divided by `h`.
    const E: &'static [&'static [f64]] =
        &[&[71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0]];
    const D: &'static [&'static [f64]] = &[&[
        -12715105075.0 / 11282082432.0,
        0.0,
        87487479700.0 / 32700410799.0,
        -10690763975.0 / 1880347072.0,
        701980252875.0 / 199316789632.0,
        -1453857185.0 / 822651844.0,
        69997945.0 / 29380423.0,
    ]];
    const DEGREE: usize = 4;
    const CONTROL: Control = Control { safety: 0.9, alpha: 0.2, beta: 0.0, shrink: 0.2, grow: 10.0 };

    fn error<S: Real, B: Buffer<S>>((controlled, scale): (usize, impl Fn(usize, S) -> S), h: S, x: &[S], y: &[S], estimates: &[B]) -> S {
        let mut sum = S::zero();
        for c in 0..controlled {
            let r = h * estimates[0].as_ref()[c] / scale(c, x[c].abs().max(y[c].abs()));
            sum += r * r;
        }
        (sum / S::splat(controlled.max(1) as f64)).sqrt()
    }

    fn dense<S: Real>((r, q): (S, S), h: S, delta: S, [f0, f1]: [S; 2], row: impl Fn(usize) -> S) -> S {
        let cubic = h * f0 - delta;
        let row3 = delta - h * f1 - cubic;
        let tail = row(0).mul_add(q, row3);
        let tail = tail.mul_add(r, cubic);
        tail.mul_add(q, delta)
    }
}
