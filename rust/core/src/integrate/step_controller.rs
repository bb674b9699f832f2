//! Step-size control of adaptive methods: time, next step size, and the end of a run without progress.
//!
//! PI control (Gustafsson; Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.2):
//! `h_new / h = safety error^-alpha error_old^beta`, within `[shrink, grow]`. Just after a rejection, the step size does not increase.
//! The method `radau5` computes its next step size itself.

use super::accuracy::{Accuracy, Work};
use super::stall::StallDetector;
use crate::scalar::Real;
use crate::status::Status;

/// The constants of the step-size control.
#[derive(Clone, Copy, Debug)]
pub struct Control {
    pub safety: f64,
    pub alpha: f64,
    pub beta: f64,
    pub shrink: f64,
    pub grow: f64,
}

/// The lower bound of the previous error in the PI control, as in Hairer's dopri5.f.
const LEAST_ERROR: f64 = 1e-4;
/// A step below this fraction of the segment does not advance a solution. Near `t = 0` the resolution of time is no limit.
const SHORTEST: f64 = f64::EPSILON * f64::EPSILON;
/// The factor of the step size after an attempt whose error is not finite.
const NOT_FINITE_FACTOR: f64 = 0.2;

/// The time and the step size of an adaptive method.
#[derive(Clone, Debug)]
pub struct StepController<T> {
    pub tolerance: T,
    pub t: f64,
    pub t_old: f64,
    /// The end of the segment, s.
    pub t_end: f64,
    /// The latest time at which the input of the segment is evaluated, s.
    pub input_end: f64,
    /// The size of the next attempt, s.
    pub h: f64,
    pub h_max: f64,
    /// The first step size, s, if the caller chose one, otherwise zero.
    pub h_first: f64,
    pub work: Work,
    /// The fraction `SHORTEST` of the segment, s, or zero for a segment without end.
    shortest: f64,
    stall: StallDetector,
    error_old: f64,
    rejected: bool,
    blown: bool,
}

impl<T: Accuracy> StepController<T> {
    pub fn new(tolerance: T) -> Self {
        StepController {
            tolerance,
            t: 0.0,
            t_old: 0.0,
            t_end: 0.0,
            input_end: 0.0,
            h: 0.0,
            h_max: f64::INFINITY,
            h_first: 0.0,
            work: Work::default(),
            shortest: 0.0,
            stall: StallDetector::new(),
            error_old: LEAST_ERROR,
            rejected: false,
            blown: false,
        }
    }

    pub fn begin(&mut self, t: f64, t_end: f64, input_end: f64) {
        (self.t, self.t_old, self.t_end, self.input_end) = (t, t, t_end, input_end);
        self.error_old = LEAST_ERROR;
        self.shortest = if t_end.is_finite() { SHORTEST * (t_end - t) } else { 0.0 };
        self.stall.begin(&self.work, t);
    }

    /// Return the smaller of `t` and the latest time at which the input is evaluated, s.
    pub fn input_time(&self, t: f64) -> f64 {
        t.min(self.input_end)
    }

    /// Return the fraction of the last step at `t`, and the size of this step, s. The result is `None` if `t` is not before the end of the
    /// step.
    pub fn within(&self, t: f64) -> Option<(f64, f64)> {
        let h = self.t - self.t_old;
        if h == 0.0 || t >= self.t { None } else { Some(((t - self.t_old) / h, h)) }
    }

    /// Set the largest step size, s, also for the next attempt.
    pub fn limit(&mut self, h_max: f64) {
        self.h_max = h_max;
        if h_max < self.h {
            self.h = h_max;
        }
    }

    pub fn done(&self) -> bool {
        self.t >= self.t_end
    }

    /// The root mean square of `e(i)` divided by the allowed error at `x` and `y`, over the components with error control. Only lane 0
    /// counts.
    pub fn norm<S: Real>(&self, x: &[S], y: &[S], e: impl Fn(usize) -> S) -> f64 {
        let m = self.tolerance.controlled().min(x.len());
        let mut sum = 0.0;
        for i in 0..m {
            let r = e(i).lane(0) / self.tolerance.scale(i, x[i].lane(0).abs().max(y[i].lane(0).abs()));
            sum += r * r;
        }
        (sum / m.max(1) as f64).sqrt()
    }

    /// The resolution of time, s: ten units in the last place of `t`.
    pub fn smallest(&self) -> f64 {
        10.0 * (self.t.next_up() - self.t)
    }

    /// Begin a step, before its first attempt.
    pub fn open(&mut self) {
        (self.rejected, self.blown) = (false, false);
    }

    /// Return the size of the next attempt, and the time at its end. The error is the reason why no attempt is possible.
    pub fn propose(&mut self) -> Result<(f64, f64), Status> {
        let smallest = self.smallest();
        self.stall.check(&self.work, self.t, self.t_end)?;
        let left = self.t_end - self.t;
        if !(self.h >= smallest.max(self.shortest)) && self.h < left {
            return Err(if self.blown { Status::Diverged } else { Status::StepUnderflow });
        }
        // The step includes the remainder of the segment if the remainder would be tiny.
        Ok(if self.h >= left - smallest { (left, self.t_end) } else { (self.h, self.t + self.h) })
    }

    /// Return whether an attempt of size `h` is accepted, and set the size of the next attempt.
    pub fn judge(&mut self, error: f64, h: f64, t_new: f64, control: &Control) -> bool {
        if error < 1.0 {
            let mut factor = control.grow;
            if error > 0.0 {
                factor = control.safety * power(error, -control.alpha);
                if control.beta != 0.0 {
                    factor *= power(self.error_old, control.beta);
                }
                factor = factor.clamp(control.shrink, control.grow);
            }
            self.error_old = error.max(LEAST_ERROR);
            self.accept(t_new, h * if self.rejected { factor.min(1.0) } else { factor });
            return true;
        }
        let blown = !error.is_finite();
        self.reject(h * if blown { NOT_FINITE_FACTOR } else { (control.safety * power(error, -control.alpha)).max(control.shrink) }, blown);
        false
    }

    pub fn accept(&mut self, t_new: f64, h_next: f64) {
        self.t_old = self.t;
        self.t = t_new;
        self.h = h_next.min(self.h_max);
        self.work.steps += 1;
    }

    pub fn reject(&mut self, h_next: f64, blown: bool) {
        self.work.rejections += 1;
        self.rejected = true;
        self.blown = blown;
        self.h = h_next;
    }
}

/// Return `x^p`. The exponents -1/4 of `rodas4` and -1/8 of `dop853` occur in every step, and are computed by square roots.
fn power(x: f64, p: f64) -> f64 {
    match p {
        -0.25 => 1.0 / x.sqrt().sqrt(),
        -0.125 => 1.0 / x.sqrt().sqrt().sqrt(),
        _ => x.powf(p),
    }
}

/// Return whether all numbers are finite in lane 0. The loop has no branch per number.
pub(super) fn finite<S: Real>(x: &[S]) -> bool {
    let mut zero = S::zero();
    for &value in x {
        zero += value * S::zero();
    }
    zero.lane(0) == 0.0
}

/// Methods of [`super::Adaptive`] that use only the fields `controller` and `x`.
macro_rules! step_controlled {
    ($degree:expr) => {
        fn dense_degree(&self) -> usize {
            $degree
        }
        fn t(&self) -> f64 {
            self.controller.t
        }
        fn t_old(&self) -> f64 {
            self.controller.t_old
        }
        fn x(&self) -> &B {
            &self.x
        }
        fn x_mut(&mut self) -> &mut B {
            &mut self.x
        }
        fn work(&self) -> Work {
            self.controller.work
        }
        fn limit_step(&mut self, h_max: f64) {
            self.controller.limit(h_max);
        }
        fn first_step(&mut self, h: f64) {
            self.controller.h_first = h;
        }
    };
}
pub(super) use step_controlled;
