//! Chattering: an adaptive method that spends its steps along a surface on which the slope jumps and which the solution cannot leave.
//!
//! There is no solution in the classical sense, and every tolerance only shortens the steps: `x' = -sign(x)` from the time at which
//! `x = 0`. From time to time the slope is compared with the one a step ahead, `f(x + d)`, `d = f(x) max(h, 1/|f(x)|)`, in units of
//! the allowed error. If they differ, `[x, x + d]` is halved repeatedly, and the half in which the slope changes more is kept. A smooth
//! change decreases with the interval, a jump remains. A run may spend [`System::chatter_budget`] attempts in this way.

use super::adaptive::{Accuracy, Work};
use super::step_controller::{StepController, finite};
use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// Attempts between two checks.
const WINDOW: u64 = 500;
/// A step that moves the state by more allowed errors than this is not limited by a jump.
const MOVES: f64 = 1e3;
/// A change of slope is ignored if it moves the state in one step by less than this fraction of the allowed error.
const NOTICED: f64 = 0.1;
/// Halvings of the interval. A slope that changes within `2^-30` of it counts as a jump.
const HALVINGS: usize = 30;
/// The fraction of the change that must remain for a jump, or for two in one interval.
const REMAINS: f64 = 0.25;
/// A jump exceeds the rounding errors of the slope by this factor.
const NOISE: f64 = 10.0;

#[derive(Clone, Debug)]
pub(super) struct Chatter<B> {
    /// The number of attempts at the next check, and the number of those spent on jumps.
    look_at: u64,
    spent: u64,
    slope: B,
    low: B,
    middle: B,
    high: B,
    at: B,
}

impl<B: Clone> Chatter<B> {
    pub fn new(state: &B) -> Self {
        let [slope, low, middle, high, at] = std::array::from_fn(|_| state.clone());
        Chatter { look_at: WINDOW, spent: 0, slope, low, middle, high, at }
    }

    /// Whether the next check is due.
    pub fn due(&self, work: &Work) -> bool {
        work.steps + work.rejections >= self.look_at
    }

    /// Check before a step from `x`. `u` is scratch.
    #[cold]
    #[inline(never)]
    pub fn look<S, F, T>(&mut self, system: &mut F, controller: &mut StepController<T>, u: &mut F::Input, x: &B) -> Result<(), Status>
    where
        S: Real,
        F: System<S>,
        B: Buffer<S>,
        T: Accuracy,
    {
        self.look_at = controller.work.steps + controller.work.rejections + WINDOW;
        if !self.jumps(system, controller, u, x.as_ref()) {
            self.spent = self.spent.saturating_sub(WINDOW);
            return Ok(());
        }
        self.spent += WINDOW;
        if self.spent >= system.chatter_budget() { Err(Status::Stalled) } else { Ok(()) }
    }

    /// Whether the slope jumps a step ahead of `x`.
    fn jumps<S, F, T>(&mut self, system: &mut F, controller: &mut StepController<T>, u: &mut F::Input, x: &[S]) -> bool
    where
        S: Real,
        F: System<S>,
        B: Buffer<S>,
        T: Accuracy,
    {
        system.input(controller.input_time(controller.t), u);
        controller.work.evaluations += 1;
        system.rhs(u, x, self.slope.as_mut());
        let slope = self.slope.as_ref();
        let speed = controller.norm(x, x, |i| slope[i]);
        if !finite(slope) || speed == 0.0 || !(controller.h * speed < MOVES) {
            return false;
        }
        let ahead = controller.h.max(1.0 / speed);
        let slope_at = |system: &mut F, controller: &mut StepController<T>, at: &mut B, s: f64, out: &mut B| {
            for (c, at) in at.as_mut().iter_mut().enumerate() {
                *at = S::splat(s * ahead).mul_add(slope[c], x[c]);
            }
            controller.work.evaluations += 1;
            system.rhs(u, at.as_ref(), out.as_mut());
            finite(out.as_ref())
        };
        let change = |controller: &StepController<T>, a: &B, b: &B| ahead * controller.norm(x, x, |i| b.as_ref()[i] - a.as_ref()[i]);
        self.low.clone_from(&self.slope);
        let known = slope_at(system, controller, &mut self.at, 1.0, &mut self.high);
        let first = change(controller, &self.low, &self.high);
        if !known || first < NOTICED {
            return false;
        }
        let (mut from, mut to, mut left) = (0.0, 1.0, first);
        for _ in 0..HALVINGS {
            let s = 0.5 * (from + to);
            if !slope_at(system, controller, &mut self.at, s, &mut self.middle) {
                return false;
            }
            let (before, after) = (change(controller, &self.low, &self.middle), change(controller, &self.middle, &self.high));
            if before > after {
                std::mem::swap(&mut self.middle, &mut self.high);
                (to, left) = (s, before);
            } else {
                std::mem::swap(&mut self.middle, &mut self.low);
                (from, left) = (s, after);
            }
            if left < REMAINS * first {
                return false;
            }
        }
        // The effect of rounding errors of the state on the slope.
        for (at, &x) in self.at.as_mut().iter_mut().zip(x) {
            *at = S::splat(1.0 + f64::EPSILON) * x;
        }
        controller.work.evaluations += 1;
        system.rhs(u, self.at.as_ref(), self.middle.as_mut());
        left > NOISE * change(controller, &self.slope, &self.middle)
    }
}
