//! Structures of loops. Runs share a recording if they have the same structure. Their plants and laws have the same shape. The loop
//! parameters with the values 0, 1 and -1 are at the same positions. If equal loop parameters of one run share a slot, they are also equal in
//! the other runs.

use super::key::{Common, Key, MOST_NUMBERS};
use super::metrics::Sums;
use super::records::Notes;
use super::slots::RatesSlots;
use crate::scalar::Real;
use crate::simulate::assembly::assemble;
use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::problem::Problem;
use crate::simulate::world::Exogenous;
use crate::trace::cache::Cache;
use crate::trace::label::Label;
use crate::trace::{Sym, sym};
use std::sync::Arc;

/// The loop parameters of a run, and the indices of their operations in the recording. Runs with different indices have different
/// structures.
pub struct LoopParameters {
    pub values: Vec<f64>,
    pub structure: Vec<u32>,
    pub labels: Vec<Label>,
}

/// Return the loop parameters of run `run`.
pub fn loop_parameters(problem: &Problem, run: usize, common: Common) -> LoopParameters {
    sym::begin();
    drop(set_up(problem, run, common));
    let recording = sym::finish();
    LoopParameters { values: recording.values, structure: recording.structure, labels: recording.labels }
}

/// The metrics and records that the programs of a loop compute in addition to steps.
pub struct MetricsAndRecords<'a> {
    pub sums: Option<Sums<'a>>,
    pub notes: Option<Notes<'a>>,
}

/// Return the loop of run `run`, and its metrics and records.
pub fn set_up<'a>(problem: &Problem<'a>, run: usize, common: Common) -> (ClosedLoop<'a>, MetricsAndRecords<'a>) {
    let closed = assemble(problem, run, common.monitored.storage);
    let sums = common.plan(problem, run).map(|plan| Sums::new(problem, run, &plan, common.monitored.storage));
    let notes = common.notes.map(|monitors| Notes::new(problem, run, monitors, common.monitored));
    (closed, MetricsAndRecords { sums, notes })
}

/// The recording of loops with one structure, as an entry of a cache. `tag` distinguishes several recordings of one loop.
pub struct Seen<R, T> {
    key: Key,
    tag: T,
    /// For each loop parameter, in the order of recording: the index of its operation in the recording. Loops of one structure have equal
    /// lists.
    structure: Vec<u32>,
    pub recorded: Arc<R>,
}

impl<R, T: PartialEq> Seen<R, T> {
    /// Whether run `run` of a problem has this structure. `parameters` are its loop parameters.
    pub fn fits(&self, problem: &Problem, run: usize, common: Common, parameters: &LoopParameters) -> bool {
        self.structure == parameters.structure && self.key.is_of(problem, run, common)
    }

    /// Return the structure of run `run` if it is stored.
    pub fn known(
        cache: &Cache<Arc<Self>>,
        (problem, run, common): (&Problem, usize, Common),
        parameters: &LoopParameters,
        tag: &T,
    ) -> Option<Arc<Self>> {
        cache.find(|seen| seen.tag == *tag && seen.fits(problem, run, common, parameters))
    }

    /// Return the stored structure of run `run`, or record a new one.
    pub fn of_run(
        cache: &Cache<Arc<Self>>,
        of: (&Problem, usize, Common),
        parameters: &LoopParameters,
        tag: T,
        record: impl FnOnce() -> R,
    ) -> Arc<Self> {
        if let Some(seen) = Self::known(cache, of, parameters, &tag) {
            return seen;
        }
        let (problem, run, common) = of;
        let (key, structure) = (Key::of(problem, run, common), parameters.structure.clone());
        let seen = Arc::new(Seen { key, tag, structure, recorded: Arc::new(record()) });
        if seen.key.numbers() <= MOST_NUMBERS {
            cache.store(seen.clone(), |all| all.iter().map(|seen| seen.key.numbers()).sum::<usize>() <= MOST_NUMBERS);
        }
        seen
    }
}

/// Make the modes of contacts and joints inputs of a recorded loop.
pub fn modes_as_inputs(closed: &mut ClosedLoop, slots: &RatesSlots) {
    closed.hold_modes(&inputs(slots.contacts.count));
    closed.hold_sides(&inputs(slots.sides.count));
}

/// Declare `count` new inputs of a program.
pub fn inputs(count: usize) -> Vec<Sym> {
    (0..count).map(|_| sym::input()).collect()
}

/// Declare new inputs for the exogenous input at one instant: the desired motions, then the wrench.
pub fn instant(sizes: [usize; 2]) -> Exogenous<Sym> {
    instant_of(&inputs(sizes[0] + sizes[1]), sizes)
}

/// Return the exogenous input whose numbers are `values`: the desired motions, then the wrench.
pub fn instant_of(values: &[Sym], [desired, wrench]: [usize; 2]) -> Exogenous<Sym> {
    let mut instant = Exogenous { t: 0.0, desired: values[..desired].to_vec(), wrench: [Sym::zero(); 6] };
    instant.wrench[..wrench].copy_from_slice(&values[desired..]);
    instant
}

/// Return the indices of the operations that compute `values`.
pub fn entries(values: Vec<Sym>) -> Vec<u32> {
    values.into_iter().map(Sym::index).collect()
}
