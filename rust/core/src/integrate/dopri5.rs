//! The explicit Runge-Kutta pair of orders 5 and 4 (Dormand and Prince 1980), first same as last, with dense output of order 4
//! (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6).

use super::adaptive::{Accuracy, Adaptive, Tolerance, Work};
use super::chatter::Chatter;
use super::step_controller::{Control, StepController, finite, paced};
use super::{Attempt, Buffer, Scheme, System};
use crate::scalar::Real;
use crate::status::Status;

const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// The two solutions' difference.
const E: [f64; 7] = [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];
/// The last row of the dense output.
const D: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];
const CONTROL: Control = Control { safety: 0.9, alpha: 0.2, beta: 0.0, shrink: 0.2, grow: 10.0 };

/// The pair's arithmetic.
pub struct Pair54;

impl Scheme for Pair54 {
    const STAGES: usize = 6;
    const ESTIMATES: usize = 1;

    fn stages<S: Real, B: Buffer<S>>(attempt: &mut Attempt<S, B>, mut slope: impl FnMut(usize, &[S], &mut [S])) {
        let Attempt { h, x, slopes, y, estimates, .. } = attempt;
        for i in 1..7 {
            for c in 0..x.len() {
                let mut sum = S::splat(A[i][0]) * slopes[0].as_ref()[c];
                for j in 1..i {
                    sum = S::splat(A[i][j]).mul_add(slopes[j].as_ref()[c], sum);
                }
                y[c] = h.mul_add(sum, x[c]);
            }
            slope(i - 1, y, slopes[i].as_mut());
        }
        let error = estimates[0].as_mut();
        for c in 0..x.len() {
            let mut sum = S::zero();
            for j in 0..7 {
                sum = S::splat(E[j]).mul_add(slopes[j].as_ref()[c], sum);
            }
            error[c] = sum;
        }
    }
}

/// The method of order 5 on a state `B`.
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
pub struct Dopri5<B, U, T = Tolerance> {
    controller: StepController<T>,
    /// Slopes of the stages; the last is that of the end.
    k: [B; 7],
    error: [B; 1],
    y: B,
    x: B,
    x_old: B,
    u: U,
    chatter: Chatter<B>,
}

impl<B: Clone, U: Clone, T: Accuracy> Dopri5<B, U, T> {
    /// The method with these tolerances; `state` and `input` give the sizes.
    pub fn new(tolerance: T, state: B, input: U) -> Self {
        let k = std::array::from_fn(|_| state.clone());
        let [error, y, x] = std::array::from_fn(|_| state.clone());
        Dopri5 {
            controller: StepController::new(tolerance),
            chatter: Chatter::new(&state),
            k,
            error: [error],
            y,
            x,
            x_old: state,
            u: input,
        }
    }

    /// Try a step of `h`: the new state in `y`, its slope in `k[6]`; returns the error.
    fn attempt<S, F>(&mut self, system: &mut F, h: f64) -> f64
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let Dopri5 { controller, k, error, y, x, u, .. } = self;
        let times: [f64; Pair54::STAGES] = std::array::from_fn(|i| controller.input_time(controller.t + C[i + 1] * h));
        let mut attempt = Attempt { h: S::splat(h), times: &times, x: x.as_ref(), slopes: k, y: y.as_mut(), estimates: error };
        if !system.attempt::<Pair54, B>(&mut attempt) {
            Pair54::stages(&mut attempt, |i, y, dx| {
                system.input(times[i], u);
                system.rhs(u, y, dx);
            });
        }
        controller.work.evaluations += Pair54::STAGES as u64;
        if !finite(y.as_ref()) || !finite(k[6].as_ref()) {
            return f64::NAN;
        }
        controller.norm(x.as_ref(), y.as_ref(), |c| S::splat(h) * error[0].as_ref()[c])
    }
}

impl<S: Real, F: System<S, Input = U>, B: Buffer<S>, U: Clone, T: Accuracy> Adaptive<S, F, B> for Dopri5<B, U, T> {
    paced!(4);

    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        self.controller.begin(t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        system.input(t, &mut self.u);
        system.rhs(&self.u, self.x.as_ref(), self.k[0].as_mut());
        self.controller.work.evaluations += 1;
        if !finite(self.x.as_ref()) || !finite(self.k[0].as_ref()) {
            return Err(Status::Diverged);
        }
        let [k0, k1, ..] = &mut self.k;
        self.controller.guess::<S, F, B>(system, &mut self.u, &self.x, k0, &mut self.y, k1, 4.0);
        Ok(())
    }

    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        if self.controller.done() {
            return Ok(true);
        }
        if self.chatter.due(&self.controller.work) {
            self.chatter.look(system, &mut self.controller, &mut self.u, &self.x)?;
        }
        // The slopes of the last step served its dense output until now.
        if self.controller.t > self.controller.t_old {
            self.k.swap(0, 6);
            self.controller.t_old = self.controller.t;
        }
        self.controller.open();
        loop {
            let (h, t_new) = self.controller.propose()?;
            let error = self.attempt::<S, F>(system, h);
            if self.controller.judge(error, h, t_new, &CONTROL) {
                std::mem::swap(&mut self.x_old, &mut self.x);
                std::mem::swap(&mut self.x, &mut self.y);
                return Ok(self.controller.done());
            }
        }
    }

    fn interpolate(&mut self, _: &mut F, t: f64, out: &mut B) {
        let h = self.controller.t - self.controller.t_old;
        if h == 0.0 || t >= self.controller.t {
            out.clone_from(&self.x);
            return;
        }
        let theta = (t - self.controller.t_old) / h;
        let (r, q, h) = (S::splat(theta), S::splat(1.0 - theta), S::splat(h));
        let (x0, x1, out) = (self.x_old.as_ref(), self.x.as_ref(), out.as_mut());
        for c in 0..x0.len() {
            let delta = x1[c] - x0[c];
            let cubic = h * self.k[0].as_ref()[c] - delta;
            let row3 = delta - h * self.k[6].as_ref()[c] - cubic;
            let mut row4 = S::zero();
            for j in 0..7 {
                row4 = S::splat(D[j]).mul_add(self.k[j].as_ref()[c], row4);
            }
            let tail = (h * row4).mul_add(q, row3);
            let tail = tail.mul_add(r, cubic);
            let tail = tail.mul_add(q, delta);
            out[c] = tail.mul_add(r, x0[c]);
        }
    }
}
