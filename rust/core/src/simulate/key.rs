//! What a recording of a loop depends on, so that a known structure is told without recording: plants and laws have the same shape,
//! and the numbers of the set-up have zeros and ones in the same places.

use super::measures::{Plan, same_aims};
use super::monitors::Monitored;
use super::problem::Problem;
use crate::integrate::Method;
use crate::law::LawSpec;
use crate::plant::PlantSpec;

/// Numbers of motions that the keys of kept loops may hold in all: 32 MB.
pub const MOST_NUMBERS: usize = 1 << 22;

/// What a recording depends on beside the numbers of the set-up.
pub struct Key {
    plant: PlantSpec,
    law: LawSpec,
    method: Method,
    held: bool,
    monitors: bool,
    tau_max: Option<Vec<f64>>,
    /// Where forces act, and where they were given to act.
    force_frames: [Option<usize>; 2],
    /// What programs sum up.
    plan: Option<Plan>,
    common: Common,
}

/// What the runs of a problem have in common: asked once, since every run has a say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Common {
    /// Runs side by side, not one.
    pub lanes: bool,
    /// All have the same exogenous input.
    pub shared: bool,
    /// What monitors watch.
    pub monitored: Monitored,
    /// The programs sum runs up, with the positions of frames or without.
    pub sums: bool,
    pub aims: bool,
    /// They note what records need, with so many monitors.
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

    /// What the programs of run `run` sum up.
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

    /// Numbers of its motions, which it keeps alive.
    pub fn numbers(&self) -> usize {
        self.law.motions().iter().map(|motion| motion.numbers()).sum()
    }
}
