//! The operations of straight-line machine code and their operands, for every instruction set.
//!
//! A register holds one *slot*: one number per lane. Code reads and writes slots at offsets from base addresses, which are its first
//! arguments: the frame (inputs, outputs, spilled registers), the constants, and the stream. The *stream* is the array of inputs of a
//! program that repeats.

/// An instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Set {
    /// x86-64 without extensions: two lanes, 16 registers, the last of which is scratch.
    Sse2,
    /// AVX2 and FMA: four lanes, 16 registers.
    Avx2,
    /// AVX-512 F, DQ and VL: eight lanes, 32 registers, in scalar code too.
    Avx512,
    /// The vectors of aarch64: two lanes, 32 registers, the last two of which are scratch.
    Neon,
}

/// An instruction set, and the kind of code. Packed code computes all lanes of a register, scalar code one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    pub set: Set,
    pub packed: bool,
}

impl Form {
    /// The number of lanes that the code computes.
    pub fn lanes(self) -> usize {
        match self.set {
            _ if !self.packed => 1,
            Set::Sse2 | Set::Neon => 2,
            Set::Avx2 => 4,
            Set::Avx512 => 8,
        }
    }

    /// The number of registers for values, without the scratch registers of the encoder.
    pub fn registers(self) -> usize {
        match self.set {
            Set::Sse2 => 15,
            Set::Avx2 => 16,
            Set::Avx512 => 32,
            Set::Neon => 30,
        }
    }

    /// Whether the instruction set has fused multiply-add, which rounds once.
    pub fn has_fused(self) -> bool {
        self.set > Set::Sse2
    }

    /// Whether [`Assemble::select`] uses every bit of its mask. Otherwise, only the sign bit of the mask selects the lane.
    pub fn selects_bits(self) -> bool {
        match self.set {
            Set::Sse2 | Set::Neon => true,
            Set::Avx2 | Set::Avx512 => false,
        }
    }

    /// The size of one slot, in bytes.
    pub fn width(self) -> usize {
        8 * self.lanes()
    }
}

/// A base address that the code receives as an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// The first argument: the frame with inputs, outputs and spilled registers.
    Frame,
    /// The second argument: the constants.
    Constants,
    /// The third argument: the stream, which advances in each iteration. The fourth argument is the number of iterations.
    Stream,
}

/// An operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    Register(u8),
    /// The slot at `base + offset` bytes. In packed code this address must be a multiple of the slot's width.
    Slot(Base, i32),
    /// The number at `base + offset` bytes, broadcast to every lane.
    Spread(Base, i32),
}

/// An operation `a op b` on each lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    /// `if a < b { a } else { b }`: the result is `b` if one operand is NaN, and if both are zero.
    Min,
    /// `if a > b { a } else { b }`: the result is `b` if one operand is NaN, and if both are zero.
    Max,
    And,
    /// `!a & b`.
    AndNot,
    Or,
    Xor,
}

impl Binary {
    /// Whether the operation acts on bits and not on numbers.
    pub fn is_logic(self) -> bool {
        match self {
            Binary::And | Binary::AndNot | Binary::Or | Binary::Xor => true,
            Binary::Add | Binary::Sub | Binary::Mul | Binary::Div | Binary::Min | Binary::Max => false,
        }
    }
}

/// A fused multiply-add, which rounds once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// `x y + z`.
    Add,
    /// `x y - z`.
    Sub,
    /// `z - x y`.
    NegAdd,
    /// `-x y - z`.
    NegSub,
}

/// The roles of the registers `dst`, `a` and `b` in a [`Product`] of `x`, `y` and `z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The factors are `a` and `b`, and the addend is `dst`, which the result replaces.
    P231,
    /// The factors are `a` and `dst`, and the addend is `b`.
    P213,
    /// The factors are `dst` and `b`, and the addend is `a`.
    P132,
}

/// The calling convention: the registers of arguments, and the registers that a function must preserve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallingConvention {
    SystemV,
    Win64,
}

impl CallingConvention {
    /// The convention of `extern "C"` on the system for which this crate is compiled. The encoder of aarch64 does not read it.
    pub const HERE: CallingConvention = if cfg!(windows) { CallingConvention::Win64 } else { CallingConvention::SystemV };
}

/// An encoder of machine code. Each method appends the instructions of one operation. The registers of one call may be equal, unless the
/// method excludes it.
pub trait Assemble {
    fn new(form: Form) -> Self;

    fn finish(self) -> Vec<u8>;

    /// `dst = a op b`. SSE2 requires `dst == a`. Scalar AVX2 and AVX-512 require `dst != a` if `b` is in memory and `op` acts on bits. They
    /// have no such instruction with an operand of eight bytes, so that `b` is first loaded into `dst`.
    fn binary(&mut self, op: Binary, dst: u8, a: u8, b: Source);

    /// Compute `product` with the operands `dst`, `a`, `b` in the roles of `order`, and write it to `dst`. Not available in SSE2.
    fn fused(&mut self, product: Product, order: Order, dst: u8, a: u8, b: Source);

    /// Write the square root of `a` to `dst`.
    fn sqrt(&mut self, dst: u8, a: Source);

    /// `dst = from`: copy a register, load a slot, or broadcast one number to every lane.
    fn load(&mut self, dst: u8, from: Source);

    /// Store register `from` in the slot at `base + offset` bytes.
    fn store(&mut self, base: Base, offset: i32, from: u8);

    /// Set all bits of `dst` in lanes where `a < b`, and clear them in other lanes. A comparison with NaN is false. SSE2 requires
    /// `dst == a`.
    fn less(&mut self, dst: u8, a: u8, b: Source);

    /// Write `yes` to `dst` in lanes where the sign bit of `mask` is set, and `no` to the other lanes. SSE2 and NEON require full masks:
    /// all bits set or all clear.
    fn select(&mut self, dst: u8, mask: u8, yes: u8, no: u8);

    /// Write a mask for [`select`](Self::select) to `dst`. It is set in lanes where the sign bit of `a` is set.
    fn sign_mask(&mut self, dst: u8, a: u8);

    /// `dst = a << bits` in lanes of 64 bits. SSE2 requires `dst == a`.
    fn shift_left(&mut self, dst: u8, a: u8, bits: u8);

    /// The prologue of a function: move the arguments to the registers of the code, and save the caller's registers.
    fn enter(&mut self, convention: CallingConvention);

    /// The position of the next instruction, for [`repeat_from`](Self::repeat_from).
    fn here(&self) -> usize;

    /// Advance the stream by `advance` bytes, and jump to `start` unless this iteration is the last one.
    fn repeat_from(&mut self, start: usize, advance: u32);

    /// Restore the registers that [`enter`](Self::enter) saved. [`ret`](Self::ret) must follow.
    fn leave(&mut self, convention: CallingConvention);

    /// Return to the caller.
    fn ret(&mut self);
}
