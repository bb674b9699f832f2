//! The state rates, the law and the guards of a loop as recorded functions, with their tangents and adjoints. A guard is a function whose
//! change of sign ends a contact mode.

use super::directions::{Directions, refused};
use super::set_ups::SetUps;
use super::timeline::Contacts;
use crate::error::{Error, Result};
use crate::interrupt;
use crate::law::Route;
use crate::scalar::Real;
use crate::simulate::assembly::assemble;
use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::observer::run_observer::Guard;
use crate::simulate::problem::Problem;
use crate::simulate::problem::sampling::Sampling;
use crate::simulate::record::slots::Instant;
use crate::simulate::record::structure::{entries, instant};
use crate::trace::adjoint::adjoint;
use crate::trace::branches::{Branches, branches};
use crate::trace::function::Recorded;
use crate::trace::sym::{self, Sym};
use crate::trace::tangents::{Tangents, tangents};
use crate::trace::tape::{Moving, Op};
use crate::trace::{Evaluation, Signature, Slots, form};
use std::sync::OnceLock;

/// The largest number of groups in one block. A group is the directions in the lanes of one register. The function's values are computed
/// once for all groups of a block.
const GROUPS_PER_BLOCK: usize = 2;

/// Sizes of the arguments and results of a loop's functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// The size of the desired motion at one instant.
    pub desired: usize,
    /// The size of the exogenous input at one instant. The exogenous input starts with the desired motion.
    pub width: usize,
    pub n: usize,
    /// The number of states of the plant.
    pub plant: usize,
    /// The number of states of plant and law together.
    pub states: usize,
    /// The number of the law's results: the plant's input and the rate of the law's state.
    pub answer: usize,
    /// The first state of the law whose rate has the acting input as a term, see `Sampler::with_torque_states`.
    pub torque_states: Option<usize>,
    /// Whether the law is evaluated at sample times only.
    pub sampled: bool,
    guards: usize,
    /// The number of groups of directions in a block. A group has one direction per lane.
    pub groups: usize,
    /// The number of varying loop parameters.
    pub moved: usize,
    /// Whether the exogenous input varies.
    pub drives: bool,
}

impl Sizes {
    pub fn of(problem: &Problem, directions: &Directions) -> Self {
        let (n, p, plant) = (problem.plant(0).n(), problem.law(0).initial_state().len(), problem.plant(0).states());
        let sampling = problem.options.sampling.as_ref();
        Sizes {
            desired: directions.width() - if problem.forces.is_empty() { 0 } else { 6 },
            width: directions.width(),
            n,
            plant,
            states: plant + p,
            answer: n + p,
            torque_states: problem.law(0).torque_states().filter(|_| sampling.is_some_and(Sampling::changes_output)),
            sampled: problem.options.sampling.is_some(),
            guards: usize::from(matches!(problem.law(0).route(), Route::Guarded | Route::Bounded)),
            groups: directions.count.div_ceil(form(true).lanes()).min(GROUPS_PER_BLOCK),
            moved: directions.moved,
            drives: directions.drives(),
        }
    }

    /// The number of tangents of the exogenous input. It is zero if this input does not vary.
    pub fn driven(&self) -> usize {
        if self.drives { self.width } else { 0 }
    }
}

/// A recorded function `y = f(c, u, x, held, modes)` of the loop parameters `c`, the exogenous input `u`, the state `x` and the held input.
/// The modes of contacts are 0 or 1, and do not vary. Runs with the same structure share the function, so it does not store values of `c`.
pub struct Function {
    ops: Vec<Op>,
    arguments: Arguments,
    answer: Vec<u32>,
    /// The number of validity flags after the results. A flag is positive if the results are valid.
    guards: usize,
    /// The inputs that vary: loop parameters, the exogenous input, the state, the held input.
    moving: Vec<u32>,
    groups: usize,
    /// The compiled function, its tangent and its adjoint. The loop parameters in them are zero.
    calls: [OnceLock<Call>; 3],
}

/// The arguments of a function after the loop parameters.
#[derive(Clone, Copy)]
struct Arguments {
    exogenous: Instant,
    state: Slots,
    held: Slots,
    modes: Slots,
}

impl Arguments {
    fn new(given: usize, exogenous: [usize; 2], [state, held, modes]: [usize; 3]) -> Self {
        let mut signature = Signature::new(given);
        let exogenous = Instant::add(&mut signature, ["desired", "force"], exogenous);
        let mut input = |name, count| signature.input(name, count);
        Arguments { exogenous, state: input("state", state), held: input("held", held), modes: input("modes", modes) }
    }

    /// The number of loop parameters.
    fn given(&self) -> usize {
        self.exogenous.slots.first
    }

    fn count(&self) -> usize {
        self.modes.end() - self.given()
    }
}

/// The recorded functions of a loop.
pub struct LoopFunctions {
    pub sizes: Sizes,
    /// The state rates. In a continuous loop, the result of the function ends with the plant's input. In a sampled loop, the input is an
    /// argument.
    pub rates: Function,
    /// The plant's input and the rate of the law's state.
    pub law: Function,
    /// One function for each condition that ends a contact mode. The function is zero at the instant at which the mode changes.
    pub guards: Vec<Function>,
    /// The branches of the state rates ([`Function::branches`]).
    pub branches: Option<[Function; 2]>,
}

impl LoopFunctions {
    /// Record the functions of run 0. `set_ups`: the set-ups of the loop.
    ///
    /// Errors: `Input` for a law that branches on its numbers, and for a parameter whose value is a constant in the recorded operations.
    pub fn of(problem: &Problem, directions: &Directions, set_ups: &SetUps, contacts: &Contacts) -> Result<Self> {
        let sizes = Sizes::of(problem, directions);
        let refusal = || Error::input("law", format!("has no derivatives of runs: {} branches on its numbers", problem.law(0).name()));
        let all = |run: usize| {
            interrupt::check();
            let of = LoopRecorder { problem, run, directions, sizes: &sizes };
            let guards: Option<Vec<Function>> = contacts.guards.iter().map(|&guard| of.guard(guard)).collect();
            Some(LoopFunctions { sizes, rates: of.rates(contacts.held())?, law: of.law()?, guards: guards?, branches: None })
        };
        let mut own = all(0).ok_or_else(refusal)?;
        for (k, &(p, run)) in directions.runs.iter().enumerate() {
            // Runs with the same key and the same set-up have equal recordings. Debug builds check this.
            let same = set_ups.is_of_run_0(problem, k, run);
            if same && !cfg!(debug_assertions) {
                continue;
            }
            if !all(run).ok_or_else(refusal)?.same_operations(&own) {
                debug_assert!(!same, "two loops of one key differ");
                return Err(refused(p, "is a constant of the loop's program"));
            }
        }
        own.branches = own.rates.branches(sizes.states);
        Ok(own)
    }

    fn all(&self) -> impl Iterator<Item = &Function> {
        [&self.rates, &self.law].into_iter().chain(&self.guards)
    }

    /// Whether both recordings have the same operations.
    pub fn same_operations(&self, other: &Self) -> bool {
        self.all().map(|function| &function.ops).eq(other.all().map(|function| &function.ops))
    }

    /// The number of recorded operations plus the number of operations of the compiled functions.
    pub fn operations(&self) -> usize {
        let compiled = |function: &Function| {
            let calls = function.calls.iter().filter_map(OnceLock::get);
            calls.map(|call| call.evaluation.operations()).sum::<usize>()
        };
        self.all().chain(self.branches.iter().flatten()).map(|function| function.ops.len() + compiled(function)).sum()
    }
}

/// Records functions of the loop of one run.
struct LoopRecorder<'a> {
    problem: &'a Problem<'a>,
    run: usize,
    directions: &'a Directions<'a>,
    sizes: &'a Sizes,
}

impl LoopRecorder<'_> {
    fn record(
        &self,
        (held, modes): (bool, usize),
        body: impl FnOnce(&mut ClosedLoop, crate::simulate::Exogenous<Sym>, Vec<Sym>, Vec<Sym>) -> Vec<Sym>,
    ) -> Option<Function> {
        let LoopRecorder { problem, run, directions, sizes } = *self;
        sym::begin_moving(Moving::These(directions.moving.clone()));
        sym::differentiate();
        let mut closed = assemble(problem, run, false);
        let exogenous = [sizes.desired, sizes.width - sizes.desired];
        let arguments = Arguments::new(sym::end_set_up(), exogenous, [sizes.states, if held { sizes.answer } else { 0 }, modes]);
        let (u, x, acting) = (instant(exogenous), arguments.state.declare(), arguments.held.declare());
        if modes > 0 {
            closed.hold_modes(&arguments.modes.declare());
        }
        let mut answer = body(&mut closed, u, x, acting);
        if sizes.guards > 0 {
            answer.push(sym::validity().unwrap_or_else(|| Sym::splat(1.0)));
        }
        drop(closed);
        let recording = sym::finish();
        if recording.failed {
            return None;
        }
        let entry = |(_, &entry): (_, &u32)| if let Op::Input(slot) = recording.ops[entry as usize] { Some(slot) } else { None };
        let mut moving: Vec<u32> =
            directions.moving.iter().zip(&recording.structure).filter(|(moves, _)| **moves).filter_map(entry).collect();
        let driven = arguments.exogenous.slots.inputs().filter(|_| sizes.drives);
        moving.extend(driven.chain(arguments.state.inputs()).chain(arguments.held.inputs()));
        debug_assert_eq!(recording.values.len(), arguments.given(), "loop parameters are numbers of the set-up");
        let (answer, calls) = (entries(answer), Default::default());
        Some(Function { ops: recording.ops, arguments, answer, guards: sizes.guards, moving, groups: sizes.groups, calls })
    }

    /// Record the state rates with `contacts` held contacts. Without held contacts, the state determines their modes.
    fn rates(&self, contacts: usize) -> Option<Function> {
        let sizes = self.sizes;
        self.record((sizes.sampled, 2 * contacts), |closed, u, x, acting| {
            if sizes.sampled {
                let (tau, dz) = acting.split_at(sizes.n);
                closed.hold_input(tau, dz);
            }
            let mut dx = x.clone();
            closed.rhs(&u, &x, &mut dx);
            if !sizes.sampled {
                dx.extend(&closed.tau);
            }
            dx
        })
    }

    fn law(&self) -> Option<Function> {
        self.record((false, 0), |closed, u, x, _| {
            closed.answer(&u, &x);
            closed.tau.iter().chain(closed.law_rate()).copied().collect()
        })
    }

    fn guard(&self, Guard { contact, by_push }: Guard) -> Option<Function> {
        self.record((false, 0), |closed, _, x, _| vec![closed.contact(contact, &x)[usize::from(by_push)]])
    }
}

impl Function {
    fn recorded(&self, ops: Vec<Op>, more: usize, answer: Vec<u32>) -> Recorded {
        Recorded { ops, values: vec![0.0; self.arguments.given()], inputs: self.arguments.count() + more, answer }
    }

    /// The number of results, without the validity flags.
    pub fn answers(&self) -> usize {
        self.answer.len() - self.guards
    }

    /// Return the branches of the first `count` results: the margins, and the results with one more held input for the result of each
    /// comparison ([`crate::trace::branches`]). All inputs of the margins vary but the modes and the loop parameters that are constant.
    fn branches(&self, count: usize) -> Option<[Function; 2]> {
        let Arguments { exogenous, held, modes, .. } = self.arguments;
        let varying = exogenous.slots.first..held.end();
        let Branches { ops, margins, held: rates, outputs } = branches(&self.ops, modes.end(), &self.answer[..count], varying.clone())?;
        let parameters = self.moving.iter().copied().filter(|&input| (input as usize) < varying.start);
        let moving = parameters.chain(varying.start as u32..varying.end as u32).collect();
        let decided = Arguments { modes: modes.part(0, modes.count + margins.len()), ..self.arguments };
        let function =
            |ops, arguments, answer, moving| Function { ops, arguments, answer, moving, guards: 0, groups: 1, calls: Default::default() };
        Some([function(ops, self.arguments, margins, moving), function(rates, decided, outputs, Vec::new())])
    }

    /// Return compiled function number `kind` with the loop parameters `given`. `make` compiles it at the first call.
    fn call(&self, kind: usize, given: &[f64], make: impl FnOnce() -> Evaluation) -> Call {
        debug_assert_eq!(given.len(), self.arguments.given(), "one value per loop parameter");
        let mut call = self.calls[kind].get_or_init(|| Call::new(self, make())).clone();
        call.evaluation.set_up(given);
        call
    }

    /// Return the function without derivatives, for one run with the loop parameters `given`.
    pub fn value(&self, given: &[f64]) -> Call {
        self.call(0, given, || self.recorded(self.ops.clone(), 0, self.answer.clone()).program(false))
    }

    /// The number of inputs that vary.
    pub fn moving(&self) -> usize {
        self.moving.len()
    }

    /// Return the function with its tangent, for the loop parameters `given`. Its arguments are the inputs, then the tangents of the
    /// varying inputs. Its results are the function's results, then their tangents. Each lane has one direction, and the groups of
    /// directions follow one another.
    pub fn tangent(&self, given: &[f64]) -> Call {
        let made = || {
            let (inputs, groups) = (self.arguments.modes.end(), self.groups);
            let Tangents { ops, mut values, rates } = tangents(&self.ops, inputs, &self.answer, self.answers(), &self.moving, groups);
            values.extend(rates);
            self.recorded(ops, groups * self.moving.len(), values).program(true)
        };
        self.call(1, given, made)
    }

    /// Return the function with its adjoint, for the loop parameters `given`. The adjoint computes the weights of the varying inputs from
    /// the weights of the results.
    pub fn adjoint(&self, given: &[f64]) -> Call {
        let made = || {
            let (ops, mut answer) = adjoint(self.ops.clone(), self.arguments.modes.end(), &self.answer[..self.answers()], &self.moving);
            answer.splice(0..0, self.answer.iter().copied());
            self.recorded(ops, self.answers(), answer).program(false)
        };
        self.call(2, given, made)
    }
}

/// Write each number to `L` consecutive places, one for each lane.
fn spread<const L: usize>(parts: [&[f64]; 4], to: &mut [f64]) {
    let mut to = to.as_chunks_mut::<L>().0.iter_mut();
    for part in parts {
        part.iter().zip(&mut to).for_each(|(&x, to)| *to = [x; L]);
    }
}

/// A compiled function with memory for its arguments and results.
#[derive(Clone)]
pub struct Call {
    evaluation: Evaluation,
    arguments: usize,
    answers: usize,
    guards: usize,
}

impl Call {
    fn new(function: &Function, evaluation: Evaluation) -> Self {
        Call { evaluation, arguments: function.arguments.count(), answers: function.answers(), guards: function.guards }
    }

    pub fn lanes(&self) -> usize {
        self.evaluation.lanes()
    }

    /// Write the arguments `parts`, which are `u`, `x`, the held input and the modes. All lanes receive the same values.
    pub fn give(&mut self, parts: [&[f64]; 4]) {
        let (lanes, numbers) = (self.lanes(), self.evaluation.inputs(0, self.arguments));
        match lanes {
            1 => spread::<1>(parts, numbers),
            2 => spread::<2>(parts, numbers),
            4 => spread::<4>(parts, numbers),
            _ => spread::<8>(parts, numbers),
        }
    }

    /// Return the memory for `count` tangents or weights that are arguments of the function, from number `first` on, with all lanes.
    pub fn more(&mut self, first: usize, count: usize) -> &mut [f64] {
        self.evaluation.inputs(self.arguments + first, count)
    }

    /// Evaluate the function. Return an error if an angle exceeds the range of the programs' sines, or if the results are not valid.
    pub fn run(&mut self, t: f64) -> Result<()> {
        use crate::status::Status;
        self.evaluation.run();
        let failed = |status, problem: &str| Err(Error::Solve { status, t, problem: format!("{problem} at t = {t} s") });
        if !self.evaluation.is_near(0) {
            return failed(Status::Diverged, "an angle passed 10^6 rad");
        }
        if self.guards > 0 && !(self.evaluation.output(self.answers)[0] > 0.0) {
            return failed(Status::Degraded, "the tasks are near a singularity, where the law decides ranks and the run has no derivative");
        }
        Ok(())
    }

    /// The outputs of the function at the last evaluation, with all lanes.
    pub fn answers(&self) -> &[f64] {
        self.evaluation.outputs(0, self.answers)
    }

    /// Return `count` tangents or weights that are results of the function, from number `first` on, with all lanes.
    pub fn behind(&self, first: usize, count: usize) -> &[f64] {
        self.evaluation.outputs(self.answers + self.guards + first, count)
    }
}
