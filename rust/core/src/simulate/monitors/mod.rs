//! The identities of a run, at its recorded times:
//!
//! ```text
//! V1 = s' M s / 2 + (a - a_hat)' Gamma^-1 (a - a_hat) / 2 never increases
//! V1(0) - V1(t) - int s' Kd s = 0
//! dM/dt - 2 C is skew
//! E(t) - E(0) - int P dt = 0
//! ```
//!
//! `E` is stored in the plant, or in the law's own storage function, and `P` is the power put into it. Cartesian impedance of a rigid arm
//! adds the largest term and the residual of its target model. A law of elastic joints adds `max |tau_J - u|`. With its own storage
//! function it adds the passivity at the port, `int F.x_dot - (E(t) - E(0))`, which is never negative in a passive loop.
//!
//! [`Checks`] computes them on any number, so that programs do so within a step.

pub mod identities;
mod level_norms;
mod projection_loss;
mod static_torque;
mod target_model;
mod torque_error;

use super::force::{Force, Wrench};
use super::gauge::Identities;
use super::problem::Problem;
use crate::dynamics::ArmAt;
use crate::law::{LawSpec, ProjectionLoss, Solve};
use crate::motion::{Motion, sample_all};
use crate::plant::PlantSpec;
use crate::priority::PrioritySolver;
use crate::scalar::Real;
use identities::Theory;
use level_norms::LevelNorms;

/// A run.
pub struct Scope<'p, 'a> {
    pub problem: &'p Problem<'a>,
    pub run: usize,
    pub monitored: Monitored,
}

/// Properties of the monitors that all runs of a problem share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Monitored {
    /// The energy is the law's own storage function.
    pub storage: bool,
    /// The target model of an impedance.
    pub target: bool,
    /// The loss of a projector.
    pub loss: bool,
}

impl Monitored {
    /// Of a problem.
    pub fn of(problem: &Problem) -> Self {
        Monitored { storage: problem.watches_storage(), target: problem.watches_target(), loss: problem.watches_loss() }
    }
}

impl<'a> Scope<'_, 'a> {
    pub fn plant(&self) -> &'a PlantSpec {
        self.problem.plant(self.run)
    }

    pub fn law(&self) -> &'a LawSpec {
        self.problem.law(self.run)
    }
}

/// The data of a record for a monitor.
pub struct Moment<'a, S: Real> {
    /// The law's desired motions, one after another, and the wrench at the frame of the force.
    pub desired: &'a [S],
    pub wrench: &'a [S; 6],
    /// The plant's state, the law's, and the input.
    pub x: &'a [S],
    pub z: &'a [S],
    pub tau: &'a [S],
    /// The plant's arm at its `q`.
    pub arm: &'a mut ArmAt<S>,
    /// The quantities of the identities, with the integrals of the dissipation of the law and of the input power.
    pub identities: Identities<S>,
    /// `E - int P` and `V1 + int s' Kd s` of the first record.
    pub first: [S; 2],
    /// The loss of the law's projector; `None` for a law without one.
    pub loss: Option<S>,
}

/// A monitor of one run, on plain numbers or recorded.
pub trait Monitor<S: Real> {
    /// Its series at a record, as many as [`MonitorKind::NAMES`].
    fn evaluate(&mut self, at: &mut Moment<S>, out: &mut [S]);
}

/// The monitors of a run, each with the number of its series.
type Series<S> = Vec<(usize, Box<dyn Monitor<S> + Send>)>;

/// A kind of monitor.
pub trait MonitorKind {
    /// Its series.
    const NAMES: &'static [&'static str];

    /// Whether a run has it.
    fn applies(scope: &Scope) -> bool;

    /// The monitor of a run that has it.
    fn build<S: Real>(scope: &Scope) -> Option<Box<dyn Monitor<S> + Send>>;
}

/// The kinds of monitors, in the order of their series. A monitor is in its own file and here.
macro_rules! monitors {
    ($($kind:ty,)*) => {
        /// The series of a run, without the norms of levels.
        fn series(scope: &Scope) -> Vec<&'static str> {
            let mut all = Vec::new();
            $(if <$kind>::applies(scope) {
                all.extend(<$kind>::NAMES);
            })*
            all
        }

        /// The monitors of a run.
        fn build<S: Real>(scope: &Scope) -> Series<S> {
            let mut all = Vec::new();
            $(if <$kind>::applies(scope) {
                all.extend(<$kind>::build::<S>(scope).map(|monitor| (<$kind>::NAMES.len(), monitor)));
            })*
            all
        }
    };
}

monitors! {
    identities::Skewness,
    identities::Energy,
    torque_error::InnerLoop,
    identities::Passivity,
    target_model::Target,
    projection_loss::Loss,
    identities::LyapunovBalance,
}

/// The names of the monitors of a problem's loops, in the order of [`Monitors::evaluate`].
pub fn names(problem: &Problem) -> Vec<&'static str> {
    if !problem.options.monitors {
        return Vec::new();
    }
    let scope = Scope { problem, run: 0, monitored: Monitored::of(problem) };
    let mut all = series(&scope);
    all.extend(level_norms::names(scope.law()));
    all
}

/// The monitors of one run: on plain numbers with all routes of a law that decides ranks, or recorded with its regular route.
pub struct Checks<P: Solve> {
    theory: Theory<P::Number>,
    monitors: Series<P::Number>,
    levels: Option<LevelNorms<P>>,
    loss: Option<ProjectionLoss<P::Number>>,
    /// Numbers of the plant's state that a law reads, of the bristles after them, and of norms of levels.
    states: usize,
    bristles: usize,
    norms: usize,
}

impl<P: Solve> Checks<P> {
    /// Of a run.
    pub fn new(scope: &Scope) -> Self {
        let (plant, law) = (scope.plant(), scope.law());
        let levels = LevelNorms::of(law);
        Checks {
            theory: Theory::new(|_| plant, |_| law, scope.monitored.storage),
            monitors: build(scope),
            norms: if levels.is_some() { level_norms::names(law).len() } else { 0 },
            levels,
            loss: if scope.monitored.loss { ProjectionLoss::new(law) } else { None },
            states: plant.seen(),
            bristles: plant.bristles(),
        }
    }

    /// How many of the monitors are norms of levels.
    pub fn norms(&self) -> usize {
        self.norms
    }

    /// The norms of levels alone, as [`LevelNorms::evaluate`].
    pub fn evaluate_norms(&mut self, desired: &[P::Number], x: &[P::Number], out: &mut [P::Number]) -> Option<P::Number> {
        let arm = &mut self.theory.arm;
        arm.move_to(&x[..arm.trig().len()]);
        self.levels.as_mut()?.evaluate(desired, arm.trig(), &x[..self.states], out)
    }

    /// The monitors at state `x = [plant, z, int s' Kd s, int P]` and input `tau` under the desired motions and the wrench, into `out`.
    /// `first` computes `E - int P` and `V1 + int s' Kd s` of the first record from those of this one. The result is that of
    /// [`LevelNorms::evaluate`].
    pub fn evaluate(
        &mut self,
        (desired, wrench): (&[P::Number], &[P::Number; 6]),
        (x, tau): (&[P::Number], &[P::Number]),
        first: impl FnOnce([P::Number; 2]) -> [P::Number; 2],
        out: &mut [P::Number],
    ) -> Option<P::Number> {
        let (mut out, norms) = out.split_at_mut(out.len() - self.norms);
        let stands = self.evaluate_norms(desired, x, norms);
        if self.monitors.is_empty() {
            return stands;
        }
        let identities = self.theory.identities(desired, x);
        let [dissipated, put_in] = identities.quadratures;
        let first = first([identities.energy - put_in, identities.lyapunov + dissipated]);
        let loss = self.loss.as_mut().map(|loss| loss.evaluate(&x[..tau.len()]));
        let (x, rest) = x.split_at(self.states);
        let z = &rest[self.bristles..rest.len() - 2];
        let mut at = Moment { desired, wrench, x, z, tau, arm: &mut self.theory.arm, identities, first, loss };
        for (series, monitor) in &mut self.monitors {
            let (own, rest) = out.split_at_mut(*series);
            monitor.evaluate(&mut at, own);
            out = rest;
        }
        stands
    }
}

/// What the monitors of one run need besides the record.
pub struct Monitors<'a> {
    motions: Vec<&'a Motion>,
    force: Option<&'a Force>,
    checks: Checks<PrioritySolver>,
    desired: Vec<f64>,
    /// `E` and `V1` at the first record, each with its integral there.
    first: Option<[f64; 2]>,
}

impl<'a> Monitors<'a> {
    /// Of run `run` of a problem.
    pub fn new(problem: &Problem<'a>, run: usize) -> Self {
        let law = problem.law(run);
        let scope = Scope { problem, run, monitored: Monitored::of(problem) };
        Monitors { motions: law.motions(), force: problem.force(run), checks: Checks::new(&scope), desired: law.desired(0.0), first: None }
    }

    /// The monitors at time `t`, state `x` and input `tau` into `out`.
    pub fn evaluate(&mut self, t: f64, x: &[f64], tau: &[f64], out: &mut [f64]) {
        if out.is_empty() {
            return;
        }
        sample_all(self.motions.iter().copied(), t, &mut self.desired);
        let wrench: Wrench = self.force.map_or([0.0; 6], |force| force.at(t));
        let first = |own| *self.first.get_or_insert(own);
        self.checks.evaluate((&self.desired, &wrench), (x, tau), first, out);
    }

    /// The norms of levels alone, at time `t` and state `x`.
    pub fn evaluate_norms(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        sample_all(self.motions.iter().copied(), t, &mut self.desired);
        self.checks.evaluate_norms(&self.desired, x, out);
    }
}
