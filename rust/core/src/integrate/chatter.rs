//! The detection of chattering along a surface on which the slope `f` jumps and which the solution cannot leave.
//!
//! An example is `x' = 1/2 - sign(x)` from the time at which `x = 0`, where `x'` is the time derivative. No solution exists in the
//! classical sense, and the step size of an adaptive method decreases without limit. Every `WINDOW` attempts, a check compares `f(x)` with
//! `f(x + d)`, where `d = f(x) max(h, 1/|f(x)|)` with the step size `h`. Norms are relative to the allowed error. If the two slopes differ,
//! bisection of `[x, x + d]` keeps the half in which the slope changes more. A smooth change decreases with the interval, and a jump does
//! not. A check that finds a jump adds `WINDOW` to a count, and any other check subtracts `WINDOW`. The run ends when the count reaches
//! [`System::chatter_budget`].

use super::accuracy::{Accuracy, Work};
use super::step_controller::{StepController, finite};
use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// The number of attempts between two checks.
const WINDOW: u64 = 500;
/// If a step moves the state by at least this multiple of the allowed error, the check reports no jump.
const MOVES: f64 = 1e3;
/// A change of the slope is ignored if it moves the state by less than this fraction of the allowed error in the time `max(h, 1/|f(x)|)`.
const NOTICED: f64 = 0.1;
/// The number of bisections. A change of the slope within `2^-30` of the interval counts as a jump.
const BISECTIONS: usize = 30;
/// The check reports a jump only if each bisection keeps at least this fraction of the change of the slope over `[x, x + d]`. The limit is
/// below 1/2, because two jumps in one interval can be in different halves.
const REMAINS: f64 = 0.25;
/// The check reports a jump only if it is larger than this multiple of the effect of rounding errors on the slope.
const NOISE: f64 = 10.0;

/// The state of the chattering detection.
#[derive(Clone, Debug)]
pub(super) struct Chatter<B> {
    /// The number of attempts at which the next check is due.
    next_check: u64,
    /// The count of attempts at jumps: each check adds or subtracts `WINDOW`.
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
        Chatter { next_check: WINDOW, spent: 0, slope, low, middle, high, at }
    }

    /// Prepare the detection for a new run.
    pub fn restart(&mut self) {
        (self.next_check, self.spent) = (WINDOW, 0);
    }

    /// Whether the next check is due.
    pub fn due(&self, work: &Work) -> bool {
        work.steps + work.rejections >= self.next_check
    }

    /// Check the slope before a step from the state `x`. `u` is memory for the input. The result is an error if the count of attempts at
    /// jumps reaches the budget.
    #[cold]
    #[inline(never)]
    pub fn check<S, F, T>(&mut self, system: &mut F, controller: &mut StepController<T>, u: &mut F::Input, x: &B) -> Result<(), Status>
    where
        S: Real,
        F: System<S>,
        B: Buffer<S>,
        T: Accuracy,
    {
        self.next_check = controller.work.steps + controller.work.rejections + WINDOW;
        if !self.jumps(system, controller, u, x.as_ref()) {
            self.spent = self.spent.saturating_sub(WINDOW);
            return Ok(());
        }
        self.spent += WINDOW;
        if self.spent >= system.chatter_budget() { Err(Status::Stalled) } else { Ok(()) }
    }

    /// Whether the slope jumps between `x` and `x + d`.
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
        for _ in 0..BISECTIONS {
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
        // Change the state by one rounding error, to measure the effect on the slope.
        for (at, &x) in self.at.as_mut().iter_mut().zip(x) {
            *at = S::splat(1.0 + f64::EPSILON) * x;
        }
        controller.work.evaluations += 1;
        system.rhs(u, self.at.as_ref(), self.middle.as_mut());
        left > NOISE * change(controller, &self.slope, &self.middle)
    }
}
