//! Runs of adaptive methods, segment by segment. Records at given times use the dense output of the method.

use super::rates_loop::RatesLoop;
use super::segments::{Clock, Cut, ON_SAMPLE, Outcome, Segments};
use super::step_checks::StepChecks;
use crate::integrate::Adaptive;
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::problem::times::Times;
use crate::simulate::stop::Stop;
use crate::status::Status;

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
                    system.remove_creep(at);
                    record(step.reached, system, at);
                } else {
                    record(step.reached, system, method.x());
                }
            }
            Times::At(t_eval) => {
                while self.wanted < t_eval.len() && t_eval[self.wanted] <= step.reached {
                    let t = t_eval[self.wanted];
                    method.interpolate(system, t, at);
                    system.remove_creep(at);
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
    watch: &mut StepChecks,
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
            let checks = watch.active() && switch_at.is_none();
            if checks {
                start.clone_from(method.x());
            }
            method.limit_step(segments.longest_step(method.t()));
            let done = match method.step(system) {
                Ok(done) => done,
                Err(status) => return outcome(status, method.t(), method),
            };
            let mut reached = method.t();
            let mut ends = false;
            if checks {
                match watch.check_step(system, method) {
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
            system.remove_creep(method.x_mut());
            if watch.active() {
                watch.store_step(system, method, reached);
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
