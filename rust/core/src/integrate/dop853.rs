//! The explicit Runge-Kutta method of order 8 with step control and dense output of order 7 (Dormand and
//! Prince 1980; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10).
//!
//! Error of a step: `|h| e5^2 / sqrt(n (e5^2 + 0.01 e3^2))` with the weighted norms of the two estimators;
//! accepted below 1, the next step grows by `0.9 error^(-1/8)` within [0.2, 10].

use super::adaptive::{Accuracy, Adaptive};
pub use super::adaptive::{Tolerance, Work};
use super::dop853_tableau::{A, C, D, E3, E5};
use super::patience::Patience;
use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 10.0;
pub struct Dop853<B, U, T = Tolerance> {
    tolerance: T,
    /// The slopes of the 12 stages, of the end, and of the dense output.
    k: [B; 16],
    /// Dense output, rows 3 to 6.
    dense: [B; 4],
    y: B,
    pub x: B,
    x_old: B,
    u: U,
    /// The time of `u`, NaN when there is none to reuse.
    u_time: f64,
    pub t: f64,
    t_old: f64,
    /// End of the segment, and the latest time at which its input is taken.
    t_end: f64,
    input_end: f64,
    h: f64,
    h_max: f64,
    /// The first step asked for; zero for a guess.
    h_first: f64,
    /// Whether `dense` belongs to the last step.
    dense_ready: bool,
    pub work: Work,
    patience: Patience,
}

impl<B: Clone, U: Clone, T: Accuracy> Dop853<B, U, T> {
    #[inline(always)]
    pub fn new(tolerance: T, state: B, input: U) -> Self {
        let k = std::array::from_fn(|_| state.clone());
        let dense = std::array::from_fn(|_| state.clone());
        Dop853 {
            tolerance,
            k,
            dense,
            y: state.clone(),
            x: state.clone(),
            x_old: state,
            u: input,
            u_time: f64::NAN,
            t: 0.0,
            t_old: 0.0,
            t_end: 0.0,
            input_end: 0.0,
            h: 0.0,
            h_max: f64::INFINITY,
            h_first: 0.0,
            dense_ready: false,
            work: Work::default(),
            patience: Patience::new(),
        }
    }

    /// Begin a segment from the state `self.x` at `t`. `input_end` is the latest time at which the input is
    /// taken: `t_end`, or just before it where the input jumps there.
    #[inline(always)]
    pub fn begin<S, F>(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status>
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        (self.t, self.t_old, self.t_end, self.input_end) = (t, t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        self.patience.begin(&self.work, t);
        self.dense_ready = false;
        system.anchor(self.x.as_ref());
        system.input(t, &mut self.u);
        self.u_time = f64::NAN;
        system.rhs(&self.u, self.x.as_ref(), self.k[0].as_mut());
        self.work.evaluations += 1;
        if !finite(self.x.as_ref()) || !finite(self.k[0].as_ref()) {
            return Err(Status::Diverged);
        }
        self.h = if self.h_first > 0.0 { self.h_first } else { self.guess_step(system) }.min(self.h_max);
        Ok(())
    }

    /// A first step from the sizes of the state, its slope and its curvature (Hairer, section II.4).
    #[inline(always)]
    fn guess_step<S, F>(&mut self, system: &mut F) -> f64
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let m = self.tolerance.controlled();
        let span = self.t_end - self.t;
        let scale = |i: usize, x: S| self.tolerance.scale(i, x.lane(0).abs());
        let norm = |f: &dyn Fn(usize) -> f64| ((0..m).map(|i| f(i) * f(i)).sum::<f64>() / m.max(1) as f64).sqrt();
        let (x, k) = (self.x.as_ref(), self.k[0].as_ref());
        let d0 = norm(&|i| x[i].lane(0) / scale(i, x[i]));
        let d1 = norm(&|i| k[i].lane(0) / scale(i, x[i]));
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 }.min(span);
        for i in 0..x.len() {
            self.y.as_mut()[i] = S::splat(h0).mul_add(k[i], x[i]);
        }
        system.input((self.t + h0).min(self.input_end), &mut self.u);
        system.rhs(&self.u, self.y.as_ref(), self.k[1].as_mut());
        self.work.evaluations += 1;
        let (x, k0, k1) = (self.x.as_ref(), self.k[0].as_ref(), self.k[1].as_ref());
        let d2 = norm(&|i| (k1[i] - k0[i]).lane(0) / scale(i, x[i])) / h0;
        let steepest = d1.max(d2);
        let h1 = if steepest <= 1e-15 { (1e-3 * h0).max(1e-6) } else { (0.01 / steepest).powf(0.125) };
        let h = (100.0 * h0).min(h1).min(span);
        if h.is_finite() && h > 0.0 { h } else { span * 1e-6 }
    }

    /// One accepted step; `true` at the end of the segment.
    #[inline(always)]
    pub fn step<S, F>(&mut self, system: &mut F) -> Result<bool, Status>
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        if self.t >= self.t_end {
            return Ok(true);
        }
        system.anchor(self.x.as_ref());
        self.dense_ready = false;
        let mut rejected = false;
        let mut blown = false;
        loop {
            let smallest = 10.0 * (self.t.next_up() - self.t);
            self.patience.check(&self.work, self.t, self.t_end)?;
            if self.h < smallest {
                return Err(if blown { Status::Diverged } else { Status::StepUnderflow });
            }
            // A last step that would leave a sliver is stretched over it.
            let left = self.t_end - self.t;
            let h = if self.h >= left - smallest { left } else { self.h };
            let t_new = if h == left { self.t_end } else { self.t + h };
            let error = self.attempt::<S, F>(system, h);
            if error < 1.0 {
                let factor = if error == 0.0 { GROW } else { (SAFETY / eighth_root(error)).min(GROW) };
                let factor = if rejected { factor.min(1.0) } else { factor.max(SHRINK) };
                self.t_old = self.t;
                self.t = t_new;
                std::mem::swap(&mut self.x_old, &mut self.x);
                std::mem::swap(&mut self.x, &mut self.y);
                self.k.swap(0, 12);
                self.h = (h * factor).min(self.h_max);
                self.work.steps += 1;
                return Ok(self.t >= self.t_end);
            }
            self.work.rejections += 1;
            rejected = true;
            blown = !error.is_finite();
            self.h = h * if blown { SHRINK } else { (SAFETY / eighth_root(error)).max(SHRINK) };
        }
    }

    /// The argument of stage `i` into `y`: `x + h sum_j A[i][j] k_j`.
    #[inline(always)]
    fn argument<S: Real>(&mut self, i: usize, h: f64)
    where
        B: Buffer<S>,
    {
        let (x, y) = (self.x.as_ref(), self.y.as_mut());
        for c in 0..x.len() {
            y[c] = S::splat(A[i][0]) * self.k[0].as_ref()[c];
        }
        for j in 1..i {
            if A[i][j] != 0.0 {
                let (weight, k) = (S::splat(A[i][j]), self.k[j].as_ref());
                for c in 0..y.len() {
                    y[c] = weight.mul_add(k[c], y[c]);
                }
            }
        }
        for c in 0..x.len() {
            y[c] = S::splat(h).mul_add(y[c], x[c]);
        }
    }

    /// Stages `from .. to`: the loop keeps one copy of the right-hand side in the code.
    #[inline(always)]
    fn stages<S, F>(&mut self, system: &mut F, from: usize, to: usize, h: f64)
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        for i in from..to {
            self.argument::<S>(i, h);
            let t = (self.t + C[i] * h).min(self.input_end);
            if t != self.u_time {
                system.input(t, &mut self.u);
                self.u_time = t;
            }
            system.rhs(&self.u, self.y.as_ref(), self.k[i].as_mut());
            self.work.evaluations += 1;
        }
    }

    /// Try a step of `h`: the new state in `y`, its slope in `k[12]`; returns the error.
    #[inline(always)]
    fn attempt<S, F>(&mut self, system: &mut F, h: f64) -> f64
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        // The argument of stage 12 is the new state: the method is first-same-as-last.
        self.stages::<S, F>(system, 1, 13, h);
        if !finite(self.y.as_ref()) || !finite(self.k[12].as_ref()) {
            return f64::NAN;
        }
        let (x, y) = (self.x.as_ref(), self.y.as_ref());
        let (mut e3, mut e5) = (0.0, 0.0);
        let m = self.tolerance.controlled().min(x.len());
        for c in 0..m {
            let (mut s3, mut s5) = (S::zero(), S::zero());
            for j in 0..13 {
                let k = self.k[j].as_ref()[c];
                if E3[j] != 0.0 {
                    s3 = S::splat(E3[j]).mul_add(k, s3);
                }
                if E5[j] != 0.0 {
                    s5 = S::splat(E5[j]).mul_add(k, s5);
                }
            }
            let scale = self.tolerance.scale(c, x[c].lane(0).abs().max(y[c].lane(0).abs()));
            let (s3, s5) = (s3.lane(0) / scale, s5.lane(0) / scale);
            e3 += s3 * s3;
            e5 += s5 * s5;
        }
        if e5 == 0.0 && e3 == 0.0 { 0.0 } else { h.abs() * e5 / ((e5 + 0.01 * e3) * m.max(1) as f64).sqrt() }
    }

    /// The state at `t` within the last step.
    #[inline(always)]
    pub fn interpolate<S, F>(&mut self, system: &mut F, t: f64, out: &mut B)
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let h = self.t - self.t_old;
        if h == 0.0 || t >= self.t {
            out.clone_from(&self.x);
            return;
        }
        if !self.dense_ready {
            self.prepare_dense::<S, F>(system, h);
        }
        let theta = (t - self.t_old) / h;
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

    #[inline(always)]
    fn prepare_dense<S, F>(&mut self, system: &mut F, h: f64)
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        // The stages count from the start of the step: put its state, time and slope back for a moment.
        std::mem::swap(&mut self.x, &mut self.x_old);
        self.k.swap(0, 12);
        let t = std::mem::replace(&mut self.t, self.t_old);
        system.anchor(self.x.as_ref());
        self.stages::<S, F>(system, 13, 16, h);
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
        self.t = t;
        self.k.swap(0, 12);
        std::mem::swap(&mut self.x, &mut self.x_old);
        self.dense_ready = true;
    }
}

impl<S: Real, F: System<S, Input = U>, B: Buffer<S>, U: Clone, T: Accuracy> Adaptive<S, F, B> for Dop853<B, U, T> {
    #[inline(always)]
    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        Dop853::begin(self, system, t, t_end, input_end)
    }
    #[inline(always)]
    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        Dop853::step(self, system)
    }
    #[inline(always)]
    fn interpolate(&mut self, system: &mut F, t: f64, out: &mut B) {
        Dop853::interpolate(self, system, t, out);
    }
    fn dense_degree(&self) -> usize {
        7
    }
    fn t(&self) -> f64 {
        self.t
    }
    fn t_old(&self) -> f64 {
        self.t_old
    }
    fn x(&self) -> &B {
        &self.x
    }
    fn x_mut(&mut self) -> &mut B {
        &mut self.x
    }
    fn work(&self) -> Work {
        self.work
    }
    fn limit_step(&mut self, h_max: f64) {
        self.h_max = h_max;
    }
    fn first_step(&mut self, h: f64) {
        self.h_first = h;
    }
}

#[inline(always)]
fn finite<S: Real>(x: &[S]) -> bool {
    let mut zero = S::zero();
    for &value in x {
        zero += value * S::zero();
    }
    zero.lane(0) == 0.0
}

#[inline(always)]
fn eighth_root(x: f64) -> f64 {
    x.sqrt().sqrt().sqrt()
}
