//! Runs of any plant with any law, by any method, on plain numbers or on lanes.

use super::adaptive_steps::{self, Segments};
use super::closed_loop::{ClosedLoop, Closing};
use super::fixed_steps::{self, Record};
use super::force::Wrench;
use super::problem::{Division, Ended, Fixed, Problem};
use super::rates_loop::{RatesLoop, Solved, Source};
use super::rates_programs::Rates;
use super::sampler::Sampler;
use super::sink::Sink;
use super::stop::Stop;
use super::torque_sensing::TorqueSensing;
use super::watching::{RunObserver, Watching};
use super::world::{Exogenous, World};
use crate::integrate::{Adaptive, DualSystem, FixedStep, Kind, Linearised, System, Tolerance, WithAdaptive, WithSteps};
use crate::law::{LawSpec, Route, Truth};
use crate::plant::{PlantSpec, Touch};
use crate::scalar::{Array8, Dual8, Float, Real};
use std::borrow::Cow;

/// The runs `first .. first + LANES` of a problem. Missing runs at the end repeat the last run.
pub struct General<'a> {
    pub problem: &'a Problem<'a>,
    pub division: &'a Division,
    pub first: usize,
    pub stop: &'a dyn Stop,
    pub sink: &'a mut dyn Sink,
    /// Receives events and polynomials, in addition to the records.
    pub observer: Option<&'a mut RunObserver>,
    /// The programs of the state rates, if the runs may use them.
    pub rates: Option<&'a Rates>,
}

/// A loop whose run can be recorded, observed and driven by the caller.
pub trait Watched<S: Real>: System<S, Input = Exogenous<S>> {
    /// Return the plant's input at time `t` and state `x`.
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S];
    /// Use `tau` as the plant's input instead of the law's output. If `tau` is `None`, the law computes it, and it is held if `held` is
    /// true.
    fn drive(&mut self, tau: Option<&[S]>, held: bool);
    /// Restart at `t = 0`.
    fn rewind(&mut self);
    /// Hold the contacts of the plant in the modes `contacts`.
    fn hold_contacts(&mut self, contacts: &[Touch]);
    /// Apply `wrench` instead of the external forces. `None` restores the forces.
    fn push(&mut self, wrench: Option<&Wrench>);
    /// Decide which joints stick at time `t` and state `x`.
    fn settle(&mut self, _t: f64, _x: &[S]) {}
    /// Change the mode of a joint with stick-slip friction, at time `t` and state `x`: a stuck joint slips, a sliding joint stops. `None`:
    /// check all joints.
    fn switch_joint(&mut self, _t: f64, _x: &mut [S], _joint: Option<usize>) {}
    /// For each joint with stick-slip friction, write the number that is negative when its present mode ends.
    fn margins(&mut self, _t: f64, _x: &[S], _out: &mut [f64]) {}
    /// Pass the records that were stored within steps to the sink. `time(k)` is the time of step `k`.
    fn pass_on(&mut self, _time: &dyn Fn(usize) -> f64, _: &mut dyn Sink) {}
}

impl<S: Real> Watched<S> for ClosedLoop<'_, S> {
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S] {
        self.observe_unheld(t, x);
        &self.tau
    }
    fn drive(&mut self, tau: Option<&[S]>, held: bool) {
        self.take_over(tau, held);
    }
    fn rewind(&mut self) {
        ClosedLoop::rewind(self);
    }
    fn hold_contacts(&mut self, contacts: &[Touch]) {
        ClosedLoop::hold_contacts(self, contacts);
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        ClosedLoop::push(self, wrench);
    }
    fn settle(&mut self, t: f64, x: &[S]) {
        ClosedLoop::settle(self, t, x, None);
    }
    fn switch_joint(&mut self, t: f64, x: &mut [S], joint: Option<usize>) {
        ClosedLoop::switch_joint(self, t, x, joint);
    }
    fn margins(&mut self, t: f64, x: &[S], out: &mut [f64]) {
        ClosedLoop::margins(self, t, x, out);
    }
}

/// A loop on plain numbers, with the same loop on dual numbers.
pub type Twins<'a> = Linearised<ClosedLoop<'a, f64>, ClosedLoop<'a, Dual8>, Array8, Vec<Dual8>, Exogenous<Dual8>>;

impl Watched<f64> for Twins<'_> {
    fn input_at(&mut self, t: f64, x: &[f64]) -> &[f64] {
        self.system.input_at(t, x)
    }
    fn rewind(&mut self) {
        self.system.rewind();
    }
    fn hold_contacts(&mut self, contacts: &[Touch]) {
        self.system.hold_contacts(contacts);
        self.twin.hold_contacts(contacts);
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        self.system.push(wrench);
        self.twin.push(wrench);
    }
    fn settle(&mut self, t: f64, x: &[f64]) {
        Watched::settle(&mut self.system, t, x);
        self.twin.follow(self.system.sides());
    }
    fn switch_joint(&mut self, t: f64, x: &mut [f64], joint: Option<usize>) {
        self.system.switch_joint(t, x, joint);
        self.twin.follow(self.system.sides());
    }
    fn margins(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        self.system.margins(t, x, out);
    }
    fn drive(&mut self, tau: Option<&[f64]>, held: bool) {
        self.system.drive(tau, held);
        self.twin.take_over(None, held || tau.is_some());
        if let Some((input, rate)) = self.system.held() {
            self.twin.hold(input, rate);
        }
    }
}

impl Twins<'_> {
    /// Return the loop with owned copies of its motions, forces and limits.
    pub fn into_owned(self) -> Twins<'static> {
        let (closed, twin) = (self.system.into_owned(), self.twin.into_owned());
        let (state, input) = (vec![Dual8::zero(); closed.size()], twin.instant());
        Linearised::new(closed, twin, state, input)
    }
}

/// Passes records to the sink, lane by lane. Negative zeros become zeros, because programs and direct evaluation may differ only there.
struct Recorder<'a> {
    sink: &'a mut dyn Sink,
    /// Returns the time of each step.
    time: &'a dyn Fn(usize) -> f64,
    /// The number of states. The numbers after them in `x` are metrics.
    size: usize,
    x: Vec<f64>,
    tau: Vec<f64>,
}

impl Recorder<'_> {
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

impl<S: Real, F: Watched<S>> Record<F, Vec<S>> for Recorder<'_> {
    fn record(&mut self, i: usize, t: f64, closed: &mut F, x: &Vec<S>) {
        let tau = closed.input_at(t, x);
        self.write(i, t, x, tau);
    }
    fn accept(&mut self, closed: &mut F) {
        closed.pass_on(self.time, self.sink);
    }
}

impl<'a> General<'a> {
    /// Return a recorder for states with `all` numbers.
    fn recorder<'b>(problem: &Problem, sink: &'b mut dyn Sink, time: &'b dyn Fn(usize) -> f64, all: usize) -> Recorder<'b> {
        Recorder { sink, time, size: problem.state_size(), x: vec![0.0; all], tau: vec![0.0; problem.plant(0).n()] }
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

/// A run of fixed steps, as a task for any method.
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

/// A run of an adaptive method, as a task for any method.
struct AdaptiveRun<'a, 'b> {
    general: General<'a>,
    segments: &'b Segments,
    /// The times of the samples and of the actions of their outputs, s.
    instants: Vec<f64>,
}

impl<S: Real, F: Watched<S>> WithAdaptive<S, F> for AdaptiveRun<'_, '_> {
    type Output = Ended;

    fn with<M: Adaptive<S, F, Vec<S>>>(self, mut closed: F, mut method: M) -> Ended {
        let General { problem, first, stop, sink, observer, .. } = self.general;
        // With random jitter, each run has different instants.
        let segments = self.segments.with_breaks(&self.instants);
        let size = method.x().len();
        let mut recorder = General::recorder(problem, sink, &|_| f64::NAN, size);
        let mut i = 0;
        let kept = size - if problem.options.monitors { 2 } else { 0 };
        let mut watch = Watching::new(problem.plant(first), observer, kept, method.x());
        let record = |t: f64, closed: &mut F, x: &Vec<S>| {
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
    /// Run only the run `first`, with the code for its kind of method.
    pub fn run_single(self) -> Ended {
        match (self.problem.options.method.kind(), self.division) {
            (Kind::ExplicitSteps(method), Division::Fixed(fixed)) => {
                let (closed, x) = close::<Float>(self.problem, self.first);
                let u = closed.instant();
                match method.apply(closed, x, u, FixedRun { general: self, fixed }) {
                    Ok(ended) => ended,
                    Err(_) => unreachable!("plants without velocities were refused"),
                }
            }
            (Kind::ImplicitSteps(method), Division::Fixed(fixed)) => {
                let (closed, x) = self.implicit();
                let u = closed.instant();
                method.apply(closed, x, u, FixedRun { general: self, fixed })
            }
            (Kind::ExplicitAdaptive(method), Division::Adaptive(segments)) => {
                let (closed, x) = close::<Float>(self.problem, self.first);
                let (u, controlled) = (closed.instant(), closed.controlled());
                let instants = closed.instants(self.problem.options.t_end);
                let closed = RatesLoop::explicit(closed, self.source());
                let tolerance = self.problem.tolerance(controlled);
                method.apply(closed, tolerance, x, u, AdaptiveRun { general: self, segments, instants })
            }
            (Kind::ImplicitAdaptive(method), Division::Adaptive(segments)) => {
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

    /// Return the source of programs for run `first`.
    fn source(&self) -> Option<Source<'a>> {
        self.rates.map(|rates| Source { rates, problem: self.problem, run: self.first })
    }
}

/// Return the loop of run `first` on plain and on dual numbers, and the initial state.
pub fn twins<'a>(problem: &'a Problem, first: usize) -> (Twins<'a>, Vec<f64>) {
    let (closed, x) = close::<f64>(problem, first);
    let (twin, moving) = close::<Dual8>(problem, first);
    let input = twin.instant();
    (Linearised::new(closed, twin, moving, input), x)
}

/// Return the loop of the runs from `first` on, and the initial state.
#[inline(never)]
pub fn close<'a, S: Real>(problem: &'a Problem, first: usize) -> (ClosedLoop<'a, S>, Vec<S>) {
    let last = problem.runs() - 1;
    let run = |lane: usize| (first + lane).min(last);
    (assemble(problem, run, problem.watches_storage()), start(problem, run))
}

/// Return the desired motions and forces of the runs `run(lane)`.
pub fn world<'a>(problem: &'a Problem, lanes: usize, run: impl Fn(usize) -> usize) -> World<'a> {
    World::new(lanes, |lane| problem.law(run(lane)).motions(), |lane| problem.force(run(lane)))
}

/// Return the loop of the runs `run(lane)`. `storage`: see [`Problem::watches_storage`].
pub fn assemble<'a, S: Real>(problem: &'a Problem, run: impl Fn(usize) -> usize + Copy, storage: bool) -> ClosedLoop<'a, S> {
    let o = &problem.options;
    let plant = PlantSpec::build::<S>(|lane| problem.plant(run(lane)), problem.force_frame());
    let law = LawSpec::build::<S>(|lane| problem.law(run(lane)));
    let closing = Closing { tau_max: o.tau_max.as_deref().map(Cow::Borrowed), held: o.sampling.is_some(), monitored: o.monitors, storage };
    let spec = problem.plant(run(0));
    let sizes = (spec.states(), spec.seen(), problem.law(run(0)).initial_state().len(), spec.model().angles());
    let truth =
        if closing.watches_dissipation() { Truth::new(|lane| problem.law(run(lane)), |lane| problem.plant(run(lane))) } else { None };
    let period = o.sampling.as_ref().map(|sampling| sampling.period);
    ClosedLoop::new(plant, law, world(problem, S::LANES, run), closing, sampler(problem, run), sizes).judged_by(truth).asked_every(period)
}

/// Return the clock of the controllers of the runs `run(lane)`. `None` for an ideal controller.
pub fn sampler<S: Real>(problem: &Problem, run: impl Fn(usize) -> usize + Copy) -> Option<Sampler<S>> {
    let (o, plant) = (&problem.options, problem.plant(run(0)));
    // A law of the user may have a memory. It is called once per sample, even if the sample is used several times.
    let asked_once = problem.law(run(0)).route() == Route::Outside;
    let dissipated = usize::from(o.monitors && !problem.watches_storage());
    let sizes = (plant.states(), plant.n(), problem.law(run(0)).initial_state().len() + dissipated);
    o.sampling.as_ref().filter(|sampling| !sampling.is_plain() || asked_once).map(|sampling| {
        let seeds = (0..S::LANES).map(|lane| sampling.seed.wrapping_add(run(lane) as u64)).collect();
        let sensing = TorqueSensing::of(problem, sampling, run);
        Sampler::new(sampling.clone(), seeds, o.grid(), sizes, sensing)
    })
}

/// Return the initial state of the runs `run(lane)`.
pub fn start<S: Real>(problem: &Problem, run: impl Fn(usize) -> usize) -> Vec<S> {
    let (states, p) = (problem.plant(0).states(), problem.law(0).initial_state().len());
    let of_plant = (0..states).map(|k| S::from_lanes(|lane| problem.x0[run(lane) * states + k]));
    let laws: Vec<Vec<f64>> =
        (0..S::LANES).map(|lane| problem.law(run(lane)).start(&problem.x0[run(lane) * states..(run(lane) + 1) * states])).collect();
    let of_law = (0..p).map(|k| S::from_lanes(|lane| laws[lane][k]));
    let quadratures = if problem.options.monitors { 2 } else { 0 };
    of_plant.chain(of_law).chain((0..quadratures).map(|_| S::zero())).collect()
}
