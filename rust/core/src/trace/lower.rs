//! From a recording to the instructions of one instruction set.
//!
//! Lowering removes entries without an effect on an output. It expands sine and cosine into the polynomials of `scalar::trig`, and turns
//! negation and absolute value into bit operations. A fused product is one instruction if the target has it, otherwise a product and a sum.
//! Nothing else is fused and nothing is reordered. So the bits are those of direct evaluation on the same instruction set, except for the
//! signs of zeros.

use super::memo::Memo;
use super::straight::{Instruction, Part, Straight};
use super::tape::Op;
use crate::scalar::trig;

/// Lower a part of a recording. `fused`: the target has fused multiply-add. Input `k` is in slot `k`. If there are angles, `reach_slot`
/// receives the largest magnitude among them and its previous content.
pub fn lower(part: Part, reach_slot: u32, fused: bool) -> Straight {
    let Part { ops, outputs, .. } = part;
    let mut lowering = Lowering {
        part,
        ops,
        known: vec![None; ops.len()],
        turns: Vec::new(),
        constants: Memo::default(),
        fused,
        out: Straight::default(),
    };
    lowering.entries();
    for &(slot, value) in outputs {
        let value = lowering.at(value);
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
    /// The value of each entry that is lowered already.
    known: Vec<Option<u32>>,
    /// The angles whose sine and cosine are computed already.
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

    /// Lower the entries that the outputs require, in the order of the recording. Lifetimes are shorter than in depth-first order.
    /// Operations depend less often on the one just before.
    fn entries(&mut self) {
        let mut needed = vec![false; self.ops.len()];
        self.part.outputs.iter().for_each(|&(_, value)| needed[value as usize] = true);
        for i in (0..self.ops.len()).rev().filter(|&i| !self.part.is_before(i as u32)) {
            if needed[i] {
                self.reads(self.ops[i]).into_iter().flatten().for_each(|a| needed[a as usize] = true);
            }
        }
        for i in (0..self.ops.len()).filter(|&i| needed[i]) {
            if self.known[i].is_some() {
                continue;
            }
            let before = self.part.is_before(i as u32).then(|| self.part.places.get(&(i as u32))).flatten();
            self.known[i] = Some(match before {
                Some(&slot) => self.push(Instruction::Input(slot)),
                None => self.instruction(i as u32),
            });
        }
    }

    /// `x` if entry `c` is `-x` and the target can both add and subtract in a fused product.
    fn negated(&self, c: u32) -> Option<u32> {
        match self.ops[c as usize] {
            Op::Neg(x) if self.fused && !self.part.is_before(c) => Some(x),
            _ => None,
        }
    }

    /// The entries whose values the lowered `op` reads.
    fn reads(&self, op: Op) -> [Option<u32>; 3] {
        if let Op::Fma(a, b, c) | Op::Fnma(a, b, c) = op
            && let Some(x) = self.negated(c)
        {
            return [Some(a), Some(b), Some(x)];
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
            Op::Add(a, b) => I::Add(self.at(a), self.at(b)),
            Op::Sub(a, b) => I::Sub(self.at(a), self.at(b)),
            Op::Mul(a, b) => I::Mul(self.at(a), self.at(b)),
            Op::Div(a, b) => I::Div(self.at(a), self.at(b)),
            Op::Neg(a) => I::Xor(self.at(a), self.constant(-0.0)),
            Op::Abs(a) => I::AndNot(self.constant(-0.0), self.at(a)),
            Op::Fma(a, b, c) => match self.negated(c) {
                Some(x) => I::Fms(self.at(a), self.at(b), self.at(x)),
                None => return self.fma(self.at(a), self.at(b), self.at(c)),
            },
            Op::Fnma(a, b, c) => match self.negated(c) {
                Some(x) => I::Fnms(self.at(a), self.at(b), self.at(x)),
                None => return self.fnma(self.at(a), self.at(b), self.at(c)),
            },
            Op::Sqrt(a) => I::Sqrt(self.at(a)),
            Op::Max(a, b) => I::Max(self.at(a), self.at(b)),
            Op::Min(a, b) => I::Min(self.at(a), self.at(b)),
            Op::Less(a, b) => I::Less(self.at(a), self.at(b)),
            Op::Select(mask, yes, no) => I::Select(self.at(mask), self.at(yes), self.at(no)),
            Op::Sin(a) | Op::Cos(a) => return self.turn(top, a, (Op::Sin(a), Op::Cos(a))),
            Op::UnfusedSin(a) | Op::UnfusedCos(a) => {
                let fused = std::mem::replace(&mut self.fused, false);
                let value = self.turn(top, a, (Op::UnfusedSin(a), Op::UnfusedCos(a)));
                self.fused = fused;
                return value;
            }
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

    /// Sine and cosine of entry `a`, computed as in `scalar::trig::sin_cos_near`. `pair` are their operations. The result is the value of
    /// entry `top`, which is one of them.
    fn turn(&mut self, top: u32, a: u32, pair: (Op, Op)) -> u32 {
        use Instruction as I;
        let x = self.at(a);
        if !self.turns.contains(&x) {
            self.turns.push(x);
        }
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
        // Bit 0 of the quadrant swaps the two. Bit 1 changes the sign of the sine, and bit 0 xor bit 1 that of the cosine.
        let odd = self.push(I::Shift(rounded, 63));
        let swap = self.push(I::Signs(odd));
        let upper = self.push(I::Shift(rounded, 62));
        let mixed = self.push(I::Xor(upper, odd));
        let sign = self.constant(-0.0);
        let (sin_sign, cos_sign) = (self.push(I::And(upper, sign)), self.push(I::And(mixed, sign)));
        let swapped = (self.push(I::Select(swap, cos, sin)), self.push(I::Select(swap, sin, cos)));
        let sin = self.push(I::Xor(swapped.0, sin_sign));
        let cos = self.push(I::Xor(swapped.1, cos_sign));
        // Now the values of both entries of the pair are known.
        for (entry, op) in [(pair.0, sin), (pair.1, cos)] {
            if let Some(at) = self.twin(top, entry) {
                self.known[at] = Some(op);
            }
        }
        self.known[top as usize].unwrap_or_default()
    }

    /// The other entry of the pair of sine and cosine, next to `top`. Both are recorded one after the other.
    fn twin(&self, top: u32, wanted: Op) -> Option<usize> {
        let top = top as usize;
        [Some(top), top.checked_sub(1), Some(top + 1)].into_iter().flatten().find(|&i| self.ops.get(i) == Some(&wanted))
    }

    /// Two coefficients at a time (Estrin), as in `sin_cos_near`.
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
