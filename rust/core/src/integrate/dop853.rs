//! The explicit Runge-Kutta method of order 8 with step control and dense output of order 7 (Dormand and
//! Prince 1980; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10).
//!
//! Error of a step: `|h| e5^2 / sqrt(n (e5^2 + 0.01 e3^2))` with the weighted norms of the two estimators;
//! accepted below 1, the next step grows by `0.9 error^(-1/8)` within [0.2, 10].

use super::adaptive::{Accuracy, Adaptive, Tolerance, Work};
use super::chatter::Chatter;
use super::dop853_tableau::{A, C, D, E3, E5};
use super::step_controller::{Control, StepController, finite, paced};
use super::{Attempt, Buffer, Scheme, System};
use crate::scalar::Real;
use crate::status::Status;

const CONTROL: Control = Control { safety: 0.9, alpha: 0.125, beta: 0.0, shrink: 0.2, grow: 10.0 };

/// The argument of stage `i` into `y`: `x + h sum_j A[i][j] k_j`.
fn argument<S: Real, B: Buffer<S>>(i: usize, h: S, x: &[S], k: &[B], y: &mut [S]) {
    for c in 0..x.len() {
        y[c] = S::splat(A[i][0]) * k[0].as_ref()[c];
    }
    for j in 1..i {
        if A[i][j] != 0.0 {
            let (weight, k) = (S::splat(A[i][j]), k[j].as_ref());
            for c in 0..x.len() {
                y[c] = weight.mul_add(k[c], y[c]);
            }
        }
    }
    for c in 0..x.len() {
        y[c] = h.mul_add(y[c], x[c]);
    }
}

/// The method's arithmetic. The argument of stage 12 is the new state: the method is first-same-as-last.
pub struct Order8;

impl Scheme for Order8 {
    const STAGES: usize = 12;
    const ESTIMATES: usize = 2;

    fn stages<S: Real, B: Buffer<S>>(attempt: &mut Attempt<S, B>, mut slope: impl FnMut(usize, &[S], &mut [S])) {
        let Attempt { h, x, slopes, y, estimates, .. } = attempt;
        for i in 1..13 {
            argument(i, *h, x, slopes, y);
            slope(i - 1, y, slopes[i].as_mut());
        }
        for (estimate, weights) in estimates.iter_mut().zip([E3, E5]) {
            let estimate = estimate.as_mut();
            for c in 0..x.len() {
                let mut sum = S::zero();
                for j in 0..13 {
                    if weights[j] != 0.0 {
                        sum = S::splat(weights[j]).mul_add(slopes[j].as_ref()[c], sum);
                    }
                }
                estimate[c] = sum;
            }
        }
    }
}

/// The method of order 8 on a state `B`.
pub struct Dop853<B, U, T = Tolerance> {
    controller: StepController<T>,
    /// The slopes of the 12 stages, of the end, and of the dense output.
    k: [B; 16],
    /// The estimates of orders 3 and 5.
    errors: [B; 2],
    /// Dense output, rows 3 to 6.
    dense: [B; 4],
    y: B,
    x: B,
    x_old: B,
    u: U,
    /// The time of `u`, NaN when there is none to reuse.
    u_time: f64,
    /// Whether `dense` belongs to the last step.
    dense_ready: bool,
    chatter: Chatter<B>,
}

impl<B: Clone, U: Clone, T: Accuracy> Dop853<B, U, T> {
    /// The method with these tolerances; `state` and `input` give the sizes.
    pub fn new(tolerance: T, state: B, input: U) -> Self {
        Dop853 {
            controller: StepController::new(tolerance),
            chatter: Chatter::new(&state),
            k: std::array::from_fn(|_| state.clone()),
            errors: std::array::from_fn(|_| state.clone()),
            dense: std::array::from_fn(|_| state.clone()),
            y: state.clone(),
            x: state.clone(),
            x_old: state,
            u: input,
            u_time: f64::NAN,
            dense_ready: false,
        }
    }

    /// Try a step of `h`: the new state in `y`, its slope in `k[12]`; returns the error.
    fn attempt<S, F>(&mut self, system: &mut F, h: f64) -> f64
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let Dop853 { controller, k, errors, y, x, u, u_time, .. } = self;
        let times: [f64; Order8::STAGES] = std::array::from_fn(|i| controller.input_time(controller.t + C[i + 1] * h));
        let mut attempt = Attempt { h: S::splat(h), times: &times, x: x.as_ref(), slopes: k, y: y.as_mut(), estimates: errors };
        if system.attempt::<Order8, B>(&mut attempt) {
            *u_time = f64::NAN;
        } else {
            Order8::stages(&mut attempt, |i, y, dx| {
                if times[i] != *u_time {
                    system.input(times[i], u);
                    *u_time = times[i];
                }
                system.rhs(u, y, dx);
            });
        }
        controller.work.evaluations += Order8::STAGES as u64;
        if !finite(y.as_ref()) || !finite(k[12].as_ref()) {
            return f64::NAN;
        }
        let (x, y) = (x.as_ref(), y.as_ref());
        let (mut e3, mut e5) = (0.0, 0.0);
        let m = self.controller.tolerance.controlled().min(x.len());
        for c in 0..m {
            let scale = self.controller.tolerance.scale(c, x[c].lane(0).abs().max(y[c].lane(0).abs()));
            let [s3, s5] = [0, 1].map(|k| self.errors[k].as_ref()[c].lane(0) / scale);
            e3 += s3 * s3;
            e5 += s5 * s5;
        }
        if e5 == 0.0 && e3 == 0.0 { 0.0 } else { h.abs() * e5 / ((e5 + 0.01 * e3) * m.max(1) as f64).sqrt() }
    }

    fn prepare_dense<S, F>(&mut self, system: &mut F, h: f64)
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        // The stages count from the start of the step: put its state, time and slope back for a moment.
        std::mem::swap(&mut self.x, &mut self.x_old);
        self.k.swap(0, 12);
        let t = std::mem::replace(&mut self.controller.t, self.controller.t_old);
        for i in 13..16 {
            argument(i, S::splat(h), self.x.as_ref(), &self.k, self.y.as_mut());
            system.input(self.controller.input_time(self.controller.t + C[i] * h), &mut self.u);
            system.rhs(&self.u, self.y.as_ref(), self.k[i].as_mut());
            self.controller.work.evaluations += 1;
        }
        self.u_time = f64::NAN;
        for (row, weights) in self.dense.iter_mut().zip(&D) {
            let row = row.as_mut();
            for c in 0..row.len() {
                let mut sum = S::zero();
                for j in 0..16 {
                    if weights[j] != 0.0 {
                        sum = S::splat(weights[j]).mul_add(self.k[j].as_ref()[c], sum);
                    }
                }
                row[c] = S::splat(h) * sum;
            }
        }
        self.controller.t = t;
        self.k.swap(0, 12);
        std::mem::swap(&mut self.x, &mut self.x_old);
        self.dense_ready = true;
    }
}

impl<S: Real, F: System<S, Input = U>, B: Buffer<S>, U: Clone, T: Accuracy> Adaptive<S, F, B> for Dop853<B, U, T> {
    paced!(7);

    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        self.controller.begin(t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        self.dense_ready = false;
        self.u_time = f64::NAN;
        system.input(t, &mut self.u);
        system.rhs(&self.u, self.x.as_ref(), self.k[0].as_mut());
        self.controller.work.evaluations += 1;
        if !finite(self.x.as_ref()) || !finite(self.k[0].as_ref()) {
            return Err(Status::Diverged);
        }
        let [k0, k1, ..] = &mut self.k;
        self.controller.guess::<S, F, B>(system, &mut self.u, &self.x, k0, &mut self.y, k1, 7.0);
        Ok(())
    }

    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        if self.controller.done() {
            return Ok(true);
        }
        if self.chatter.due(&self.controller.work) {
            self.u_time = f64::NAN;
            self.chatter.look(system, &mut self.controller, &mut self.u, &self.x)?;
        }
        self.dense_ready = false;
        self.controller.open();
        loop {
            let (h, t_new) = self.controller.propose()?;
            let error = self.attempt::<S, F>(system, h);
            if self.controller.judge(error, h, t_new, &CONTROL) {
                std::mem::swap(&mut self.x_old, &mut self.x);
                std::mem::swap(&mut self.x, &mut self.y);
                self.k.swap(0, 12);
                return Ok(self.controller.done());
            }
        }
    }

    fn interpolate(&mut self, system: &mut F, t: f64, out: &mut B) {
        let h = self.controller.t - self.controller.t_old;
        if h == 0.0 || t >= self.controller.t {
            out.clone_from(&self.x);
            return;
        }
        if !self.dense_ready {
            self.prepare_dense::<S, F>(system, h);
        }
        let theta = (t - self.controller.t_old) / h;
        let (r, q) = (S::splat(theta), S::splat(1.0 - theta));
        let (x0, x1) = (self.x_old.as_ref(), self.x.as_ref());
        // After the swap in `step`, k[12] is the slope at the start and k[0] that at the end.
        let (f0, f1) = (self.k[12].as_ref(), self.k[0].as_ref());
        let out = out.as_mut();
        let hs = S::splat(h);
        for c in 0..x0.len() {
            let delta = x1[c] - x0[c];
            let row1 = hs.mul_add(f0[c], -delta);
            let row2 = delta + delta - hs * (f1[c] + f0[c]);
            let tail = self.dense[3].as_ref()[c] * r + self.dense[2].as_ref()[c];
            let tail = tail * q + self.dense[1].as_ref()[c];
            let tail = tail * r + self.dense[0].as_ref()[c];
            let tail = tail * q + row2;
            let tail = tail * r + row1;
            let tail = tail * q + delta;
            out[c] = tail.mul_add(r, x0[c]);
        }
    }
}
