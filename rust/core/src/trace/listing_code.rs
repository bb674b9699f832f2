//! Listings of machine code: one line per operation of the emitter, for any instruction set.
//!
//! Registers are `r0`, `r1` and so on. Values that were stored because no register was free are `spill0`, `spill1` and so on. Inputs and
//! numbers among the operands are in memory. An operation is one line, even if it has several machine instructions.

use super::emit::assemble;
use super::instruction::{Assemble, Base, Binary, CallingConvention, Form, Order, Product, Source};
use super::listing::{Line, Listing, Lowered, Names, number};

#[derive(Clone, Copy)]
enum Place {
    Register(u8),
    /// A base address and an offset in bytes.
    Memory(Base, i32),
    Bits(u8),
}

/// An assembler that records the operations instead of encoding them: the result, the name and the operands of each.
struct Writer(Vec<(Place, &'static str, Vec<Place>)>);

impl Lowered {
    /// List the machine code that the emitter makes for `form`. Spilled values are in slots from `free` on.
    pub fn code(&self, form: Form, free: usize, names: Names) -> Listing {
        let (writer, emitted) = assemble::<Writer>(&self.straight, form, free);
        let stream = self.straight.stream;
        let name = |place: &Place| match *place {
            Place::Register(k) => format!("r{k}"),
            Place::Bits(bits) => bits.to_string(),
            Place::Memory(Base::Constants, at) => number(emitted.constants[at as usize / 8]),
            Place::Memory(Base::Stream, at) => {
                let Some(stream) = stream else { return String::new() };
                names(stream.first + at as u32 / if stream.spread { 8 } else { form.width() as u32 })
            }
            Place::Memory(Base::Frame, at) => match (at as usize / form.width()).checked_sub(free) {
                Some(spill) => format!("spill{spill}"),
                None => names(at as u32 / form.width() as u32),
            },
        };
        let line = |(to, kind, operands): &(Place, &'static str, Vec<Place>)| Line {
            to: name(to),
            kind,
            operands: operands.iter().map(&name).collect(),
        };
        let outputs = self.straight.outputs.iter().map(|&(slot, _)| (names(slot), names(slot)));
        Listing { lines: writer.0.iter().map(line).collect(), outputs: outputs.collect() }
    }
}

impl Writer {
    fn line(&mut self, to: u8, kind: &'static str, operands: impl Into<Vec<Place>>) {
        self.0.push((Place::Register(to), kind, operands.into()));
    }
}

fn of(source: Source) -> Place {
    match source {
        Source::Register(k) => Place::Register(k),
        Source::Slot(base, at) | Source::Spread(base, at) => Place::Memory(base, at),
    }
}

impl Assemble for Writer {
    fn new(_: Form) -> Self {
        Writer(Vec::new())
    }
    fn finish(self) -> Vec<u8> {
        Vec::new()
    }
    fn binary(&mut self, op: Binary, dst: u8, a: u8, b: Source) {
        let (a, b) = (Place::Register(a), of(b));
        let (kind, operands) = match op {
            Binary::Add => ("add", [a, b]),
            Binary::Sub => ("sub", [a, b]),
            Binary::Mul => ("mul", [a, b]),
            Binary::Div => ("div", [a, b]),
            // As in `Instruction`, the first operand is the result unless the second one is smaller (`min`) or larger (`max`).
            Binary::Min => ("min", [b, a]),
            Binary::Max => ("max", [b, a]),
            Binary::And => ("and", [a, b]),
            Binary::AndNot => ("andnot", [a, b]),
            Binary::Or => ("or", [a, b]),
            Binary::Xor => ("xor", [a, b]),
        };
        self.line(dst, kind, operands);
    }
    fn fused(&mut self, product: Product, order: Order, dst: u8, a: u8, b: Source) {
        let (to, a, b) = (Place::Register(dst), Place::Register(a), of(b));
        let operands = match order {
            Order::P231 => [a, b, to],
            Order::P213 => [a, to, b],
            Order::P132 => [to, b, a],
        };
        let kind = match product {
            Product::Add => "fma",
            Product::Sub => "fms",
            Product::NegAdd => "fnma",
            Product::NegSub => "fnms",
        };
        self.line(dst, kind, operands);
    }
    fn sqrt(&mut self, dst: u8, a: Source) {
        self.line(dst, "sqrt", [of(a)]);
    }
    fn load(&mut self, dst: u8, from: Source) {
        self.line(dst, if matches!(from, Source::Register(_)) { "move" } else { "load" }, [of(from)]);
    }
    fn store(&mut self, base: Base, offset: i32, from: u8) {
        self.0.push((Place::Memory(base, offset), "store", vec![Place::Register(from)]));
    }
    fn less(&mut self, dst: u8, a: u8, b: Source) {
        self.line(dst, "less", [Place::Register(a), of(b)]);
    }
    fn select(&mut self, dst: u8, mask: u8, yes: u8, no: u8) {
        self.line(dst, "select", [mask, yes, no].map(Place::Register));
    }
    fn sign_mask(&mut self, dst: u8, a: u8) {
        self.line(dst, "signs", [Place::Register(a)]);
    }
    fn shift_left(&mut self, dst: u8, a: u8, bits: u8) {
        self.line(dst, "shift", [Place::Register(a), Place::Bits(bits)]);
    }
    fn enter(&mut self, _: CallingConvention) {}
    fn here(&self) -> usize {
        self.0.len()
    }
    fn repeat_from(&mut self, _: usize, _: u32) {}
    fn leave(&mut self, _: CallingConvention) {}
    fn ret(&mut self) {}
}
