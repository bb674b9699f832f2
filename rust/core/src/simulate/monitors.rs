//! The identities that theory promises of a run, at its recorded times:
//!
//! `V1 = s' M s / 2 + (a - a_hat)' Gamma^-1 (a - a_hat) / 2` never increases, and
//! `V1(0) - V1(t) - int s' Kd s = 0`; `dM/dt - 2 C` is skew; `E(t) - E(0) - int P dt = 0` for the energy `E` stored in the
//! plant, or in the law's own storage function, and the power `P` put into it.
//!
//! Cartesian impedance of a rigid arm adds the largest term and the residual of its [`TargetModel`]. Laws with a null space or a
//! compensated coupling add the [`ProjectionLoss`].
//!
//! A law of elastic joints adds `max |tau_J - u|`, and with its own storage function the passivity at the port: what flowed
//! in there less what is stored, `int F.x_dot - (E(t) - E(0))`, never negative in a passive loop.
//!
//! [`Checks`] computes them on any number, so that programs do so within a step.

use super::force::{Force, Wrench};
use super::identities::Balances;
use super::level_norms::LevelNorms;
use super::problem::Problem;
use super::target_model::TargetModel;
use crate::law::{LawSpec, ProjectionLoss, Solve};
use crate::motion::{Motion, sample_all};
use crate::priority::PrioritySolver;
use crate::scalar::Real;

/// The energy of a rigid plant, then norms of the error and of the residual of each level of priority.
const ENERGY_AND_LEVELS: [&str; 19] = [
    "skewness",
    "energy",
    "energy_balance",
    "error_1",
    "residual_1",
    "error_2",
    "residual_2",
    "error_3",
    "residual_3",
    "error_4",
    "residual_4",
    "error_5",
    "residual_5",
    "error_6",
    "residual_6",
    "error_7",
    "residual_7",
    "error_8",
    "residual_8",
];

/// Monitors of every rigid plant.
const ENERGY: usize = 3;

/// The names of the monitors of a problem's loops, in the order of [`Monitor::evaluate`].
pub fn names(problem: &Problem) -> &'static [&'static str] {
    let law = problem.law(0);
    match law {
        _ if !problem.options.monitors => &[],
        // What an identity says of the law inside ends at contact.
        LawSpec::Guarded(_) => &ENERGY_AND_LEVELS[..ENERGY],
        _ if problem.watches_storage() => lossless(&["skewness", "energy", "energy_balance", "torque_error", "passivity", "loss"], problem),
        _ if problem.watches_target() => lossless(&["skewness", "energy", "energy_balance", "target", "target_balance", "loss"], problem),
        _ if law.reduction().is_some() => lossless(&["skewness", "energy", "energy_balance", "torque_error", "loss"], problem),
        LawSpec::Adaptive(_) => &["skewness", "energy", "energy_balance", "lyapunov", "lyapunov_balance"],
        LawSpec::PriorityVelocity(law) => &ENERGY_AND_LEVELS[ENERGY..ENERGY_AND_LEVELS.len().min(ENERGY + 2 * law.levels.len())],
        LawSpec::PriorityAcceleration(law) => &ENERGY_AND_LEVELS[..ENERGY_AND_LEVELS.len().min(ENERGY + 2 * law.levels.len())],
        _ if !law.plant().has_speeds() => &[],
        _ => lossless(&["skewness", "energy", "energy_balance", "loss"], problem),
    }
}

/// These names, the last one only where some law has a loss.
fn lossless(names: &'static [&'static str], problem: &Problem) -> &'static [&'static str] {
    &names[..names.len() - usize::from(!problem.watches_loss())]
}

/// What the monitors of all runs of a problem have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watched {
    /// The energy is the law's own storage function.
    pub storage: bool,
    /// The target model of an impedance.
    pub target: bool,
    /// The loss of a projector.
    pub loss: bool,
}

impl Watched {
    pub fn of(problem: &Problem) -> Self {
        Watched { storage: problem.watches_storage(), target: problem.watches_target(), loss: problem.watches_loss() }
    }
}

/// The monitors of one run: on plain numbers with all routes of a law that decides ranks, or recorded with its regular route.
pub struct Checks<P: Solve> {
    balances: Balances<P::Number>,
    levels: Option<LevelNorms<P>>,
    target: Option<TargetModel<P::Number>>,
    /// Whether the last monitor is the loss, and of what: some laws of a batch may have none.
    watches_loss: bool,
    loss: Option<ProjectionLoss<P::Number>>,
    states: usize,
}

impl<P: Solve> Checks<P> {
    /// Of run `run` of a problem.
    pub fn new(problem: &Problem, run: usize, watched: Watched) -> Self {
        let (plant, law) = (problem.plant(run), problem.law(run));
        Checks {
            balances: Balances::new(|_| plant, |_| law, watched.storage),
            levels: LevelNorms::of(law),
            target: if watched.target { TargetModel::new(problem, run) } else { None },
            watches_loss: watched.loss,
            loss: if watched.loss { ProjectionLoss::new(law) } else { None },
            states: plant.seen(),
        }
    }

    /// How many of a loop's `all` monitors are norms of levels.
    pub fn norms(&self, all: usize) -> usize {
        match self.levels {
            None => 0,
            Some(_) if self.balances.theory.has_velocities() => all - ENERGY,
            Some(_) => all,
        }
    }

    /// The norms of levels alone, as [`LevelNorms::evaluate`].
    pub fn evaluate_norms(&mut self, desired: &[P::Number], x: &[P::Number], out: &mut [P::Number]) -> Option<P::Number> {
        let arm = &mut self.balances.theory.arm;
        arm.move_to(&x[..arm.trig().len()]);
        self.levels.as_mut()?.evaluate(desired, arm.trig(), &x[..self.states], out)
    }

    /// The monitors at state `x = [plant, z, int s' Kd s, int P]` and input `tau` under the desired motions and the wrench, into `out`.
    /// `first`: see [`Balances::evaluate`]. Returned as by [`LevelNorms::evaluate`].
    pub fn evaluate(
        &mut self,
        (desired, wrench): (&[P::Number], &[P::Number; 6]),
        (x, tau): (&[P::Number], &[P::Number]),
        first: impl FnOnce([P::Number; 2]) -> [P::Number; 2],
        out: &mut [P::Number],
    ) -> Option<P::Number> {
        let (out, norms) = out.split_at_mut(out.len() - self.norms(out.len()));
        let stands = self.evaluate_norms(desired, x, norms);
        let (out, lost) = out.split_at_mut(out.len() - usize::from(self.watches_loss));
        if !out.is_empty() {
            self.balances.evaluate(desired, x, first, out);
        }
        let loss = self.loss.as_mut().map(|loss| loss.evaluate(&x[..tau.len()]));
        lost.fill(loss.unwrap_or(P::Number::zero()));
        if let Some(target) = &mut self.target {
            let state = (&x[..self.states], &x[self.states..x.len() - 2], tau);
            let found = target.evaluate(&mut self.balances.theory.arm, (desired, wrench), state, loss);
            out[ENERGY..].copy_from_slice(&found);
        }
        stands
    }
}

/// What the monitors of one run need besides the record.
pub struct Monitor<'a> {
    motions: Vec<&'a Motion>,
    force: Option<&'a Force>,
    checks: Checks<PrioritySolver>,
    desired: Vec<f64>,
    /// `E` and `V1` at the first record, each with its integral there.
    first: Option<[f64; 2]>,
}

impl<'a> Monitor<'a> {
    /// Of run `run` of a problem.
    pub fn new(problem: &Problem<'a>, run: usize) -> Self {
        let law = problem.law(run);
        Monitor {
            motions: law.motions(),
            force: problem.force(run),
            checks: Checks::new(problem, run, Watched::of(problem)),
            desired: law.desired(0.0),
            first: None,
        }
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
