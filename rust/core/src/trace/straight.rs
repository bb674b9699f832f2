//! Straight-line instructions for one instruction set, made from a recorded computation. The emitter translates them to machine code.

use super::memo::Memo;
use super::tape::Op;

/// An instruction. Its operands are the indices of earlier instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    /// The number in the slot with this index.
    Input(u32),
    /// A constant in all lanes, stored as the bits of a number.
    Const(u64),
    Add(u32, u32),
    Sub(u32, u32),
    Mul(u32, u32),
    Div(u32, u32),
    /// `b` if `a < b`, otherwise `a`.
    Max(u32, u32),
    /// `b` if `b < a`, otherwise `a`.
    Min(u32, u32),
    And(u32, u32),
    /// `!a & b`
    AndNot(u32, u32),
    Xor(u32, u32),
    /// `a b + c`
    Fma(u32, u32, u32),
    /// `a b - c`
    Fms(u32, u32, u32),
    /// `c - a b`
    Fnma(u32, u32, u32),
    /// `-a b - c`
    Fnms(u32, u32, u32),
    Sqrt(u32),
    /// All bits set if `a < b`, otherwise none.
    Less(u32, u32),
    /// A mask: all bits are set if the sign bit of the operand is set, otherwise none. If only the sign bit of the mask is read, the mask
    /// may be the operand unchanged.
    Signs(u32),
    /// `Select(mask, yes, no)`: `yes` if the sign bit of `mask` is set, otherwise `no`.
    Select(u32, u32, u32),
    /// The bits of the operand, shifted left by this number of places.
    Shift(u32, u8),
}

impl Instruction {
    /// The indices of the operands.
    pub fn operands(self) -> impl Iterator<Item = u32> {
        use Instruction::*;
        let (count, all) = match self {
            Input(_) | Const(_) => (0, [0; 3]),
            Sqrt(a) | Signs(a) | Shift(a, _) => (1, [a, 0, 0]),
            Add(a, b) | Sub(a, b) | Mul(a, b) | Div(a, b) | Max(a, b) | Min(a, b) => (2, [a, b, 0]),
            And(a, b) | AndNot(a, b) | Xor(a, b) | Less(a, b) => (2, [a, b, 0]),
            Fma(a, b, c) | Fms(a, b, c) | Fnma(a, b, c) | Fnms(a, b, c) | Select(a, b, c) => (3, [a, b, c]),
        };
        all.into_iter().take(count)
    }

    /// Return the instruction with operands `f(operand)`.
    pub fn on(self, f: impl Fn(u32) -> u32) -> Self {
        use Instruction::*;
        match self {
            Input(_) | Const(_) => self,
            Add(a, b) => Add(f(a), f(b)),
            Sub(a, b) => Sub(f(a), f(b)),
            Mul(a, b) => Mul(f(a), f(b)),
            Div(a, b) => Div(f(a), f(b)),
            Max(a, b) => Max(f(a), f(b)),
            Min(a, b) => Min(f(a), f(b)),
            And(a, b) => And(f(a), f(b)),
            AndNot(a, b) => AndNot(f(a), f(b)),
            Xor(a, b) => Xor(f(a), f(b)),
            Fma(a, b, c) => Fma(f(a), f(b), f(c)),
            Fms(a, b, c) => Fms(f(a), f(b), f(c)),
            Fnma(a, b, c) => Fnma(f(a), f(b), f(c)),
            Fnms(a, b, c) => Fnms(f(a), f(b), f(c)),
            Sqrt(a) => Sqrt(f(a)),
            Less(a, b) => Less(f(a), f(b)),
            Signs(a) => Signs(f(a)),
            Select(a, b, c) => Select(f(a), f(b), f(c)),
            Shift(a, by) => Shift(f(a), by),
        }
    }

    /// Whether the value is an input or a constant, and needs no computation.
    pub fn is_leaf(self) -> bool {
        matches!(self, Instruction::Input(_) | Instruction::Const(_))
    }
}

/// Instructions in program order, and the slots of the results.
#[derive(Clone, Debug, Default)]
pub struct Straight {
    pub instructions: Vec<Instruction>,
    /// The results: `(slot, index of the value)`.
    pub outputs: Vec<(u32, u32)>,
    /// The slot of the largest magnitude of all angles whose sine is computed. If this magnitude reaches
    /// [`REDUCTION_LIMIT`](crate::scalar::trig::REDUCTION_LIMIT), the results are not valid.
    pub reach: Option<u32>,
    /// The inputs that change in every iteration, for a program that repeats.
    pub stream: Option<Stream>,
}

/// A stream: inputs in an array outside of the frame (the memory of the program). In each iteration, the position in this array advances by
/// `advance` slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    /// The index of the first input of the stream.
    pub first: u32,
    /// The number of inputs per iteration.
    pub count: u32,
    pub advance: u32,
    /// Whether the array has one number for all lanes, instead of one per lane.
    pub spread: bool,
}

impl Stream {
    /// The index of input `slot` within the stream. `None` means that the input is in the frame.
    pub fn place(&self, slot: u32) -> Option<u32> {
        slot.checked_sub(self.first).filter(|&k| k < self.count)
    }

    /// The number of slots that `turns` iterations read.
    pub fn slots(&self, turns: usize) -> usize {
        self.advance as usize * turns.saturating_sub(1) + self.count as usize
    }
}

impl Straight {
    /// The number of computed operations.
    pub fn operations(&self) -> usize {
        self.instructions.iter().filter(|i| !i.is_leaf()).count()
    }
}

/// A part of a recording: the entries (indices of recorded operations) from `start` on, and the outputs `(slot, entry)`.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    pub ops: &'a [Op],
    pub start: u32,
    pub outputs: &'a [(u32, u32)],
    /// The slots of earlier entries that the part reads. Inputs and constants are not listed.
    pub places: &'a SlotTable,
}

/// The slots of a frame that a program may use in addition to inputs and outputs.
#[derive(Clone, Copy)]
pub struct Scratch {
    /// The slot with the largest magnitude of all angles since the caller last cleared this slot.
    pub reach: u32,
    /// The first free slot.
    pub free: usize,
}

/// For each entry that a later part of the recording reads, the slot of the frame that stores its value.
pub type SlotTable = Memo<u32>;

impl Part<'_> {
    /// Whether an earlier part computes this entry, or native code at a cut before this part.
    #[inline]
    pub(super) fn is_before(&self, entry: u32) -> bool {
        match self.ops[entry as usize] {
            Op::Const(_) | Op::Input(_) => false,
            Op::Decided(cut, ..) => cut < self.start,
            _ => entry < self.start,
        }
    }

    /// Return `x` if entry `c` is `-x` and a fused instruction can subtract `x` instead of adding `c`. `fused`: whether the instruction set
    /// has fused multiply-add.
    #[inline]
    pub(super) fn negated(&self, c: u32, fused: bool) -> Option<u32> {
        match self.ops[c as usize] {
            Op::Neg(x) if fused && !self.is_before(c) => Some(x),
            _ => None,
        }
    }

    /// The entries that the instruction of `op` reads.
    #[inline]
    pub(super) fn reads(&self, op: Op, fused: bool) -> impl Iterator<Item = u32> + use<> {
        let subtracted = match op {
            Op::Fma(a, b, c) => self.negated(c, fused).map(|x| Op::Fma(a, b, x)),
            Op::Fnma(a, b, c) => self.negated(c, fused).map(|x| Op::Fnma(a, b, x)),
            _ => None,
        };
        // Within one part, the result of a cut is that of the formula.
        let skipped = usize::from(matches!(op, Op::Decided(..)));
        subtracted.unwrap_or(op).operands().skip(skipped)
    }

    /// Return, for each entry, whether the outputs depend on it. Entries that only earlier parts read are not included.
    pub(super) fn needed(&self, fused: bool) -> Vec<bool> {
        let mut needed = vec![false; self.ops.len()];
        self.outputs.iter().for_each(|&(_, value)| needed[value as usize] = true);
        for i in (0..self.ops.len()).rev() {
            if needed[i] && !self.is_before(i as u32) {
                self.reads(self.ops[i], fused).for_each(|a| needed[a as usize] = true);
            }
        }
        needed
    }

    /// Find the entry with operation `wanted`, at `top` or next to it. Sine and cosine of an angle are recorded one after the other.
    pub(super) fn twin(&self, top: u32, wanted: Op) -> Option<usize> {
        let top = top as usize;
        [Some(top), top.checked_sub(1), Some(top + 1)].into_iter().flatten().find(|&i| self.ops.get(i) == Some(&wanted))
    }

    /// Return the entries of earlier parts that the part reads.
    pub fn before(&self) -> Vec<u32> {
        let (mut needed, mut before) = (vec![false; self.ops.len()], Vec::new());
        self.outputs.iter().for_each(|&(_, value)| needed[value as usize] = true);
        for (i, op) in self.ops.iter().enumerate().rev() {
            if !needed[i] {
                continue;
            }
            if self.is_before(i as u32) {
                before.push(i as u32);
            } else {
                op.operands().for_each(|a| needed[a as usize] = true);
            }
        }
        before
    }
}
