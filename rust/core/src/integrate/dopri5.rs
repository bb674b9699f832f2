//! The explicit Runge-Kutta pair of orders 5 and 4, first same as last, with dense output of order 4 (Dormand and Prince 1980).
//!
//! See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6.

use super::accuracy::{Accuracy, Tolerance};
use super::step_controller::{Control, StepController};
use super::{Buffer, Embedded, Scheme};
use crate::scalar::Real;

/// The tableau of the pair of orders 5 and 4 of Dormand and Prince.
///
/// ```
/// use armlet_core::integrate::{Pair54, Scheme};
///
/// // Order 2: `sum b_i c_i = 1/2`, with the weights of the last stage.
/// let weights = Pair54::A[Pair54::STAGES];
/// let sum: f64 = weights.iter().zip(Pair54::C).map(|(b, c)| b * c).sum();
/// assert!((sum - 0.5).abs() < 1e-15);
/// ```
pub struct Pair54;

impl Scheme for Pair54 {
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

    fn error<S: Real, B: Buffer<S>, T: Accuracy>(controller: &StepController<T>, h: f64, x: &[S], y: &[S], estimates: &[B]) -> f64 {
        controller.norm(x, y, |c| S::splat(h) * estimates[0].as_ref()[c])
    }

    fn dense<S: Real>((r, q): (S, S), h: S, delta: S, [f0, f1]: [S; 2], row: impl Fn(usize) -> S) -> S {
        let cubic = h * f0 - delta;
        let row3 = delta - h * f1 - cubic;
        let tail = row(0).mul_add(q, row3);
        let tail = tail.mul_add(r, cubic);
        tail.mul_add(q, delta)
    }
}

/// The method of order 5 of Dormand and Prince. `B` is the type of the state, `U` that of the input, and `T` that of the tolerances.
///
/// ```
/// use armlet_core::integrate::events::{Event, Watched};
/// use armlet_core::integrate::solve::{Recorder, Request, solve};
/// use armlet_core::integrate::{Dopri5, System, Tolerance};
/// use armlet_core::scalar::Real;
/// use armlet_core::status::Status;
///
/// /// `x'' = -x`.
/// struct Oscillator;
/// impl<S: Real> System<S> for Oscillator {
///     type Input = ();
///     fn input(&mut self, _: f64, _: &mut ()) {}
///     fn rhs(&mut self, _: &(), x: &[S], dx: &mut [S]) {
///         (dx[0], dx[1]) = (x[1], -x[0]);
///     }
/// }
/// struct Last([f64; 2]);
/// impl Recorder for Last {
///     fn state(&mut self, _: f64, x: &[f64]) {
///         self.0.copy_from_slice(x);
///     }
/// }
/// struct Nothing;
/// impl Watched for Nothing {
///     fn value(&mut self, _: usize, _: f64, _: &[f64]) -> f64 {
///         1.0
///     }
/// }
/// let tolerance = Tolerance { rtol: 1e-10, atol: 1e-12, controlled: 2 };
/// let (mut method, mut last) = (Dopri5::new(tolerance, [1.0, 0.0], ()), Last([0.0; 2]));
/// let end = solve(&mut Oscillator, &mut method, (0.0, 1.0), &Request::default(), &mut Nothing, &mut last);
/// assert_eq!(end.status, Status::Success);
/// assert!((last.0[0] - 1.0f64.cos()).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub type Dopri5<B, U, T = Tolerance> = Embedded<Pair54, B, U, T>;
