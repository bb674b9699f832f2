//! The identities that theory promises of a run, at its recorded times:
//!
//! `V1 = s' M s / 2 + (a - a_hat)' Gamma^-1 (a - a_hat) / 2` never increases, and
//! `V1(0) - V1(t) - int s' Kd s = 0`; `dM/dt - 2 C` is skew; `E(t) - E(0) - int P dt = 0` for the energy `E` stored in the
//! plant, or in the law's own storage function, and the power `P` put into it.
//!
//! Cartesian impedance of a rigid arm adds the largest term and the residual of its [`TargetModel`].
//!
//! A law of elastic joints adds `max |tau_J - u|`, and with its own storage function the passivity at the port: what flowed
//! in there less what is stored, `int F.x_dot - (E(t) - E(0))`, never negative in a passive loop.
//!
//! [`Balances`] computes them on any number, so that programs do so within a step; norms of levels need plain numbers.

use super::identities::Balances;
use super::problem::Problem;
use super::target_model::TargetModel;
use crate::law::{Law, LawSpec, PriorityAcceleration, PriorityVelocity};
use crate::motion::{Motion, sample_all};
use crate::plant::PlantKind;

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
        _ if problem.watches_storage() => &["skewness", "energy", "energy_balance", "torque_error", "passivity"],
        _ if problem.watches_target() => &["skewness", "energy", "energy_balance", "target", "target_balance"],
        _ if law.reduction().is_some() => &["skewness", "energy", "energy_balance", "torque_error"],
        LawSpec::Adaptive(_) => &["skewness", "energy", "energy_balance", "lyapunov", "lyapunov_balance"],
        LawSpec::PriorityVelocity(law) => &ENERGY_AND_LEVELS[ENERGY..ENERGY_AND_LEVELS.len().min(ENERGY + 2 * law.levels.len())],
        LawSpec::PriorityAcceleration(law) => &ENERGY_AND_LEVELS[..ENERGY_AND_LEVELS.len().min(ENERGY + 2 * law.levels.len())],
        _ if law.plant() == PlantKind::Velocity => &[],
        _ => &["skewness", "energy", "energy_balance"],
    }
}

/// What the monitors of one run need besides the record.
pub struct Monitor<'a> {
    motions: Vec<&'a Motion>,
    balances: Balances<f64>,
    target: Option<TargetModel<'a>>,
    desired: Vec<f64>,
    states: usize,
    levels: Option<Levels>,
    /// `E` and `V1` at the first record, each with its integral there.
    first: Option<[f64; 2]>,
}

impl<'a> Monitor<'a> {
    /// Of run `run` of a problem.
    pub fn new(problem: &Problem<'a>, run: usize) -> Self {
        let (plant, law, storage) = (problem.plant(run), problem.law(run), problem.watches_storage());
        Monitor {
            motions: law.motions(),
            balances: Balances::new(|_| plant, |_| law, storage),
            target: TargetModel::new(problem, run),
            desired: law.desired(0.0),
            states: plant.states(),
            levels: Levels::of(law),
            first: None,
        }
    }

    /// The monitors at time `t`, state `x = [plant, z, int s' Kd s, int P]` and input `tau` into `out`.
    pub fn evaluate(&mut self, t: f64, x: &[f64], tau: &[f64], out: &mut [f64]) {
        if out.is_empty() {
            return;
        }
        let plant = &x[..self.states];
        let arm = &mut self.balances.theory.arm;
        arm.move_to(&x[..arm.trig().len()]);
        let (out, of_levels) = out.split_at_mut(out.len() - self.levels.as_ref().map_or(0, |levels| levels.monitors(out.len())));
        if let Some(levels) = &mut self.levels {
            levels.evaluate(t, arm.trig(), plant, of_levels);
        }
        if out.is_empty() {
            return;
        }
        sample_all(self.motions.iter().copied(), t, &mut self.desired);
        self.balances.evaluate(&self.desired, x, |own| *self.first.get_or_insert(own), out);
        if let Some(target) = &mut self.target {
            out[ENERGY..].copy_from_slice(&target.evaluate(t, &mut self.balances.theory.arm, &self.desired, plant, tau));
        }
    }
}

/// A law of tasks in priority, asked again at the records.
struct Levels {
    law: Engine,
    motions: Vec<Motion>,
    desired: Vec<f64>,
    u: Vec<f64>,
}

enum Engine {
    Velocity(Box<PriorityVelocity>),
    Acceleration(Box<PriorityAcceleration>),
}

impl Levels {
    fn of(law: &LawSpec) -> Option<Self> {
        let engine = match law {
            LawSpec::PriorityVelocity(spec) => Engine::Velocity(Box::new(spec.engine())),
            LawSpec::PriorityAcceleration(spec) => Engine::Acceleration(Box::new(spec.engine())),
            _ => return None,
        };
        let motions: Vec<Motion> = law.motions().into_iter().cloned().collect();
        let (n, width) = (law.model().n(), motions.iter().map(|motion| 3 * motion.dof()).sum());
        Some(Levels { law: engine, motions, desired: vec![0.0; width], u: vec![0.0; n] })
    }

    /// How many of a loop's `all` monitors are norms of levels.
    fn monitors(&self, all: usize) -> usize {
        if matches!(self.law, Engine::Velocity(_)) { all } else { all - ENERGY }
    }

    fn evaluate(&mut self, t: f64, trig: &[(f64, f64)], x: &[f64], out: &mut [f64]) {
        sample_all(&self.motions, t, &mut self.desired);
        match &mut self.law {
            Engine::Velocity(law) => {
                law.evaluate(&self.desired, trig, x, &[], &mut self.u, &mut []);
                law.norms(out);
            }
            Engine::Acceleration(law) => {
                law.evaluate(&self.desired, trig, x, &[], &mut self.u, &mut []);
                law.norms(out);
            }
        }
    }
}
