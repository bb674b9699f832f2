//! The end of a run that makes no progress: at the limit of steps, or earlier if the run would certainly reach this limit.
//!
//! An input that switches (a target out of reach, a bound) makes every step across the switch fail. The run then follows the switch in
//! steps of the size of the tolerance. Progress is measured in windows. The run ends after ten consecutive windows at whose rate the
//! remaining time would take more steps than the cap.

use super::adaptive::{MAX_STEPS, Work};
use crate::status::Status;

/// Attempts in a window, after which the progress is measured.
const WINDOW: u64 = 10_000;
/// Number of consecutive slow windows that end a run. A stiff start takes fewer.
const SLOW: u32 = 10;

#[derive(Clone, Copy, Debug)]
pub(super) struct StallDetector {
    /// The number of attempts at the next check, and the time of the last one.
    look_at: u64,
    t: f64,
    slow: u32,
}

impl StallDetector {
    pub fn new() -> Self {
        StallDetector { look_at: 0, t: 0.0, slow: 0 }
    }

    /// A segment begins at `t`.
    pub fn begin(&mut self, work: &Work, t: f64) {
        *self = StallDetector { look_at: MAX_STEPS.min(work.steps + work.rejections + WINDOW), t, slow: 0 };
    }

    /// Before an attempt at `t` on the way to `t_end`.
    pub fn check(&mut self, work: &Work, t: f64, t_end: f64) -> Result<(), Status> {
        let attempts = work.steps + work.rejections;
        if attempts < self.look_at { Ok(()) } else { self.look(attempts, t, t_end) }
    }

    #[cold]
    fn look(&mut self, attempts: u64, t: f64, t_end: f64) -> Result<(), Status> {
        if attempts >= MAX_STEPS {
            return Err(Status::MaxSteps);
        }
        let windows = (MAX_STEPS / WINDOW) as f64;
        self.slow = if t_end.is_finite() && (t - self.t) * windows < t_end - t { self.slow + 1 } else { 0 };
        (self.look_at, self.t) = (MAX_STEPS.min(attempts + WINDOW), t);
        if self.slow >= SLOW { Err(Status::Stalled) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Attempts until a run of constant steps `h` from 0 to 1 ends, after `start` steps of 1e-9.
    fn attempts(h: f64, start: u64) -> (u64, Option<Status>) {
        let (mut work, mut t, mut stall) = (Work::default(), 0.0, StallDetector::new());
        stall.begin(&work, t);
        while t < 1.0 {
            if let Err(status) = stall.check(&work, t, 1.0) {
                return (work.steps, Some(status));
            }
            t += if work.steps < start { 1e-9 } else { h };
            work.steps += 1;
        }
        (work.steps, None)
    }

    #[test]
    fn a_collapsed_step_ends_a_run_and_a_slow_start_does_not() {
        assert_eq!(attempts(1e-8, 0), (SLOW as u64 * WINDOW, Some(Status::Stalled)));
        // 2,000,000 steps are many and allowed.
        assert_eq!(attempts(5e-7, 0).1, None);
        assert_eq!(attempts(1e-5, (SLOW as u64 - 1) * WINDOW).1, None);
        let mut stall = StallDetector::new();
        let spent = Work { steps: MAX_STEPS, ..Work::default() };
        stall.begin(&spent, 0.0);
        assert_eq!(stall.check(&spent, 0.0, 1.0), Err(Status::MaxSteps));
    }
}
