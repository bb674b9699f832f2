//! The steps that compute a part of a tape (the list of recorded operations), for the interpreter. Each value has a slot in the frame, which
//! is the memory of the program.
//!
//! An output that the part does not read is computed in its slot. Other values are in slots after those of the program. After the last
//! read of a value, its slot is reused.

use super::straight::Part;
use super::tape::Op;
use std::collections::HashSet;

/// The operation of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    Add,
    Sub,
    Mul,
    Div,
    Neg,
    /// `a b + c`
    Fma,
    /// `a b - c`
    Fms,
    /// `c - a b`
    Fnma,
    /// `-a b - c`
    Fnms,
    Sqrt,
    Abs,
    Max,
    Min,
    Less,
    Select,
    /// Sine and cosine. The second operand is the slot of the cosine.
    Turn,
    Copy,
}

/// An operation. The operands in `from` are slots, and `to` is the slot of the result.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub action: Action,
    pub to: u32,
    pub from: [u32; 3],
}

/// The steps of a part, in the order of the recording.
pub struct Steps {
    pub steps: Vec<Step>,
    /// The constants: `(slot, number)`.
    pub constants: Vec<(u32, f64)>,
    /// The number of slots that a frame requires.
    pub slots: usize,
}

/// Return the steps of a part. Slots of new values begin at `first`. `fused`: whether the instruction set has fused multiply-add.
pub fn steps(part: Part, first: usize, fused: bool) -> Steps {
    Assignment::new(part, first, fused).steps()
}

/// A position after all steps.
const NEVER: u32 = u32::MAX;

/// The assignment of slots to the values of a part.
struct Assignment<'a> {
    part: Part<'a>,
    fused: bool,
    /// Whether the outputs depend on an entry (a recorded operation).
    needed: Vec<bool>,
    /// The slot of each entry that is already assigned.
    slot: Vec<Option<u32>>,
    /// The last entry that reads the value of an entry. `NEVER` for values that remain until the end.
    last: Vec<u32>,
    /// Whether the step of an entry already exists.
    done: Vec<bool>,
    free: Vec<u32>,
    next: u32,
    steps: Vec<Step>,
    constants: Vec<(u32, f64)>,
}

impl<'a> Assignment<'a> {
    fn new(part: Part<'a>, first: usize, fused: bool) -> Self {
        let entries = part.ops.len();
        Assignment {
            needed: part.needed(fused),
            part,
            fused,
            slot: vec![None; entries],
            last: vec![0; entries],
            done: vec![false; entries],
            free: Vec::new(),
            next: first as u32,
            steps: Vec::new(),
            constants: Vec::new(),
        }
    }

    fn steps(mut self) -> Steps {
        self.leaves();
        self.values();
        // A copy overwrites a slot that the part reads. Copies of inputs and constants are first, like in machine code.
        let outputs = self.part.outputs.iter().filter(|&&(slot, value)| self.slot[value as usize] != Some(slot));
        let (leaves, computed): (Vec<_>, Vec<_>) = outputs.partition(|&&(_, value)| self.is_leaf(value));
        for &(slot, value) in leaves.into_iter().chain(computed) {
            let from = self.at(value);
            self.steps.push(Step { action: Action::Copy, to: slot, from: [from; 3] });
        }
        Steps { steps: self.steps, constants: self.constants, slots: self.next as usize }
    }

    /// Whether the value of an entry is an input, a constant, or computed by an earlier part.
    fn is_leaf(&self, entry: u32) -> bool {
        self.part.is_before(entry) || matches!(self.part.ops[entry as usize], Op::Input(_) | Op::Const(_))
    }

    /// Assign the slots of inputs and constants, and of outputs that the part does not read. Find the last reads of the other values.
    fn leaves(&mut self) {
        let Part { ops, outputs, places, .. } = self.part;
        let mut read = HashSet::new();
        for i in (0..ops.len() as u32).filter(|&i| self.needed[i as usize]) {
            let slot = match ops[i as usize] {
                Op::Input(slot) => slot,
                Op::Const(bits) => {
                    self.constants.push((self.next, f64::from_bits(bits)));
                    self.next += 1;
                    self.next - 1
                }
                _ if self.part.is_before(i) => places.get(&i).copied().unwrap_or_default(),
                op => {
                    self.part.reads(op, self.fused).for_each(|a| self.last[a as usize] = i);
                    continue;
                }
            };
            read.insert(slot);
            self.slot[i as usize] = Some(slot);
        }
        for &(slot, value) in outputs {
            self.last[value as usize] = NEVER;
            if !self.is_leaf(value) && !read.contains(&slot) {
                self.slot[value as usize].get_or_insert(slot);
            }
        }
    }

    /// Assign the slots of computed values, in the order of the recording.
    fn values(&mut self) {
        for i in 0..self.part.ops.len() as u32 {
            if self.needed[i as usize] && !self.is_leaf(i) {
                self.value(i);
            }
        }
    }

    /// Reuse the slots that are read for the last time at entry `i`, and add the step that computes the entry.
    fn value(&mut self, i: u32) {
        let op = self.part.ops[i as usize];
        let from = self.operands(op);
        for a in self.part.reads(op, self.fused) {
            if self.last[a as usize] == i && !self.is_leaf(a) {
                self.last[a as usize] = NEVER;
                self.free.push(self.at(a));
            }
        }
        match op {
            _ if self.done[i as usize] => {}
            Op::Sin(a) | Op::Cos(a) => self.turn(i, a, from[0]),
            _ => {
                let to = self.own(i);
                self.steps.push(Step { action: self.action(op), to, from });
            }
        }
    }

    /// Add the step that computes sine and cosine of entry `a`, which is in slot `angle`. Entry `top` is the sine or the cosine. A result
    /// that is not needed has a slot, too.
    fn turn(&mut self, top: u32, a: u32, angle: u32) {
        let results = [Op::Sin(a), Op::Cos(a)].map(|op| {
            let entry = self.part.twin(top, op).filter(|&entry| self.needed[entry] && !self.is_leaf(entry as u32));
            match entry {
                Some(entry) => {
                    self.done[entry] = true;
                    (self.own(entry as u32), true)
                }
                None => (self.new_slot(), false),
            }
        });
        self.free.extend(results.iter().filter(|(_, used)| !used).map(|&(slot, _)| slot));
        let [(sin, _), (cos, _)] = results;
        self.steps.push(Step { action: Action::Turn, to: sin, from: [angle, cos, angle] });
    }

    fn at(&self, entry: u32) -> u32 {
        self.slot[entry as usize].unwrap_or_default()
    }

    /// Return a slot that no value uses.
    fn new_slot(&mut self) -> u32 {
        self.free.pop().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    /// Return the slot of the result of an entry. Unless it is the slot of an output, assign a slot that no value uses.
    fn own(&mut self, entry: u32) -> u32 {
        let slot = self.slot[entry as usize].unwrap_or_else(|| self.new_slot());
        *self.slot[entry as usize].insert(slot)
    }

    /// The slots of the operands. The last slot is repeated.
    fn operands(&self, op: Op) -> [u32; 3] {
        let mut reads = self.part.reads(op, self.fused).map(|a| self.at(a));
        let a = reads.next().unwrap_or_default();
        let b = reads.next().unwrap_or(a);
        [a, b, reads.next().unwrap_or(b)]
    }

    fn action(&self, op: Op) -> Action {
        let subtracts = |c: u32| self.part.negated(c, self.fused).is_some();
        match op {
            Op::Add(..) => Action::Add,
            Op::Sub(..) => Action::Sub,
            Op::Mul(..) => Action::Mul,
            Op::Div(..) => Action::Div,
            Op::Neg(..) => Action::Neg,
            Op::Fma(_, _, c) if subtracts(c) => Action::Fms,
            Op::Fma(..) => Action::Fma,
            Op::Fnma(_, _, c) if subtracts(c) => Action::Fnms,
            Op::Fnma(..) => Action::Fnma,
            Op::Sqrt(..) => Action::Sqrt,
            Op::Abs(..) => Action::Abs,
            Op::Max(..) => Action::Max,
            Op::Min(..) => Action::Min,
            Op::Less(..) => Action::Less,
            Op::Select(..) => Action::Select,
            Op::Sin(..) | Op::Cos(..) => Action::Turn,
            // A cut is a boundary of parts, so that only the results of the formula are computed here.
            Op::Const(_) | Op::Input(_) | Op::Decided(..) | Op::Decide(..) | Op::Argument(..) => Action::Copy,
        }
    }
}
