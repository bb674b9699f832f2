//! Runs of any plant under any law: one number or lanes, by any method.

use super::adaptive_steps;
use super::closed_loop::{ClosedLoop, Closing, Exogenous, World};
use super::fixed_steps::{self, Record};
use super::planar_pr::Sink;
use super::problem::{Division, Ended, Problem};
use super::stop::Stop;
use crate::integrate::Rk4;
use crate::integrate::Tolerance;
use crate::integrate::dop853::Dop853;
use crate::law::LawSpec;
use crate::plant::PlantSpec;
use crate::scalar::{Real, Task};

/// The runs `first .. first + LANES` of a problem (the last one repeated to fill the lanes).
pub struct General<'a> {
    pub problem: &'a Problem<'a>,
    pub division: &'a Division,
    pub first: usize,
    pub stop: &'a dyn Stop,
    pub sink: &'a mut dyn Sink,
}

/// Records of a lane at a time, from a buffer made once.
struct Recorder<'a> {
    sink: &'a mut dyn Sink,
    times: &'a dyn Fn(usize) -> f64,
    x: Vec<f64>,
    tau: Vec<f64>,
}

impl Recorder<'_> {
    #[inline(never)]
    fn write<S: Real>(&mut self, i: usize, t: f64, closed: &ClosedLoop<S>, x: &[S]) {
        for lane in 0..S::LANES {
            for (to, from) in self.x.iter_mut().zip(x) {
                *to = from.lane(lane);
            }
            for (to, from) in self.tau.iter_mut().zip(&closed.tau) {
                *to = from.lane(lane);
            }
            self.sink.record(i, lane, t, &self.x, &self.tau);
        }
    }
}

impl<S: Real> Record<ClosedLoop<'_, S>, Vec<S>> for Recorder<'_> {
    #[inline(always)]
    fn record(&mut self, i: usize, closed: &mut ClosedLoop<S>, x: &Vec<S>) {
        let t = (self.times)(i);
        closed.observe_unheld(t, x);
        self.write(i, t, closed, x);
    }
}

impl Task for General<'_> {
    type Output = Ended;

    #[inline(always)]
    fn run<S: Real>(self) -> Ended {
        let (mut closed, x) = close::<S>(self.problem, self.first);
        let u = closed.instant();
        let (n, size) = (closed.tau.len(), x.len());
        match self.division {
            Division::Fixed(fixed) => {
                let records = &fixed.schedule.records;
                let times = |i: usize| records[i].t;
                let mut recorder = Recorder { sink: self.sink, times: &times, x: vec![0.0; size], tau: vec![0.0; n] };
                let mut method = Rk4::<Vec<S>, Exogenous<S>>::new(x.clone(), u);
                Ended::Fixed(fixed_steps::run(&mut closed, &mut method, x, &fixed.schedule, fixed.hold, self.stop, &mut recorder))
            }
            Division::Adaptive(segments) => {
                let o = &self.problem.options;
                let tolerance = Tolerance { rtol: o.rtol, atol: o.atol, controlled: closed.controlled() };
                let mut method = Dop853::new(tolerance, x, u);
                let mut recorder = Recorder { sink: self.sink, times: &|_| 0.0, x: vec![0.0; size], tau: vec![0.0; n] };
                let mut i = 0;
                Ended::Adaptive(adaptive_steps::run::<S, _, _, _>(&mut closed, &mut method, segments, self.stop, |t, closed, x| {
                    closed.observe_unheld(t, x);
                    recorder.write(i, t, closed, x);
                    i += 1;
                }))
            }
        }
    }
}

/// The loop of the runs from `first` on, and its state at the start.
#[inline(never)]
fn close<'a, S: Real>(problem: &'a Problem, first: usize) -> (ClosedLoop<'a, S>, Vec<S>) {
    let last = problem.runs() - 1;
    let run = |lane: usize| (first + lane).min(last);
    let o = &problem.options;
    let plant = PlantSpec::build::<S>(|lane| problem.plant(run(lane)), problem.force_frame());
    let law = LawSpec::build::<S>(|lane| problem.law(run(lane)));
    let world = World::new(S::LANES, |lane| problem.law(run(lane)).motions(), |lane| problem.force(run(lane)));
    let closing = Closing {
        tau_max: o.tau_max.as_deref(),
        held: o.sample_time.is_some(),
        monitored: o.monitors,
        storage: problem.watches_storage(run(0)),
    };
    let spec = problem.plant(run(0));
    let (states, p) = (spec.states(), problem.law(run(0)).initial_state().len());
    let closed = ClosedLoop::new(plant, law, world, closing, (states, p, spec.model().angles()));
    let mut x = vec![S::zero(); closed.size()];
    for (k, x) in x.iter_mut().enumerate().take(states) {
        *x = S::from_lanes(|lane| problem.x0[run(lane) * states + k]);
    }
    for k in 0..p {
        x[states + k] = S::from_lanes(|lane| problem.law(run(lane)).initial_state()[k]);
    }
    (closed, x)
}
