//! Batches of runs with adaptive steps, one run per lane of a register. Each lane has its own time and step size. When a run ends, the lane
//! takes the next run of the batch. The results of a run have the bits of a single run.
//!
//! A run leaves its lane if an angle exceeds the range of the programs' sines. It is then repeated alone.

use super::adaptive_lane::{AdaptiveLane, Judged, LaneFrame};
use super::division::{Division, Ended};
use super::run_group::RunGroup;
use crate::integrate::{ExplicitAdaptive, MethodKind, Scheme, WithScheme};
use crate::simulate::adaptive::segments::Segments;
use crate::simulate::loops::sink::Sink;
use crate::simulate::problem::Problem;
use crate::simulate::record::lane_attempt::LanePrograms;
use crate::simulate::record::rates::{Rates, RatesOfRun, RecordedRates};
use crate::simulate::stop::Stop;
use crate::trace::{Frame, engine};
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
            let programs = first.rates.0.in_lanes(method, self.problem, first.run, self.rates.common);
            let register = Register { of: &self, segments, programs, first: Some(first), aside: &mut aside, interrupted: false };
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
    programs: Arc<LanePrograms>,
    /// The run that selects the structure, before it enters a lane.
    first: Option<Ready<'r, K>>,
    /// Runs of other structures.
    aside: &'s mut Vec<Ready<'r, K>>,
    interrupted: bool,
}

impl<'a, 'r, W: Waiting<'r, K>, K: Sink + 'r> Register<'_, 'a, '_, 'r, W, K> {
    /// Return the next run with the structure `recorded`.
    fn next(&mut self, recorded: &Arc<RecordedRates>) -> Option<Ready<'r, K>> {
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

    /// Fill the lane `lane` with a run that has an attempt to compute, and write this attempt. Leave it empty if no run waits.
    fn fill<C: Scheme>(
        &mut self,
        run: &mut Option<AdaptiveLane<'a, 'r, C, K>>,
        recorded: &Arc<RecordedRates>,
        (frame, lane): (&mut Frame, usize),
    ) {
        let programs = self.programs.clone();
        loop {
            let mut at = LaneFrame { programs: &programs, frame, lane };
            let Some(active) = run else {
                let Some(Ready { run: index, sink, rates }) = self.next(recorded) else { return };
                *run = Some(AdaptiveLane::new(self.of.problem, index, &rates, self.segments, sink, at));
                continue;
            };
            let Some(outcome) = active.advance(self.of.stop) else { return active.write_attempt(&mut at) };
            let ended = Ended::Adaptive(outcome);
            self.interrupted |= run.take().is_some_and(|run| (self.of.finish)(run.into_sink(), &ended));
        }
    }

    /// Repeat the run in a lane alone if its angles are beyond the range of the programs' sines. The lane is then empty.
    fn repeat_far<C: Scheme>(&mut self, run: &mut Option<AdaptiveLane<'a, 'r, C, K>>, (frame, lane): (&Frame, usize)) {
        if self.programs.is_near(frame, lane) {
            return;
        }
        let Some(run) = run.take() else { return };
        let AdaptiveLanes { problem, division, rates, stop, .. } = *self.of;
        let (first, sink) = (run.run, run.into_sink());
        let ended = RunGroup { problem, division, first, stop, sink, observer: None }.run_single(rates);
        self.interrupted |= (self.of.finish)(sink, &ended);
    }
}

impl<'r, W: Waiting<'r, K>, K: Sink + 'r> WithScheme for Register<'_, '_, '_, 'r, W, K> {
    /// Whether a run was interrupted.
    type Output = bool;

    fn with<C: Scheme>(mut self) -> bool {
        let programs = self.programs.clone();
        let mut frame = programs.frame();
        let Some(recorded) = self.first.as_ref().map(|first| first.rates.0.clone()) else { return false };
        let mut lanes: Vec<Option<AdaptiveLane<C, K>>> = (0..frame.lanes()).map(|_| None).collect();
        let mut judged = vec![Judged::Rejected; lanes.len()];
        loop {
            for (lane, run) in lanes.iter_mut().enumerate() {
                self.fill(run, &recorded, (&mut frame, lane));
            }
            if lanes.iter().all(Option::is_none) {
                return self.interrupted;
            }
            programs.attempt(&mut frame);
            for (lane, (run, judged)) in lanes.iter_mut().zip(&mut judged).enumerate() {
                self.repeat_far(run, (&frame, lane));
                let mut at = LaneFrame { programs: &programs, frame: &mut frame, lane };
                *judged = run.as_mut().map_or(Judged::Rejected, |run| run.judge(&mut at));
            }
            let requests_dense = judged.contains(&Judged::Interpolated);
            if requests_dense {
                programs.dense(&mut frame);
            }
            for (lane, (run, &judged)) in lanes.iter_mut().zip(&judged).enumerate().filter(|(_, (_, judged))| **judged != Judged::Rejected)
            {
                if judged == Judged::Interpolated {
                    self.repeat_far(run, (&frame, lane));
                }
                if let Some(run) = run {
                    run.accept(judged, &LaneFrame { programs: &programs, frame: &mut frame, lane });
                }
            }
        }
    }
}
