//! Programs (recorded and compiled computations) of the state rates of a closed loop and of their derivatives. Adaptive and implicit
//! methods and steppers use them, and loops in which joints stick and slip between fixed steps.
//!
//! The rates are a program for one run. The derivatives are programs for lanes, with one direction per lane. A first program computes the
//! rates and all values that the derivatives read. A second program computes the derivatives of the rates along one direction per lane, in
//! several passes over all directions. The directions of the law's states have a separate program, because few operations depend on these
//! states, and their number may be large.

use super::assembly::assemble;
use super::attempt_programs::AttemptProgram;
use super::closed_loop::ClosedLoop;
use super::force::Force;
use super::key::Common;
use super::layout::Slots;
use super::loop_programs::Watch;
use super::problem::Problem;
use super::recorded::{self, Seen, inputs, instant, modes_as_inputs};
use super::world::Exogenous;
use crate::integrate::System;
use crate::motion::Motion;
use crate::plant::PlantSpec;
use crate::trace::cache::Cache;
use crate::trace::differentiate::Differentiation;
use crate::trace::tape::Op;
use crate::trace::{Cut, Part, Program, Scratch, SlotTable, Sym, engine, form, segments, sym};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// The programs of the derivatives of the rates, for lanes.
pub struct Derivatives {
    /// Computes the rates, and the values that the derivatives read.
    pub values: Program,
    /// Computes the derivatives along the plant's states and the exogenous input.
    pub plant: Program,
    /// Computes the derivatives along the law's states.
    pub law: Option<Program>,
    /// The first slot of the direction along which the program `plant` differentiates.
    pub along_plant: usize,
    /// The first slot of the direction along which the program `law` differentiates.
    pub along_law: usize,
    /// Whether the program `plant` also differentiates along the exogenous input. Then the components of the exogenous input follow the
    /// plant's states in the direction at `along_plant`.
    pub moves: bool,
    pub rates: usize,
    pub derivatives: usize,
    pub reach: usize,
}

impl Derivatives {
    /// The number of slots of a frame for all these programs.
    pub fn slots(&self) -> usize {
        self.all().map(Program::slots).max().unwrap_or(0)
    }

    pub fn all(&self) -> impl Iterator<Item = &Program> {
        [&self.values, &self.plant].into_iter().chain(&self.law)
    }
}

/// The program of functions whose changes of sign end a mode. It shares the frame of the rates.
pub struct GuardProgram {
    pub program: Program,
    /// The slot of the first function.
    pub first: usize,
}

/// The programs of all loops with the same structure.
pub struct RatesPrograms {
    pub rates: Program,
    /// The depth and the push of each contact, if the modes of contacts are inputs.
    pub contacts: Option<GuardProgram>,
    /// The margins of the joints that stick and slip.
    pub margins: Option<GuardProgram>,
    /// The program of a whole attempt, for small loops with an adaptive explicit method.
    pub attempt: Option<AttemptProgram>,
    pub derivatives: Option<Derivatives>,
}

/// The derivatives that a method requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequiredDerivatives {
    /// No derivatives, only the rates.
    Rates,
    /// Derivatives along the states.
    States,
    /// Derivatives along the states and with respect to time.
    Time,
}

impl RequiredDerivatives {
    fn of(problem: &Problem, run: usize) -> Self {
        let moves = |force: &&Force| matches!(force, Force::Signal(_));
        let still = problem.options.sampling.is_some() || problem.law(run).motions().iter().all(|motion| matches!(motion, Motion::Hold(_)));
        let method = problem.options.method;
        match (method.is_implicit(), method.is_rosenbrock()) {
            (false, _) => RequiredDerivatives::Rates,
            (true, true) if !still || problem.forces.iter().any(moves) => RequiredDerivatives::Time,
            (true, _) => RequiredDerivatives::States,
        }
    }
}

/// The recorded rates of all loops with the same structure.
pub struct RecordedRates {
    pub slots: Slots,
    pub programs: RatesPrograms,
}

/// A stored recording of rates, which later runs may use. The tag states whether the input is held, and which derivatives the method
/// requires.
type SeenRates = Seen<RecordedRates, (bool, RequiredDerivatives)>;

static KNOWN: Cache<Arc<SeenRates>> = Cache::new();

/// Whether the rates of a problem's loops can be recorded.
pub fn is_recordable(problem: &Problem) -> bool {
    let method = problem.options.method;
    // With an implicit method of fixed steps, only plants without a wall have programs.
    let free = |plant: &PlantSpec| method.is_adaptive() || !method.is_implicit() || plant.wall().is_none();
    problem.plants.iter().all(|plant| free(plant)) && problem.laws.iter().all(|law| law.route().is_recordable())
}

/// The number of contact modes that are inputs of the rates: two for each contact if the method is adaptive. An adaptive method keeps every
/// contact in its mode within a step. With fixed steps, the modes follow the state.
fn contact_modes(problem: &Problem, run: usize) -> usize {
    if problem.options.method.is_adaptive() { 2 * problem.plant(run).contacts() } else { 0 }
}

/// The rates of a run as programs, and the loop parameters of the run.
pub type RatesOfRun = (Arc<RecordedRates>, Vec<f64>);

/// Record the rates of the one run of a problem twice: with the law's output as the input, and with a held input. The first result is
/// `None` for a sampled law.
pub fn record_both(problem: &Problem) -> [Option<RatesOfRun>; 2] {
    let sampled = problem.options.sampling.is_some();
    [false, true].map(|held| {
        if is_recordable(problem) && (held || !sampled) { of_run(problem, 0, Common::of_functions(problem), held) } else { None }
    })
}

/// Return the rates of run `run`. `held`: whether the input is held. The result is `None` if the code branches on data.
fn of_run(problem: &Problem, run: usize, common: Common, held: bool) -> Option<RatesOfRun> {
    let (parameters, wanted) = (recorded::loop_parameters(problem, run, common), RequiredDerivatives::of(problem, run));
    let record = || record(problem, run, (common, held, wanted), true, &mut |_, _, _, _, _| ());
    let seen = Seen::of_run(&KNOWN, (problem, run, common), &parameters, (held, wanted), record);
    seen.recorded.clone().map(|recorded| (recorded, parameters.values))
}

/// Return the rates of [`of_run`] if they are already recorded, otherwise `None`.
fn known(problem: &Problem, run: usize, common: Common, held: bool) -> Option<RatesOfRun> {
    let (parameters, tag) = (recorded::loop_parameters(problem, run, common), (held, RequiredDerivatives::of(problem, run)));
    let seen = Seen::known(&KNOWN, (problem, run, common), &parameters, &tag)?;
    seen.recorded.clone().map(|recorded| (recorded, parameters.values))
}

/// Record the rates of run `run` for a listing, with the derivatives that the method requires. If `folds` is false, the operations are not
/// simplified, and no derivatives are recorded.
pub fn record_watched(problem: &Problem, run: usize, common: Common, folds: bool, watch: Watch) -> Option<RecordedRates> {
    let (held, wanted) =
        (problem.options.sampling.is_some(), if folds { RequiredDerivatives::of(problem, run) } else { RequiredDerivatives::Rates });
    record(problem, run, (common, held, wanted), folds, watch)
}

fn record(
    problem: &Problem,
    run: usize,
    (common, held, wanted): (Common, bool, RequiredDerivatives),
    folds: bool,
    watch: Watch,
) -> Option<RecordedRates> {
    sym::begin_that(folds);
    let mut closed: ClosedLoop<Sym> = assemble(problem, run, common.monitored.storage);
    let given = sym::end_set_up();
    let (plant, law) = (problem.plant(run).states(), problem.law(run).initial_state().len());
    let sides = problem.plant(run).sticking_joints();
    let slots = Slots {
        given,
        desired: closed.instant().desired.len(),
        wrench: if problem.forces.is_empty() { 0 } else { 6 },
        plant,
        law,
        quadratures: closed.size() - plant - law,
        inputs: closed.tau.len(),
        answer: closed.law_rate().len(),
        modes: contact_modes(problem, run) + sides,
        sides,
        speeds: closed.first_speed(),
    };
    let (u, x) = arguments(&mut closed, &slots, held);
    let mut dx = x.clone();
    closed.rhs(&u, &x, &mut dx);
    drop(closed);
    let recording = sym::finish();
    if recording.failed {
        return None;
    }
    let rates: Vec<u32> = dx.into_iter().map(Sym::index).collect();
    let mut programs = make(recording.ops, &rates, &slots, wanted, watch);
    programs.attempt = AttemptProgram::of(problem, run, common, held, (&slots, programs.rates.operations()));
    let contacts = |closed: &mut ClosedLoop<Sym>, _: &Exogenous<Sym>, x: &[Sym]| {
        closed.turn_to(x);
        (0..slots.contact_modes() / 2).flat_map(|i| closed.contact(i, x)).collect()
    };
    let of_run = (problem, run, common, held);
    let mut free = programs.rates.slots();
    if slots.contact_modes() > 0 {
        programs.contacts = guards(of_run, (&slots, free), contacts);
        free = programs.contacts.as_ref().map_or(free, |contacts| contacts.program.slots());
    }
    if slots.sides > 0 {
        programs.margins = guards(of_run, (&slots, free), |closed, u, x| closed.margins_under(u, x));
    }
    Some(RecordedRates { slots, programs })
}

/// Record functions `of` the loop whose changes of sign end a mode. The program has the inputs of the rates. Its results are in the slots
/// from `first` on, which no program before it uses.
fn guards(
    (problem, run, common, held): (&Problem, usize, Common, bool),
    (slots, first): (&Slots, usize),
    of: impl FnOnce(&mut ClosedLoop<Sym>, &Exogenous<Sym>, &[Sym]) -> Vec<Sym>,
) -> Option<GuardProgram> {
    sym::begin();
    let mut closed: ClosedLoop<Sym> = assemble(problem, run, common.monitored.storage);
    sym::end_set_up();
    let (u, x) = arguments(&mut closed, slots, held);
    let numbers: Vec<u32> = of(&mut closed, &u, &x).into_iter().map(Sym::index).collect();
    drop(closed);
    let recording = sym::finish();
    if recording.failed {
        return None;
    }
    let part = Part { ops: &recording.ops, start: 0, outputs: &to(first, &numbers), places: &SlotTable::default() };
    let scratch = Scratch { reach: slots.reach() as u32, free: first + numbers.len() };
    Some(GuardProgram { program: Program::new(part, None, scratch, form(false), engine()), first })
}

/// Declare the inputs of a recorded loop in the order of their slots, and hold its input and its modes. Return the exogenous input and the
/// state.
fn arguments(closed: &mut ClosedLoop<Sym>, slots: &Slots, held: bool) -> (Exogenous<Sym>, Vec<Sym>) {
    let u = instant(slots.desired, slots.wrench);
    let (x, tau, dz) = (inputs(slots.states()), inputs(slots.inputs), inputs(slots.answer));
    if held {
        closed.hold_input(&tau, &dz);
    }
    modes_as_inputs(closed, slots);
    (u, x)
}

/// Pair recorded operations, given by their indices `entries`, with consecutive slots from `first` on: `(slot, index)`.
fn to(first: usize, entries: &[u32]) -> Vec<(u32, u32)> {
    entries.iter().enumerate().map(|(k, &entry)| ((first + k) as u32, entry)).collect()
}

fn make(ops: Vec<Op>, rates: &[u32], slots: &Slots, wanted: RequiredDerivatives, watch: Watch) -> RatesPrograms {
    let none = SlotTable::default();
    let part = Part { ops: &ops, start: 0, outputs: &to(slots.rates(), rates), places: &none };
    let reach = slots.reach();
    let scratch = Scratch { reach: reach as u32, free: reach + 1 };
    watch("rates".into(), part, None, scratch, false);
    let program = Program::new(part, None, scratch, form(false), engine());
    RatesPrograms {
        rates: program,
        contacts: None,
        margins: None,
        attempt: None,
        derivatives: (wanted != RequiredDerivatives::Rates)
            .then(|| differentiate(ops, rates, slots, wanted == RequiredDerivatives::Time, watch)),
    }
}

fn differentiate(ops: Vec<Op>, of: &[u32], slots: &Slots, moves: bool, watch: Watch) -> Derivatives {
    let entries = |first: usize, count: usize| first as u32..(first + count) as u32;
    let mut moving: Vec<u32> = entries(slots.state(), slots.plant).collect();
    if moves {
        moving.extend(entries(slots.given, slots.desired + slots.wrench));
    }
    let law: Vec<u32> = entries(slots.state() + slots.plant, slots.law).collect();
    let inputs = slots.rates();
    let along_law = inputs + moving.len();
    let rates = along_law + law.len();
    let derivatives = rates + slots.states();
    let reach = derivatives + slots.states();
    let mut work = Differentiation::new(ops, inputs);
    let mut cuts = vec![Cut { end: work.length(), outputs: to(rates, of) }];
    for moving in [&moving, &law] {
        let outputs = to(derivatives, &work.along(moving, of));
        cuts.push(Cut { end: work.length(), outputs });
    }
    let needs_law = cuts[2].outputs.iter().any(|&(_, entry)| entry != 0);
    let ops = work.finish();
    let (places, mut free) = segments::join(&ops, &mut cuts, reach as u32 + 1);
    let mut start = 0;
    let mut program = |name: &str, cut: &Cut| {
        let part = Part { ops: &ops, start, outputs: &cut.outputs, places: &places };
        let scratch = Scratch { reach: reach as u32, free: free as usize };
        watch(name.into(), part, None, scratch, true);
        let made = Program::new(part, None, scratch, form(true), engine());
        (start, free) = (cut.end, made.slots() as u32);
        made
    };
    let [values, plant] = [program("values", &cuts[0]), program("along_plant", &cuts[1])];
    let law = needs_law.then(|| program("along_law", &cuts[2]));
    Derivatives { values, plant, law, along_plant: inputs, along_law, moves, rates, derivatives, reach }
}

/// The recorded rates of the runs of a problem. They are recorded on first use.
pub struct Rates {
    common: Common,
    /// The rates of all runs, if all runs have the same plant and law.
    shared: Option<OnceLock<Option<RatesOfRun>>>,
    used: AtomicBool,
}

impl Rates {
    /// Prepare the rates of a problem. The result is `None` if the loops of the problem cannot be recorded. It is also `None` for an explicit
    /// method of fixed steps, unless joints stick and slip between its steps.
    pub fn of(problem: &Problem) -> Option<Self> {
        let shared = (problem.plants.len() == 1 && problem.laws.len() == 1).then(OnceLock::new);
        let method = problem.options.method;
        let sticks = problem.plants.iter().any(|plant| plant.sticks());
        let takes = (method.is_adaptive() || method.is_implicit() || sticks) && is_recordable(problem);
        takes.then(|| Rates { common: Common::of_functions(problem), shared, used: AtomicBool::new(false) })
    }

    /// The name of the engine that computed the runs.
    pub fn engine(&self) -> &'static str {
        if self.used.load(Ordering::Relaxed) { engine().name() } else { "direct" }
    }

    /// Return the rates of run `run` if an earlier run with the same structure has recorded them. If none has, record them if `worth` is
    /// true, otherwise return `None`. The result is also `None` if the code branches on data.
    pub fn of_run(&self, problem: &Problem, run: usize, worth: bool) -> Option<RatesOfRun> {
        let held = problem.options.sampling.is_some();
        let found = match &self.shared {
            Some(shared) if worth => shared.get_or_init(|| of_run(problem, run, self.common, held)).clone(),
            Some(shared) if shared.get().is_some() => shared.get().cloned().flatten(),
            _ if worth => of_run(problem, run, self.common, held),
            _ => known(problem, run, self.common, held),
        };
        self.used.fetch_or(found.is_some(), Ordering::Relaxed);
        found
    }
}
