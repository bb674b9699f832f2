//! An encoder of x86-64 machine code for straight-line programs: SSE2 (legacy encoding), AVX2 with FMA (VEX) and AVX-512 (EVEX). Source:
//! Intel 64 and IA-32 Architectures Software Developer's Manual, volume 2, chapter 2.
//!
//! An instruction is a prefix, an opcode, a ModRM byte (`mode reg rm`) and, for memory, a displacement. The prefix has the upper bits of
//! register numbers. In VEX and EVEX, it also has the first source operand of instructions with three operands. The encoder selects the
//! shortest of several encodings. Register rdi points to the frame (the memory of the program), and rsi to the constants. Register rdx
//! points to the stream (the inputs of a program that repeats). Register rcx has the number of remaining iterations.

use super::opcode::{Map, Opcode, Operand, Prefix, opcode};

pub use super::instruction::{Assemble, Base, Binary, CallingConvention, Form, Order, Product, Set, Source};

/// An encoder. It stores the machine code that it has already encoded.
pub struct Assembler {
    form: Form,
    bytes: Vec<u8>,
}

const RDX: u8 = 2;
const RSP: u8 = 4;
const RSI: u8 = 6;
const RDI: u8 = 7;
/// The mask register of comparisons and blends.
const K1: u8 = 1;
/// The scratch register of SSE2 code.
const SCRATCH: u8 = 15;
/// On Windows, the function must preserve xmm6 to xmm15. After the two pushes of `enter`, the stack is not aligned to 16 bytes. `STACK`
/// therefore has 8 additional bytes.
const SAVED: [u8; 10] = [6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
const STACK: i32 = 16 * SAVED.len() as i32 + 8;

fn address(base: Base) -> u8 {
    match base {
        Base::Frame => RDI,
        Base::Constants => RSI,
        Base::Stream => RDX,
    }
}

impl Assemble for Assembler {
    fn new(form: Form) -> Self {
        assert!(form.set != Set::Neon, "x86-64 has no NEON");
        Assembler { form, bytes: Vec::new() }
    }

    fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn binary(&mut self, op: Binary, dst: u8, a: u8, b: Source) {
        let byte = match op {
            Binary::And => 0x54,
            Binary::AndNot => 0x55,
            Binary::Or => 0x56,
            Binary::Xor => 0x57,
            Binary::Add => 0x58,
            Binary::Mul => 0x59,
            Binary::Sub => 0x5C,
            Binary::Min => 0x5D,
            Binary::Div => 0x5E,
            Binary::Max => 0x5F,
        };
        if !op.is_logic() {
            return self.three(opcode(self.number(), Map::M0F, byte), dst, a, b);
        }
        let mut b = b;
        if !self.form.packed && !matches!(b, Source::Register(_)) {
            let register = if self.form.set == Set::Sse2 { SCRATCH } else { dst };
            debug_assert!(register != a, "scalar logic with a memory operand requires dst != a");
            self.load(register, b);
            b = Source::Register(register);
        }
        self.three(opcode(self.bits(), Map::M0F, byte), dst, a, b);
    }

    fn fused(&mut self, product: Product, order: Order, dst: u8, a: u8, b: Source) {
        debug_assert!(self.form.set != Set::Sse2, "SSE2 has no fused multiply-add");
        let product = match product {
            Product::Add => 0x8,
            Product::Sub => 0xA,
            Product::NegAdd => 0xC,
            Product::NegSub => 0xE,
        };
        let order = match order {
            Order::P132 => 0x90,
            Order::P213 => 0xA0,
            Order::P231 => 0xB0,
        };
        let byte = order + product + u8::from(!self.form.packed);
        self.three(Opcode { wide: true, ..opcode(Prefix::P66, Map::M0F38, byte) }, dst, a, b);
    }

    fn sqrt(&mut self, dst: u8, a: Source) {
        // A scalar square root copies the upper half of its second operand, which no code reads. The second operand is the source register,
        // or `dst` for a source in memory.
        let second = match a {
            _ if self.form.packed => 0,
            Source::Register(a) => a,
            _ => dst,
        };
        let a = self.operand(a);
        self.encode(opcode(self.number(), Map::M0F, 0x51), dst, second, a);
    }

    fn load(&mut self, dst: u8, from: Source) {
        let packed = opcode(self.bits(), Map::M0F, 0x28);
        let scalar = opcode(Prefix::F2, Map::M0F, 0x10);
        let operand = self.operand(from);
        match (from, self.form) {
            // The store form of the instruction exchanges the registers. Its prefix is shorter if only the source register is 8 or higher.
            (Source::Register(from), Form { set: Set::Avx2, .. }) if from >= 8 && dst < 8 => {
                self.encode(opcode(self.bits(), Map::M0F, 0x29), from, 0, Operand::Register(dst));
            }
            (Source::Register(_), _) | (Source::Slot(..), Form { packed: true, .. }) => self.encode(packed, dst, 0, operand),
            (_, Form { packed: false, .. }) => self.encode(scalar, dst, 0, operand),
            (_, Form { set: Set::Sse2, .. }) => {
                self.encode(scalar, dst, 0, operand);
                self.encode(opcode(Prefix::P66, Map::M0F, 0x14), dst, dst, Operand::Register(dst));
            }
            _ => self.encode(Opcode { broadcast: true, ..opcode(Prefix::P66, Map::M0F38, 0x19) }, dst, 0, operand),
        }
    }

    fn store(&mut self, base: Base, offset: i32, from: u8) {
        let store = if self.form.packed { opcode(self.bits(), Map::M0F, 0x29) } else { opcode(Prefix::F2, Map::M0F, 0x11) };
        self.encode(store, from, 0, Operand::Memory(address(base), offset, false));
    }

    fn less(&mut self, dst: u8, a: u8, b: Source) {
        // For `a < b`, SSE2 has only the signalling comparison. The signalling and the quiet comparison set different exception flags, and
        // no code reads these flags.
        let compare = opcode(self.number(), Map::M0F, 0xC2).with(if self.form.set == Set::Sse2 { 0x01 } else { 0x11 });
        let registers = [dst, a, if let Source::Register(b) = b { b } else { 0 }];
        if self.form.set < Set::Avx512 || !self.form.packed && registers.iter().all(|&r| r < 16) {
            return self.three(Opcode { evex: Some(false), ..compare }, dst, a, b);
        }
        let b = self.operand(b);
        self.encode(Opcode { evex: Some(true), ..compare }, K1, a, b);
        self.encode(Opcode::masked(Prefix::F3, 0x38), dst, 0, Operand::Register(K1));
    }

    fn select(&mut self, dst: u8, mask: u8, yes: u8, no: u8) {
        match self.form.set {
            Set::Sse2 => self.select_bits(dst, mask, yes, no),
            _ if self.form.set == Set::Avx2 || !self.form.packed && [dst, mask, yes, no].iter().all(|&r| r < 16) => {
                self.encode(opcode(Prefix::P66, Map::M0F3A, 0x4B).with(mask << 4), dst, no, Operand::Register(yes));
            }
            _ => {
                self.encode(Opcode::masked(Prefix::F3, 0x39), K1, 0, Operand::Register(mask));
                self.encode(Opcode { blend: true, ..Opcode::masked(Prefix::P66, 0x65) }, dst, no, Operand::Register(yes));
            }
        }
    }

    fn sign_mask(&mut self, dst: u8, a: u8) {
        if self.form.set == Set::Sse2 {
            // Copy the upper half of each lane to its lower half. Then fill all bits with the sign bit.
            self.encode(opcode(Prefix::P66, Map::M0F, 0x70).with(0xF5), dst, 0, Operand::Register(a));
            self.encode(opcode(Prefix::P66, Map::M0F, 0x72).with(31), 4, 0, Operand::Register(dst));
        } else if dst != a {
            self.load(dst, Source::Register(a));
        }
    }

    fn shift_left(&mut self, dst: u8, a: u8, bits: u8) {
        debug_assert!(bits < 64 && (self.form.set != Set::Sse2 || dst == a));
        // In VEX and EVEX, the prefix contains the destination register.
        self.encode(opcode(Prefix::P66, Map::M0F, 0x73).with(bits), 6, dst, Operand::Register(a));
    }

    fn ret(&mut self) {
        // Without vzeroupper, later SSE code of the caller can be slow.
        if self.form.packed && self.form.set != Set::Sse2 {
            self.bytes.extend([0xC5, 0xF8, 0x77]);
        }
        self.bytes.push(0xC3);
    }

    fn enter(&mut self, convention: CallingConvention) {
        if convention == CallingConvention::Win64 {
            // push rdi; push rsi; mov rdi, rcx; mov rsi, rdx; mov rdx, r8; mov rcx, r9; sub rsp, STACK
            self.bytes.extend([0x57, 0x56, 0x48, 0x89, 0xCF, 0x48, 0x89, 0xD6, 0x4C, 0x89, 0xC2, 0x4C, 0x89, 0xC9, 0x48, 0x81, 0xEC]);
            self.bytes.extend(STACK.to_le_bytes());
            self.saved(0x29);
        }
    }

    fn here(&self) -> usize {
        self.bytes.len()
    }

    fn repeat_from(&mut self, start: usize, advance: u32) {
        // add rdx, advance; dec rcx; jnz start
        self.bytes.extend([0x48, 0x81, 0xC2]);
        self.bytes.extend(advance.to_le_bytes());
        self.bytes.extend([0x48, 0xFF, 0xC9, 0x0F, 0x85]);
        let offset = start as i32 - (self.bytes.len() as i32 + 4);
        self.bytes.extend(offset.to_le_bytes());
    }

    fn leave(&mut self, convention: CallingConvention) {
        if convention == CallingConvention::Win64 {
            self.saved(0x28);
            // add rsp, STACK; pop rsi; pop rdi
            self.bytes.extend([0x48, 0x81, 0xC4]);
            self.bytes.extend(STACK.to_le_bytes());
            self.bytes.extend([0x5E, 0x5F]);
        }
    }
}

impl Assembler {
    /// Compute `no ^ (mask & (yes ^ no))`. Registers may be equal.
    fn select_bits(&mut self, dst: u8, mask: u8, yes: u8, no: u8) {
        // The difference `yes ^ no` is computed in `dst`, unless a later instruction reads `dst`.
        let difference = if dst == no || dst == mask { SCRATCH } else { dst };
        if difference != yes {
            self.load(difference, Source::Register(yes));
        }
        self.binary(Binary::Xor, difference, difference, Source::Register(no));
        if dst == no {
            self.binary(Binary::And, difference, difference, Source::Register(mask));
            self.binary(Binary::Xor, dst, dst, Source::Register(difference));
        } else {
            self.binary(Binary::And, dst, dst, Source::Register(if dst == mask { difference } else { mask }));
            self.binary(Binary::Xor, dst, dst, Source::Register(no));
        }
    }

    /// Store (`byte` 0x29) or load (`byte` 0x28) the registers that the caller expects unchanged, 16 bytes each.
    fn saved(&mut self, byte: u8) {
        let form = self.form;
        // Scalar code copies whole registers of 16 bytes. AVX-512 code uses the encodings of AVX2.
        self.form = Form { set: form.set.min(Set::Avx2), packed: false };
        for (i, &register) in SAVED.iter().enumerate() {
            self.encode(opcode(self.bits(), Map::M0F, byte), register, 0, Operand::Memory(RSP, 16 * i as i32, false));
        }
        self.form = form;
    }

    /// The prefix of instructions on numbers.
    fn number(&self) -> Prefix {
        if self.form.packed { Prefix::P66 } else { Prefix::F2 }
    }

    /// The prefix of instructions on bits. Legacy code without a prefix is one byte shorter and has the same effect.
    fn bits(&self) -> Prefix {
        if self.form.set == Set::Sse2 { Prefix::None } else { Prefix::P66 }
    }

    fn operand(&self, source: Source) -> Operand {
        match source {
            Source::Register(register) => Operand::Register(register),
            Source::Slot(base, offset) => Operand::Memory(address(base), offset, false),
            // In scalar code, a broadcast number is an ordinary operand.
            Source::Spread(base, offset) => Operand::Memory(address(base), offset, self.form.packed),
        }
    }

    /// Encode an instruction with three operands, or with two in legacy code.
    fn three(&mut self, opcode: Opcode, dst: u8, a: u8, b: Source) {
        debug_assert!(self.form.set != Set::Sse2 || dst == a, "SSE2 requires dst == a, got {dst} and {a}");
        let embedded = self.form == Form { set: Set::Avx512, packed: true };
        let b = self.operand(b);
        debug_assert!(embedded || !matches!(b, Operand::Memory(_, _, true)), "only packed AVX-512 spreads an operand");
        self.encode(opcode, dst, a, b);
    }

    /// Encode one instruction with the operands `reg`, `second` and `rm`. Only VEX and EVEX have `second`. It is 0 if unused.
    fn encode(&mut self, opcode: Opcode, reg: u8, second: u8, rm: Operand) {
        let high = if let Operand::Register(rm) = rm { rm } else { 0 };
        debug_assert!((reg | second | high) < if self.form.set == Set::Avx512 { 32 } else { 16 });
        // EVEX counts displacements of one byte in units of the operand's size.
        let mut unit = 1;
        if self.form.set == Set::Sse2 {
            self.legacy(opcode, reg, high);
        } else {
            let (offset, spread) = if let Operand::Memory(_, offset, spread) = rm { (offset, spread) } else { (0, false) };
            let size = if spread { 8 } else { self.form.width() as i32 };
            let better = self.form.packed || (reg | second | high) >= 16 || !fits(offset, 1) && fits(offset, size);
            if opcode.evex.unwrap_or(self.form.set == Set::Avx512 && better) {
                unit = size;
                self.evex(opcode, reg, second, high, spread);
            } else {
                self.vex(opcode, reg, second, high);
            }
        }
        self.bytes.push(opcode.byte);
        self.address(reg, rm, unit);
        self.bytes.extend(opcode.immediate);
    }

    fn legacy(&mut self, opcode: Opcode, reg: u8, rm: u8) {
        match opcode.prefix {
            Prefix::None => {}
            Prefix::P66 => self.bytes.push(0x66),
            Prefix::F3 => self.bytes.push(0xF3),
            Prefix::F2 => self.bytes.push(0xF2),
        }
        if (reg | rm) >= 8 {
            self.bytes.push(0x40 | (reg >> 3) << 2 | rm >> 3);
        }
        self.bytes.push(0x0F);
    }

    fn vex(&mut self, opcode: Opcode, reg: u8, second: u8, rm: u8) {
        let length = u8::from(self.form.packed) << 2;
        let last = (!second & 15) << 3 | length | opcode.prefix as u8;
        let reg = (!reg >> 3 & 1) << 7;
        if rm < 8 && opcode.map == Map::M0F && !opcode.wide {
            self.bytes.extend([0xC5, reg | last]);
        } else {
            let rm = (!rm >> 3 & 1) << 5;
            self.bytes.extend([0xC4, reg | 1 << 6 | rm | opcode.map as u8, u8::from(opcode.wide) << 7 | last]);
        }
    }

    fn evex(&mut self, opcode: Opcode, reg: u8, second: u8, rm: u8, spread: bool) {
        let registers = (!reg >> 3 & 1) << 7 | (!rm >> 4 & 1) << 6 | (!rm >> 3 & 1) << 5 | (!reg >> 4 & 1) << 4;
        let middle = 1 << 7 | (!second & 15) << 3 | 1 << 2 | opcode.prefix as u8;
        let length = u8::from(self.form.packed) << 6;
        let last = length | u8::from(spread && !opcode.broadcast) << 4 | (!second >> 4 & 1) << 3 | u8::from(opcode.blend);
        self.bytes.extend([0x62, registers | opcode.map as u8, middle, last]);
    }

    /// Append the ModRM byte and the displacement, in the fewest bytes.
    fn address(&mut self, reg: u8, rm: Operand, unit: i32) {
        let reg = (reg & 7) << 3;
        let (base, offset) = match rm {
            Operand::Register(rm) => return self.bytes.push(0xC0 | reg | rm & 7),
            Operand::Memory(base, offset, _) => (base, offset),
        };
        let mode = if offset == 0 { 0 } else { 1 + u8::from(!fits(offset, unit)) };
        self.bytes.push(mode << 6 | reg | base);
        if base == RSP {
            self.bytes.push(0x24);
        }
        match mode {
            0 => {}
            1 => self.bytes.push((offset / unit) as i8 as u8),
            _ => self.bytes.extend(offset.to_le_bytes()),
        }
    }
}

/// Whether a displacement is a signed byte multiplied by `unit`.
fn fits(offset: i32, unit: i32) -> bool {
    offset % unit == 0 && i8::try_from(offset / unit).is_ok()
}

#[cfg(all(test, target_arch = "x86_64", unix))]
#[path = "x86_run_tests.rs"]
mod run_tests;
#[cfg(test)]
#[path = "x86_tests.rs"]
mod tests;
