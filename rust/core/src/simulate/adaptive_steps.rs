//! A run of an adaptive method: segments between jumps and samples, records by dense output.

use super::bound::Bound;
use super::schedule::{Times, require_times};
use super::stop::Stop;
use super::watcher::{Cut, Watcher};
use crate::error::Result;
use crate::integrate::{Adaptive, Buffer, System, Work};
use crate::scalar::Real;
use crate::status::Status;

/// A time this close to a sample, in periods, is that sample.
const ON_SAMPLE: f64 = 1e-9;

/// The segments and records of an adaptive run.
#[derive(Clone, Debug)]
pub struct Segments {
    pub t_end: f64,
    pub times: Times,
    /// Jumps of the input strictly inside the run, increasing.
    pub breaks: Vec<f64>,
    pub clock: Clock,
    /// What the state must keep to.
    pub bound: Bound,
}

/// The instants at which a sampled law is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// In every stage.
    None,
    /// Once per period, s.
    Every(f64),
    /// At every break, of which the loop knows what falls there.
    Breaks,
}

impl Segments {
    pub fn new(t_end: f64, times: Times, breaks: &[f64], clock: Clock, bound: Bound) -> Result<Self> {
        match &times {
            Times::At(t_eval) => require_times(t_eval, t_end)?,
            Times::Every(0) => return Err(crate::error::Error::input("record_every", "is not positive: expected an integer >= 1, got 0")),
            Times::Every(_) => {}
        }
        let breaks = breaks.iter().copied().filter(|&b| b > 0.0 && b < t_end).collect();
        Ok(Segments { t_end, times, breaks, clock, bound })
    }

    /// The same run with more breaks.
    pub fn with_breaks(&self, more: &[f64]) -> Self {
        let mut all = self.clone();
        if !more.is_empty() {
            all.breaks.extend(more);
            all.breaks.sort_by(f64::total_cmp);
            all.breaks.dedup();
        }
        all
    }

    /// Whether a sample falls on `t`.
    fn is_sample(&self, t: f64) -> bool {
        match self.clock {
            Clock::None => false,
            Clock::Every(period) => (t / period - (t / period).round()).abs() < ON_SAMPLE,
            Clock::Breaks => true,
        }
    }

    /// The end of the segment that starts at `t`, and whether the input jumps there.
    fn next(&self, t: f64, sample: u64) -> (f64, bool) {
        let mut end = (self.t_end, false);
        if let Some(&b) = self.breaks.get(self.breaks.partition_point(|&b| b <= t)) {
            end = (b, true);
        }
        if let Clock::Every(period) = self.clock {
            let next = (sample + 1) as f64 * period;
            // A sample that is, up to rounding, the end is the end.
            if next < end.0 - ON_SAMPLE * period {
                end = (next, false);
            }
        }
        end
    }
}

/// How a run ended, when, and the work it took.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub status: Status,
    pub t: f64,
    pub work: Work,
}

/// Run `system` from `method.x`, with somebody who looks at every step; `record(t, system, x)` is called for every record.
pub fn run<S, F, B, M, W>(
    system: &mut F,
    method: &mut M,
    segments: &Segments,
    stop: &dyn Stop,
    watch: &mut W,
    mut record: impl FnMut(f64, &mut F, &B),
) -> Outcome
where
    S: Real,
    F: System<S>,
    B: Buffer<S>,
    M: Adaptive<S, F, B>,
    W: Watcher<F, B, M>,
{
    let (mut t, mut sample, mut wanted, mut accepted) = (0.0, 0u64, 0usize, 0usize);
    let mut at = method.x().clone();
    // Where a watched step starts.
    let mut start = at.clone();
    let mut started = false;
    let outcome = |status, t, method: &M| Outcome { status, t, work: method.work() };
    // The end of a piece that is taken again up to a switch.
    let mut switch_at: Option<f64> = None;
    // Whether this piece begins inside a segment.
    let mut inside = false;
    if !segments.bound.holds(method.x().as_ref()) {
        return outcome(Status::Diverged, t, method);
    }
    if watch.active()
        && let Err(status) = watch.begin(system, t, method.x())
    {
        return outcome(status, t, method);
    }
    loop {
        if let Clock::Every(period) = segments.clock
            && started
            && t >= (sample + 1) as f64 * period
        {
            sample += 1;
        }
        if segments.clock != Clock::None && !inside {
            system.sample(t, method.x().as_ref());
        }
        let (segment_end, jumps) = segments.next(t, sample);
        let input_end = if jumps { segment_end.next_down() } else { segment_end };
        let end = switch_at.unwrap_or(segment_end);
        if switch_at.is_some() {
            method.first_step(end - t);
        }
        if let Err(status) = method.begin(system, t, end, input_end.min(end)) {
            return outcome(status, t, method);
        }
        if switch_at.is_some() {
            method.first_step(0.0);
        }
        if !started {
            started = true;
            match &segments.times {
                Times::Every(_) => record(0.0, system, method.x()),
                Times::At(t_eval) => {
                    if t_eval.first() == Some(&0.0) {
                        record(0.0, system, method.x());
                        wanted = 1;
                    }
                }
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
                        // Back to the start of the step, and on to the switch.
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
            if !ends && !segments.bound.holds(method.x().as_ref()) {
                return outcome(Status::Diverged, reached, method);
            }
            if watch.active() {
                watch.keep(system, method, reached);
            }
            accepted += 1;
            let finished = ends || done && end >= segments.t_end;
            match &segments.times {
                Times::Every(every) => {
                    if accepted.is_multiple_of(*every) || finished {
                        if done && end == segment_end && segments.is_sample(end) {
                            system.sample(end, method.x().as_ref());
                        }
                        if ends {
                            method.interpolate(system, reached, &mut at);
                            record(reached, system, &at);
                        } else {
                            record(reached, system, method.x());
                        }
                    }
                }
                Times::At(t_eval) => {
                    while wanted < t_eval.len() && t_eval[wanted] <= reached {
                        method.interpolate(system, t_eval[wanted], &mut at);
                        // The input recorded is that from this instant on.
                        if done && t_eval[wanted] == segment_end && segments.is_sample(end) {
                            system.sample(end, at.as_ref());
                        }
                        record(t_eval[wanted], system, &at);
                        wanted += 1;
                    }
                }
            }
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
