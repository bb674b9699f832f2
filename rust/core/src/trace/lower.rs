//! Lowering: from a recording to the instructions of one instruction set.
//!
//! Lowering removes entries (recorded operations) without an effect on an output. It expands sine and cosine into the polynomials of
//! `scalar::trig`, and replaces negation and absolute value by bit operations. A fused multiply-add is one instruction if the instruction
//! set has it, otherwise a product and a sum. Lowering fuses and reorders nothing else. So the results have the bits of direct evaluation
//! on the same instruction set, except for the signs of zeros.

use super::memo::Memo;
use super::straight::{Instruction, Part, Straight};
use super::tape::Op;
use crate::scalar::trig;

/// Translate a part of a recording to instructions. Input `k` is in slot `k`. `fused`: whether the instruction set has fused multiply-add.
/// If the part computes sines, the number in slot `reach_slot` becomes the maximum of its previous value and the magnitudes of all angles.
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
    /// For each entry, the index of its instruction, if the entry is already lowered.
    known: Vec<Option<u32>>,
    /// The angles whose sine and cosine are already computed.
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

    /// Return the instruction of a constant with these bits.
    fn bits(&mut self, bits: u64) -> u32 {
        let instructions = &mut self.out.instructions;
        *self.constants.entry(bits).or_insert_with(|| {
            instructions.push(Instruction::Const(bits));
            instructions.len() as u32 - 1
        })
    }

    /// Lower the entries that the outputs require, in the order of the recording.
    fn entries(&mut self) {
        let needed = self.part.needed(self.fused);
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
            Op::Fma(a, b, c) => match self.part.negated(c, self.fused) {
                Some(x) => I::Fms(self.at(a), self.at(b), self.at(x)),
                None => return self.fma(self.at(a), self.at(b), self.at(c)),
            },
            Op::Fnma(a, b, c) => match self.part.negated(c, self.fused) {
                Some(x) => I::Fnms(self.at(a), self.at(b), self.at(x)),
                None => return self.fnma(self.at(a), self.at(b), self.at(c)),
            },
            Op::Sqrt(a) => I::Sqrt(self.at(a)),
            Op::Max(a, b) => I::Max(self.at(a), self.at(b)),
            Op::Min(a, b) => I::Min(self.at(a), self.at(b)),
            Op::Less(a, b) => I::Less(self.at(a), self.at(b)),
            Op::Select(mask, yes, no) => I::Select(self.at(mask), self.at(yes), self.at(no)),
            Op::Decided(_, given, _) => return self.at(given),
            Op::Argument(..) | Op::Decide(..) => unreachable!("a cut is a boundary of parts"),
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

    /// Compute sine and cosine of entry `a` as `scalar::trig::sin_cos_near` does. Entry `top` is the sine or the cosine. Return the
    /// instruction of `top`.
    fn turn(&mut self, top: u32, a: u32) -> u32 {
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
        // Bit 0 of the quadrant exchanges sine and cosine. Bit 1 changes the sign of the sine. Bit 0 xor bit 1 changes the sign of the
        // cosine.
        let odd = self.push(I::Shift(rounded, 63));
        let swap = self.push(I::Signs(odd));
        let upper = self.push(I::Shift(rounded, 62));
        let mixed = self.push(I::Xor(upper, odd));
        let sign = self.constant(-0.0);
        let (sin_sign, cos_sign) = (self.push(I::And(upper, sign)), self.push(I::And(mixed, sign)));
        let swapped = (self.push(I::Select(swap, cos, sin)), self.push(I::Select(swap, sin, cos)));
        let sin = self.push(I::Xor(swapped.0, sin_sign));
        let cos = self.push(I::Xor(swapped.1, cos_sign));
        // Both entries are now lowered.
        for (entry, op) in [(Op::Sin(a), sin), (Op::Cos(a), cos)] {
            if let Some(at) = self.part.twin(top, entry) {
                self.known[at] = Some(op);
            }
        }
        self.known[top as usize].unwrap_or_default()
    }

    /// Evaluate a polynomial in pairs of coefficients (Estrin), as `sin_cos_near` does.
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
