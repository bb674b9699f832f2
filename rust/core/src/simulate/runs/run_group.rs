//! Runs of any plant with any law, by any method, on plain numbers or on lanes.

use super::division::{Division, Ended, Fixed};
use crate::integrate::{Adaptive, FixedStep, MethodKind, Tolerance, WithAdaptive, WithSteps};
use crate::scalar::Real;
use crate::simulate::adaptive;
use crate::simulate::adaptive::rates_loop::RatesLoop;
use crate::simulate::adaptive::segments::Segments;
use crate::simulate::adaptive::step_checks::StepChecks;
use crate::simulate::fixed;
use crate::simulate::fixed::steps::Record;
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::loops::sink::Sink;
use crate::simulate::monitors;
use crate::simulate::observer::run_observer::RunObserver;
use crate::simulate::problem::Problem;
use crate::simulate::record::rates::Rates;
use crate::simulate::stop::Stop;
use std::borrow::Cow;

/// The runs `first .. first + LANES` of a problem. If the problem has fewer runs, the remaining lanes repeat the last run.
pub struct RunGroup<'a> {
    pub problem: &'a Problem<'a>,
    pub division: &'a Division,
    pub first: usize,
    pub stop: &'a dyn Stop,
    pub sink: &'a mut dyn Sink,
    /// Receives events, contact modes and polynomials of the steps, in addition to the records.
    pub observer: Option<&'a mut RunObserver>,
}

/// Passes records to the sink, lane by lane. Negative zeros become zeros, because signs of zeros may differ between recordings
/// of a loop.
pub(super) struct LaneRecorder<'a, 't, K: Sink + ?Sized> {
    pub sink: &'a mut K,
    /// Returns the time of each step.
    time: &'t dyn Fn(usize) -> f64,
    /// The number of states. The numbers after them in `x` are metrics.
    size: usize,
    x: Vec<f64>,
    tau: Vec<f64>,
}

impl<'a, 't, K: Sink + ?Sized> LaneRecorder<'a, 't, K> {
    /// Return a recorder for states with `all` numbers.
    pub fn new(problem: &Problem, sink: &'a mut K, time: &'t dyn Fn(usize) -> f64, all: usize) -> Self {
        LaneRecorder { sink, time, size: problem.state_size(), x: vec![0.0; all], tau: vec![0.0; problem.plant(0).n()] }
    }

    /// Record time `t` and state `x` of an adaptive run as record `i`, and increase `i`.
    pub fn write_next(&mut self, i: &mut usize, t: f64, closed: &mut RatesLoop, x: &[f64]) {
        self.write(*i, t, x, closed.input_at(t, x));
        *i += 1;
    }

    #[inline(never)]
    fn write<S: Real>(&mut self, i: usize, t: f64, x: &[S], tau: &[S]) {
        for lane in 0..S::LANES {
            for (to, from) in self.x.iter_mut().zip(x) {
                *to = from.lane(lane) + 0.0;
            }
            for (to, from) in self.tau.iter_mut().zip(tau) {
                *to = from.lane(lane) + 0.0;
            }
            let (x, stored) = self.x.split_at(self.size);
            self.sink.record(i, lane, t, x, &self.tau);
            if !stored.is_empty() {
                self.sink.take(lane, stored, self.time);
            }
        }
    }
}

impl<S: Real, F: SimulatedLoop<S>> Record<S, F> for LaneRecorder<'_, '_, dyn Sink + '_> {
    fn record(&mut self, i: usize, t: f64, closed: &mut F, x: &[S]) {
        let tau = closed.input_at(t, x);
        self.write(i, t, x, tau);
    }
    fn accept(&mut self, closed: &mut F) {
        closed.pass_on(self.time, self.sink);
    }
}

impl<'a> RunGroup<'a> {
    /// Run `closed` with fixed steps of `method`.
    pub fn fixed<S, F, M>(self, fixed: &Fixed, closed: &mut F, x: Vec<S>, mut method: M) -> Ended
    where
        S: Real,
        F: SimulatedLoop<S>,
        M: FixedStep<S, F, Vec<S>>,
    {
        let time = |step: usize| fixed.schedule.time(step);
        let mut recorder = LaneRecorder::new(self.problem, self.sink, &time, x.len());
        Ended::Fixed(fixed::steps::run(closed, &mut method, x, &fixed.schedule, fixed.hold, self.stop, &mut recorder))
    }
}

/// A run of fixed steps, as a task for any method of fixed steps.
struct FixedRun<'a, 'b> {
    general: RunGroup<'a>,
    fixed: &'b Fixed,
}

impl<'a> WithSteps<f64, RatesLoop<'a>> for FixedRun<'a, '_> {
    type Output = Ended;

    fn with<M: FixedStep<f64, RatesLoop<'a>, Vec<f64>>>(self, mut closed: RatesLoop<'a>, x: Vec<f64>, method: M) -> Ended {
        self.general.fixed(self.fixed, &mut closed, x, method)
    }
}

/// A run of adaptive steps, as a task for any adaptive method.
struct AdaptiveRun<'a, 'b> {
    general: RunGroup<'a>,
    segments: &'b Segments,
}

impl<'a> WithAdaptive<f64, RatesLoop<'a>> for AdaptiveRun<'a, '_> {
    type Output = Ended;

    fn with<M: Adaptive<f64, RatesLoop<'a>, Vec<f64>>>(self, mut closed: RatesLoop<'a>, mut method: M) -> Ended {
        let RunGroup { problem, first, stop, sink, observer, .. } = self.general;
        let segments = problem.segments_of(self.segments, &closed, first);
        let size = method.x().len();
        let mut recorder = LaneRecorder::new(problem, sink, &|_| f64::NAN, size);
        let mut i = 0;
        let states = size - monitors::integrals(problem.options.monitors).count();
        let mut watch = StepChecks::new(problem.plant(first), observer, states, method.x());
        let record = |t: f64, closed: &mut RatesLoop, x: &[f64]| recorder.write_next(&mut i, t, closed, x);
        Ended::Adaptive(adaptive::steps::run(&mut closed, &mut method, &segments, stop, &mut watch, record))
    }
}

impl Problem<'_> {
    /// Return the segments of run `run`, whose loop is `closed`. The samples of a controller also end segments. With random jitter, they
    /// differ between runs.
    pub(super) fn segments_of<'b>(&self, segments: &'b Segments, closed: &RatesLoop, run: usize) -> Cow<'b, Segments> {
        let instants = closed.instants(self.options.t_end);
        if instants.is_empty() && self.shares_exogenous() {
            return Cow::Borrowed(segments);
        }
        Cow::Owned(self.limit_by_own_tables(segments.with_breaks(&instants), run))
    }

    pub(super) fn tolerance(&self, controlled: usize) -> Tolerance {
        Tolerance { rtol: self.options.rtol, atol: self.options.atol, controlled }
    }
}

impl<'a> RunGroup<'a> {
    /// Compute only the run `first`, with the recorded rates of the problem.
    pub fn run_single(self, rates: &'a Rates) -> Ended {
        let (closed, x) = RatesLoop::new(self.problem, self.first, rates);
        let (u, tolerance) = (closed.instant(), self.problem.tolerance(closed.controlled()));
        match (self.problem.options.method.kind(), self.division) {
            (MethodKind::ExplicitSteps(method), Division::Fixed(fixed)) => {
                match method.apply(closed, x, u, FixedRun { general: self, fixed }) {
                    Ok(ended) => ended,
                    Err(_) => unreachable!("plants without velocities were refused"),
                }
            }
            (MethodKind::ImplicitSteps(method), Division::Fixed(fixed)) => method.apply(closed, x, u, FixedRun { general: self, fixed }),
            (MethodKind::ExplicitAdaptive(method), Division::Adaptive(segments)) => {
                method.apply(closed, tolerance, x, u, AdaptiveRun { general: self, segments })
            }
            (MethodKind::ImplicitAdaptive(method), Division::Adaptive(segments)) => {
                method.apply(closed, tolerance, x, u, AdaptiveRun { general: self, segments })
            }
            (_, _) => unreachable!("the division is that of the method"),
        }
    }
}
