//! Runs of loops as programs, which are recorded and compiled loops. Two runs have the same structure if the recordings of their loops have
//! the same operations. This file finds the structure of each run, and groups runs with the same structure.
//!
//! All lanes of a program compute runs of one structure. So the program of a run, and the bits of its results, do not depend on the other
//! runs. A run whose angles exceed the range of the sines of machine code is repeated by the interpreter, which has no such range.

use super::division::{Division, Ended, Fixed};
use super::run_group::RunGroup;
use crate::scalar::{Array8, Real};
use crate::simulate::assembly::{samples, start, world};
use crate::simulate::fixed::schedule::Within;
use crate::simulate::fixed::step_loop::StepLoop;
use crate::simulate::fixed::step_method::{StepMethod, tabulate};
use crate::simulate::fixed::steps::Faults;
use crate::simulate::loops::log::Block;
use crate::simulate::loops::sink::Sink;
use crate::simulate::monitors;
use crate::simulate::problem::Problem;
use crate::simulate::record::key::Common;
use crate::simulate::record::step::{self, Recorded, SeenLoop};
use crate::simulate::record::structure;
use crate::simulate::sampled::frame_controller::ControllerSlots;
use crate::trace::{Engine, engine};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The number type of a group of runs.
pub type Lanes = Array8;

/// The number of evaluations of the rates in a batch from which the program of a large step repays its compilation.
const LONG: usize = 1 << 17;

/// The structures of the runs of a problem. Runs with one structure use one program. A structure is recorded when it first occurs.
pub struct Structures {
    /// The structures recorded so far.
    seen: Mutex<Vec<Arc<SeenLoop>>>,
    /// The loop parameters, if they are equal in all runs.
    shared: Option<Vec<f64>>,
    /// The exogenous inputs of all steps, if all runs of a batch share them.
    table: Option<Vec<f64>>,
    common: Common,
    engine: Engine,
    /// The number of runs that the interpreter repeated.
    repeated: AtomicUsize,
}

impl Structures {
    /// Create the list with the structure of run 0. The result is `None` if programs of whole steps cannot compute the runs of the problem.
    /// `batch`: whether a program may compute several runs, one per lane.
    pub fn of(problem: &Problem, division: &Division, batch: bool) -> Option<Self> {
        let Division::Fixed(fixed) = division else { return None };
        if !step::is_recordable(problem) {
            return None;
        }
        // A program requires the same sample times in all lanes. With random jitter, each run has different sample times.
        let lanes = batch && problem.options.sampling.as_ref().is_none_or(|sampling| sampling.jitter == 0.0);
        let notes = problem.notes_in_programs().then(|| monitors::names(problem).len());
        let evaluations = problem.options.method.evaluations_per_step().unwrap_or(1) as usize * fixed.schedule.steps * problem.runs();
        let common = Common { notes, long: lanes && evaluations >= LONG, ..Common::of(problem, lanes) };
        let parameters = structure::loop_parameters(problem, 0, common);
        let seen = step::of_run(problem, 0, common, &parameters);
        let first = &seen.recorded;
        let engine = if lanes || first.programs.count(evaluations) || first.programs.repays() { engine() } else { Engine::Interpreter };
        let table = || tabulate(&first.slots, &first.programs_for(engine), &world(problem, 1, |_| 0), &fixed.schedule);
        let table = if lanes { table() } else { None };
        let same = problem.plants.len() == 1 && problem.laws.len() == 1;
        Some(Structures {
            shared: same.then_some(parameters.values),
            table,
            seen: Mutex::new(vec![seen]),
            common,
            engine,
            repeated: AtomicUsize::new(0),
        })
    }

    /// The number of runs that one program computes.
    pub fn lanes(&self) -> usize {
        if self.common.lanes { Lanes::LANES } else { 1 }
    }

    /// The engine that computed `runs` runs. If some of them were repeated by the interpreter, it is the engine of the others.
    pub fn engine(&self, runs: usize) -> Engine {
        if self.repeated.load(Ordering::Relaxed) < runs { self.engine } else { Engine::Interpreter }
    }

    /// Return the structure and the loop parameters of run `run`.
    fn of_run(&self, problem: &Problem, run: usize) -> (Arc<Recorded>, Vec<f64>) {
        let seen = || self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(values) = &self.shared {
            return (seen()[0].recorded.clone(), values.clone());
        }
        let parameters = structure::loop_parameters(problem, run, self.common);
        let mut seen = seen();
        let known = match seen.iter().find(|known| known.fits(problem, run, self.common, &parameters)) {
            Some(known) => known.clone(),
            None => {
                seen.push(step::of_run(problem, run, self.common, &parameters));
                seen[seen.len() - 1].clone()
            }
        };
        (known.recorded.clone(), parameters.values)
    }
}

/// Passes the records of some lanes of a group to the sink.
struct SelectedLanes<'a> {
    sink: &'a mut dyn Sink,
    /// For each lane, the lane of the group, or `None` to ignore the records.
    lanes: Vec<Option<usize>>,
}

impl Sink for SelectedLanes<'_> {
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]) {
        if let Some(lane) = self.lanes[lane] {
            self.sink.record(i, lane, t, x, tau);
        }
    }

    fn block(&mut self, block: &Block) {
        self.sink.block(&block.of_lanes(|lane| self.lanes[lane]));
    }

    fn take(&mut self, lane: usize, stored: &[f64], time: &dyn Fn(usize) -> f64) {
        if let Some(lane) = self.lanes[lane] {
            self.sink.take(lane, stored, time);
        }
    }
}

/// Run a group of `S::LANES` runs with fixed steps.
pub fn run<S: Real>(structures: &Structures, group: RunGroup, fixed: &Fixed) -> Ended {
    let RunGroup { problem, division, first, stop, sink, .. } = group;
    let last = problem.runs() - 1;
    let at = |lane: usize| (first + lane).min(last);
    let rows: Vec<(Arc<Recorded>, Vec<f64>)> = (0..S::LANES).map(|lane| structures.of_run(problem, at(lane))).collect();
    let mut faults = Faults { at: vec![f64::INFINITY; S::LANES], interrupted: false, steps: 0 };
    let mut left: Vec<usize> = (0..S::LANES).collect();
    while let Some(&lead) = left.first() {
        let (recorded, own) = &rows[lead];
        let same = |lane: usize| Some(&rows[lane]).filter(|(other, _)| Arc::ptr_eq(other, recorded));
        let mut lanes = vec![None; S::LANES];
        left.iter().filter(|&&lane| same(lane).is_some()).for_each(|&lane| lanes[lane] = Some(lane));
        // A lane whose run has another structure computes the run of lane `lead` instead, because the motions of its run could have another
        // size. The results of this lane are ignored.
        let row = |lane: usize| at(if same(lane).is_some() { lane } else { lead });
        let given = |lane: usize| same(lane).map_or(own.as_slice(), |(_, values)| values.as_slice());
        let mut closed = loop_of::<S>(problem, (recorded, structures.engine), row, structures.table.as_deref(), given);
        let method = StepMethod::new(&closed);
        let mut chosen = SelectedLanes { sink: &mut *sink, lanes: lanes.clone() };
        let group = RunGroup { problem, division, first, stop, sink: &mut chosen, observer: None };
        let within = match structures.common {
            Common { sums: true, .. } => Some(fixed.schedule.summing_up()),
            Common { notes: Some(_), .. } => fixed.schedule.noting(),
            _ => None,
        };
        let within = within.map(|schedule| Fixed { schedule, hold: fixed.hold });
        if let Some(Within::Notes { every, .. }) = within.as_ref().map(|fixed| fixed.schedule.within) {
            closed.note_every(every);
        }
        let mut x = start::<S>(problem, row);
        if structures.common.sums {
            x.append(&mut initial_metrics(problem, structures.common, row));
        }
        let Ended::Fixed(found) = group.fixed(within.as_ref().unwrap_or(fixed), &mut closed, x, method) else {
            unreachable!("steps are fixed")
        };
        faults.interrupted |= found.interrupted;
        faults.steps = found.steps;
        for lane in lanes.into_iter().flatten() {
            faults.at[lane] = found.at[lane];
            if closed.strayed(lane) && structures.engine == Engine::Machine && !faults.interrupted {
                let group = RunGroup { problem, division, first, stop, sink: &mut *sink, observer: None };
                interpreted(structures, group, fixed, (at(lane), lane), &mut faults);
            }
        }
        left.retain(|&lane| same(lane).is_none());
        if faults.interrupted {
            break;
        }
    }
    Ended::Fixed(faults)
}

/// Return the stored numbers of the metrics before the first record, for the runs `run(lane)`.
fn initial_metrics<S: Real>(problem: &Problem, common: Common, run: impl Fn(usize) -> usize) -> Vec<S> {
    let lanes: Vec<Vec<f64>> =
        (0..S::LANES).map(|lane| common.plan(problem, run(lane)).map_or_else(Vec::new, |plan| plan.start())).collect();
    (0..lanes[0].len()).map(|k| S::from_lanes(|lane| lanes[lane][k])).collect()
}

/// Create the loop of a recording, for the runs `row(lane)` with the loop parameters `given(lane)`. `table` has the exogenous inputs of all steps.
pub fn loop_of<'a, 'b, S: Real>(
    problem: &'a Problem<'a>,
    (recorded, engine): (&Arc<Recorded>, Engine),
    row: impl Fn(usize) -> usize + Copy,
    table: Option<&'a [f64]>,
    given: impl Fn(usize) -> &'b [f64],
) -> StepLoop<'a, S> {
    let samples = |slots: &ControllerSlots, lanes: usize| samples(problem, *slots, [S::LANES, lanes], row);
    StepLoop::new((recorded.clone(), engine), world(problem, S::LANES, row), samples, table, given)
}

/// Compute run `run` in lane `lane` of a group with the interpreter of its recording.
fn interpreted(structures: &Structures, group: RunGroup, fixed: &Fixed, (run, lane): (usize, usize), faults: &mut Faults) {
    let RunGroup { problem, division, stop, sink, .. } = group;
    let common = Common { lanes: false, long: false, sums: false, notes: None, ..structures.common };
    let parameters = structure::loop_parameters(problem, run, common);
    let recorded = step::of_run(problem, run, common, &parameters).recorded.clone();
    let mut closed = loop_of::<f64>(problem, (&recorded, Engine::Interpreter), |_| run, None, |_| &parameters.values);
    let mut chosen = SelectedLanes { sink, lanes: vec![Some(lane)] };
    let alone = RunGroup { problem, division, first: run, stop, sink: &mut chosen, observer: None };
    let method = StepMethod::new(&closed);
    structures.repeated.fetch_add(1, Ordering::Relaxed);
    replace(faults, lane, alone.fixed(fixed, &mut closed, start::<f64>(problem, |_| run), method));
}

/// Replace the fault of lane `lane` by the fault of the run that was computed instead.
fn replace(faults: &mut Faults, lane: usize, ended: Ended) {
    if let Ended::Fixed(found) = ended {
        faults.at[lane] = found.at[0];
        faults.interrupted |= found.interrupted;
        faults.steps = found.steps;
    }
}
