//! Runs of adaptive methods. A segment lies between two successive times at which the input jumps or the controller takes a sample. Records
//! at given times use the dense output of the method.

use super::bound::Bound;
use super::rates_loop::RatesLoop;
use super::schedule::{Times, require_times};
use super::stop::Stop;
use super::time_scale::TimeScale;
use super::watching::Watching;
use crate::error::Result as CoreResult;
use crate::integrate::{Adaptive, System, Work};
use crate::status::Status;

/// A time `t` counts as a sample time if `|t - sample time| / period` is below this limit, dimensionless.
const ON_SAMPLE: f64 = 1e-9;

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
    fn longest_step(&self, t: f64) -> f64 {
        self.scales.iter().fold(self.max_step, |longest, scale| longest.min(scale.longest_step(t)))
    }

    /// Whether a sample may be due at the end `t` of a segment.
    fn is_sample(&self, t: f64) -> bool {
        match self.clock {
            Clock::None => false,
            Clock::Every(period) => (t / period - (t / period).round()).abs() < ON_SAMPLE,
            Clock::Breaks => true,
        }
    }

    /// Return the end of the segment that starts at `t`, and whether the input jumps at this end.
    fn next(&self, t: f64, sample: u64) -> (f64, bool) {
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

/// An accepted step.
struct Step {
    reached: f64,
    /// Whether an event ends the run at `reached`.
    ends: bool,
    /// Whether this is the last step of the run.
    finished: bool,
    /// The time of the sample at the end of the step, if there is one.
    sample: Option<f64>,
}

/// The records that the run must still write.
struct DueRecords<'a> {
    times: &'a Times,
    /// The number of requested times that already have a record.
    wanted: usize,
    /// The number of accepted steps.
    accepted: usize,
}

impl DueRecords<'_> {
    /// Return whether the initial state is recorded.
    fn at_start(&mut self) -> bool {
        let Times::At(t_eval) = self.times else { return true };
        self.wanted = usize::from(t_eval.first() == Some(&0.0));
        self.wanted == 1
    }

    /// Record the states at all record times within a step. `at` is memory for an interpolated state.
    fn record<'a, M>(
        &mut self,
        system: &mut RatesLoop<'a>,
        method: &mut M,
        step: &Step,
        at: &mut Vec<f64>,
        record: &mut impl FnMut(f64, &mut RatesLoop<'a>, &[f64]),
    ) where
        M: Adaptive<f64, RatesLoop<'a>, Vec<f64>>,
    {
        self.accepted += 1;
        match self.times {
            Times::Every(every) => {
                if !self.accepted.is_multiple_of(*every) && !step.finished {
                    return;
                }
                if let Some(t) = step.sample {
                    system.sample(t, method.x());
                }
                if step.ends {
                    method.interpolate(system, step.reached, at);
                    system.still(at);
                    record(step.reached, system, at);
                } else {
                    record(step.reached, system, method.x());
                }
            }
            Times::At(t_eval) => {
                while self.wanted < t_eval.len() && t_eval[self.wanted] <= step.reached {
                    let t = t_eval[self.wanted];
                    method.interpolate(system, t, at);
                    system.still(at);
                    // A record at a sample time contains the input that acts after the sample.
                    if step.sample == Some(t) {
                        system.sample(t, at);
                    }
                    record(t, system, at);
                    self.wanted += 1;
                }
            }
        }
    }
}

/// Run `system` from the state of `method`. `watch` checks every step, and `record(t, system, x)` is called for every record.
// Long: the function is not divided, because all branches of its loop use the same variables.
pub fn run<'a, M>(
    system: &mut RatesLoop<'a>,
    method: &mut M,
    segments: &Segments,
    stop: &dyn Stop,
    watch: &mut Watching,
    mut record: impl FnMut(f64, &mut RatesLoop<'a>, &[f64]),
) -> Outcome
where
    M: Adaptive<f64, RatesLoop<'a>, Vec<f64>>,
{
    let (mut t, mut sample) = (0.0, 0u64);
    let mut due = DueRecords { times: &segments.times, wanted: 0, accepted: 0 };
    let mut at = method.x().clone();
    // A copy of the state at the start of a step. The observer may move the run back to this state.
    let mut start = at.clone();
    let mut started = false;
    let outcome = |status, t, method: &M| Outcome { status, t, work: method.work() };
    // The time of a switch, if the step is being repeated up to this switch.
    let mut switch_at: Option<f64> = None;
    // Whether the next step begins inside a segment, not at its start.
    let mut inside = false;
    if !segments.bound.holds(method.x()) {
        return outcome(Status::Diverged, t, method);
    }
    if watch.active()
        && let Err(status) = watch.begin(system, t, method.x())
    {
        return outcome(status, t, method);
    }
    loop {
        let samples = match segments.clock {
            Clock::None => false,
            Clock::Every(period) if started => {
                let next = t >= (sample + 1) as f64 * period - ON_SAMPLE * period;
                sample += u64::from(next);
                next
            }
            Clock::Every(_) | Clock::Breaks => true,
        };
        if samples && !inside {
            system.sample(t, method.x());
        }
        let (segment_end, jumps) = segments.next(t, sample);
        let input_end = if jumps { segment_end.next_down() } else { segment_end };
        let end = switch_at.unwrap_or(segment_end);
        if switch_at.is_some() {
            method.first_step(end - t);
        }
        method.limit_step(segments.longest_step(t));
        if let Err(status) = method.begin(system, t, end, input_end.min(end)) {
            return outcome(status, t, method);
        }
        if switch_at.is_some() {
            method.first_step(0.0);
        }
        if !started {
            started = true;
            if due.at_start() {
                record(0.0, system, method.x());
            }
            if segments.t_end == 0.0 {
                return outcome(Status::Success, 0.0, method);
            }
        }
        loop {
            if stop.requested() {
                return outcome(Status::Interrupted, method.t(), method);
            }
            let looks = watch.active() && switch_at.is_none();
            if looks {
                start.clone_from(method.x());
            }
            method.limit_step(segments.longest_step(method.t()));
            let done = match method.step(system) {
                Ok(done) => done,
                Err(status) => return outcome(status, method.t(), method),
            };
            let mut reached = method.t();
            let mut ends = false;
            if looks {
                match watch.look(system, method) {
                    Err(status) => return outcome(status, method.t(), method),
                    Ok(Some(Cut::Switch(cut))) => {
                        // Return to the start of the step, and step to the switch.
                        (t, inside) = (method.t_old(), true);
                        method.x_mut().clone_from(&start);
                        if cut > t {
                            switch_at = Some(cut);
                        } else {
                            watch.switch(system, t, method.x_mut());
                        }
                        break;
                    }
                    Ok(Some(Cut::End(cut))) => (reached, ends) = (cut, true),
                    Ok(None) => {}
                }
            }
            if !ends && !segments.bound.holds(method.x()) {
                return outcome(Status::Diverged, reached, method);
            }
            system.still(method.x_mut());
            if watch.active() {
                watch.keep(system, method, reached);
            }
            let sampled = done && end == segment_end && segments.is_sample(end);
            let step = Step { reached, ends, finished: ends || done && end >= segments.t_end, sample: sampled.then_some(end) };
            due.record(system, method, &step, &mut at, &mut record);
            if ends {
                return outcome(Status::Event, reached, method);
            }
            if done {
                (t, inside) = (end, end < segment_end);
                if switch_at.take().is_some() {
                    watch.switch(system, end, method.x_mut());
                }
                break;
            }
        }
        if t >= segments.t_end {
            return outcome(Status::Success, t, method);
        }
    }
}
