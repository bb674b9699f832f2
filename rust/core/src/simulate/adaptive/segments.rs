//! The segments of an adaptive run. A segment lies between two successive times at which the input jumps or the controller takes a sample.

use crate::error::Result as CoreResult;
use crate::integrate::Work;
use crate::simulate::problem::bound::Bound;
use crate::simulate::problem::time_scale::TimeScale;
use crate::simulate::problem::times::{Times, require_times};
use crate::status::Status;

/// A time `t` counts as a sample time if `|t - sample time| / period` is below this limit, dimensionless.
pub const ON_SAMPLE: f64 = 1e-9;

/// The segments and records of an adaptive run, prepared before the run.
#[derive(Clone, Debug)]
pub struct Segments {
    pub t_end: f64,
    pub times: Times,
    /// The times at which the input jumps, within the run, s, increasing. With `Clock::Breaks`, they include the sample times and the times
    /// at which outputs begin to act.
    pub breaks: Vec<f64>,
    pub clock: Clock,
    /// The limit of the absolute values of the plant's states.
    pub bound: Bound,
    /// The largest step that the caller allows, s, or infinity.
    pub max_step: f64,
    /// The time scales of the functions of time in the loop, which also limit the steps.
    pub scales: Vec<TimeScale>,
}

/// The instants at which a sampled law is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// The law is evaluated in every stage.
    None,
    /// The law is evaluated at the start and at each multiple of this period, s. A jump of the input between them is no sample.
    Every(f64),
    /// The loop's `sample` is called at the start and at every break. The loop decides whether a sample is due.
    Breaks,
}

impl Segments {
    pub fn new(t_end: f64, times: Times, breaks: &[f64], clock: Clock, bound: Bound) -> CoreResult<Self> {
        match &times {
            Times::At(t_eval) => require_times(t_eval, t_end)?,
            Times::Every(0) => return Err(crate::error::Error::input("record_every", "is not positive: expected an integer >= 1, got 0")),
            Times::Every(_) => {}
        }
        let breaks = breaks.iter().copied().filter(|&b| b > 0.0 && b <= t_end).collect();
        Ok(Segments { t_end, times, breaks, clock, bound, max_step: f64::INFINITY, scales: Vec::new() })
    }

    /// Return these segments, also divided at the times `more`, s.
    pub fn with_breaks(&self, more: &[f64]) -> Self {
        let mut all = self.clone();
        if !more.is_empty() {
            all.breaks.extend(more);
            all.breaks.sort_by(f64::total_cmp);
            all.breaks.dedup();
        }
        all
    }

    /// Return these segments for a loop with a function of time whose time scale is `scale`, if there is one.
    pub fn scaled(mut self, scale: Option<TimeScale>) -> Self {
        self.scales.extend(scale);
        self
    }

    /// The length of the longest step from time `t`, s.
    pub fn longest_step(&self, t: f64) -> f64 {
        self.scales.iter().fold(self.max_step, |longest, scale| longest.min(scale.longest_step(t)))
    }

    /// Whether a sample may be due at the end `t` of a segment.
    pub fn is_sample(&self, t: f64) -> bool {
        match self.clock {
            Clock::None => false,
            Clock::Every(period) => (t / period - (t / period).round()).abs() < ON_SAMPLE,
            Clock::Breaks => true,
        }
    }

    /// Return the end of the segment that starts at `t`, and whether the input jumps at this end.
    pub fn next(&self, t: f64, sample: u64) -> (f64, bool) {
        let mut end = (self.t_end, false);
        if let Some(&b) = self.breaks.get(self.breaks.partition_point(|&b| b <= t)) {
            end = (b, true);
        }
        if let Clock::Every(period) = self.clock {
            let next = (sample + 1) as f64 * period;
            // A sample that is practically at the end does not shorten the segment.
            if next < end.0 - ON_SAMPLE * period {
                end = (next, false);
            }
        }
        end
    }
}

/// The reason why a step is shortened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// The system switches its mode at this time, and the step is repeated up to it.
    Switch(f64),
    /// The run ends at this time.
    End(f64),
}

/// The end of a run: its status, its end time, s, and the counts of its evaluations and steps.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub status: Status,
    pub t: f64,
    pub work: Work,
}
