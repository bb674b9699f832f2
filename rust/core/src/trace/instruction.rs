//! The operations of straight-line machine code and their operands, for every instruction set.
//!
//! A register holds one *slot*: one number per lane. Code reads and writes slots relative to addresses, which are its first arguments. They
//! are the frame (inputs, outputs, spilled registers), the constants, and the stream of a program that repeats.

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

/// An instruction set and whether its code is packed: every lane of a register, or one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    pub set: Set,
    pub packed: bool,
}

impl Form {
    /// Numbers per register that the code computes.
    pub fn lanes(self) -> usize {
        match self.set {
            _ if !self.packed => 1,
            Set::Sse2 | Set::Neon => 2,
            Set::Avx2 => 4,
            Set::Avx512 => 8,
        }
    }

    /// Registers that the caller may use; scratch registers are not counted.
    pub fn registers(self) -> usize {
        match self.set {
            Set::Sse2 => 15,
            Set::Avx2 => 16,
            Set::Avx512 => 32,
            Set::Neon => 30,
        }
    }

    /// Whether the set has products and sums with one rounding.
    pub fn has_fused(self) -> bool {
        self.set > Set::Sse2
    }

    /// Whether [`Assemble::select`] selects bits by the bits of its mask, instead of lanes by the sign bit.
    pub fn selects_bits(self) -> bool {
        matches!(self.set, Set::Sse2 | Set::Neon)
    }

    /// Bytes of one slot.
    pub fn width(self) -> usize {
        8 * self.lanes()
    }
}

/// An address that the code receives as an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// The first argument: inputs, outputs and spilled registers.
    Frame,
    /// The second argument.
    Constants,
    /// The third argument, which advances in each iteration. The fourth argument is the number of iterations.
    Stream,
}

/// An operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    Register(u8),
    /// One slot at `base + offset` bytes. Packed code requires an address that is a multiple of the slot's width.
    Slot(Base, i32),
    /// The number at `base + offset` bytes, in every lane.
    Spread(Base, i32),
}

/// `a op b`, lane by lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    /// `if a < b { a } else { b }`: `b` if one is NaN, and if both are zero.
    Min,
    /// `if a > b { a } else { b }`: `b` if one is NaN, and if both are zero.
    Max,
    And,
    /// `!a & b`.
    AndNot,
    Or,
    Xor,
}

impl Binary {
    /// Whether the operation is on bits, not on numbers.
    pub fn is_logic(self) -> bool {
        matches!(self, Binary::And | Binary::AndNot | Binary::Or | Binary::Xor)
    }
}

/// A product and a sum with one rounding.
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

/// The roles of the operands `dst`, `a`, `b` as `x y, z` of a [`Product`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// `dst = a b, dst`: the sum is formed in place.
    P231,
    /// `dst = a dst, b`.
    P213,
    /// `dst = dst b, a`.
    P132,
}

/// How a caller passes arguments, and the registers that it expects to remain unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    SystemV,
    Win64,
}

impl Convention {
    /// The convention of `extern "C"` on the system that this is compiled for.
    pub const HERE: Convention = if cfg!(windows) { Convention::Win64 } else { Convention::SystemV };
}

/// An encoder of machine code. A method appends the instructions of one operation. Its registers may be equal.
pub trait Assemble {
    fn new(form: Form) -> Self;

    fn finish(self) -> Vec<u8>;

    /// `dst = a op b`. SSE2 requires `dst == a`. Scalar AVX2 and AVX-512 require `dst != a` if `b` is in memory
    /// and `op` is logic. No such instruction reads a number of eight bytes, so `b` is loaded into `dst` first.
    fn binary(&mut self, op: Binary, dst: u8, a: u8, b: Source);

    /// `dst` = the product and sum of `dst, a, b` in the roles of `order`, with one rounding. Not available in SSE2.
    fn fused(&mut self, product: Product, order: Order, dst: u8, a: u8, b: Source);

    /// `dst` = the square root of `a`.
    fn sqrt(&mut self, dst: u8, a: Source);

    /// `dst = from`: move a register, load a slot, or load one number into every lane.
    fn load(&mut self, dst: u8, from: Source);

    /// Store `from` in the slot at `base + offset` bytes.
    fn store(&mut self, base: Base, offset: i32, from: u8);

    /// All bits of `dst` are ones in lanes where `a < b`, else zeros; zeros if one is NaN. SSE2 requires `dst == a`.
    fn less(&mut self, dst: u8, a: u8, b: Source);

    /// `dst = yes` in lanes where the sign bit of `mask` is set, else `no`.
    /// SSE2 and NEON require full masks: all ones or zeros.
    fn select(&mut self, dst: u8, mask: u8, yes: u8, no: u8);

    /// `dst` = a mask for [`select`](Self::select), set in lanes where the sign bit of `a` is set.
    fn sign_mask(&mut self, dst: u8, a: u8);

    /// `dst = a << bits` in lanes of 64 bits. SSE2 requires `dst == a`.
    fn shift_left(&mut self, dst: u8, a: u8, bits: u8);

    /// The prologue: move the arguments to the registers of the code, and save the caller's registers.
    fn enter(&mut self, convention: Convention);

    /// The place of the next instruction, for [`again`](Self::again).
    fn here(&self) -> usize;

    /// Advance the stream by `advance` bytes, and jump to `start` unless this was the last iteration.
    fn again(&mut self, start: usize, advance: u32);

    /// Restore the registers that [`enter`](Self::enter) saved, just before [`ret`](Self::ret).
    fn leave(&mut self, convention: Convention);

    /// Return to the caller.
    fn ret(&mut self);
}
