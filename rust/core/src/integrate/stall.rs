//! The end of a run that makes too little progress. The run ends at the limit of attempts, or earlier if it would reach this limit at its
//! present rate.
//!
//! If the control input switches at a surface in the state space, for example at a bound, steps across this surface are rejected. The steps
//! along the surface then become very small. A *window* is a fixed number of attempts. A window is slow if the remaining time of the
//! segment would require more than `MAX_STEPS` attempts at its rate. The run ends after ten consecutive slow windows.

use super::accuracy::{MAX_STEPS, Work};
use crate::status::Status;

/// The number of attempts in a window.
const WINDOW: u64 = 10_000;
/// The number of consecutive slow windows that end a run.
const SLOW: u32 = 10;

/// The progress of a run through its windows.
#[derive(Clone, Copy, Debug)]
pub(super) struct StallDetector {
    /// The number of attempts at which the next check is due.
    next_check: u64,
    /// The time of the last check, s.
    t: f64,
    slow: u32,
}

impl StallDetector {
    pub fn new() -> Self {
        StallDetector { next_check: 0, t: 0.0, slow: 0 }
    }

    /// Begin a segment at time `t`.
    pub fn begin(&mut self, work: &Work, t: f64) {
        *self = StallDetector { next_check: MAX_STEPS.min(work.steps + work.rejections + WINDOW), t, slow: 0 };
    }

    /// Check the progress before an attempt at time `t`, for a segment that ends at `t_end`. The result is an error if the run must end.
    pub fn check(&mut self, work: &Work, t: f64, t_end: f64) -> Result<(), Status> {
        let attempts = work.steps + work.rejections;
        if attempts < self.next_check { Ok(()) } else { self.check_progress(attempts, t, t_end) }
    }

    #[cold]
    fn check_progress(&mut self, attempts: u64, t: f64, t_end: f64) -> Result<(), Status> {
        if attempts >= MAX_STEPS {
            return Err(Status::MaxSteps);
        }
        let windows = (MAX_STEPS / WINDOW) as f64;
        self.slow = if t_end.is_finite() && (t - self.t) * windows < t_end - t { self.slow + 1 } else { 0 };
        (self.next_check, self.t) = (MAX_STEPS.min(attempts + WINDOW), t);
        if self.slow >= SLOW { Err(Status::Stalled) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Return the number of attempts of a run from t = 0 to t = 1, and its error. The first `start` steps have the size 1e-9, and all later
    /// steps have the size `h`.
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
        // A run of 2,000,000 steps is long, but within the limit.
        assert_eq!(attempts(5e-7, 0).1, None);
        assert_eq!(attempts(1e-5, (SLOW as u64 - 1) * WINDOW).1, None);
        let mut stall = StallDetector::new();
        let spent = Work { steps: MAX_STEPS, ..Work::default() };
        stall.begin(&spent, 0.0);
        assert_eq!(stall.check(&spent, 0.0, 1.0), Err(Status::MaxSteps));
    }
}
