//! Runs of adaptive methods, segment by segment. Records at given times use the dense output of the method.

use super::rates_loop::RatesLoop;
use super::segments::{Clock, Cut, ON_SAMPLE, Outcome, Segments};
use super::step_checks::StepChecks;
use crate::integrate::Adaptive;
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::problem::times::Times;
use crate::simulate::stop::Stop;
use crate::status::Status;
use std::borrow::Cow;

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
#[derive(Default)]
struct DueRecords {
    /// The number of requested times that already have a record.
    wanted: usize,
    /// The number of accepted steps.
    accepted: usize,
}

impl DueRecords {
    /// Return whether the initial state is recorded.
    fn at_start(&mut self, times: &Times) -> bool {
        let Times::At(t_eval) = times else { return true };
        self.wanted = usize::from(t_eval.first() == Some(&0.0));
        self.wanted == 1
    }

    /// Record the states at all record times within a step. `at` is memory for an interpolated state.
    fn record<'a, M>(
        &mut self,
        system: &mut RatesLoop<'a>,
        method: &mut M,
        (times, step): (&Times, &Step),
        at: &mut Vec<f64>,
        record: &mut impl FnMut(f64, &mut RatesLoop<'a>, &[f64]),
    ) where
        M: Adaptive<f64, RatesLoop<'a>, Vec<f64>>,
    {
        self.accepted += 1;
        match times {
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

/// The next action of a run.
pub enum Next {
    /// Begin a segment ([`Walk::begin_segment`]).
    Segment,
    /// Compute a step ([`Walk::begin_step`]).
    Step,
    End(Outcome),
}

/// The progress of one run along its segments.
pub struct Walk<'a> {
    segments: Cow<'a, Segments>,
    due: DueRecords,
    /// The start of the present segment, s.
    t: f64,
    /// The index of the last sample.
    sample: u64,
    /// The end of the present segment, and the end of its steps, s. The steps end earlier at a switch.
    segment_end: f64,
    end: f64,
    /// Memory for an interpolated state.
    at: Vec<f64>,
    /// A copy of the state at the start of a step. The observer may move the run back to this state.
    start: Vec<f64>,
    started: bool,
    /// The time of a switch, if the step is being repeated up to this switch.
    switch_at: Option<f64>,
    /// Whether the next step begins inside a segment, not at its start.
    inside: bool,
    /// Whether the observer checks the present step.
    checks: bool,
}

fn outcome<'b, M>(status: Status, t: f64, method: &M) -> Outcome
where
    M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
{
    Outcome { status, t, work: method.work() }
}

impl<'a> Walk<'a> {
    /// Prepare a run with states of `size` numbers.
    pub fn new(segments: Cow<'a, Segments>, size: usize) -> Self {
        Walk {
            segments,
            due: DueRecords::default(),
            t: 0.0,
            sample: 0,
            segment_end: 0.0,
            end: 0.0,
            at: vec![0.0; size],
            start: vec![0.0; size],
            started: false,
            switch_at: None,
            inside: false,
            checks: false,
        }
    }

    /// Check the initial state, which is the state of `method`.
    pub fn begin<'b, M>(&mut self, system: &mut RatesLoop<'b>, method: &M, watch: &mut StepChecks) -> Next
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        if !self.segments.bound.holds(method.x()) {
            return Next::End(outcome(Status::Diverged, 0.0, method));
        }
        match if watch.active() { watch.begin(system, 0.0, method.x()) } else { Ok(()) } {
            Ok(()) => Next::Segment,
            Err(status) => Next::End(outcome(status, 0.0, method)),
        }
    }

    /// Begin the next segment, or continue inside a segment after a switch. `record(t, system, x)` is called for every record.
    pub fn begin_segment<'b, M>(
        &mut self,
        system: &mut RatesLoop<'b>,
        method: &mut M,
        record: &mut impl FnMut(f64, &mut RatesLoop<'b>, &[f64]),
    ) -> Next
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let (segments, t) = (&*self.segments, self.t);
        let samples = match segments.clock {
            Clock::None => false,
            Clock::Every(period) if self.started => {
                let next = t >= (self.sample + 1) as f64 * period - ON_SAMPLE * period;
                self.sample += u64::from(next);
                next
            }
            Clock::Every(_) | Clock::Breaks => true,
        };
        if samples && !self.inside {
            system.sample(t, method.x());
        }
        let (segment_end, jumps) = segments.next(t, self.sample);
        let input_end = if jumps { segment_end.next_down() } else { segment_end };
        self.segment_end = segment_end;
        self.end = self.switch_at.unwrap_or(segment_end);
        if self.switch_at.is_some() {
            method.first_step(self.end - t);
        }
        method.limit_step(segments.longest_step(t));
        if let Err(status) = method.begin(system, t, self.end, input_end.min(self.end)) {
            return Next::End(outcome(status, t, method));
        }
        if self.switch_at.is_some() {
            method.first_step(0.0);
        }
        if !self.started {
            self.started = true;
            if self.due.at_start(&segments.times) {
                record(0.0, system, method.x());
            }
            if segments.t_end == 0.0 {
                return Next::End(outcome(Status::Success, 0.0, method));
            }
        }
        Next::Step
    }

    /// Prepare a step of `method`. Return the end of the run if `stop` requests it.
    pub fn begin_step<'b, M>(&mut self, method: &mut M, stop: &dyn Stop, watch: &StepChecks) -> Option<Outcome>
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        if stop.requested() {
            return Some(outcome(Status::Interrupted, method.t(), method));
        }
        self.checks = watch.active() && self.switch_at.is_none();
        if self.checks {
            self.start.clone_from(method.x());
        }
        method.limit_step(self.segments.longest_step(method.t()));
        None
    }

    /// Whether the last step of `method` has neither records nor checks, and does not end a segment. Then [`Walk::pass_step`] replaces
    /// [`Walk::end_step`].
    pub fn passes<'b, M>(&self, method: &M, watch: &StepChecks) -> bool
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let due = match &self.segments.times {
            Times::At(t_eval) => t_eval.get(self.due.wanted).is_some_and(|&t| t <= method.t()),
            Times::Every(every) => (self.due.accepted + 1).is_multiple_of(*every),
        };
        !due && !watch.active() && method.t() < self.end
    }

    /// Process the last step of `method`, which passes. `largest` is the largest absolute value of the plant's states.
    pub fn pass_step<'b, M>(&mut self, method: &M, largest: f64) -> Next
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        self.due.accepted += 1;
        let permitted = self.segments.bound.permits(largest);
        if permitted { Next::Step } else { Next::End(outcome(Status::Diverged, method.t(), method)) }
    }

    /// Whether [`Walk::end_step`] interpolates in the last step of `method`.
    pub fn interpolates<'b, M>(&self, method: &M, watch: &StepChecks) -> bool
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let due = match &self.segments.times {
            Times::At(t_eval) => t_eval.get(self.due.wanted).is_some_and(|&t| t < method.t()),
            Times::Every(_) => false,
        };
        due || watch.active()
    }

    /// Process the last step of `method`. `done`: whether it reached the end of the steps of the segment. `watch` checks the step, and
    /// `record(t, system, x)` is called for every record.
    pub fn end_step<'b, M>(
        &mut self,
        system: &mut RatesLoop<'b>,
        method: &mut M,
        done: bool,
        watch: &mut StepChecks,
        record: &mut impl FnMut(f64, &mut RatesLoop<'b>, &[f64]),
    ) -> Next
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let segments = &*self.segments;
        let mut reached = method.t();
        let mut ends = false;
        if self.checks {
            match watch.check_step(system, method) {
                Err(status) => return Next::End(outcome(status, method.t(), method)),
                Ok(Some(Cut::Switch(cut))) => {
                    // Return to the start of the step, and step to the switch.
                    (self.t, self.inside) = (method.t_old(), true);
                    method.x_mut().clone_from(&self.start);
                    if cut > self.t {
                        self.switch_at = Some(cut);
                    } else {
                        watch.switch(system, self.t, method.x_mut());
                    }
                    return self.end_or_segment(method);
                }
                Ok(Some(Cut::End(cut))) => (reached, ends) = (cut, true),
                Ok(None) => {}
            }
        }
        if !ends && !segments.bound.holds(method.x()) {
            return Next::End(outcome(Status::Diverged, reached, method));
        }
        system.remove_creep(method.x_mut());
        if watch.active() {
            watch.store_step(system, method, reached);
        }
        let sampled = done && self.end == self.segment_end && segments.is_sample(self.end);
        let finished = ends || done && self.end >= segments.t_end;
        let step = Step { reached, ends, finished, sample: sampled.then_some(self.end) };
        self.due.record(system, method, (&segments.times, &step), &mut self.at, record);
        if ends {
            return Next::End(outcome(Status::Event, reached, method));
        }
        if !done {
            return Next::Step;
        }
        (self.t, self.inside) = (self.end, self.end < self.segment_end);
        if self.switch_at.take().is_some() {
            watch.switch(system, self.end, method.x_mut());
        }
        self.end_or_segment(method)
    }

    /// The next action at the start of a segment.
    fn end_or_segment<'b, M>(&self, method: &M) -> Next
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        if self.t >= self.segments.t_end { Next::End(outcome(Status::Success, self.t, method)) } else { Next::Segment }
    }
}

/// Run `system` from the state of `method`. `watch` checks every step, and `record(t, system, x)` is called for every record.
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
    let mut walk = Walk::new(Cow::Borrowed(segments), method.x().len());
    let mut next = walk.begin(system, method, watch);
    loop {
        next = match next {
            Next::End(outcome) => return outcome,
            Next::Segment => walk.begin_segment(system, method, &mut record),
            Next::Step => match walk.begin_step(method, stop, watch) {
                Some(outcome) => Next::End(outcome),
                None => match method.step(system) {
                    Ok(done) => walk.end_step(system, method, done, watch, &mut record),
                    Err(status) => Next::End(outcome(status, method.t(), method)),
                },
            },
        }
    }
}
