//! Listings: a program as text, one line per operation. The stages are the recording, the instructions and the machine code.
//!
//! A line has the form `to = kind(operands)`. An operand is the result of an earlier line, an input, a number, or the number of bits of a
//! shift. In machine code, results and operands can also be registers and slots of memory.

use super::instruction::Form;
use super::lower::lower;
use super::straight::{Instruction, Part, Scratch, Straight, Stream};
use super::tape::Op;

/// One line. Numbers are decimal text with enough digits to restore their bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub to: String,
    pub kind: &'static str,
    pub operands: Vec<String>,
}

/// The lines of one stage, in the order of computation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Listing {
    pub lines: Vec<Line>,
    /// The outputs of the program: `(output, value)`.
    pub outputs: Vec<(String, String)>,
}

/// Returns the name of a slot.
pub type Names<'a> = &'a dyn Fn(u32) -> String;

/// A part of a recording as straight-line instructions.
pub struct Lowered {
    pub straight: Straight,
    /// The slots that the part reads.
    pub inputs: Vec<u32>,
}

impl Lowered {
    /// Lower a part for `form`, as `Program::new` does.
    pub fn of(part: Part, stream: Option<Stream>, scratch: Scratch, form: Form) -> Self {
        let straight = Straight { stream, ..lower(part, scratch.reach, form.has_fused()) };
        let inputs =
            straight.instructions.iter().filter_map(|i| if let Instruction::Input(slot) = i { Some(*slot) } else { None }).collect();
        Lowered { straight, inputs }
    }

    /// List the instructions of the part.
    pub fn listing(&self, names: Names) -> Listing {
        let (mut values, mut lines) = (Vec::<String>::new(), Vec::new());
        for &instruction in &self.straight.instructions {
            values.push(match instruction {
                Instruction::Input(slot) => names(slot),
                Instruction::Const(bits) => number(f64::from_bits(bits)),
                _ => line(&mut lines, instruction.kind(), instruction.operands().map(|a| values[a as usize].clone()), instruction.bits()),
            });
        }
        let outputs = self.straight.outputs.iter().map(|&(slot, value)| (names(slot), values[value as usize].clone())).collect();
        Listing { lines, outputs }
    }
}

/// List the operations of a part of a recording on which its outputs depend.
pub fn recorded(part: Part, names: Names) -> Listing {
    let Part { ops, start, outputs, places } = part;
    let end = outputs.iter().map(|&(_, entry)| entry + 1).max().unwrap_or(start);
    let mut needed = vec![false; ops.len()];
    outputs.iter().for_each(|&(_, entry)| needed[entry as usize] = true);
    for i in (0..ops.len()).rev().filter(|&i| !part.is_before(i as u32)) {
        if needed[i] {
            part.reads(ops[i], false).for_each(|a| needed[a as usize] = true);
        }
    }
    let (mut values, mut lines) = (Vec::<String>::with_capacity(ops.len()), Vec::new());
    for (i, &op) in ops.iter().enumerate().take(end as usize) {
        values.push(match op {
            Op::Const(bits) => number(f64::from_bits(bits)),
            Op::Input(slot) => names(slot),
            _ if part.is_before(i as u32) => places.get(&(i as u32)).map_or(String::new(), |&slot| names(slot)),
            _ if !needed[i] => String::new(),
            // The lines are those of the formula. Native code is not listed.
            Op::Decided(_, given, _) => values[given as usize].clone(),
            _ => line(&mut lines, op.kind(), op.operands().map(|a| values[a as usize].clone()), None),
        });
    }
    let outputs = outputs.iter().map(|&(slot, entry)| (names(slot), values[entry as usize].clone())).collect();
    Listing { lines, outputs }
}

/// Add a line, and return the name of its result.
fn line(lines: &mut Vec<Line>, kind: &'static str, operands: impl Iterator<Item = String>, bits: Option<u8>) -> String {
    let to = format!("t{}", lines.len());
    lines.push(Line { to: to.clone(), kind, operands: operands.chain(bits.map(|bits| bits.to_string())).collect() });
    to
}

/// Return a number as decimal text with enough digits to restore its bits.
pub(super) fn number(x: f64) -> String {
    format!("{x:?}")
}

impl Op {
    /// The name of the operation, one word.
    pub fn kind(self) -> &'static str {
        match self {
            Op::Const(_) => "number",
            Op::Input(_) => "input",
            Op::Add(..) => "add",
            Op::Sub(..) => "sub",
            Op::Mul(..) => "mul",
            Op::Div(..) => "div",
            Op::Neg(_) => "neg",
            Op::Fma(..) => "fma",
            Op::Fnma(..) => "fnma",
            Op::Sqrt(_) => "sqrt",
            Op::Abs(_) => "abs",
            Op::Max(..) => "max",
            Op::Min(..) => "min",
            Op::Sin(_) => "sin",
            Op::Cos(_) => "cos",
            Op::Less(..) => "less",
            Op::Select(..) => "select",
            Op::Argument(..) | Op::Decide(..) | Op::Decided(..) => "cut",
        }
    }
}

impl Instruction {
    /// The name of the operation, one word.
    pub fn kind(self) -> &'static str {
        use Instruction::*;
        match self {
            Input(_) => "input",
            Const(_) => "number",
            Add(..) => "add",
            Sub(..) => "sub",
            Mul(..) => "mul",
            Div(..) => "div",
            Max(..) => "max",
            Min(..) => "min",
            And(..) => "and",
            AndNot(..) => "andnot",
            Xor(..) => "xor",
            Fma(..) => "fma",
            Fms(..) => "fms",
            Fnma(..) => "fnma",
            Fnms(..) => "fnms",
            Sqrt(_) => "sqrt",
            Less(..) => "less",
            Signs(_) => "signs",
            Select(..) => "select",
            Shift(..) => "shift",
        }
    }

    /// The number of places of a shift.
    fn bits(self) -> Option<u8> {
        if let Instruction::Shift(_, by) = self { Some(by) } else { None }
    }
}
