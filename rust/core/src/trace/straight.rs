//! A recorded computation as straight-line instructions of one instruction set: what the emitter and the portable evaluation run.
//!
//! Lowering removes what no output needs, writes sine and cosine out (`scalar::trig`, the same polynomials), turns negation and
//! absolute value into bit operations, and chooses fused multiply-add: where the target has it, `a b + c` is one instruction
//! wherever the product has no other use; elsewhere it is a product and a sum.

use super::tape::{Memo, Op};
use crate::scalar::trig;

/// An instruction on the values of earlier ones, by index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    /// The number in a slot of the frame.
    Input(u32),
    /// The bits of a number, the same in all lanes.
    Const(u64),
    Add(u32, u32),
    Sub(u32, u32),
    Mul(u32, u32),
    Div(u32, u32),
    /// `b` where `a < b`, else `a`.
    Max(u32, u32),
    /// `b` where `b < a`, else `a`.
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
    Sqrt(u32),
    /// All bits where `a < b`, else none.
    Less(u32, u32),
    /// All bits where the sign bit is set, else none; an instruction set may leave the value as it is.
    Signs(u32),
    /// The second where the sign bit of the first is set, else the third.
    Select(u32, u32, u32),
    /// The bits moved up.
    Shift(u32, u8),
}

impl Instruction {
    /// The values that it reads.
    pub fn operands(self) -> impl Iterator<Item = u32> {
        use Instruction::*;
        let (count, all) = match self {
            Input(_) | Const(_) => (0, [0; 3]),
            Sqrt(a) | Signs(a) | Shift(a, _) => (1, [a, 0, 0]),
            Add(a, b) | Sub(a, b) | Mul(a, b) | Div(a, b) | Max(a, b) | Min(a, b) => (2, [a, b, 0]),
            And(a, b) | AndNot(a, b) | Xor(a, b) | Less(a, b) => (2, [a, b, 0]),
            Fma(a, b, c) | Fms(a, b, c) | Fnma(a, b, c) | Select(a, b, c) => (3, [a, b, c]),
        };
        all.into_iter().take(count)
    }

    /// The same instruction on `f` of its operands.
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
            Sqrt(a) => Sqrt(f(a)),
            Less(a, b) => Less(f(a), f(b)),
            Signs(a) => Signs(f(a)),
            Select(a, b, c) => Select(f(a), f(b), f(c)),
            Shift(a, by) => Shift(f(a), by),
        }
    }

    /// Whether it is there before the program runs.
    pub fn is_leaf(self) -> bool {
        matches!(self, Instruction::Input(_) | Instruction::Const(_))
    }
}

/// Instructions in the order in which they run, and where the results go.
#[derive(Clone, Debug, Default)]
pub struct Straight {
    pub instructions: Vec<Instruction>,
    /// `(slot, value)`
    pub outputs: Vec<(u32, u32)>,
    /// The largest magnitude of all angles whose sine is taken; beyond [`trig::REDUCTION_LIMIT`] the results are not valid.
    pub reach: Option<u32>,
}

impl Straight {
    /// Operations that are computed.
    pub fn operations(&self) -> usize {
        self.instructions.iter().filter(|i| !i.is_leaf()).count()
    }
}

/// A part of a recording: its entries from `start` on, for the outputs `(slot, entry)`.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    pub ops: &'a [Op],
    pub start: u32,
    pub outputs: &'a [(u32, u32)],
    /// The slots of earlier entries that it reads; leaves need none.
    pub places: &'a Places,
}

/// The slots of entries that several parts of a recording use.
pub type Places = Memo<u32>;

impl Part<'_> {
    /// Whether an entry is there before the part runs, and not computed by it.
    fn is_before(&self, entry: u32) -> bool {
        entry < self.start && !matches!(self.ops[entry as usize], Op::Const(_) | Op::Input(_))
    }

    /// How often each entry is read by entries that an output needs, and those that earlier parts have to compute.
    pub fn uses(&self) -> (Vec<u32>, Vec<u32>) {
        let (mut uses, mut before) = (vec![0u32; self.ops.len()], Vec::new());
        for &(_, value) in self.outputs {
            uses[value as usize] += 1;
        }
        for (i, op) in self.ops.iter().enumerate().rev() {
            if uses[i] == 0 {
                continue;
            }
            if self.is_before(i as u32) {
                before.push(i as u32);
            } else {
                op.operands().for_each(|a| uses[a as usize] += 1);
            }
        }
        (uses, before)
    }
}

/// Lower a part of a recording; `fused`: the target has fused multiply-add. Input `k` is in slot `k`.
/// Where angles occur, `reach_slot` receives the largest magnitude of them and of what it holds.
pub fn lower(part: Part, reach_slot: u32, fused: bool) -> Straight {
    let Part { ops, outputs, .. } = part;
    let mut lowering = Lowering {
        part,
        ops,
        uses: part.uses().0,
        known: vec![None; ops.len()],
        turns: Vec::new(),
        constants: Memo::default(),
        fused,
        out: Straight::default(),
    };
    for &(slot, value) in outputs {
        let value = lowering.value(value);
        lowering.out.outputs.push((slot, value));
    }
    if !lowering.turns.is_empty() {
        let mut reach = lowering.push(Instruction::Input(reach_slot));
        for angle in std::mem::take(&mut lowering.turns) {
            let sign = lowering.constant(-0.0);
            let magnitude = lowering.push(Instruction::AndNot(sign, angle));
            reach = lowering.push(Instruction::Max(reach, magnitude));
        }
        lowering.out.outputs.push((reach_slot, reach));
        lowering.out.reach = Some(reach_slot);
    }
    lowering.out
}

struct Lowering<'a> {
    part: Part<'a>,
    ops: &'a [Op],
    uses: Vec<u32>,
    /// The value of each entry of the tape, once it is lowered.
    known: Vec<Option<u32>>,
    /// The angles whose sine and cosine are there.
    turns: Vec<u32>,
    constants: Memo<u64>,
    fused: bool,
    out: Straight,
}

impl Lowering<'_> {
    fn push(&mut self, instruction: Instruction) -> u32 {
        self.out.instructions.push(instruction);
        self.out.instructions.len() as u32 - 1
    }

    fn constant(&mut self, x: f64) -> u32 {
        self.bits(x.to_bits())
    }

    /// A constant by its bits.
    fn bits(&mut self, bits: u64) -> u32 {
        let instructions = &mut self.out.instructions;
        *self.constants.entry(bits).or_insert_with(|| {
            instructions.push(Instruction::Const(bits));
            instructions.len() as u32 - 1
        })
    }

    /// The value of entry `i`, lowered with what it needs: depth first, which keeps lifetimes short. Without recursion.
    fn value(&mut self, i: u32) -> u32 {
        let mut stack = vec![i];
        while let Some(&top) = stack.last() {
            if self.known[top as usize].is_some() {
                stack.pop();
                continue;
            }
            if let Some(&slot) = self.part.places.get(&top).filter(|_| self.part.is_before(top)) {
                stack.pop();
                self.known[top as usize] = Some(self.push(Instruction::Input(slot)));
                continue;
            }
            let before = stack.len();
            let needed = self.needed(self.ops[top as usize]);
            stack.extend(needed.into_iter().flatten().filter(|&a| self.known[a as usize].is_none()).rev());
            if stack.len() == before {
                stack.pop();
                self.known[top as usize] = Some(self.instruction(top));
            }
        }
        self.known[i as usize].unwrap_or_default()
    }

    /// The factors of entry `a`, if it is a product that one entry alone reads and that is therefore fused with it.
    fn product(&self, a: u32) -> Option<(u32, u32)> {
        match self.ops[a as usize] {
            Op::Mul(x, y) if self.fused && self.uses[a as usize] == 1 && !self.part.is_before(a) => Some((x, y)),
            _ => None,
        }
    }

    /// The entries that are lowered before `op`.
    fn needed(&self, op: Op) -> [Option<u32>; 3] {
        let fused = match op {
            Op::Add(a, b) => self.product(b).map(|p| (p, a)).or_else(|| self.product(a).map(|p| (p, b))),
            Op::Sub(a, b) => self.product(b).map(|p| (p, a)).or_else(|| self.product(a).map(|p| (p, b))),
            _ => None,
        };
        if let Some(((x, y), other)) = fused {
            return [Some(x), Some(y), Some(other)];
        }
        let mut operands = op.operands();
        [operands.next(), operands.next(), operands.next()]
    }

    fn at(&self, a: u32) -> u32 {
        self.known[a as usize].unwrap_or_default()
    }

    fn instruction(&mut self, top: u32) -> u32 {
        use Instruction as I;
        let lowered = match self.ops[top as usize] {
            Op::Const(bits) => return self.bits(bits),
            Op::Input(slot) => I::Input(slot),
            Op::Add(a, b) => match (self.product(b), self.product(a)) {
                (Some((x, y)), _) => I::Fma(self.at(x), self.at(y), self.at(a)),
                (_, Some((x, y))) => I::Fma(self.at(x), self.at(y), self.at(b)),
                _ => I::Add(self.at(a), self.at(b)),
            },
            Op::Sub(a, b) => match (self.product(b), self.product(a)) {
                (Some((x, y)), _) => I::Fnma(self.at(x), self.at(y), self.at(a)),
                (_, Some((x, y))) => I::Fms(self.at(x), self.at(y), self.at(b)),
                _ => I::Sub(self.at(a), self.at(b)),
            },
            Op::Mul(a, b) => I::Mul(self.at(a), self.at(b)),
            Op::Div(a, b) => I::Div(self.at(a), self.at(b)),
            Op::Neg(a) => I::Xor(self.at(a), self.constant(-0.0)),
            Op::Abs(a) => I::AndNot(self.constant(-0.0), self.at(a)),
            Op::Fma(a, b, c) => return self.fma(self.at(a), self.at(b), self.at(c)),
            Op::Fnma(a, b, c) => return self.fnma(self.at(a), self.at(b), self.at(c)),
            Op::Sqrt(a) => I::Sqrt(self.at(a)),
            Op::Max(a, b) => I::Max(self.at(a), self.at(b)),
            Op::Min(a, b) => I::Min(self.at(a), self.at(b)),
            Op::Less(a, b) => I::Less(self.at(a), self.at(b)),
            Op::Select(mask, yes, no) => I::Select(self.at(mask), self.at(yes), self.at(no)),
            Op::Sin(a) | Op::Cos(a) => return self.turn(top, a),
        };
        self.push(lowered)
    }

    fn fma(&mut self, a: u32, b: u32, c: u32) -> u32 {
        if self.fused {
            return self.push(Instruction::Fma(a, b, c));
        }
        let product = self.push(Instruction::Mul(a, b));
        self.push(Instruction::Add(product, c))
    }

    fn fnma(&mut self, a: u32, b: u32, c: u32) -> u32 {
        if self.fused {
            return self.push(Instruction::Fnma(a, b, c));
        }
        let product = self.push(Instruction::Mul(a, b));
        self.push(Instruction::Sub(c, product))
    }

    /// Sine and cosine of entry `a` as `scalar::trig::sin_cos_near` computes them; the value of entry `top`, which is one of them.
    fn turn(&mut self, top: u32, a: u32) -> u32 {
        use Instruction as I;
        let x = self.at(a);
        self.turns.push(x);
        let (k, round) = (self.constant(trig::TWO_OVER_PI), self.constant(trig::ROUND));
        let rounded = self.fma(x, k, round);
        let turns = self.push(I::Sub(rounded, round));
        let mut r = x;
        for part in trig::PIO2 {
            let part = self.constant(part);
            r = self.fnma(turns, part, r);
        }
        let z = self.push(I::Mul(r, r));
        let zz = self.push(I::Mul(z, z));
        let (sin, cos) = (self.polynomial(trig::SIN, z, zz), self.polynomial(trig::COS, z, zz));
        let rz = self.push(I::Mul(r, z));
        let sin = self.fma(rz, sin, r);
        let (half, one) = (self.constant(-0.5), self.constant(1.0));
        let near_one = self.fma(half, z, one);
        let cos = self.fma(zz, cos, near_one);
        // Bit 0 of the quadrant swaps the two, bit 1 turns the sign of the sine, bit 0 xor bit 1 that of the cosine.
        let odd = self.push(I::Shift(rounded, 63));
        let swap = self.push(I::Signs(odd));
        let upper = self.push(I::Shift(rounded, 62));
        let mixed = self.push(I::Xor(upper, odd));
        let sign = self.constant(-0.0);
        let (sin_sign, cos_sign) = (self.push(I::And(upper, sign)), self.push(I::And(mixed, sign)));
        let swapped = (self.push(I::Select(swap, cos, sin)), self.push(I::Select(swap, sin, cos)));
        let sin = self.push(I::Xor(swapped.0, sin_sign));
        let cos = self.push(I::Xor(swapped.1, cos_sign));
        // Both entries of the pair are known from here on.
        for (entry, op) in [(Op::Sin(a), sin), (Op::Cos(a), cos)] {
            if let Some(at) = self.twin(top, entry) {
                self.known[at] = Some(op);
            }
        }
        self.known[top as usize].unwrap_or_default()
    }

    /// The entry of the pair of sine and cosine next to `top`: they are recorded one after the other.
    fn twin(&self, top: u32, wanted: Op) -> Option<usize> {
        let top = top as usize;
        [Some(top), top.checked_sub(1), Some(top + 1)].into_iter().flatten().find(|&i| self.ops.get(i) == Some(&wanted))
    }

    /// Two coefficients at a time (Estrin), as `sin_cos_near`.
    fn polynomial(&mut self, a: [f64; 6], z: u32, zz: u32) -> u32 {
        let mut pair = |k: usize| {
            let (first, second) = (self.constant(a[k]), self.constant(a[k + 1]));
            self.fma(first, z, second)
        };
        let pairs = [pair(0), pair(2), pair(4)];
        let high = self.fma(pairs[0], zz, pairs[1]);
        self.fma(high, zz, pairs[2])
    }
}
