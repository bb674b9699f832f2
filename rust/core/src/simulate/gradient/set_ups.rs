//! The recorded set-ups of a loop: the operations that compute its constants from the loop parameters.

use super::directions::Directions;
use crate::interrupt;
use crate::simulate::assembly::assemble;
use crate::simulate::problem::Problem;
use crate::simulate::record::key::{Common, Key};
use crate::trace::sym;
use crate::trace::tape::{Moving, Op};

/// The recorded set-up of one run.
#[derive(Clone, PartialEq)]
pub struct SetUp {
    pub ops: Vec<Op>,
    /// For each loop parameter, in the order of recording: the index of its operation in `ops`.
    pub structure: Vec<u32>,
}

/// The set-ups of run 0 and of the compared runs of a loop ([`Directions::runs`]).
pub struct SetUps {
    pub common: Common,
    /// The key of run 0.
    pub key: Key,
    /// The runs with their set-ups. The first run is run 0.
    pub runs: Vec<(usize, SetUp)>,
    /// The loop parameters of run 0 that are inputs of the functions.
    pub values: Vec<f64>,
}

impl SetUps {
    pub fn of(problem: &Problem, directions: &Directions) -> Self {
        let of = |run: usize| {
            interrupt::check();
            sym::begin_moving(Moving::These(directions.moving.clone()));
            drop(assemble(problem, run, false));
            let recording = sym::finish();
            ((run, SetUp { ops: recording.ops, structure: recording.structure }), recording.values)
        };
        let (first, values) = of(0);
        let runs = std::iter::once(first).chain(directions.runs.iter().map(|&(_, run)| of(run).0)).collect();
        let common = Common::of_functions(problem);
        SetUps { common, key: Key::of(problem, 0, common), runs, values }
    }

    /// Whether compared run number `k`, which is run `run` of the problem, has the set-up and the key of run 0.
    pub fn is_of_run_0(&self, problem: &Problem, k: usize, run: usize) -> bool {
        self.runs[1 + k].1 == self.runs[0].1 && self.key.is_of(problem, run, self.common)
    }
}
