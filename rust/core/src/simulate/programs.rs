//! Runs as programs: the structures of their loops, and groups of rows.
//!
//! Rows are grouped by structure, so that the program of a row, and with it its bits, depends on that row alone. A row whose angles exceed
//! the range of the programs' sines is repeated directly.

use super::fixed_steps::Faults;
use super::general::{General, sampler, start, world};
use super::key::Common;
use super::log::Block;
use super::monitors;
use super::problem::{Division, Ended, Fixed, Problem};
use super::program_loop::ProgramLoop;
use super::program_step::{ProgramStep, tabulate};
use super::recorded::{self, Recorded, SeenLoop};
use super::redo;
use super::schedule::Within;
use super::sink::Sink;
use crate::law::Route;
use crate::scalar::{Array8, Real};
use crate::trace::Engine;
use std::sync::{Arc, Mutex, PoisonError};

/// The number of steps below which a direct run is faster than making a program.
const SHORT: usize = 20;

/// Runs side by side.
pub type Lanes = Array8;

/// The structures of the runs of a problem, recorded as they appear.
pub struct Structures {
    /// The structures so far.
    seen: Mutex<Vec<Arc<SeenLoop>>>,
    /// The numbers of the set-up, if all runs have the same.
    shared: Option<Vec<f64>>,
    /// The exogenous inputs of all steps, if all runs of a batch share them.
    table: Option<Vec<f64>>,
    common: Common,
    engine: Engine,
}

impl Structures {
    /// The structures of a problem whose loops run as programs; `None` for other problems. `lanes` selects programs for runs side by side.
    pub fn of(problem: &Problem, division: &Division, lanes: bool) -> Option<Self> {
        let Division::Fixed(fixed) = division else { return None };
        // All lanes of a group would share one random jitter.
        let late = problem.options.sampling.as_ref().is_some_and(|sampling| sampling.jitter != 0.0);
        // The routes of a law that decides ranks differ in rounding. Other laws have the same bits when they run directly.
        let short = !lanes && fixed.schedule.steps < SHORT && problem.law(0).route() != Route::Guarded;
        if short || late || !recorded::is_recordable(problem) {
            return None;
        }
        let common = Common { notes: problem.notes_in_programs().then(|| monitors::names(problem).len()), ..Common::of(problem, lanes) };
        let parameters = recorded::loop_parameters(problem, 0, common);
        let seen = recorded::of_run(problem, 0, common, &parameters);
        let first = seen.recorded.clone()?;
        let engine = first.engine();
        let world = world(problem, 1, |_| 0);
        let table = if lanes { tabulate(&first, &world, fixed.schedule.steps, fixed.schedule.dt) } else { None };
        let same = problem.plants.len() == 1 && problem.laws.len() == 1;
        Some(Structures { seen: Mutex::new(vec![seen]), shared: same.then_some(parameters.values), table, common, engine })
    }

    /// How the programs run.
    pub fn engine(&self) -> Engine {
        self.engine
    }

    /// The structure of run `run`, and the numbers of its set-up; `None` where its code branches on data.
    fn of_run(&self, problem: &Problem, run: usize) -> Option<(Arc<Recorded>, Vec<f64>)> {
        let seen = || self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(values) = &self.shared {
            return seen()[0].recorded.clone().map(|recorded| (recorded, values.clone()));
        }
        let parameters = recorded::loop_parameters(problem, run, self.common);
        let mut seen = seen();
        let known = match seen.iter().find(|known| known.fits(problem, run, self.common, &parameters)) {
            Some(known) => known.clone(),
            None => {
                seen.push(recorded::of_run(problem, run, self.common, &parameters));
                seen[seen.len() - 1].clone()
            }
        };
        known.recorded.clone().map(|recorded| (recorded, parameters.values))
    }
}

/// The records of some lanes of a group.
struct Chosen<'a> {
    sink: &'a mut dyn Sink,
    /// The lane of the group for each lane; `None` without records.
    lanes: Vec<Option<usize>>,
}

impl Sink for Chosen<'_> {
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]) {
        if let Some(lane) = self.lanes[lane] {
            self.sink.record(i, lane, t, x, tau);
        }
    }

    fn block(&mut self, block: &Block) {
        self.sink.block(&block.of_lanes(|lane| self.lanes[lane]));
    }

    fn take(&mut self, lane: usize, kept: &[f64], time: &dyn Fn(usize) -> f64) {
        if let Some(lane) = self.lanes[lane] {
            self.sink.take(lane, kept, time);
        }
    }
}

/// The runs of a group, `S::LANES` from its first one on, by fixed steps.
pub fn run<S: Real>(structures: &Structures, group: General, fixed: &Fixed) -> Ended {
    let General { problem, division, first, stop, sink, .. } = group;
    let last = problem.runs() - 1;
    let at = |lane: usize| (first + lane).min(last);
    let rows: Vec<Option<(Arc<Recorded>, Vec<f64>)>> = (0..S::LANES).map(|lane| structures.of_run(problem, at(lane))).collect();
    let mut faults = Faults { at: vec![f64::INFINITY; S::LANES], interrupted: false, steps: 0 };
    let mut left: Vec<usize> = (0..S::LANES).collect();
    while let Some(&lead) = left.first() {
        let Some((recorded, own)) = &rows[lead] else {
            left.remove(0);
            direct(General { problem, division, first, stop, sink: &mut *sink, observer: None, rates: None }, at(lead), lead, &mut faults);
            continue;
        };
        let same = |lane: usize| rows[lane].as_ref().filter(|(other, _)| Arc::ptr_eq(other, recorded));
        let mut lanes = vec![None; S::LANES];
        left.iter().filter(|&&lane| same(lane).is_some()).for_each(|&lane| lanes[lane] = Some(lane));
        // Lanes with other structures run as the first one: their motions may have another number.
        let row = |lane: usize| at(if same(lane).is_some() { lane } else { lead });
        let given = |lane: usize| same(lane).map_or(own.as_slice(), |(_, values)| values.as_slice());
        let held = problem.options.sampling.is_some();
        let mut closed = ProgramLoop::<S>::new(
            recorded.clone(),
            world(problem, S::LANES, row),
            held,
            sampler(problem, row),
            structures.table.as_deref(),
            given,
        );
        if recorded.layout.guards > 0 {
            closed.redo_by((0..S::LANES).map(|lane| redo::direct(problem, row(lane), recorded.layout.norms > 0)).collect());
        }
        let method = ProgramStep::new(&closed);
        let mut chosen = Chosen { sink: &mut *sink, lanes: lanes.clone() };
        let group = General { problem, division, first, stop, sink: &mut chosen, observer: None, rates: None };
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
            x.append(&mut kept(problem, structures.common, row));
        }
        let Ended::Fixed(found) = group.fixed(within.as_ref().unwrap_or(fixed), &mut closed, x, method) else {
            unreachable!("steps are fixed")
        };
        faults.interrupted |= found.interrupted;
        faults.steps = found.steps;
        for lane in lanes.into_iter().flatten() {
            faults.at[lane] = found.at[lane];
            if closed.strayed(lane) && !faults.interrupted {
                direct(
                    General { problem, division, first, stop, sink: &mut *sink, observer: None, rates: None },
                    at(lane),
                    lane,
                    &mut faults,
                );
            }
        }
        left.retain(|&lane| same(lane).is_none());
        if faults.interrupted {
            break;
        }
    }
    Ended::Fixed(faults)
}

/// The sums of the runs `run(lane)` before their first record.
fn kept<S: Real>(problem: &Problem, common: Common, run: impl Fn(usize) -> usize) -> Vec<S> {
    let lanes: Vec<Vec<f64>> =
        (0..S::LANES).map(|lane| common.plan(problem, run(lane)).map_or_else(Vec::new, |plan| plan.start())).collect();
    (0..lanes[0].len()).map(|k| S::from_lanes(|lane| lanes[lane][k])).collect()
}

/// Run `run`, lane `lane` of a group, without a program.
fn direct(group: General, run: usize, lane: usize, faults: &mut Faults) {
    let General { problem, division, stop, sink, .. } = group;
    let mut chosen = Chosen { sink, lanes: vec![Some(lane)] };
    let alone = General { problem, division, first: run, stop, sink: &mut chosen, observer: None, rates: None };
    if let Ended::Fixed(found) = alone.run_single() {
        faults.at[lane] = found.at[0];
        faults.interrupted |= found.interrupted;
        faults.steps = found.steps;
    }
}
