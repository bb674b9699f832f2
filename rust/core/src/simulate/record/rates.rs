//! Programs (recorded computations) of the state rates of a closed loop and of their derivatives. Adaptive and implicit methods use them, and
//! loops in which joints stick and slip between fixed steps.
//!
//! A loop is recorded once. The interpreter computes the recording until machine code of it repays, and beyond the range of its sines.
//!
//! The rates are a program for one run. The derivatives are programs for lanes, with one direction per lane. A first program computes the
//! rates and all values that the derivatives read. A second program computes the derivatives of the rates along one direction per lane, in
//! several passes over all directions. The directions of the law's states have a separate program, because few operations depend on these
//! states, and their number may be large. Further programs compute the law's results, and the numbers from which native code decides the
//! modes of contacts and joints.

use super::attempt::AttemptProgram;
use super::key::Common;
use super::lane_attempt::{LaneAttempts, LanePrograms};
use super::slots::RatesSlots;
use super::step_programs::Watch;
use super::structure::{self, Seen, instant, modes_as_inputs};
use crate::integrate::ExplicitAdaptive;
use crate::simulate::assembly::assemble;
use crate::simulate::problem::Problem;
use crate::simulate::problem::force::Force;
use crate::trace::cache::{Cache, MadeOnce};
use crate::trace::differentiate::Differentiation;
use crate::trace::tape::Op;
use crate::trace::{ByEngine, Cut, Engine, Part, Program, Signature, SlotTable, Slots, engine, form, segments, sym};
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
    pub signature: Signature,
    /// The direction along which the program `plant` differentiates. If it also differentiates along the exogenous input, the components of
    /// this input follow the plant's states.
    pub along_plant: Slots,
    /// The direction along which the program `law` differentiates.
    pub along_law: Slots,
    /// Whether the program `plant` also differentiates along the exogenous input.
    pub moves: bool,
    pub rates: Slots,
    pub derivatives: Slots,
}

impl Derivatives {
    pub fn all(&self) -> impl Iterator<Item = &Program> + Clone {
        [&self.values, &self.plant].into_iter().chain(&self.law)
    }
}

/// The program of a function of the loop. All functions share a frame.
pub struct FunctionProgram {
    pub program: Program,
    pub results: Slots,
}

/// The programs of all loops with the same structure, for one engine.
pub struct RatesPrograms {
    pub rates: FunctionProgram,
    /// The plant's input. With a held input, also the rate of the law's state. `None` if the caller supplies the law.
    pub law: Option<FunctionProgram>,
    /// The depth and the push of each contact, if the modes of contacts are inputs.
    pub contacts: Option<FunctionProgram>,
    /// The margins of the joints that stick and slip.
    pub margins: Option<FunctionProgram>,
    /// The numbers from which native code decides which joints stick.
    pub loads: Option<FunctionProgram>,
    pub derivatives: Option<Derivatives>,
}

impl RatesPrograms {
    /// The programs of one run, which share a frame.
    pub fn of_one_run(&self) -> impl Iterator<Item = &Program> + Clone {
        let functions = [&self.law, &self.contacts, &self.margins, &self.loads];
        std::iter::once(&self.rates).chain(functions.into_iter().flatten()).map(|function| &function.program)
    }
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
        let still = problem.options.sampling.is_some() || !problem.law(run).motions().iter().any(|motion| motion.moves());
        let method = problem.options.method;
        match (method.is_implicit(), method.is_rosenbrock()) {
            (false, _) => RequiredDerivatives::Rates,
            (true, true) if !still || problem.forces.iter().any(moves) => RequiredDerivatives::Time,
            (true, _) => RequiredDerivatives::States,
        }
    }
}

/// The recording of a loop. The lists are the indices of the operations that compute its results.
struct Tape {
    ops: Vec<Op>,
    rates: Vec<u32>,
    law: Vec<u32>,
    contacts: Vec<u32>,
    margins: Vec<u32>,
    loads: Vec<u32>,
}

/// The recorded rates of all loops with the same structure.
pub struct RecordedRates {
    pub slots: RatesSlots,
    /// Whether the input is held.
    pub held: bool,
    tape: Tape,
    required: RequiredDerivatives,
    pub programs: ByEngine<RatesPrograms>,
    attempt: MadeOnce<Option<AttemptProgram>>,
    in_lanes: MadeOnce<LanePrograms>,
}

impl RecordedRates {
    /// Return the programs for an engine. They are made on first use.
    pub fn programs_for(&self, engine: Engine) -> Arc<RatesPrograms> {
        self.programs.get(engine, || make(&self.tape, &self.slots, (self.required, engine), &mut |_, _, _, _, _| ()))
    }

    /// Return the program of whole attempts of run `run`, if the loop has one.
    pub fn attempt(&self, problem: &Problem, run: usize, common: Common) -> Arc<Option<AttemptProgram>> {
        let operations = self.programs_for(engine()).rates.program.operations();
        self.attempt.get(|| AttemptProgram::of(problem, run, common, self.held, (&self.slots, operations)))
    }

    /// Return the programs of attempts in lanes, for run `run` of a problem whose method is `method`.
    pub fn in_lanes(&self, method: ExplicitAdaptive, problem: &Problem, run: usize, common: Common) -> Arc<LanePrograms> {
        let (held, slots, rates) = (self.held, &self.slots, &|free| self.rates_in_lanes(free));
        self.in_lanes.get(|| method.scheme(LaneAttempts { problem, run, common, held, slots, rates }))
    }

    /// Return the program of the rates for lanes, which may use the slots from `free` on for intermediate values.
    fn rates_in_lanes(&self, free: usize) -> Program {
        let outputs = self.slots.results[0].outputs(&self.tape.rates);
        let part = Part { ops: &self.tape.ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        Program::new(part, None, self.slots.signature.scratch(free), form(true), engine())
    }
}

/// A stored recording of rates, which later runs may use. The tag states whether the input is held, and which derivatives the method
/// requires.
type SeenRates = Seen<RecordedRates, (bool, RequiredDerivatives)>;

static KNOWN: Cache<Arc<SeenRates>> = Cache::new();

/// The number of contact modes that are inputs of the rates: two for each contact if the method is adaptive. An adaptive method keeps every
/// contact in its mode within a step. With fixed steps, the modes follow the state.
fn contact_modes(problem: &Problem, run: usize) -> usize {
    if problem.options.method.is_adaptive() { 2 * problem.plant(run).contacts() } else { 0 }
}

/// The rates of a run as programs, and the loop parameters of the run.
pub type RatesOfRun = (Arc<RecordedRates>, Vec<f64>);

/// Return the rates of run `run`. `held`: whether the input is held.
pub fn of_run(problem: &Problem, run: usize, common: Common, held: bool) -> RatesOfRun {
    let (parameters, required) = (structure::loop_parameters(problem, run, common), RequiredDerivatives::of(problem, run));
    let record = || {
        let (tape, slots) = record(problem, run, common, held, true);
        RecordedRates {
            slots,
            held,
            tape,
            required,
            programs: ByEngine::default(),
            attempt: MadeOnce::default(),
            in_lanes: MadeOnce::default(),
        }
    };
    let seen = Seen::of_run(&KNOWN, (problem, run, common), &parameters, (held, required), record);
    (seen.recorded.clone(), parameters.values)
}

/// Record the rates of run `run` for a listing, with the derivatives that the method requires. If `folds` is false, the operations are not
/// simplified, and no derivatives are recorded. Return the signature of the rates, and of their derivatives.
pub fn record_watched(problem: &Problem, run: usize, common: Common, folds: bool, watch: Watch) -> (Signature, Option<Signature>) {
    let required = if folds { RequiredDerivatives::of(problem, run) } else { RequiredDerivatives::Rates };
    let (tape, slots) = record(problem, run, common, problem.options.sampling.is_some(), folds);
    let programs = make(&tape, &slots, (required, engine()), watch);
    (slots.signature, programs.derivatives.map(|derivatives| derivatives.signature))
}

/// Record the loop of run `run`.
fn record(problem: &Problem, run: usize, common: Common, held: bool, folds: bool) -> (Tape, RatesSlots) {
    sym::begin_that(folds);
    let mut closed = assemble(problem, run, common.monitored.storage);
    let signature = Signature::new(sym::end_set_up());
    let sizes = [problem.plant(run).states(), problem.law(run).initial_state().len()];
    let modes = [contact_modes(problem, run), problem.plant(run).sticking_joints()];
    let mut slots = RatesSlots::new(signature, &closed, if problem.forces.is_empty() { 0 } else { 6 }, sizes, modes);
    let u = instant(slots.exogenous.sizes());
    let (x, tau, dz) = (slots.state.declare(), slots.tau.declare(), slots.law_rate.declare());
    let mut law = Vec::new();
    if held {
        if problem.law(run).route().is_recordable() {
            closed.answer(&u, &x);
            law = closed.tau.iter().chain(closed.law_rate()).copied().collect();
        }
        closed.hold_input(&tau, &dz);
    }
    modes_as_inputs(&mut closed, &slots);
    let mut dx = x.clone();
    closed.rhs(&u, &x, &mut dx);
    if !held {
        law.clone_from(&closed.tau);
    }
    let contacts = (0..slots.contacts.count / 2).flat_map(|i| closed.contact(i, &x)).collect();
    let (loads, margins) = if slots.sides.count > 0 { closed.loads_and_margins(&u, &x) } else { Default::default() };
    drop(closed);
    let recording = sym::finish();
    assert!(!recording.failed, "a recorded law or plant does not branch on data");
    let [rates, law, contacts, margins, loads] = [dx, law, contacts, margins, loads].map(structure::entries);
    let tape = Tape { ops: recording.ops, rates, law, contacts, margins, loads };
    let mut results = |name, entries: &[u32]| slots.signature.output(name, entries.len());
    slots.results = [
        results("rates", &tape.rates),
        results("law", &tape.law),
        results("contacts", &tape.contacts),
        results("margins", &tape.margins),
        results("loads", &tape.loads),
    ];
    (tape, slots)
}

fn make(tape: &Tape, slots: &RatesSlots, (required, engine): (RequiredDerivatives, Engine), watch: Watch) -> RatesPrograms {
    let (none, mut free) = (SlotTable::default(), slots.signature.slots());
    // The intermediate values of a program are in slots that no program before it uses.
    let mut function = |name: Option<&str>, entries: &[u32], results: Slots| {
        let (outputs, scratch) = (results.outputs(entries), slots.signature.scratch(free));
        let part = Part { ops: &tape.ops, start: 0, outputs: &outputs, places: &none };
        if let Some(name) = name {
            watch(name.into(), part, None, scratch, false);
        }
        let program = Program::new(part, None, scratch, form(false), engine);
        free = program.slots();
        FunctionProgram { program, results }
    };
    let [of_rates, of_law, of_contacts, of_margins, of_loads] = slots.results;
    let rates = function(Some("rates"), &tape.rates, of_rates);
    let mut further = |entries: &[u32], results: Slots| (!entries.is_empty()).then(|| function(None, entries, results));
    let (law, contacts) = (further(&tape.law, of_law), further(&tape.contacts, of_contacts));
    let (margins, loads) = (further(&tape.margins, of_margins), further(&tape.loads, of_loads));
    let derivatives = (required != RequiredDerivatives::Rates)
        .then(|| differentiate(tape, slots, (required == RequiredDerivatives::Time, engine), watch));
    RatesPrograms { rates, law, contacts, margins, loads, derivatives }
}

fn differentiate(tape: &Tape, slots: &RatesSlots, (moves, engine): (bool, Engine), watch: Watch) -> Derivatives {
    let mut moving: Vec<u32> = slots.state.part(0, slots.plant).inputs().collect();
    if moves {
        moving.extend(slots.exogenous.slots.inputs());
    }
    let law: Vec<u32> = slots.state.part(slots.plant, slots.law).inputs().collect();
    let mut signature = slots.signature.of_inputs();
    let mut work = Differentiation::new(tape.ops.clone(), signature.angle());
    let (along_plant, along_law) = (signature.input("along_plant", moving.len()), signature.input("along_law", law.len()));
    let [rates, derivatives] = ["rates", "derivatives"].map(|name| signature.output(name, slots.state.count));
    let mut cuts = vec![Cut { end: work.length(), outputs: rates.outputs(&tape.rates) }];
    for moving in [&moving, &law] {
        let outputs = derivatives.outputs(&work.along(moving, &tape.rates));
        cuts.push(Cut { end: work.length(), outputs });
    }
    let needs_law = cuts[2].outputs.iter().any(|&(_, entry)| entry != 0);
    let ops = work.finish();
    let (places, mut free) = segments::join(&ops, &mut cuts, signature.slots() as u32);
    let mut start = 0;
    let mut program = |name: &str, cut: &Cut| {
        let part = Part { ops: &ops, start, outputs: &cut.outputs, places: &places };
        let scratch = signature.scratch(free as usize);
        watch(name.into(), part, None, scratch, true);
        let made = Program::new(part, None, scratch, form(true), engine);
        (start, free) = (cut.end, made.slots() as u32);
        made
    };
    let [values, plant] = [program("values", &cuts[0]), program("along_plant", &cuts[1])];
    let law = needs_law.then(|| program("along_law", &cuts[2]));
    Derivatives { values, plant, law, signature, along_plant, along_law, moves, rates, derivatives }
}

/// The recorded rates of the runs of a problem. They are recorded on first use.
pub struct Rates {
    pub common: Common,
    /// The rates of all runs, if all runs have the same plant and law.
    shared: Option<OnceLock<RatesOfRun>>,
    /// Whether machine code has computed a run.
    machine: AtomicBool,
    /// Whether the caller supplies the law of a run.
    external: bool,
}

impl Rates {
    /// Prepare the rates of a problem.
    pub fn of(problem: &Problem) -> Self {
        let shared = (problem.plants.len() == 1 && problem.laws.len() == 1).then(OnceLock::new);
        let external = !problem.laws.iter().all(|law| law.route().is_recordable());
        Rates { common: Common::of_functions(problem), shared, machine: AtomicBool::new(false), external }
    }

    /// The name of the engine that computed the runs. It is "direct" if the caller supplies their laws.
    pub fn engine(&self) -> &'static str {
        match (self.external, self.machine.load(Ordering::Relaxed)) {
            (true, _) => "direct",
            (false, true) => Engine::Machine.name(),
            (false, false) => Engine::Interpreter.name(),
        }
    }

    /// Note that an engine computes a run.
    pub fn note(&self, engine: Engine) {
        self.machine.fetch_or(engine == Engine::Machine, Ordering::Relaxed);
    }

    /// Return the rates of run `run`. `held`: whether the input is held.
    pub fn of_run(&self, problem: &Problem, run: usize, held: bool) -> RatesOfRun {
        match &self.shared {
            Some(shared) => shared.get_or_init(|| of_run(problem, run, self.common, held)).clone(),
            None => of_run(problem, run, self.common, held),
        }
    }
}
