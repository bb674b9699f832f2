//! The key of a recorded loop, which identifies a known structure without recording. Loops have the same structure if their plants and laws
//! have the same shape, and their numbers have zeros and ones at the same places.

use super::measures::{Plan, same_aims};
use super::monitors::Monitored;
use super::problem::Problem;
use crate::integrate::Method;
use crate::law::LawSpec;
use crate::plant::PlantSpec;

/// The largest number of numbers of motions in all stored keys: 32 MB.
pub const MOST_NUMBERS: usize = 1 << 22;

/// The parts of a recording's key other than the numbers of the set-up.
pub struct Key {
    plant: PlantSpec,
    law: LawSpec,
    method: Method,
    held: bool,
    monitors: bool,
    tau_max: Option<Vec<f64>>,
    /// The frame at which forces act, and the frame of the argument.
    force_frames: [Option<usize>; 2],
    /// The metrics in the programs.
    plan: Option<Plan>,
    common: Common,
}

/// Properties that all runs of a problem share. They are computed once, because they depend on every run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Common {
    /// Runs side by side, not one.
    pub lanes: bool,
    /// All have the same exogenous input.
    pub shared: bool,
    /// The monitored quantities.
    pub monitored: Monitored,
    /// Whether the programs compute metrics, with or without the positions of frames.
    pub sums: bool,
    pub aims: bool,
    /// The number of monitors, if the programs compute records.
    pub notes: Option<usize>,
}

impl Common {
    pub fn of(problem: &Problem, lanes: bool) -> Self {
        let sums = problem.sums_in_programs();
        Common {
            lanes,
            shared: problem.shares_exogenous(),
            monitored: Monitored::of(problem),
            sums,
            aims: sums && same_aims(problem),
            notes: None,
        }
    }

    /// The metrics in the programs of run `run`.
    pub fn plan(&self, problem: &Problem, run: usize) -> Option<Plan> {
        let measures = problem.measures.as_ref().filter(|_| self.sums)?;
        Plan::of(problem, run, measures, self.aims).ok()
    }
}

impl Key {
    pub fn of(problem: &Problem, run: usize, common: Common) -> Self {
        let o = &problem.options;
        Key {
            plant: problem.plant(run).clone(),
            law: problem.law(run).clone(),
            method: o.method,
            held: o.sampling.is_some(),
            monitors: o.monitors,
            tau_max: o.tau_max.clone(),
            force_frames: [problem.force_frame(), problem.force_frame],
            plan: common.plan(problem, run),
            common,
        }
    }

    pub fn is_of(&self, problem: &Problem, run: usize, common: Common) -> bool {
        let (o, plant) = (&problem.options, problem.plant(run));
        (self.method, self.held, self.monitors, self.common) == (o.method, o.sampling.is_some(), o.monitors, common)
            && self.force_frames == [problem.force_frame(), problem.force_frame]
            && self.tau_max == o.tau_max
            && self.plant.same_shape(plant)
            && self.plant.wall() == plant.wall()
            && self.law.same_shape(problem.law(run))
            && match (&self.plan, common.plan(problem, run)) {
                (Some(plan), Some(other)) => plan.same_shape(&other),
                (plan, other) => plan.is_none() && other.is_none(),
            }
    }

    /// Number of numbers of its motions, which stay in memory.
    pub fn numbers(&self) -> usize {
        self.law.motions().iter().map(|motion| motion.numbers()).sum()
    }
}
