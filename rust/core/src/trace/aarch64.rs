//! An encoder of aarch64 machine code (NEON) for straight-line programs of two lanes or of one number.
//!
//! Source: Arm Architecture Reference Manual for A-profile, chapter C7 (SIMD and floating-point instructions).
//!
//! An instruction is a word of 32 bits: a pattern and register numbers. Register `d` is in bits 0 to 4, `n` in bits 5 to 9, and `m` in bits
//! 16 to 20. Only loads and stores access memory, so that an operand in memory is first loaded into a scratch register. Register x0 points
//! to the frame (the memory of the program), and x1 to the constants. Register x2 points to the stream (the inputs of a program that
//! repeats). Register x3 has the number of remaining iterations. In scalar code, the bits of a register beyond the first number are
//! undefined.

use super::instruction::{Assemble, Base, Binary, CallingConvention, Form, Order, Product, Set, Source};

/// An encoder. It stores the machine code that it has already encoded.
pub struct Assembler {
    form: Form,
    bytes: Vec<u8>,
}

/// The scratch registers: `SCRATCH` for a mask or a sum, `FETCHED` for an operand from memory.
const SCRATCH: u8 = 30;
const FETCHED: u8 = 31;
/// Register x9, which holds offsets that do not fit in an instruction.
const OFFSET: u8 = 9;
const STACK: u8 = 31;

// Instructions on numbers: first the packed form, then the scalar form.
const FADD: [u32; 2] = [0x4E60_D400, 0x1E60_2800];
const FSUB: [u32; 2] = [0x4EE0_D400, 0x1E60_3800];
const FMUL: [u32; 2] = [0x6E60_DC00, 0x1E60_0800];
const FDIV: [u32; 2] = [0x6E60_FC00, 0x1E60_1800];
const FSQRT: [u32; 2] = [0x6EE1_F800, 0x1E61_C000];
/// `n > m`: all bits of a lane are set where the comparison is true, otherwise none.
const FCMGT: [u32; 2] = [0x6EE0_E400, 0x7EE0_E400];

// Packed form only: `-n`, `d + n m`, `d - n m`.
const FNEG: u32 = 0x6EE0_F800;
const FMLA: u32 = 0x4E60_CC00;
const FMLS: u32 = 0x4EE0_CC00;

// Scalar form only, with the addend register in bits 10 to 14: `a + n m`, `a - n m`, `-a - n m`, `n m - a`.
const FMADD: u32 = 0x1F40_0000;
const FMSUB: u32 = 0x1F40_8000;
const FNMADD: u32 = 0x1F60_0000;
const FNMSUB: u32 = 0x1F60_8000;

// Instructions on all bits of a register. BIC is `n & !m`. BSL copies the bits of `n` where `d` is one, and the bits of `m` where `d` is
// zero. BIT copies the bits of `n` to `d` where `m` is one, and BIF where `m` is zero. All other bits of `d` remain unchanged.
const AND: u32 = 0x4E20_1C00;
const BIC: u32 = 0x4E60_1C00;
const ORR: u32 = 0x4EA0_1C00;
const EOR: u32 = 0x6E20_1C00;
const BSL: u32 = 0x6E60_1C00;
const BIT: u32 = 0x6EA0_1C00;
const BIF: u32 = 0x6EE0_1C00;
/// Set all bits of lanes that are negative integers, and clear other lanes.
const CMLT: u32 = 0x4EE0_A800;
/// `n << s`, where bits 16 to 22 are `64 + s`.
const SHL: u32 = 0x4F00_5400;
/// Copy the first lane of `n` to both lanes.
const DUP: u32 = 0x4E08_0400;

/// The patterns of a load or a store of `size` bytes (16 or 8). The offset is in units of `size` (bits 10 to 21), in bytes (bits 12 to 20),
/// or in a register (bits 16 to 20).
struct Access {
    size: i32,
    scaled: u32,
    unscaled: u32,
    register: u32,
}

const LOAD: [Access; 2] = [
    Access { size: 16, scaled: 0x3DC0_0000, unscaled: 0x3CC0_0000, register: 0x3CE0_6800 },
    Access { size: 8, scaled: 0xFD40_0000, unscaled: 0xFC40_0000, register: 0xFC60_6800 },
];
const STORE: [Access; 2] = [
    Access { size: 16, scaled: 0x3D80_0000, unscaled: 0x3C80_0000, register: 0x3CA0_6800 },
    Access { size: 8, scaled: 0xFD00_0000, unscaled: 0xFC00_0000, register: 0xFC20_6800 },
];

impl Assemble for Assembler {
    fn new(form: Form) -> Self {
        assert!(form.set == Set::Neon, "aarch64 has NEON, got {:?}", form.set);
        Assembler { form, bytes: Vec::new() }
    }

    fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn binary(&mut self, op: Binary, dst: u8, a: u8, b: Source) {
        let b = self.fetch(b);
        match op {
            Binary::Add => self.number(FADD, dst, a, b),
            Binary::Sub => self.number(FSUB, dst, a, b),
            Binary::Mul => self.number(FMUL, dst, a, b),
            Binary::Div => self.number(FDIV, dst, a, b),
            Binary::And => self.word(AND, dst, a, b),
            Binary::AndNot => self.word(BIC, dst, b, a),
            Binary::Or => self.word(ORR, dst, a, b),
            Binary::Xor => self.word(EOR, dst, a, b),
            // FMIN and FMAX are not used, because they differ from `Min` and `Max` for NaN and zeros.
            Binary::Min => self.choose(dst, a, b, [b, a]),
            Binary::Max => self.choose(dst, a, b, [a, b]),
        }
    }

    fn fused(&mut self, product: Product, order: Order, dst: u8, a: u8, b: Source) {
        let b = self.fetch(b);
        let (x, y, z) = match order {
            Order::P231 => (a, b, dst),
            Order::P213 => (a, dst, b),
            Order::P132 => (dst, b, a),
        };
        if !self.form.packed {
            let word = match product {
                Product::Add => FMADD,
                Product::Sub => FNMSUB,
                Product::NegAdd => FMSUB,
                Product::NegSub => FNMADD,
            };
            return self.word(word | u32::from(z) << 10, dst, x, y);
        }
        let (word, negative) = match product {
            Product::Add => (FMLA, false),
            Product::Sub => (FMLA, true),
            Product::NegAdd => (FMLS, false),
            Product::NegSub => (FMLS, true),
        };
        // Compute the sum in `dst` if `dst` holds the addend. Use a scratch register if it does not, or if the negated addend would
        // overwrite a factor.
        let sum = match z {
            _ if dst == z && !(negative && (dst == x || dst == y)) => dst,
            FETCHED => FETCHED,
            _ => SCRATCH,
        };
        if negative {
            self.word(FNEG, sum, z, 0);
        } else {
            self.copy(sum, z);
        }
        self.word(word, sum, x, y);
        self.copy(dst, sum);
    }

    fn sqrt(&mut self, dst: u8, a: Source) {
        let a = self.fetch(a);
        self.number(FSQRT, dst, a, 0);
    }

    fn load(&mut self, dst: u8, from: Source) {
        match from {
            Source::Register(from) => self.copy(dst, from),
            Source::Slot(base, offset) => self.access(&LOAD[usize::from(!self.form.packed)], dst, base, offset),
            Source::Spread(base, offset) => {
                self.access(&LOAD[1], dst, base, offset);
                if self.form.packed {
                    self.word(DUP, dst, dst, 0);
                }
            }
        }
    }

    fn store(&mut self, base: Base, offset: i32, from: u8) {
        self.access(&STORE[usize::from(!self.form.packed)], from, base, offset);
    }

    fn less(&mut self, dst: u8, a: u8, b: Source) {
        let b = self.fetch(b);
        self.number(FCMGT, dst, b, a);
    }

    fn select(&mut self, dst: u8, mask: u8, yes: u8, no: u8) {
        if dst == no {
            self.word(BIT, dst, yes, mask);
        } else if dst == yes && dst != mask {
            self.word(BIF, dst, no, mask);
        } else {
            self.copy(dst, mask);
            self.word(BSL, dst, yes, no);
        }
    }

    fn sign_mask(&mut self, dst: u8, a: u8) {
        self.word(CMLT, dst, a, 0);
    }

    fn shift_left(&mut self, dst: u8, a: u8, bits: u8) {
        debug_assert!(bits < 64);
        self.word(SHL | u32::from(64 + bits) << 16, dst, a, 0);
    }

    /// On every system, the function must preserve the low halves of registers v8 to v15.
    fn enter(&mut self, _: CallingConvention) {
        // stp d8, d9, [sp, -64]!; stp d10, d11, [sp, 16]; ..
        self.pair(0x6D80_0000, 8, -8);
        (1..4).for_each(|i| self.pair(0x6D00_0000, 8 + 2 * i, 2 * i as i32));
    }

    fn here(&self) -> usize {
        self.bytes.len()
    }

    fn repeat_from(&mut self, start: usize, advance: u32) {
        // add x2, x2, #high, lsl #12; add x2, x2, #low; subs x3, x3, #1; b.ne start
        debug_assert!(advance < 1 << 24);
        self.push(0x9140_0042 | advance >> 12 << 10);
        self.push(0x9100_0042 | (advance & 0xFFF) << 10);
        self.push(0xF100_0463);
        let offset = (start as i32 - self.bytes.len() as i32) / 4;
        debug_assert!(offset >= -(1 << 18));
        self.push(0x5400_0001 | (offset as u32 & 0x7_FFFF) << 5);
    }

    fn leave(&mut self, _: CallingConvention) {
        // ldp d14, d15, [sp, 48]; ..; ldp d8, d9, [sp], 64
        (1..4).rev().for_each(|i| self.pair(0x6D40_0000, 8 + 2 * i, 2 * i as i32));
        self.pair(0x6CC0_0000, 8, 8);
    }

    fn ret(&mut self) {
        self.push(0xD65F_03C0);
    }
}

impl Assembler {
    fn push(&mut self, word: u32) {
        self.bytes.extend(word.to_le_bytes());
    }

    fn word(&mut self, pattern: u32, d: u8, n: u8, m: u8) {
        debug_assert!(d < 32 && n < 32 && m < 32);
        self.push(pattern | u32::from(m) << 16 | u32::from(n) << 5 | u32::from(d));
    }

    fn number(&mut self, patterns: [u32; 2], d: u8, n: u8, m: u8) {
        self.word(patterns[usize::from(!self.form.packed)], d, n, m);
    }

    fn copy(&mut self, dst: u8, from: u8) {
        if dst != from {
            self.word(ORR, dst, from, from);
        }
    }

    /// Write `a` to `dst` where `greater[0] > greater[1]`, otherwise `b`.
    fn choose(&mut self, dst: u8, a: u8, b: u8, greater: [u8; 2]) {
        let mask = if dst == a || dst == b { SCRATCH } else { dst };
        self.number(FCMGT, mask, greater[0], greater[1]);
        self.select(dst, mask, a, b);
    }

    /// Return the register of an operand. Load an operand that is in memory.
    fn fetch(&mut self, source: Source) -> u8 {
        if let Source::Register(register) = source {
            return register;
        }
        self.load(FETCHED, source);
        FETCHED
    }

    /// Load or store with the shortest form that can represent the offset.
    fn access(&mut self, access: &Access, register: u8, base: Base, offset: i32) {
        let base = match base {
            Base::Frame => 0,
            Base::Constants => 1,
            Base::Stream => 2,
        };
        if offset % access.size == 0 && (0..4096).contains(&(offset / access.size)) {
            self.word(access.scaled | ((offset / access.size) as u32) << 10, register, base, 0);
        } else if (-256..256).contains(&offset) {
            self.word(access.unscaled | (offset as u32 & 0x1FF) << 12, register, base, 0);
        } else {
            let [low, high] = [offset as u32 & 0xFFFF, offset as u32 >> 16];
            // movz sets the low 16 bits of the register and clears the rest. movn sets the low 16 bits and fills the rest with ones. movk
            // sets only bits 16 to 31.
            let (start, sign_bits) = if offset < 0 { (0x9280_0000 | (!low & 0xFFFF) << 5, 0xFFFF) } else { (0xD280_0000 | low << 5, 0) };
            self.word(start, OFFSET, 0, 0);
            if high != sign_bits {
                self.word(0xF2A0_0000 | high << 5, OFFSET, 0, 0);
            }
            self.word(access.register, register, base, OFFSET);
        }
    }

    /// Store or load the registers `first` and `first + 1` at the stack pointer plus `8 offset` bytes.
    fn pair(&mut self, pattern: u32, first: u8, offset: i32) {
        self.word(pattern | (offset as u32 & 0x7F) << 15 | u32::from(first + 1) << 10, first, STACK, 0);
    }
}

#[cfg(test)]
#[path = "aarch64_tests.rs"]
mod tests;
