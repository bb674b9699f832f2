//! The structure of a loop's recorded functions, and a store of these functions by structure.
//!
//! The *set-up* of a run is the recorded construction of its loop, before the first evaluation. The set-up, the varying loop parameters and
//! the [`Key`] of a run determine its recording. Loops with the same set-ups, keys, sizes and contacts therefore share their functions. The
//! values of loop parameters belong to each loop.
//!
//! A parameter may be a constant of the recording, such as gravity. Then the key of a run with another value differs from the key of run 0.
//! If the set-up or the key of a run differs from that of run 0, the recordings of both runs are compared.

use super::directions::Directions;
use super::functions::{LoopFunctions, Sizes};
use super::set_ups::{SetUp, SetUps};
use super::timeline::Contacts;
use crate::error::Result;
use crate::simulate::observer::run_observer::Guard;
use crate::simulate::problem::Problem;
use crate::simulate::record::key::{Key, MOST_NUMBERS};
use crate::trace::cache::Cache;
use crate::trace::function::KEPT_OPERATIONS;
use std::sync::{Arc, OnceLock};

/// The functions of all loops with the same structure.
struct KnownFunctions {
    sizes: Sizes,
    /// For each loop parameter, whether it varies.
    moving: Vec<bool>,
    /// The number of contacts that are held in their modes.
    held: usize,
    guards: Vec<Guard>,
    /// The key and the set-up of run 0 and of each compared run.
    runs: Vec<(Key, SetUp)>,
    /// The functions, recorded by the first loop that requires them. Other threads wait for this recording.
    made: OnceLock<Result<Arc<LoopFunctions>>>,
}

impl KnownFunctions {
    fn fits(&self, problem: &Problem, directions: &Directions, set_ups: &SetUps, contacts: &Contacts) -> bool {
        let alike =
            |((key, set_up), (run, other)): (&(Key, SetUp), &(usize, SetUp))| set_up == other && key.is_of(problem, *run, set_ups.common);
        self.sizes == Sizes::of(problem, directions)
            && (&self.moving, self.held, &self.guards) == (&directions.moving, contacts.held(), &contacts.guards)
            && self.runs.len() == set_ups.runs.len()
            && self.runs.iter().zip(&set_ups.runs).all(alike)
    }

    /// The number of values of desired motions that the keys store.
    fn numbers(&self) -> usize {
        self.runs.iter().map(|(key, _)| key.numbers()).sum()
    }

    fn operations(&self) -> usize {
        let made = self.made.get().and_then(|made| made.as_ref().ok());
        self.runs.iter().map(|(_, set_up)| set_up.ops.len()).sum::<usize>() + made.map_or(0, |functions| functions.operations())
    }
}

/// The recorded functions of the loops of one call, by structure. All loops have the same options.
#[derive(Default)]
pub struct FunctionStore(Cache<Arc<KnownFunctions>>);

impl FunctionStore {
    /// Return the functions of a loop. If the store has none of this structure, record them.
    pub fn functions(
        &self,
        problem: &Problem,
        directions: &Directions,
        set_ups: &SetUps,
        contacts: &Contacts,
    ) -> Result<Arc<LoopFunctions>> {
        let new = || {
            let runs = set_ups.runs.iter().map(|(run, set_up)| (Key::of(problem, *run, set_ups.common), set_up.clone()));
            Arc::new(KnownFunctions {
                sizes: Sizes::of(problem, directions),
                moving: directions.moving.clone(),
                held: contacts.held(),
                guards: contacts.guards.clone(),
                runs: runs.collect(),
                made: OnceLock::new(),
            })
        };
        let is = |known: &Arc<KnownFunctions>| known.fits(problem, directions, set_ups, contacts);
        let known = self.0.find_or_store(is, new, |all| {
            all.iter().map(|known| known.numbers()).sum::<usize>() <= MOST_NUMBERS
                && all.iter().map(|known| known.operations()).sum::<usize>() <= KEPT_OPERATIONS
        });
        let record = || LoopFunctions::of(problem, directions, set_ups, contacts).map(Arc::new);
        let made = known.made.get_or_init(record).clone();
        #[cfg(debug_assertions)]
        if let (Ok(made), Ok(again)) = (&made, record()) {
            assert!(again.same_operations(made), "two loops of one structure differ");
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::super::rows::KnownLoops;
    use super::super::{Parameter, Parameters, Rows, sensitivities, sensitivities_of_rows};
    use super::*;
    use crate::arm::Arm;
    use crate::dynamics::Model;
    use crate::error::Error;
    use crate::law::{Gain, LawSpec, PdGravitySpec};
    use crate::plant::{PlantSpec, RigidSpec, Wall};
    use crate::simulate::{Options, Times};
    use nalgebra::dvector;
    use std::sync::atomic::AtomicBool;

    fn model(gravity: f64) -> Model {
        Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -gravity]).expect("an arm"))
    }

    fn law(model: &Model, kp: f64, kd: f64) -> LawSpec {
        let (kp, kd) = (Gain::scalar("kp", 2, kp).expect("a gain"), Gain::scalar("kd", 2, kd).expect("a gain"));
        PdGravitySpec::new(model.clone(), dvector![0.3, 0.2], kp, kd).expect("a law").into()
    }

    /// Runs of 20 steps with two records. `plants` and `laws` have one entry, or one per run.
    fn problem<'a>(plants: Vec<&'a PlantSpec>, laws: Vec<&'a LawSpec>) -> Problem<'a> {
        let options = Options { times: Times::At(vec![0.01, 0.02]), monitors: false, ..Options::fixed(0.02, 1e-3) };
        let runs = plants.len().max(laws.len());
        let x0 = (0..4 * runs).map(|k| 0.1 + 0.01 * k as f64).collect();
        Problem { plants, laws, x0, forces: Vec::new(), force_frame: None, options, measures: None }
    }

    /// Each row has different gains. The structure of a row depends on whether `kp` is 1. The parameter is `kd`.
    #[test]
    fn rows_of_one_structure_share_functions_and_keep_their_bits() {
        let (model, rows) = (model(9.81), 9);
        let plant = PlantSpec::from(RigidSpec::new(model.clone()));
        let pair = |row: usize| {
            let (kp, kd) = (if row.is_multiple_of(3) { 1.0 } else { 5.0 + row as f64 }, 2.0 + 0.1 * row as f64);
            [law(&model, kp, kd), law(&model, kp, kd + 1e-3)]
        };
        let laws: Vec<LawSpec> = (0..rows).flat_map(pair).collect();
        let batch = problem(vec![&plant], laws.iter().collect());
        let parameters: Vec<Vec<Parameter>> = vec![vec![vec![(1, 1e3)]]; rows];
        let divided = Rows::of(&batch, &parameters, &[1]).expect("rows");
        let (known, mut found) = (KnownLoops::default(), Vec::new());
        for row in 0..rows {
            found.push(known.prepare(&divided, row).expect("it has derivatives").functions);
        }
        for (row, functions) in found.iter().enumerate() {
            let first = if row.is_multiple_of(3) { 0 } else { 1 };
            assert!(Arc::ptr_eq(functions, &found[first]), "row {row} has the structure of row {first}");
        }
        assert!(!Arc::ptr_eq(&found[0], &found[1]), "a gain of one is structure");
        let of_rows = |threads: usize| sensitivities_of_rows(&divided, threads, &mut || false).expect("it has derivatives");
        let expected = of_rows(1);
        assert_eq!(of_rows(3), expected);
        for row in 0..rows {
            let mut alone = problem(vec![&plant], laws[2 * row..2 * row + 2].iter().collect());
            alone.x0 = batch.x0[8 * row..8 * row + 8].to_vec();
            let all = Parameters { all: &parameters[row], sizes: &[1], shared: &[] };
            let own = sensitivities(&alone, all, &AtomicBool::new(false)).expect("it has derivatives");
            for (series, own) in expected.iter().zip(&own) {
                assert!(own.iter().any(|&rate| rate != 0.0));
                assert_eq!(&series[row * own.len()..(row + 1) * own.len()], own.as_slice(), "row {row}");
            }
        }
    }

    #[test]
    fn an_invalid_problem_is_an_error() {
        let model = model(9.81);
        let (plant, law) = (PlantSpec::from(RigidSpec::new(model.clone())), law(&model, 5.0, 2.0));
        let refused = |change: fn(&mut Options)| {
            let mut invalid = problem(vec![&plant], vec![&law]);
            change(&mut invalid.options);
            let all = Parameters { all: &[], sizes: &[], shared: &[] };
            sensitivities(&invalid, all, &AtomicBool::new(false)).expect_err("it is invalid").to_string()
        };
        assert!(refused(|options| options.monitors = true).starts_with("monitors have no derivatives"));
        assert!(refused(|options| options.times = Times::Every(1)).starts_with("times are not given"));
        assert_eq!(refused(|options| options.tau_max = Some(vec![5.0])), "tau_max has the wrong length: expected 2, got 1");
    }

    /// The stiffness of a wall is an input of the recording, and gravity is a constant. Both are in the key.
    #[test]
    fn a_constant_of_the_recording_is_refused_in_shared_functions_too() {
        let plant = |gravity: f64, stiffness: f64| {
            let wall = Wall::new(1, [0.8, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness, 1.0).expect("a wall");
            PlantSpec::from(RigidSpec { wall: Some(wall), ..RigidSpec::new(model(gravity)) })
        };
        let law = law(&model(9.81), 5.0, 2.0);
        let rates = |other: PlantSpec| {
            let first = plant(9.81, 100.0);
            // Rows with separate copies of the same plants are separate loops.
            let plants = [first.clone(), other.clone(), first, other];
            let batch = problem(plants.iter().collect(), vec![&law]);
            let parameters: Vec<Vec<Parameter>> = vec![vec![vec![(1, 1e3)]]; 2];
            let rows = Rows::of(&batch, &parameters, &[1])?;
            let known = KnownLoops::default();
            known.prepare(&rows, 0).map(drop).and_then(|()| known.prepare(&rows, 1).map(drop))?;
            sensitivities_of_rows(&rows, 2, &mut || false)
        };
        assert!(rates(plant(9.81, 100.001)).is_ok());
        let refused = rates(plant(9.82, 100.0));
        assert!(matches!(refused, Err(Error::Input { problem, .. }) if problem.contains("is a constant of the loop's program")));
    }
}
