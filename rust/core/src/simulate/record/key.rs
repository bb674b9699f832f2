//! Keys of recorded loops. Two loops have the same recording if their keys match and their loop parameters have the same structure
//! (`structure::LoopParameters`). So a stored recording is found without recording the whole loop.

use crate::integrate::Method;
use crate::law::LawSpec;
use crate::plant::PlantSpec;
use crate::simulate::metrics::plan::Plan;
use crate::simulate::monitors::Monitored;
use crate::simulate::problem::Problem;
use crate::simulate::problem::sampling::{Parts, Sampling};

/// The largest number of stored values of motions in all keys together: 32 MiB.
pub const MOST_NUMBERS: usize = 1 << 22;

/// The key of a recorded loop: the data that determine its recording. A comparison ignores most values of plants and laws, such as gains.
/// The values of the wall and of `tau_max` must be equal.
pub struct Key {
    plant: PlantSpec,
    law: LawSpec,
    method: Method,
    /// The parts of a sampled controller. `None` without sampling.
    sampled: Option<Parts>,
    monitors: bool,
    tau_max: Option<Vec<f64>>,
    /// The frame at which forces act, and the argument `force_frame` of the problem.
    force_frames: [Option<usize>; 2],
    /// The metrics that the programs compute.
    plan: Option<Plan>,
    common: Common,
}

/// Properties that all runs of a problem have in common. They are computed once, because they depend on all runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Common {
    /// Whether programs compute one run per lane.
    pub lanes: bool,
    /// Whether a large step is also one program, because there are many steps.
    pub long: bool,
    /// Whether all runs have the same exogenous input.
    pub shared: bool,
    /// The monitored quantities.
    pub monitored: Monitored,
    /// Whether the programs compute metrics.
    pub sums: bool,
    /// The number of monitors, if the programs compute records.
    pub notes: Option<usize>,
}

impl Common {
    pub fn of(problem: &Problem, lanes: bool) -> Self {
        Common {
            lanes,
            long: false,
            shared: problem.shares_exogenous(),
            monitored: Monitored::of(problem),
            sums: problem.sums_in_programs(),
            notes: None,
        }
    }

    /// Return the properties for functions and state rates of one run, whose programs compute no metrics and no records.
    pub fn of_functions(problem: &Problem) -> Self {
        Common { lanes: false, long: false, shared: false, monitored: Monitored::of(problem), sums: false, notes: None }
    }

    /// Return the metrics that the programs of run `run` compute.
    pub fn plan(&self, problem: &Problem, run: usize) -> Option<Plan> {
        let measures = problem.measures.as_ref().filter(|_| self.sums)?;
        Plan::of(problem, run, measures).ok()
    }
}

impl Key {
    pub fn of(problem: &Problem, run: usize, common: Common) -> Self {
        let o = &problem.options;
        Key {
            plant: problem.plant(run).clone(),
            law: problem.law(run).clone(),
            method: o.method,
            sampled: o.sampling.as_ref().map(Sampling::parts),
            monitors: o.monitors,
            tau_max: o.tau_max.clone(),
            force_frames: [problem.force_frame(), problem.force_frame],
            plan: common.plan(problem, run),
            common,
        }
    }

    pub fn is_of(&self, problem: &Problem, run: usize, common: Common) -> bool {
        let (o, plant) = (&problem.options, problem.plant(run));
        (self.method, self.monitors, self.common) == (o.method, o.monitors, common)
            && self.sampled == o.sampling.as_ref().map(Sampling::parts)
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

    /// Return the number of values of the desired motions in this key. The cache stores them with the key.
    pub fn numbers(&self) -> usize {
        self.law.motions().iter().map(|motion| motion.numbers()).sum()
    }
}
