//! Runs of any plant with any law, by any method, on plain numbers or on lanes.

use super::adaptive_steps::{self, Segments};
use super::assembly::{Watched, close, twins};
use super::fixed_steps::{self, Record};
use super::monitors;
use super::problem::{Division, Ended, Fixed, Problem};
use super::rates_loop::{RatesLoop, Solved, Source};
use super::rates_programs::Rates;
use super::run_observer::RunObserver;
use super::sink::Sink;
use super::stop::Stop;
use super::watching::Watching;
use crate::integrate::{Adaptive, FixedStep, MethodKind, Tolerance, WithAdaptive, WithSteps};
use crate::scalar::Real;

/// The runs `first .. first + LANES` of a problem. If the problem has fewer runs, the remaining lanes repeat the last run.
pub struct General<'a> {
    pub problem: &'a Problem<'a>,
    pub division: &'a Division,
    pub first: usize,
    pub stop: &'a dyn Stop,
    pub sink: &'a mut dyn Sink,
    /// Receives events, contact modes and polynomials of the steps, in addition to the records.
    pub observer: Option<&'a mut RunObserver>,
    /// The programs of the state rates, if the runs may use them.
    pub rates: Option<&'a Rates>,
}

/// Passes records to the sink, lane by lane. Negative zeros become zeros, because signs of zeros may differ between programs and direct
/// evaluation.
struct LaneRecorder<'a> {
    sink: &'a mut dyn Sink,
    /// Returns the time of each step.
    time: &'a dyn Fn(usize) -> f64,
    /// The number of states. The numbers after them in `x` are metrics.
    size: usize,
    x: Vec<f64>,
    tau: Vec<f64>,
}

impl LaneRecorder<'_> {
    #[inline(never)]
    fn write<S: Real>(&mut self, i: usize, t: f64, x: &[S], tau: &[S]) {
        for lane in 0..S::LANES {
            for (to, from) in self.x.iter_mut().zip(x) {
                *to = from.lane(lane) + 0.0;
            }
            for (to, from) in self.tau.iter_mut().zip(tau) {
                *to = from.lane(lane) + 0.0;
            }
            let (x, kept) = self.x.split_at(self.size);
            self.sink.record(i, lane, t, x, &self.tau);
            if !kept.is_empty() {
                self.sink.take(lane, kept, self.time);
            }
        }
    }
}

impl<S: Real, F: Watched<S>> Record<S, F> for LaneRecorder<'_> {
    fn record(&mut self, i: usize, t: f64, closed: &mut F, x: &[S]) {
        let tau = closed.input_at(t, x);
        self.write(i, t, x, tau);
    }
    fn accept(&mut self, closed: &mut F) {
        closed.pass_on(self.time, self.sink);
    }
}

impl<'a> General<'a> {
    /// Return a recorder for states with `all` numbers.
    fn recorder<'b>(problem: &Problem, sink: &'b mut dyn Sink, time: &'b dyn Fn(usize) -> f64, all: usize) -> LaneRecorder<'b> {
        LaneRecorder { sink, time, size: problem.state_size(), x: vec![0.0; all], tau: vec![0.0; problem.plant(0).n()] }
    }

    /// Run `closed` with fixed steps of `method`.
    pub fn fixed<S, F, M>(self, fixed: &Fixed, closed: &mut F, x: Vec<S>, mut method: M) -> Ended
    where
        S: Real,
        F: Watched<S>,
        M: FixedStep<S, F, Vec<S>>,
    {
        let time = |step: usize| fixed.schedule.time(step);
        let mut recorder = Self::recorder(self.problem, self.sink, &time, x.len());
        Ended::Fixed(fixed_steps::run(closed, &mut method, x, &fixed.schedule, fixed.hold, self.stop, &mut recorder))
    }
}

/// A run of fixed steps, as a task for any method of fixed steps.
struct FixedRun<'a, 'b> {
    general: General<'a>,
    fixed: &'b Fixed,
}

impl<S: Real, F: Watched<S>> WithSteps<S, F> for FixedRun<'_, '_> {
    type Output = Ended;

    fn with<M: FixedStep<S, F, Vec<S>>>(self, mut closed: F, x: Vec<S>, method: M) -> Ended {
        self.general.fixed(self.fixed, &mut closed, x, method)
    }
}

/// A run of adaptive steps, as a task for any adaptive method.
struct AdaptiveRun<'a, 'b> {
    general: General<'a>,
    segments: &'b Segments,
    /// The times of the samples, and the times at which their outputs begin to act, s.
    instants: Vec<f64>,
}

impl<S: Real, F: Watched<S>> WithAdaptive<S, F> for AdaptiveRun<'_, '_> {
    type Output = Ended;

    fn with<M: Adaptive<S, F, Vec<S>>>(self, mut closed: F, mut method: M) -> Ended {
        let General { problem, first, stop, sink, observer, .. } = self.general;
        // The samples of a controller also end segments. With random jitter, they differ between runs.
        let segments = problem.limit_by_own_tables(self.segments.with_breaks(&self.instants), first);
        let size = method.x().len();
        let mut recorder = General::recorder(problem, sink, &|_| f64::NAN, size);
        let mut i = 0;
        let kept = size - monitors::integrals(problem.options.monitors).count();
        let mut watch = Watching::new(problem.plant(first), observer, kept, method.x());
        let record = |t: f64, closed: &mut F, x: &[S]| {
            let tau = closed.input_at(t, x);
            recorder.write(i, t, x, tau);
            i += 1;
        };
        Ended::Adaptive(adaptive_steps::run(&mut closed, &mut method, &segments, stop, &mut watch, record))
    }
}

impl Problem<'_> {
    fn tolerance(&self, controlled: usize) -> Tolerance {
        Tolerance { rtol: self.options.rtol, atol: self.options.atol, controlled }
    }
}

impl<'a> General<'a> {
    /// Compute only the run `first`.
    pub fn run_single(self) -> Ended {
        match (self.problem.options.method.kind(), self.division) {
            (MethodKind::ExplicitSteps(method), Division::Fixed(fixed)) => {
                let (closed, x) = close::<f64>(self.problem, self.first);
                let u = closed.instant();
                let closed = RatesLoop::explicit(closed, self.source());
                match method.apply(closed, x, u, FixedRun { general: self, fixed }) {
                    Ok(ended) => ended,
                    Err(_) => unreachable!("plants without velocities were refused"),
                }
            }
            (MethodKind::ImplicitSteps(method), Division::Fixed(fixed)) => {
                let (closed, x) = self.implicit();
                let u = closed.instant();
                method.apply(closed, x, u, FixedRun { general: self, fixed })
            }
            (MethodKind::ExplicitAdaptive(method), Division::Adaptive(segments)) => {
                let (closed, x) = close::<f64>(self.problem, self.first);
                let (u, controlled) = (closed.instant(), closed.controlled());
                let instants = closed.instants(self.problem.options.t_end);
                let closed = RatesLoop::explicit(closed, self.source());
                let tolerance = self.problem.tolerance(controlled);
                method.apply(closed, tolerance, x, u, AdaptiveRun { general: self, segments, instants })
            }
            (MethodKind::ImplicitAdaptive(method), Division::Adaptive(segments)) => {
                let (closed, x) = self.implicit();
                let (u, tolerance) = (closed.instant(), self.problem.tolerance(closed.controlled()));
                let instants = closed.instants(self.problem.options.t_end);
                method.apply(closed, tolerance, x, u, AdaptiveRun { general: self, segments, instants })
            }
            (_, _) => unreachable!("the division is that of the method"),
        }
    }

    /// Return the loop of run `first` for an implicit method, and the initial state.
    fn implicit(&self) -> (Solved<'a>, Vec<f64>) {
        let (twins, x) = twins(self.problem, self.first);
        (RatesLoop::implicit(twins, self.source()), x)
    }

    /// Return the data from which programs for run `first` are made; `None` if the run uses no programs.
    fn source(&self) -> Option<Source<'a>> {
        self.rates.map(|rates| Source { rates, problem: self.problem, run: self.first })
    }
}
