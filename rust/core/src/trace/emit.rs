//! Machine code from a straight-line program. If all registers are used, the value with the furthest next read leaves its register (Belady
//! 1966).
//!
//! This value is then stored in a slot of the frame (the memory of the program), unless it is already in memory. New slots follow the slots
//! of the program. An instruction reads a value directly from memory if it can, and if the value is not read again soon.

use super::instruction::{Assemble, Base, Binary, CallingConvention, Form, Order, Product, Set, Source};
use super::lifetimes::{Lifetimes, NEVER};
use super::straight::{Instruction, Straight};

/// A value in memory is loaded into a register if it is read again within this number of instructions. Otherwise, the instruction reads it
/// from memory.
const SOON: u32 = 24;

/// Machine code and its constants.
pub struct Emitted {
    pub bytes: Vec<u8>,
    /// The constants. The second argument of the code points to them.
    pub constants: Vec<f64>,
    /// The number of slots that a frame of the code requires.
    pub slots: usize,
    /// The number of values that were stored because no register was free.
    pub spilled: usize,
}

/// Emit `program` for `form`. Values without a register use slots from `first` on.
pub fn emit<A: Assemble>(program: &Straight, form: Form, first: usize) -> Emitted {
    let (assembler, emitted) = assemble::<A>(program, form, first);
    Emitted { bytes: assembler.finish(), ..emitted }
}

/// Emit `program` like [`emit`], and return the assembler instead of its bytes.
pub(super) fn assemble<A: Assemble>(program: &Straight, form: Form, first: usize) -> (A, Emitted) {
    let lifetimes = Lifetimes::of(program);
    let values = program.instructions.len();
    let mut emitter: Emitter<A> = Emitter {
        program,
        lifetimes: &lifetimes,
        form,
        assembler: A::new(form),
        register: vec![None; values],
        spill: vec![None; values],
        holder: vec![None; form.registers()],
        free_slots: Vec::new(),
        leaving: Vec::new(),
        slots: first as u32,
        spilled: 0,
        constant: vec![None; values],
        constants: Vec::new(),
        at: 0,
    };
    emitter.run();
    let Emitter { assembler, constants, slots, spilled, .. } = emitter;
    (assembler, Emitted { bytes: Vec::new(), constants, slots: slots as usize, spilled })
}

/// An emission in progress.
struct Emitter<'a, A> {
    program: &'a Straight,
    lifetimes: &'a Lifetimes,
    form: Form,
    assembler: A,
    /// For each value, its register. A value may have both a register and a slot.
    register: Vec<Option<u8>>,
    /// For each value, the slot of the frame in which it is stored.
    spill: Vec<Option<u32>>,
    /// The value in each register.
    holder: Vec<Option<u32>>,
    free_slots: Vec<u32>,
    /// Slots whose values this instruction reads for the last time. They become free after the instruction.
    leaving: Vec<u32>,
    slots: u32,
    spilled: usize,
    /// For each value, its index in `constants` if it is a constant that the code reads from memory.
    constant: Vec<Option<u32>>,
    constants: Vec<f64>,
    /// The position of the present instruction in program order.
    at: u32,
}

impl<A: Assemble> Emitter<'_, A> {
    fn run(&mut self) {
        self.assembler.enter(CallingConvention::HERE);
        let start = self.assembler.here();
        let lifetimes = self.lifetimes;
        let mut early = lifetimes.early.iter().peekable();
        for (at, &i) in lifetimes.order.iter().enumerate() {
            self.at = at as u32;
            let to = self.instruction(self.program.instructions[i as usize]);
            (self.register[i as usize], self.holder[to as usize]) = (Some(to), Some(i));
            while let Some((_, slot)) = early.next_if(|(position, _)| *position == self.at) {
                self.assembler.store(Base::Frame, self.offset(*slot), to);
            }
            self.release([i, i, i]);
            self.free_slots.append(&mut self.leaving);
        }
        self.at = lifetimes.order.len() as u32;
        for &(slot, value) in &lifetimes.late {
            let from = self.obtain(value, [value; 3]);
            self.assembler.store(Base::Frame, self.offset(slot), from);
        }
        if let Some(stream) = self.program.stream {
            let width = if stream.spread { 8 } else { self.form.width() as u32 };
            self.assembler.repeat_from(start, stream.advance * width);
        }
        self.assembler.leave(CallingConvention::HERE);
        self.assembler.ret();
    }

    fn offset(&self, slot: u32) -> i32 {
        slot as i32 * self.form.width() as i32
    }

    fn dies(&self, value: u32) -> bool {
        self.lifetimes.next_read(value, self.at + 1) == NEVER
    }

    /// Free the registers and slots of those `values` that this instruction reads for the last time.
    fn release(&mut self, values: [u32; 3]) {
        for value in values {
            if self.dies(value) {
                if let Some(register) = self.register[value as usize].take() {
                    self.holder[register as usize] = None;
                }
                if let Some(slot) = self.spill[value as usize].take() {
                    self.leaving.push(slot);
                }
            }
        }
    }

    /// Return the memory operand of a value. `None` means that the value is only in a register.
    fn memory(&mut self, value: u32) -> Option<Source> {
        if let Some(slot) = self.spill[value as usize] {
            return Some(Source::Slot(Base::Frame, self.offset(slot)));
        }
        match self.program.instructions[value as usize] {
            Instruction::Input(slot) => Some(self.input(slot)),
            Instruction::Const(bits) => Some(self.constant(value, f64::from_bits(bits))),
            _ => None,
        }
    }

    /// Return the memory operand of an input.
    fn input(&self, slot: u32) -> Source {
        match self.program.stream.and_then(|stream| Some((stream.spread, stream.place(slot)?))) {
            None => Source::Slot(Base::Frame, self.offset(slot)),
            Some((false, place)) => Source::Slot(Base::Stream, self.offset(place)),
            Some((true, place)) => Source::Spread(Base::Stream, 8 * place as i32),
        }
    }

    /// Whether a memory operand can be one number for all lanes: in AVX-512, and in code for one lane.
    fn spreads(&self) -> bool {
        !self.form.packed || self.form.set == Set::Avx512
    }

    /// Return the memory operand of a constant. Without broadcasts, memory has a copy of the constant for every lane.
    fn constant(&mut self, value: u32, x: f64) -> Source {
        let spreads = self.form.packed && self.spreads();
        let copies = if spreads { 1 } else { self.form.lanes() };
        let constants = &mut self.constants;
        let place = *self.constant[value as usize].get_or_insert_with(|| {
            constants.extend(std::iter::repeat_n(x, copies));
            (constants.len() - copies) as u32
        });
        if spreads { Source::Spread(Base::Constants, 8 * place as i32) } else { Source::Slot(Base::Constants, 8 * place as i32) }
    }

    /// Return a register for a new value. If none is free, free one. The operands of the present instruction remain in their registers.
    fn take(&mut self, operands: [u32; 3]) -> u8 {
        if let Some(free) = self.holder.iter().position(Option::is_none) {
            return free as u8;
        }
        let (mut furthest, mut best) = (0, 0);
        for (register, holder) in self.holder.iter().enumerate() {
            let Some(value) = holder.filter(|value| !operands.contains(value)) else { continue };
            // The value with the highest score is moved out of its register. Of two values with the same next read, prefer the value that
            // is already in memory.
            let in_memory = self.spill[value as usize].is_some() || self.program.instructions[value as usize].is_leaf();
            let score = 2 * u64::from(self.lifetimes.next_read(value, self.at)) + u64::from(in_memory) + 1;
            if score > furthest {
                (furthest, best) = (score, register);
            }
        }
        if let Some(value) = self.holder[best].take() {
            self.register[value as usize] = None;
            if self.memory(value).is_none() {
                let slot = self.free_slots.pop().unwrap_or(self.slots);
                self.slots = self.slots.max(slot + 1);
                self.spill[value as usize] = Some(slot);
                self.spilled += 1;
                self.assembler.store(Base::Frame, self.offset(slot), best as u8);
            }
        }
        best as u8
    }

    /// Return the register of a value. If the value has no register, load it.
    fn obtain(&mut self, value: u32, operands: [u32; 3]) -> u8 {
        if let Some(register) = self.register[value as usize] {
            return register;
        }
        let register = self.take(operands);
        if let Some(source) = self.memory(value) {
            self.assembler.load(register, source);
        }
        (self.register[value as usize], self.holder[register as usize]) = (Some(register), Some(value));
        register
    }

    /// Return a value as the last operand of an instruction. It is a memory operand unless the value should be in a register.
    fn operand(&mut self, value: u32, operands: [u32; 3]) -> Source {
        if self.register[value as usize].is_none() {
            let next = self.lifetimes.next_read(value, self.at + 1);
            if (next == NEVER || next - self.at > SOON)
                && let Some(source) = self.memory(value)
                && (self.spreads() || !matches!(source, Source::Spread(..)))
            {
                return source;
            }
        }
        Source::Register(self.obtain(value, operands))
    }

    /// Return the register for the result of an instruction with these operands. Its first operand is `a`, in register `from`. SSE2
    /// overwrites this register. If `a` is read again later, SSE2 code first copies `a` to the result's register.
    fn result(&mut self, a: u32, from: u8, operands: [u32; 3]) -> u8 {
        if self.form.set > Set::Sse2 {
            self.release(operands);
            return self.take(operands);
        }
        if self.dies(a) {
            self.release(operands);
            return from;
        }
        let to = self.take(operands);
        self.assembler.load(to, Source::Register(from));
        self.release(operands);
        to
    }

    fn instruction(&mut self, instruction: Instruction) -> u8 {
        use Instruction::*;
        match instruction {
            Input(_) | Const(_) => unreachable!("leaves are not computed"),
            Add(a, b) => self.commuting(Binary::Add, a, b),
            Mul(a, b) => self.commuting(Binary::Mul, a, b),
            And(a, b) => self.commuting(Binary::And, a, b),
            Xor(a, b) => self.commuting(Binary::Xor, a, b),
            Sub(a, b) => self.binary(Binary::Sub, a, b),
            Div(a, b) => self.binary(Binary::Div, a, b),
            AndNot(a, b) => self.binary(Binary::AndNot, a, b),
            // For equal numbers and NaN, the operations of the assembler return their second operand. `Max` and `Min` of `Instruction`
            // return `a`.
            Max(a, b) => self.binary(Binary::Max, b, a),
            Min(a, b) => self.binary(Binary::Min, b, a),
            Fma(a, b, c) => self.fused(Product::Add, a, b, c),
            Fms(a, b, c) => self.fused(Product::Sub, a, b, c),
            Fnma(a, b, c) => self.fused(Product::NegAdd, a, b, c),
            Fnms(a, b, c) => self.fused(Product::NegSub, a, b, c),
            Less(a, b) => {
                let (from, source) = self.pair(a, b, false);
                let to = self.result(a, from, [a, b, b]);
                self.assembler.less(to, from_or(to, from, self.form), source);
                to
            }
            Sqrt(a) => {
                let source = self.operand(a, [a; 3]);
                self.release([a; 3]);
                let to = self.take([a; 3]);
                self.assembler.sqrt(to, source);
                to
            }
            Signs(a) => {
                let from = self.obtain(a, [a; 3]);
                self.release([a; 3]);
                let to = self.take([a; 3]);
                self.assembler.sign_mask(to, from);
                to
            }
            Shift(a, by) => {
                let from = self.obtain(a, [a; 3]);
                let to = self.result(a, from, [a; 3]);
                self.assembler.shift_left(to, from_or(to, from, self.form), by);
                to
            }
            Select(mask, yes, no) => {
                let operands = [mask, yes, no];
                let registers = operands.map(|value| self.obtain(value, operands));
                self.release(operands);
                let to = self.take(operands);
                self.assembler.select(to, registers[0], registers[1], registers[2]);
                to
            }
        }
    }

    /// Return the operands of an instruction: the first in a register, the second in a register or in memory.
    fn pair(&mut self, a: u32, b: u32, logic: bool) -> (u8, Source) {
        let operands = [a, b, b];
        let from = self.obtain(a, operands);
        // Instructions on bits have no memory operand of the size of one number.
        let source = if logic && !self.form.packed { Source::Register(self.obtain(b, operands)) } else { self.operand(b, operands) };
        (from, source)
    }

    fn binary(&mut self, op: Binary, a: u32, b: u32) -> u8 {
        let (from, source) = self.pair(a, b, op.is_logic());
        let to = self.result(a, from, [a, b, b]);
        self.assembler.binary(op, to, from_or(to, from, self.form), source);
        to
    }

    fn commuting(&mut self, op: Binary, a: u32, b: u32) -> u8 {
        let swap = self.register[a as usize].is_none() && self.register[b as usize].is_some();
        if swap { self.binary(op, b, a) } else { self.binary(op, a, b) }
    }

    /// Emit a fused multiply-add of `a b` and `c`. If an operand is read for the last time, the result replaces it in its register.
    fn fused(&mut self, product: Product, a: u32, b: u32, c: u32) -> u8 {
        let operands = [a, b, c];
        let ends = |this: &Self, value: u32| {
            this.register[value as usize].is_some() && this.dies(value) && operands.iter().filter(|&&other| other == value).count() == 1
        };
        if ends(self, c) {
            let (a, b) = if self.register[a as usize].is_none() && self.register[b as usize].is_some() { (b, a) } else { (a, b) };
            let from = self.obtain(a, operands);
            let source = self.operand(b, operands);
            let to = self.obtain(c, operands);
            self.assembler.fused(product, Order::P231, to, from, source);
            self.release(operands);
            return to;
        }
        for (dying, other) in [(a, b), (b, a)] {
            if ends(self, dying) {
                let from = self.obtain(other, operands);
                let source = self.operand(c, operands);
                let to = self.obtain(dying, operands);
                self.assembler.fused(product, Order::P213, to, from, source);
                self.release(operands);
                return to;
            }
        }
        let (from, second) = (self.obtain(a, operands), self.obtain(b, operands));
        let third = match self.register[c as usize] {
            Some(register) => Source::Register(register),
            None => self.memory(c).unwrap_or(Source::Register(from)),
        };
        let to = self.take(operands);
        self.assembler.load(to, third);
        self.assembler.fused(product, Order::P231, to, from, Source::Register(second));
        self.release(operands);
        to
    }
}

/// The register of the first operand. In SSE2 it equals the register of the result.
fn from_or(to: u8, from: u8, form: Form) -> u8 {
    if form.set == Set::Sse2 { to } else { from }
}
