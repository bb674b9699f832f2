//! Reference operations for tests of the encoders: plain Rust on arrays that represent registers.

use super::instruction::{Assemble, Base, Binary, Form, Order, Product, Set, Source};

/// One call of a method of [`Assemble`].
#[derive(Clone, Copy, Debug)]
pub enum Operation {
    Binary(Binary, u8, u8, Source),
    Fused(Product, Order, u8, u8, Source),
    Sqrt(u8, Source),
    Load(u8, Source),
    Store(Base, i32, u8),
    Less(u8, u8, Source),
    Select(u8, u8, u8, u8),
    SignMask(u8, u8),
    ShiftLeft(u8, u8, u8),
}

pub const BINARIES: [Binary; 10] =
    [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Min, Binary::Max, Binary::And, Binary::AndNot, Binary::Or, Binary::Xor];
pub const PRODUCTS: [Product; 4] = [Product::Add, Product::Sub, Product::NegAdd, Product::NegSub];
pub const ORDERS: [Order; 3] = [Order::P231, Order::P213, Order::P132];
/// Special numbers for rounding, signs and comparisons.
pub const SPECIAL: [f64; 12] =
    [0.0, -0.0, 1.0, -1.0, 1.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, -f64::NAN, f64::MIN_POSITIVE, 5e-324, f64::MAX];

/// Random bits (xorshift64*). Equal seeds produce equal sequences.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() >> 33) as usize % end
    }

    /// Return a special number, a number of order one, or arbitrary bits.
    pub fn number(&mut self) -> f64 {
        match self.below(4) {
            0 => SPECIAL[self.below(SPECIAL.len())],
            1 => f64::from_bits(self.bits()),
            _ => (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0,
        }
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    /// Return a random operation of this form. It uses the first `registers` registers and `slots` slots.
    pub fn operation(&mut self, form: Form, registers: usize, slots: usize) -> Operation {
        let Form { set, packed } = form;
        let (two, spreads) = (set == Set::Sse2, set >= Set::Avx512 || !packed);
        let [dst, mut a, b, c] = std::array::from_fn(|_| self.below(registers) as u8);
        let base = self.of(&[Base::Frame, Base::Constants]);
        let slot = (form.width() * self.below(slots)) as i32;
        let number = 8 * self.below(slots * form.lanes()) as i32;
        let mut source = match self.below(4) {
            0 => Source::Slot(base, slot),
            1 if spreads => Source::Spread(base, number),
            _ => Source::Register(b),
        };
        let kind = self.below(9);
        if two && matches!(kind, 0 | 5 | 8) {
            a = dst;
        }
        match kind {
            1 if !two => Operation::Fused(self.of(&PRODUCTS), self.of(&ORDERS), dst, a, source),
            0 | 1 => {
                let op = self.of(&BINARIES);
                if op.is_logic() && !packed && matches!(set, Set::Avx2 | Set::Avx512) && dst == a {
                    source = Source::Register(b);
                }
                Operation::Binary(op, dst, if two { dst } else { a }, source)
            }
            2 => Operation::Sqrt(dst, source),
            3 => Operation::Load(dst, if self.below(3) == 0 { Source::Spread(base, number) } else { source }),
            4 => Operation::Store(Base::Frame, slot, a),
            5 => Operation::Less(dst, a, source),
            6 => Operation::Select(dst, a, b, c),
            7 => Operation::SignMask(dst, a),
            _ => Operation::ShiftLeft(dst, a, self.below(64) as u8),
        }
    }
}

impl Operation {
    /// The index of the operation's variant.
    pub fn kind(self) -> usize {
        match self {
            Operation::Binary(..) => 0,
            Operation::Fused(..) => 1,
            Operation::Sqrt(..) => 2,
            Operation::Load(..) => 3,
            Operation::Store(..) => 4,
            Operation::Less(..) => 5,
            Operation::Select(..) => 6,
            Operation::SignMask(..) => 7,
            Operation::ShiftLeft(..) => 8,
        }
    }

    pub fn emit(self, code: &mut impl Assemble) {
        match self {
            Operation::Binary(op, dst, a, b) => code.binary(op, dst, a, b),
            Operation::Fused(product, order, dst, a, b) => code.fused(product, order, dst, a, b),
            Operation::Sqrt(dst, a) => code.sqrt(dst, a),
            Operation::Load(dst, from) => code.load(dst, from),
            Operation::Store(base, offset, from) => code.store(base, offset, from),
            Operation::Less(dst, a, b) => code.less(dst, a, b),
            Operation::Select(dst, mask, yes, no) => code.select(dst, mask, yes, no),
            Operation::SignMask(dst, a) => code.sign_mask(dst, a),
            Operation::ShiftLeft(dst, a, bits) => code.shift_left(dst, a, bits),
        }
    }
}

/// The registers and memory of the reference operations.
pub struct Machine {
    pub form: Form,
    pub registers: Vec<[f64; 8]>,
    pub frame: Vec<f64>,
    pub constants: Vec<f64>,
}

impl Machine {
    fn source(&self, source: Source) -> [f64; 8] {
        let memory = |base| if base == Base::Frame { &self.frame } else { &self.constants };
        match source {
            Source::Register(register) => self.registers[register as usize],
            Source::Slot(base, offset) => {
                let slot = &memory(base)[offset as usize / 8..][..self.form.lanes()];
                std::array::from_fn(|lane| slot.get(lane).copied().unwrap_or(0.0))
            }
            Source::Spread(base, offset) => [memory(base)[offset as usize / 8]; 8],
        }
    }

    pub fn apply(&mut self, operation: Operation) {
        let register = |register: u8| self.registers[register as usize];
        let (dst, lanes): (u8, [f64; 8]) = match operation {
            Operation::Binary(op, dst, a, b) => (dst, each(register(a), self.source(b), |a, b| binary(op, a, b))),
            Operation::Fused(product, order, dst, a, b) => {
                let (d, a, b) = (register(dst), register(a), self.source(b));
                let (x, y, z) = match order {
                    Order::P231 => (a, b, d),
                    Order::P213 => (a, d, b),
                    Order::P132 => (d, b, a),
                };
                (dst, std::array::from_fn(|lane| fused(product, x[lane], y[lane], z[lane])))
            }
            Operation::Sqrt(dst, a) => (dst, self.source(a).map(f64::sqrt)),
            Operation::Load(dst, from) => (dst, self.source(from)),
            Operation::Store(base, offset, from) => {
                let (from, lanes) = (register(from), self.form.lanes());
                let memory = if base == Base::Frame { &mut self.frame } else { &mut self.constants };
                return memory[offset as usize / 8..][..lanes].copy_from_slice(&from[..lanes]);
            }
            Operation::Less(dst, a, b) => (dst, each(register(a), self.source(b), |a, b| f64::from_bits(if a < b { u64::MAX } else { 0 }))),
            Operation::Select(dst, mask, yes, no) => {
                let (mask, yes, no) = (register(mask), register(yes), register(no));
                let full = |mask: f64| (mask.to_bits() as i64 >> 63) as u64;
                let bits = |mask: f64| if self.form.selects_bits() { mask.to_bits() } else { full(mask) };
                let merge = |mask: u64, yes: f64, no: f64| f64::from_bits(mask & yes.to_bits() | !mask & no.to_bits());
                (dst, std::array::from_fn(|lane| merge(bits(mask[lane]), yes[lane], no[lane])))
            }
            // In forms that do not select bits, only the sign bit of a mask is defined.
            Operation::SignMask(dst, a) if self.form.selects_bits() => {
                (dst, register(a).map(|a| f64::from_bits((a.to_bits() as i64 >> 63) as u64)))
            }
            Operation::SignMask(dst, a) => (dst, register(a)),
            Operation::ShiftLeft(dst, a, bits) => (dst, register(a).map(|a| f64::from_bits(a.to_bits() << bits))),
        };
        self.registers[dst as usize] = lanes;
    }
}

fn each(a: [f64; 8], b: [f64; 8], f: impl Fn(f64, f64) -> f64) -> [f64; 8] {
    std::array::from_fn(|lane| f(a[lane], b[lane]))
}

fn binary(op: Binary, a: f64, b: f64) -> f64 {
    let bits = |f: fn(u64, u64) -> u64| f64::from_bits(f(a.to_bits(), b.to_bits()));
    match op {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Min if a < b => a,
        Binary::Max if a > b => a,
        Binary::Min | Binary::Max => b,
        Binary::And => bits(|a, b| a & b),
        Binary::AndNot => bits(|a, b| !a & b),
        Binary::Or => bits(|a, b| a | b),
        Binary::Xor => bits(|a, b| a ^ b),
    }
}

fn fused(product: Product, x: f64, y: f64, z: f64) -> f64 {
    match product {
        Product::Add => x.mul_add(y, z),
        Product::Sub => x.mul_add(y, -z),
        Product::NegAdd => (-x).mul_add(y, z),
        Product::NegSub => (-x).mul_add(y, -z),
    }
}
