//! Recorded functions of numbers. A *program* is the compiled form of a recording. Recordings with equal operations share a program if the
//! cache still contains it.
//!
//! A *set-up parameter* is a number that remains the same from one evaluation to the next, such as a mass. A *frame* is the memory of a
//! program. The signature of a function has two groups, its inputs and its results. The program rounds like direct evaluation (without a
//! program). So both give the same bits, except for the signs of zeros.

use super::cache::Cache;
use super::frame::Frame;
use super::program::{Engine, Program, engine, form};
use super::rows::{self, Rows};
use super::signature::{Signature, Slots};
use super::straight::{Part, SlotTable};
use super::sym::{self, Sym};
use super::tape::Op;
use crate::scalar::trig::REDUCTION_LIMIT;
use std::collections::VecDeque;
use std::sync::Arc;

/// A function gets a program after this number of calls for a single configuration. Calls for a batch do not count.
pub const CALLS: usize = 16;

/// The maximum number of recorded operations of all stored functions together.
pub const KEPT_OPERATIONS: usize = 1 << 20;

/// A function, shared by all recordings with equal operations and results.
struct StoredFunction {
    ops: Vec<Op>,
    answer: Vec<u32>,
    program: Program,
    lanes: bool,
    inputs: Slots,
    results: Slots,
}

/// A function and its memory. One run evaluates the function once, or once per lane.
#[derive(Clone)]
pub struct Evaluation {
    function: Arc<StoredFunction>,
    frame: Frame,
}

impl std::fmt::Debug for Evaluation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Evaluation({} operations)", self.function.program.operations())
    }
}

/// A recorded function. `values` are the set-up parameters, which are the first inputs. `inputs` is the number of other inputs. `answer`
/// has the indices of the results in `ops`.
#[derive(Clone)]
pub struct Recorded {
    pub ops: Vec<Op>,
    pub values: Vec<f64>,
    pub inputs: usize,
    pub answer: Vec<u32>,
}

/// Record `answer` as a function of the set-up parameters and of `inputs` inputs. The result is `None` if the code reads the value of a
/// number that is not a constant, for example to branch on it.
pub fn recorded<T>(inputs: usize, set_up: impl FnOnce() -> T, answer: impl FnOnce(T, &[Sym]) -> Vec<Sym>) -> Option<Recorded> {
    sym::begin();
    let made = set_up();
    sym::end_set_up();
    let given: Vec<Sym> = (0..inputs).map(|_| sym::input()).collect();
    let answer = answer(made, &given).into_iter().map(Sym::index).collect();
    let recording = sym::finish();
    (!recording.failed).then_some(Recorded { ops: recording.ops, values: recording.values, inputs, answer })
}

/// Record a function and make its program, for one row of inputs or for one row per lane.
pub fn record<T>(lanes: bool, inputs: usize, set_up: impl FnOnce() -> T, answer: impl FnOnce(T, &[Sym]) -> Vec<Sym>) -> Option<Evaluation> {
    recorded(inputs, set_up, answer).map(|recorded| recorded.program(lanes))
}

impl Recorded {
    /// Make the program of this function, for one row of inputs or for one row per lane.
    pub fn program(self, lanes: bool) -> Evaluation {
        let values = self.values.clone();
        Evaluation::new(StoredFunction::of(self, lanes), &values)
    }

    /// The signature, and the slots of its inputs and of its results.
    fn signature(&self) -> (Signature, Slots, Slots) {
        let mut signature = Signature::new(self.values.len());
        let (inputs, results) = (signature.input("inputs", self.inputs), signature.output("results", self.answer.len()));
        (signature, inputs, results)
    }

    /// Whether `other` differs only in the values of the set-up parameters.
    pub(super) fn has_operations_of(&self, other: &Recorded) -> bool {
        let inputs = |of: &Recorded| (of.values.len(), of.inputs);
        inputs(self) == inputs(other) && self.answer == other.answer && self.ops == other.ops
    }

    /// Prepare this function for the interpreter, for one row of inputs or for one row per lane. The interpreter is valid for all angles.
    pub fn interpreted(self, lanes: bool) -> Evaluation {
        let values = self.values.clone();
        Evaluation::new(Arc::new(StoredFunction::new(self, lanes, Engine::Interpreter)), &values)
    }
}

impl Evaluation {
    fn new(function: Arc<StoredFunction>, given: &[f64]) -> Self {
        let StoredFunction { ops, answer, program, results, .. } = &*function;
        let mut frame = Frame::new(program.slots().max(results.end()), form(function.lanes).lanes());
        program.prepare(&mut frame);
        // A constant result is not an output of the program, and is written to the frame here.
        for (k, &entry) in answer.iter().enumerate() {
            if let Op::Const(bits) = ops[entry as usize] {
                frame.fill(results.first + k, f64::from_bits(bits));
            }
        }
        let mut evaluation = Evaluation { function, frame };
        evaluation.set_up(given);
        evaluation
    }

    /// Write the set-up parameters, in every lane.
    pub fn set_up(&mut self, given: &[f64]) {
        for (slot, &x) in given.iter().enumerate() {
            self.frame.fill(slot, x);
        }
    }

    pub fn lanes(&self) -> usize {
        self.frame.lanes()
    }

    /// The number of operations in one run.
    pub fn operations(&self) -> usize {
        self.function.program.operations()
    }

    /// Copy rows of the first inputs, in their order. Other inputs keep their values. Row `at` goes to the first lane, and the next rows to
    /// the next lanes. Lanes beyond the last row repeat the last row.
    #[inline]
    pub fn read(&mut self, inputs: &[Rows], at: usize) {
        let slots = self.function.inputs;
        debug_assert!(inputs.iter().map(|rows| rows.width).sum::<usize>() <= slots.count);
        rows::read(&mut self.frame, slots.first, inputs, at);
    }

    /// The memory of `count` inputs from `first` on, with all lanes.
    pub fn inputs(&mut self, first: usize, count: usize) -> &mut [f64] {
        self.frame.group_mut(self.function.inputs.part(first, count))
    }

    /// The memory of all inputs, with all lanes.
    #[inline]
    pub fn all_inputs(&mut self) -> &mut [f64] {
        self.frame.group_mut(self.function.inputs)
    }

    /// Evaluate the function for the present inputs.
    #[inline]
    pub fn run(&mut self) {
        self.reset_angle();
        self.run_on();
    }

    /// Evaluate the function, and keep the largest angle of previous runs. [`Evaluation::reset_angle`] resets the largest angle.
    #[inline]
    pub fn run_on(&mut self) {
        self.function.program.run(&mut self.frame);
    }

    /// Reset the largest angle to zero.
    #[inline]
    pub fn reset_angle(&mut self) {
        if self.function.program.turns() {
            self.frame.fill(self.function.inputs.end(), 0.0);
        }
    }

    /// Result `k`, in every lane.
    pub fn output(&self, k: usize) -> &[f64] {
        self.outputs(k, 1)
    }

    /// The `count` results from `first` on, with all lanes.
    pub fn outputs(&self, first: usize, count: usize) -> &[f64] {
        self.frame.group(self.function.results.part(first, count))
    }

    /// Copy the `length` results with the indices `first`, `first + 1`, .. to the rows of `out`, which has at most one row per lane. Return
    /// whether every number is finite. Negative zeros become positive.
    pub fn write(&self, first: usize, length: usize, out: &mut [f64]) -> bool {
        length == 0 || rows::write(&self.frame, self.function.results.first + first, length, out)
    }

    /// Whether the results of all lanes are valid ([`Evaluation::is_near`]).
    pub fn is_valid(&self) -> bool {
        (0..self.lanes()).all(|lane| self.is_near(lane))
    }

    /// Whether the results of lane `lane` are valid. Those of machine code are not if an angle has at least the magnitude
    /// `REDUCTION_LIMIT`.
    pub fn is_near(&self, lane: usize) -> bool {
        let at = self.function.inputs.end() * self.lanes() + lane;
        self.frame.numbers()[at] < REDUCTION_LIMIT
    }
}

static KNOWN: Cache<Arc<StoredFunction>> = Cache::new();

impl StoredFunction {
    /// Return the function of a recording. If no stored function matches, make a new function. The cache stores the functions that were
    /// used last.
    fn of(recorded: Recorded, lanes: bool) -> Arc<StoredFunction> {
        let (_, inputs, results) = recorded.signature();
        let is = |known: &Arc<StoredFunction>| {
            (known.lanes, known.inputs, known.results) == (lanes, inputs, results)
                && known.answer == recorded.answer
                && known.ops == recorded.ops
        };
        KNOWN.find(is).unwrap_or_else(|| {
            let function = Arc::new(StoredFunction::new(recorded, lanes, engine()));
            let fits = |known: &VecDeque<Arc<StoredFunction>>| known.iter().map(|known| known.ops.len()).sum::<usize>() <= KEPT_OPERATIONS;
            KNOWN.store(function.clone(), fits);
            function
        })
    }

    fn new(recorded: Recorded, lanes: bool, engine: Engine) -> Self {
        let (signature, inputs, results) = recorded.signature();
        let Recorded { ops, answer, .. } = recorded;
        let is_known = |entry: u32| matches!(ops[entry as usize], Op::Const(_));
        let outputs: Vec<(u32, u32)> = results.outputs(&answer).into_iter().filter(|&(_, entry)| !is_known(entry)).collect();
        let part = Part { ops: &ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        let program = Program::new(part, None, signature.scratch(signature.slots()), form(lanes), engine);
        StoredFunction { program, ops, answer, lanes, inputs, results }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cache::CAPACITY;
    use super::*;
    use crate::scalar::Real;

    /// Record `[sin(k x) y, 3, x]`, where `k` is a set-up parameter.
    fn function(k: f64, lanes: bool) -> Option<Evaluation> {
        record(lanes, 2, || Sym::varying(k), |k, xy| vec![(k * xy[0]).sin_cos().0 * xy[1], Sym::splat(3.0), xy[0]])
    }

    #[test]
    fn a_function_answers_row_by_row() {
        for lanes in [false, true] {
            let mut f = function(0.7, lanes).expect("it does not branch");
            let rows: Vec<f64> = (0..22).map(|i| if i == 6 { 2e6 } else { 0.3 * f64::from(i) - 1.0 }).collect();
            let mut out = vec![0.0; 33];
            for at in (0..11).step_by(f.lanes()) {
                f.read(&[Rows { numbers: &rows, width: 2 }], at);
                f.run();
                let end = (at + f.lanes()).min(11);
                f.write(0, 3, &mut out[3 * at..3 * end]);
                for lane in 0..f.lanes().min(11 - at) {
                    let valid = at + lane != 3 || engine() == Engine::Interpreter;
                    assert_eq!(f.is_near(lane), valid, "the reach is that of each run alone");
                }
            }
            for (i, (xy, answer)) in rows.chunks_exact(2).zip(out.chunks_exact(3)).enumerate().filter(|(i, _)| *i != 3) {
                assert!((answer[0] - (0.7 * xy[0]).sin() * xy[1]).abs() < 1e-14, "{i}");
                assert_eq!(answer[1..], [3.0, xy[0]]);
            }
        }
    }

    #[test]
    fn one_structure_has_one_program_and_few_are_kept() {
        let (first, second) = (function(0.2, true).expect("recorded"), function(0.3, true).expect("recorded"));
        assert!(Arc::ptr_eq(&first.function, &second.function));
        assert!(!Arc::ptr_eq(&first.function, &function(1.0, true).expect("recorded").function), "a one is structure");
        for k in 0..2 * CAPACITY {
            record(false, 1, || (), |(), x| vec![x[0] + Sym::splat(k as f64 + 0.5)]).expect("recorded");
        }
        assert!(KNOWN.count() <= CAPACITY);
    }

    #[test]
    fn code_that_reads_a_value_is_no_function() {
        assert!(record(true, 1, || (), |(), x| vec![Sym::splat(x[0].lane(0))]).is_none());
    }
}
