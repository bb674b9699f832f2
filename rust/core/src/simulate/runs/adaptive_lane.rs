//! One run with adaptive steps in a lane. A program computes its attempts together with those of the other lanes. All decisions are those
//! of a single run: step sizes, acceptance, segments, records, contacts and modes of joints.

use super::run_group::LaneRecorder;
use crate::integrate::{Adaptive, Embedded, Scheme};
use crate::simulate::adaptive::rates_evaluation::RatesEvaluation;
use crate::simulate::adaptive::rates_loop::RatesLoop;
use crate::simulate::adaptive::segments::{Outcome, Segments};
use crate::simulate::adaptive::step_checks::StepChecks;
use crate::simulate::adaptive::steps::{Next, Walk};
use crate::simulate::loops::sink::Sink;
use crate::simulate::monitors;
use crate::simulate::problem::Problem;
use crate::simulate::record::lane_attempt::LanePrograms;
use crate::simulate::record::rates::RatesOfRun;
use crate::simulate::stop::Stop;
use crate::simulate::world::Exogenous;
use crate::status::Status;
use crate::trace::Frame;

/// One lane of a frame, with the programs of the frame.
pub struct LaneFrame<'a> {
    pub programs: &'a LanePrograms,
    pub frame: &'a mut Frame,
    pub lane: usize,
}

/// The result of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    Rejected,
    /// The attempt is accepted. It is the start of the next step.
    Passed,
    /// The attempt is accepted, and the run requires its states.
    Accepted,
    /// The attempt is accepted, and the run requires states within the step.
    Interpolated,
}

/// The next action of a run in a lane.
enum Action {
    /// Compute an attempt of the present step.
    Attempt,
    Walk(Next),
}

/// A run in a lane. `K` is the receiver of its records.
pub struct AdaptiveLane<'a, 'r, C: Scheme, K: Sink> {
    pub run: usize,
    closed: RatesLoop<'a>,
    method: Embedded<C, Vec<f64>, Exogenous<f64>>,
    walk: Walk<'a>,
    watch: StepChecks<'static>,
    recorder: LaneRecorder<'r, 'static, K>,
    /// The number of records so far.
    records: usize,
    action: Action,
    /// The size of the present attempt, and the time at its end, s.
    attempt: (f64, f64),
    /// Whether the native code has changed the start of the present step, so that it must be written to the frame.
    moved: bool,
    /// Whether the exogenous input is constant.
    still: bool,
    /// The exogenous inputs of the stages of an attempt, one row per stage, and their times, s.
    inputs: Vec<f64>,
    times: Vec<f64>,
}

/// The memory of a run that ended, for the next run in a lane.
pub struct LaneMemory<C: Scheme> {
    evaluation: Option<RatesEvaluation>,
    method: Embedded<C, Vec<f64>, Exogenous<f64>>,
    /// The checks of a plant that has none.
    watch: Option<StepChecks<'static>>,
}

impl<'a, 'r, C: Scheme, K: Sink> AdaptiveLane<'a, 'r, C, K> {
    /// Prepare run `run` of a problem, and write its parameters to the lane. `memory` is the memory of an earlier run of this structure.
    pub fn new(
        (problem, segments): (&'a Problem<'a>, &'a Segments),
        (run, of_run): (usize, &RatesOfRun),
        sink: &'r mut K,
        memory: Option<LaneMemory<C>>,
        at: &mut LaneFrame,
    ) -> Self {
        let (evaluation, method, watch) = match memory {
            Some(LaneMemory { evaluation, method, watch }) => (evaluation, Some(method), watch),
            None => (None, None, None),
        };
        let (closed, x) = RatesLoop::in_lane(problem, run, of_run, evaluation);
        at.programs.set_parameters(at.frame, at.lane, &of_run.1);
        let walk = Walk::new(problem.segments_of(segments, &closed, run), x.len());
        let states = x.len() - monitors::integrals(problem.options.monitors).count();
        let watch = watch.unwrap_or_else(|| StepChecks::new(problem.plant(run), None, states, &x));
        let recorder = LaneRecorder::new(problem, sink, &|_| f64::NAN, x.len());
        let new_method = || Embedded::new(problem.tolerance(closed.controlled()), x.clone(), closed.instant());
        let mut method = method.unwrap_or_else(new_method);
        method.restart(&x);
        let mut lane = AdaptiveLane {
            run,
            action: Action::Attempt,
            attempt: (0.0, 0.0),
            moved: true,
            still: closed.world.is_still(),
            inputs: vec![0.0; (C::A.len() - 1) * at.programs.input_size()],
            times: vec![0.0; C::A.len() - 1],
            records: 0,
            recorder,
            walk,
            closed,
            method,
            watch,
        };
        if lane.still {
            lane.write_inputs(1, C::A.len() - 1, at);
        }
        lane.action = Action::Walk(lane.walk.begin(&mut lane.closed, &lane.method, &mut lane.watch));
        lane
    }

    /// Continue the run to its next attempt. Return the end of the run if it has no further attempt.
    pub fn advance(&mut self, stop: &dyn Stop, at: &LaneFrame) -> Option<Outcome> {
        loop {
            let next = match std::mem::replace(&mut self.action, Action::Attempt) {
                Action::Walk(Next::End(outcome)) => return Some(outcome),
                Action::Walk(Next::Segment) => self.begin_segment(),
                Action::Walk(Next::Step) => match self.walk.begin_step(&mut self.method, stop, &self.watch) {
                    Some(outcome) => return Some(outcome),
                    None if self.method.is_done() => self.end_step(),
                    None => {
                        if self.method.checks_chatter() && !self.moved {
                            let method: &mut dyn Adaptive<f64, RatesLoop<'a>, Vec<f64>> = &mut self.method;
                            at.programs.read_start(at.frame, at.lane, method.x_mut());
                        }
                        match self.method.open(&mut self.closed) {
                            Ok(()) => continue,
                            Err(status) => return Some(self.outcome(status)),
                        }
                    }
                },
                Action::Attempt => match self.method.propose() {
                    Ok(attempt) => {
                        self.attempt = attempt;
                        return None;
                    }
                    Err(status) => return Some(self.outcome(status)),
                },
            };
            self.action = Action::Walk(next);
        }
    }

    fn outcome(&self, status: Status) -> Outcome {
        let method: &dyn Adaptive<f64, RatesLoop<'a>, Vec<f64>> = &self.method;
        Outcome { status, t: method.t(), work: method.work() }
    }

    fn begin_segment(&mut self) -> Next {
        self.moved = true;
        let AdaptiveLane { walk, closed, method, recorder, records, .. } = self;
        walk.begin_segment(closed, method, &mut |t, closed, x| recorder.write_next(records, t, closed, x))
    }

    fn end_step(&mut self) -> Next {
        let AdaptiveLane { walk, closed, method, recorder, records, watch, .. } = self;
        let done = method.is_done();
        walk.end_step(closed, method, done, watch, &mut |t, closed, x| recorder.write_next(records, t, closed, x))
    }

    /// Write the present attempt to the lane.
    pub fn write_attempt(&mut self, at: &mut LaneFrame) {
        let LaneFrame { programs, frame, lane } = at;
        if std::mem::take(&mut self.moved) {
            let method: &dyn Adaptive<f64, RatesLoop<'a>, Vec<f64>> = &self.method;
            programs.set_start(frame, *lane, method.x(), self.method.slope());
            programs.hold(frame, *lane, self.closed.held());
        }
        programs.set_step(frame, *lane, self.attempt.0);
        if !self.still {
            self.method.stage_times(self.attempt.0, &mut self.times);
            self.write_inputs(1, C::STAGES, at);
        }
    }

    /// Write the exogenous inputs of `count` stages from stage `first` on, at the first times of `self.times`.
    fn write_inputs(&mut self, first: usize, count: usize, at: &mut LaneFrame) {
        let size = at.programs.input_size();
        let inputs = &mut self.inputs[..count * size];
        self.closed.world.sample_each(0, &self.times[..count], [size, size.max(1)], inputs);
        at.programs.set_inputs(at.frame, at.lane, first, inputs);
    }

    /// Judge the attempt. If the run requires its states, read them from the lane. If it requires its dense output, write the step size and
    /// the inputs of this output to the lane.
    pub fn judge(&mut self, at: &mut LaneFrame) -> Judged {
        let [error, largest] = at.programs.judged(at.frame, at.lane);
        if !self.method.judge(error, self.attempt.0, self.attempt.1) {
            return Judged::Rejected;
        }
        if self.walk.passes(&self.method, &self.watch) {
            self.action = Action::Walk(self.walk.pass_step(&self.method, largest));
            return Judged::Passed;
        }
        at.programs.read_step(at.frame, at.lane, self.method.last_step());
        if !self.walk.interpolates(&self.method, &self.watch) {
            return Judged::Accepted;
        }
        let h = self.method.dense_times(&mut self.times);
        at.programs.set_step(at.frame, at.lane, h);
        if !self.still {
            self.write_inputs(C::STAGES + 1, C::A.len() - C::STAGES - 1, at);
        }
        Judged::Interpolated
    }

    /// Process the accepted step, which does not pass. If it is interpolated, the lane has its dense output.
    pub fn accept(&mut self, judged: Judged, at: &LaneFrame) {
        if judged == Judged::Interpolated {
            self.method.receive_dense(|i, row| at.programs.read_row(at.frame, at.lane, i, row));
        }
        self.moved |= self.watch.active();
        self.action = Action::Walk(self.end_step());
    }

    /// Return the receiver of the records, and the memory of the run.
    pub fn into_parts(self) -> (&'r mut K, LaneMemory<C>) {
        let watch = Some(self.watch).filter(|watch| !watch.active());
        (self.recorder.sink, LaneMemory { evaluation: self.closed.into_evaluation(), method: self.method, watch })
    }
}
