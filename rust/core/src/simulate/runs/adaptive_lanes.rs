//! Batches of runs with adaptive steps, one run per lane of a register. Each lane has its own time and step size. When a run ends, the lane
//! takes the next run of the batch. The results of a run have the bits of a single run.
//!
//! A run leaves its lane if an angle exceeds the range of the programs' sines. It is then repeated alone.

use super::adaptive_lane::{AdaptiveLane, Judged, LaneFrame, LaneMemory};
use super::division::{Division, Ended};
use super::run_group::RunGroup;
use crate::integrate::{ExplicitAdaptive, MethodKind, Scheme, WithScheme};
use crate::simulate::adaptive::segments::Segments;
use crate::simulate::loops::sink::Sink;
use crate::simulate::problem::Problem;
use crate::simulate::record::lane_attempt::LanePrograms;
use crate::simulate::record::rates::{Rates, RatesOfRun, RecordedRates};
use crate::simulate::stop::Stop;
use crate::trace::engine;
use std::sync::Arc;

/// The number of runs from which programs in lanes repay their compilation.
const FEWEST: usize = 4;

/// The runs of a batch that wait for a lane: each with its index and the receiver of its records.
pub trait Waiting<'r, K: 'r>: Fn() -> Option<(usize, &'r mut K)> {}
impl<'r, K: 'r, F: Fn() -> Option<(usize, &'r mut K)>> Waiting<'r, K> for F {}

/// Computes runs of a batch on one thread.
pub struct AdaptiveLanes<'a, 'b, W, K> {
    pub problem: &'a Problem<'a>,
    pub division: &'a Division,
    pub rates: &'a Rates,
    pub stop: &'b dyn Stop,
    /// Returns the next run that no thread has taken yet.
    pub waiting: W,
    /// Receives the end of each run. Its result is whether the run was interrupted.
    pub finish: &'b dyn Fn(&mut K, &Ended) -> bool,
}

/// A run that waits for a lane.
struct Ready<'r, K> {
    run: usize,
    sink: &'r mut K,
    rates: RatesOfRun,
}

impl Problem<'_> {
    /// Return the method and the segments of the runs if lanes compute them.
    pub(in crate::simulate) fn in_lanes<'b>(&self, division: &'b Division) -> Option<(ExplicitAdaptive, &'b Segments)> {
        let recordable = self.laws.iter().all(|law| law.route().is_recordable());
        match (self.options.method.kind(), division) {
            (MethodKind::ExplicitAdaptive(method), Division::Adaptive(segments)) if recordable && self.runs() >= FEWEST => {
                Some((method, segments))
            }
            (_, _) => None,
        }
    }
}

impl<'a, 'b, 'r, W: Waiting<'r, K>, K: Sink + 'r> AdaptiveLanes<'a, 'b, W, K> {
    /// Compute the waiting runs. Return whether a run was interrupted. `method` and `segments` are the results of [`Problem::in_lanes`].
    pub fn run(self, (method, segments): (ExplicitAdaptive, &'a Segments)) -> bool {
        self.rates.note(engine());
        let mut aside = Vec::new();
        let mut interrupted = false;
        while let Some(first) = aside.pop().or_else(|| self.take()) {
            let recorded = first.rates.0.clone();
            let programs = recorded.in_lanes(method, self.problem, first.run, self.rates.common);
            let (programs, recorded, first) = (&*programs, &recorded, Some(first));
            let register = Register { of: &self, segments, programs, recorded, first, aside: &mut aside, interrupted: false };
            interrupted |= method.scheme(register);
        }
        interrupted
    }

    /// Take the next waiting run.
    fn take(&self) -> Option<Ready<'r, K>> {
        if self.stop.requested() {
            return None;
        }
        let (run, sink) = (self.waiting)()?;
        let rates = self.rates.of_run(self.problem, run, self.problem.options.sampling.is_some());
        Some(Ready { run, sink, rates })
    }
}

/// The runs of one structure in the lanes of one frame.
struct Register<'s, 'a, 'b, 'r, W, K> {
    of: &'s AdaptiveLanes<'a, 'b, W, K>,
    segments: &'a Segments,
    programs: &'s LanePrograms,
    /// The structure of the runs.
    recorded: &'s Arc<RecordedRates>,
    /// The run that selects the structure, before it enters a lane.
    first: Option<Ready<'r, K>>,
    /// Runs of other structures.
    aside: &'s mut Vec<Ready<'r, K>>,
    interrupted: bool,
}

/// One lane of the frame.
struct Lane<'a, 'r, C: Scheme, K: Sink> {
    run: Option<AdaptiveLane<'a, 'r, C, K>>,
    /// The memory of the last run in this lane.
    memory: Option<LaneMemory<C>>,
    judged: Judged,
}

impl<'a, 'r, W: Waiting<'r, K>, K: Sink + 'r> Register<'_, 'a, '_, 'r, W, K> {
    /// Return the next run with the structure of this register.
    fn next(&mut self) -> Option<Ready<'r, K>> {
        let recorded = self.recorded;
        let fits = |ready: &Ready<K>| Arc::ptr_eq(&ready.rates.0, recorded);
        if let Some(first) = self.first.take() {
            return Some(first);
        }
        if let Some(known) = self.aside.iter().position(fits) {
            return Some(self.aside.swap_remove(known));
        }
        loop {
            let ready = self.of.take()?;
            if fits(&ready) {
                return Some(ready);
            }
            self.aside.push(ready);
        }
    }

    /// Fill a lane with a run that has an attempt to compute, and write this attempt. The lane remains empty if no run waits.
    fn fill<C: Scheme>(&mut self, lane: &mut Lane<'a, 'r, C, K>, mut at: LaneFrame) {
        loop {
            let Some(run) = &mut lane.run else {
                let Some(Ready { run, sink, rates }) = self.next() else { return };
                let problem = (self.of.problem, self.segments);
                lane.run = Some(AdaptiveLane::new(problem, (run, &rates), sink, lane.memory.take(), &mut at));
                continue;
            };
            let Some(outcome) = run.advance(self.of.stop, &at) else { return run.write_attempt(&mut at) };
            self.end(lane, |_, _| Ended::Adaptive(outcome));
        }
    }

    /// End the run in a lane. `ended` returns its end, from its index and the receiver of its records.
    fn end<C: Scheme>(&mut self, lane: &mut Lane<'a, 'r, C, K>, ended: impl FnOnce(usize, &mut K) -> Ended) {
        let Some(run) = lane.run.take() else { return };
        let index = run.run;
        let (sink, memory) = run.into_parts();
        lane.memory = Some(memory);
        let ended = ended(index, sink);
        self.interrupted |= (self.of.finish)(sink, &ended);
    }

    /// Repeat the run in a lane alone if its angles are beyond the range of the programs' sines. The lane is then empty.
    fn repeat_far<C: Scheme>(&mut self, lane: &mut Lane<'a, 'r, C, K>, at: &LaneFrame) {
        if !self.programs.is_near(at.frame, at.lane) {
            let AdaptiveLanes { problem, division, rates, stop, .. } = *self.of;
            self.end(lane, |first, sink| RunGroup { problem, division, first, stop, sink, observer: None }.run_single(rates));
        }
    }
}

impl<'r, W: Waiting<'r, K>, K: Sink + 'r> WithScheme for Register<'_, '_, '_, 'r, W, K> {
    /// Whether a run was interrupted.
    type Output = bool;

    fn with<C: Scheme>(mut self) -> bool {
        let (programs, options) = (self.programs, &self.of.problem.options);
        let mut frame = programs.frame(options.rtol, options.atol);
        let new_lane = |_| Lane { run: None, memory: None, judged: Judged::Rejected };
        let mut lanes: Vec<Lane<C, K>> = (0..frame.lanes()).map(new_lane).collect();
        loop {
            for (k, lane) in lanes.iter_mut().enumerate() {
                self.fill(lane, LaneFrame { programs, frame: &mut frame, lane: k });
            }
            if lanes.iter().all(|lane| lane.run.is_none()) {
                return self.interrupted;
            }
            programs.attempt(&mut frame);
            for (k, lane) in lanes.iter_mut().enumerate() {
                let mut at = LaneFrame { programs, frame: &mut frame, lane: k };
                self.repeat_far(lane, &at);
                lane.judged = lane.run.as_mut().map_or(Judged::Rejected, |run| run.judge(&mut at));
            }
            if lanes.iter().any(|lane| lane.judged == Judged::Interpolated) {
                programs.dense(&mut frame);
            }
            for (k, lane) in lanes.iter_mut().enumerate() {
                let at = LaneFrame { programs, frame: &mut frame, lane: k };
                programs.set_accepted(at.frame, k, lane.judged != Judged::Rejected);
                if lane.judged == Judged::Interpolated {
                    self.repeat_far(lane, &at);
                }
                if let (Judged::Accepted | Judged::Interpolated, Some(run)) = (lane.judged, &mut lane.run) {
                    run.accept(lane.judged, &at);
                }
            }
            programs.accept(&mut frame);
        }
    }
}
