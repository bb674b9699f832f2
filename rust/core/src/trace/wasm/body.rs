//! The code of one function: instructions in stack order.
//!
//! A value that is read once becomes part of the expression that reads it. A value that is read several times, or is an output, has a
//! *local* (a register of WebAssembly). A local is free again after its last read.

use super::super::lifetimes::Lifetimes;
use super::super::straight::{Instruction, Straight};
use super::encode::*;

/// The type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// A number.
    Number,
    /// The bits of a number, a 64-bit integer.
    Bits,
    /// A mask: a 32-bit integer that is 1 where the sign bit of the number is set, otherwise 0.
    Mask,
}

impl Kind {
    fn code(self) -> u8 {
        match self {
            Kind::Number => 0x7c,
            Kind::Bits => 0x7e,
            Kind::Mask => 0x7f,
        }
    }
}

const SIGN: u64 = 1 << 63;

/// A part of an expression that is still to be written.
enum Task {
    /// Push the value as this type.
    Push(u32, Kind),
    Code(Vec<u8>),
}

struct Body<'a> {
    program: &'a Straight,
    /// The local of each value that has one.
    locals: Vec<Option<u32>>,
    /// The types of all locals.
    kinds: Vec<Kind>,
    code: Vec<u8>,
}

/// Return the code of a function with its declarations of locals, and the number of slots that it uses.
pub fn body(program: &Straight) -> (Vec<u8>, usize) {
    let instructions = &program.instructions;
    let count = instructions.len();
    let mut body = Body { program, locals: vec![None; count], kinds: Vec::new(), code: Vec::new() };
    let Lifetimes { order, early, late, .. } = Lifetimes::of(program);
    let early: Vec<(u32, u32)> = early.into_iter().map(|(at, slot)| (order[at as usize], slot)).collect();
    let rooted = body.rooted();
    let last = body.last_reads(&rooted, &late);
    let mut stores = early.iter().peekable();
    // For each position, the locals whose last read it is.
    let mut ends: Vec<Vec<u32>> = vec![Vec::new(); count + 1];
    let mut free: Vec<u32> = Vec::new();
    for v in (0..count as u32).filter(|&v| rooted[v as usize]) {
        body.write(body.expression(v));
        free.append(&mut ends[v as usize]);
        let kind = body.kind(v);
        let local = match free.iter().position(|&local| body.kinds[local as usize] == kind) {
            Some(at) => free.swap_remove(at),
            None => {
                body.kinds.push(kind);
                body.kinds.len() as u32 - 1
            }
        };
        body.local(LOCAL_SET, local);
        body.locals[v as usize] = Some(local);
        ends[(last[v as usize] as usize).min(count)].push(local);
        while let Some((_, slot)) = stores.next_if(|(value, _)| *value == v) {
            body.write(vec![Task::Code(vec![I32_CONST, 0]), Task::Push(v, Kind::Number)]);
            access(&mut body.code, F64_STORE, *slot as usize);
        }
        // A value that is only stored is free at once.
        if last[v as usize] == v {
            free.append(&mut ends[v as usize]);
        }
    }
    // All values are on the stack before the first store, because a slot of the results may also be an input.
    for &(_, value) in &late {
        body.write(vec![Task::Code(vec![I32_CONST, 0]), Task::Push(value, Kind::Number)]);
    }
    for &(slot, _) in late.iter().rev() {
        access(&mut body.code, F64_STORE, slot as usize);
    }
    let inputs = instructions.iter().filter_map(|i| if let Instruction::Input(slot) = i { Some(*slot) } else { None });
    let slots = inputs.chain(program.outputs.iter().map(|&(slot, _)| slot)).map(|slot| slot as usize + 1).max().unwrap_or(0);
    (body.finish(), slots)
}

impl Body<'_> {
    /// The type of a computed value.
    fn kind(&self, v: u32) -> Kind {
        use Instruction as I;
        match self.program.instructions[v as usize] {
            I::Less(..) | I::Signs(_) => Kind::Mask,
            I::And(..) | I::Shift(..) => Kind::Bits,
            I::AndNot(a, _) if !self.is_sign(a) => Kind::Bits,
            I::Xor(a, b) if !self.is_sign(a) && !self.is_sign(b) => Kind::Bits,
            _ => Kind::Number,
        }
    }

    /// Whether a value is the constant whose only set bit is the sign.
    fn is_sign(&self, v: u32) -> bool {
        self.program.instructions[v as usize] == Instruction::Const(SIGN)
    }

    /// For each value, whether it has a local: it is an output, or it is read several times.
    fn rooted(&self) -> Vec<bool> {
        let instructions = &self.program.instructions;
        let (mut reads, mut outputs) = (vec![0; instructions.len()], vec![false; instructions.len()]);
        self.program.outputs.iter().for_each(|&(_, value)| outputs[value as usize] = true);
        for (v, instruction) in instructions.iter().enumerate().rev() {
            if reads[v] == 0 && !outputs[v] {
                continue;
            }
            // The code of a maximum and of a minimum has each operand twice.
            let times = if matches!(instruction, Instruction::Max(..) | Instruction::Min(..)) { 2 } else { 1 };
            instruction.operands().for_each(|a| reads[a as usize] += times);
        }
        let rooted = |(v, instruction): (usize, &Instruction)| !instruction.is_leaf() && (outputs[v] || reads[v] > 1);
        instructions.iter().enumerate().map(rooted).collect()
    }

    /// For each value with a local: the last value with a local whose expression reads it. The number of values means a store at the end.
    fn last_reads(&self, rooted: &[bool], late: &[(u32, u32)]) -> Vec<u32> {
        let instructions = &self.program.instructions;
        let count = instructions.len() as u32;
        let mut last: Vec<u32> = vec![0; instructions.len()];
        late.iter().for_each(|&(_, value)| last[value as usize] = count);
        // `last` of a value without a local is the value whose expression contains it.
        for v in (0..count).rev() {
            let at = if rooted[v as usize] { v } else { last[v as usize] };
            if rooted[v as usize] {
                last[v as usize] = last[v as usize].max(v);
            }
            instructions[v as usize].operands().for_each(|a| last[a as usize] = last[a as usize].max(at));
        }
        last
    }

    /// The parts of the expression that computes `v` from its operands.
    fn expression(&self, v: u32) -> Vec<Task> {
        use Instruction as I;
        use Kind::{Bits, Mask, Number};
        use Task::Push;
        let code = |bytes: &[u8]| Task::Code(bytes.to_vec());
        let of = |a, b, opcode| vec![Push(a, Number), Push(b, Number), code(&[opcode])];
        // `yes` if `a < b`, otherwise `no`.
        let chosen = |yes, no, a, b| vec![Push(yes, Number), Push(no, Number), Push(a, Number), Push(b, Number), code(&[F64_LESS, SELECT])];
        let product = |a, b| [Push(a, Number), Push(b, Number), code(&[F64_MUL])];
        match self.program.instructions[v as usize] {
            I::Input(_) | I::Const(_) => vec![Push(v, Number)],
            I::Add(a, b) => of(a, b, F64_ADD),
            I::Sub(a, b) => of(a, b, F64_SUB),
            I::Mul(a, b) => of(a, b, F64_MUL),
            I::Div(a, b) => of(a, b, F64_DIV),
            I::Max(a, b) => chosen(b, a, a, b),
            I::Min(a, b) => chosen(b, a, b, a),
            I::Less(a, b) => of(a, b, F64_LESS),
            I::Sqrt(a) => vec![Push(a, Number), code(&[F64_SQRT])],
            I::Xor(a, b) if self.is_sign(b) => vec![Push(a, Number), code(&[F64_NEG])],
            I::Xor(a, b) if self.is_sign(a) => vec![Push(b, Number), code(&[F64_NEG])],
            I::AndNot(a, b) if self.is_sign(a) => vec![Push(b, Number), code(&[F64_ABS])],
            I::And(a, b) => vec![Push(a, Bits), Push(b, Bits), code(&[I64_AND])],
            I::Xor(a, b) => vec![Push(a, Bits), Push(b, Bits), code(&[I64_XOR])],
            I::AndNot(a, b) => vec![Push(a, Bits), code(&[I64_CONST, 0x7f, I64_XOR]), Push(b, Bits), code(&[I64_AND])],
            I::Shift(a, by) => vec![Push(a, Bits), shift(by, I64_SHIFT_LEFT)],
            I::Signs(a) => vec![Push(a, Mask)],
            I::Select(mask, yes, no) => vec![Push(yes, Number), Push(no, Number), Push(mask, Mask), code(&[SELECT])],
            // Lowering for WebAssembly makes no fused operation. Each of them would round twice.
            I::Fma(a, b, c) => product(a, b).into_iter().chain([Push(c, Number), code(&[F64_ADD])]).collect(),
            I::Fms(a, b, c) => product(a, b).into_iter().chain([Push(c, Number), code(&[F64_SUB])]).collect(),
            I::Fnma(a, b, c) => [Push(c, Number)].into_iter().chain(product(a, b)).chain([code(&[F64_SUB])]).collect(),
            I::Fnms(a, b, c) => product(a, b).into_iter().chain([code(&[F64_NEG]), Push(c, Number), code(&[F64_SUB])]).collect(),
        }
    }

    /// Write tasks in their order, with the expressions of values that have no local.
    fn write(&mut self, mut tasks: Vec<Task>) {
        tasks.reverse();
        while let Some(task) = tasks.pop() {
            let (v, wanted) = match task {
                Task::Code(bytes) => {
                    self.code.extend(bytes);
                    continue;
                }
                Task::Push(v, wanted) => (v, wanted),
            };
            match (self.program.instructions[v as usize], self.locals[v as usize]) {
                (Instruction::Const(bits), _) => self.constant(bits, wanted),
                (Instruction::Input(slot), _) => {
                    self.code.extend([I32_CONST, 0]);
                    access(&mut self.code, if wanted == Kind::Number { F64_LOAD } else { I64_LOAD }, slot as usize);
                    if wanted == Kind::Mask {
                        self.code.extend(conversion(Kind::Bits, Kind::Mask));
                    }
                }
                (_, Some(local)) => {
                    self.local(LOCAL_GET, local);
                    self.code.extend(conversion(self.kind(v), wanted));
                }
                _ => {
                    tasks.push(Task::Code(conversion(self.kind(v), wanted)));
                    tasks.extend(self.expression(v).into_iter().rev());
                }
            }
        }
    }

    fn constant(&mut self, bits: u64, wanted: Kind) {
        match wanted {
            Kind::Number => {
                self.code.push(F64_CONST);
                self.code.extend(bits.to_le_bytes());
            }
            Kind::Bits => {
                self.code.push(I64_CONST);
                signed(&mut self.code, bits as i64);
            }
            Kind::Mask => self.code.extend([I32_CONST, u8::from(bits & SIGN != 0)]),
        }
    }

    fn local(&mut self, opcode: u8, local: u32) {
        self.code.push(opcode);
        unsigned(&mut self.code, u64::from(local));
    }

    /// The code with the declarations of locals.
    fn finish(mut self) -> Vec<u8> {
        let (mut bytes, groups) = (Vec::new(), self.kinds.chunk_by(|a, b| a == b));
        unsigned(&mut bytes, groups.clone().count() as u64);
        for group in groups {
            unsigned(&mut bytes, group.len() as u64);
            bytes.push(group[0].code());
        }
        bytes.append(&mut self.code);
        bytes.push(END);
        bytes
    }
}

fn shift(by: u8, opcode: u8) -> Task {
    let mut bytes = vec![I64_CONST];
    signed(&mut bytes, i64::from(by));
    bytes.push(opcode);
    Task::Code(bytes)
}

/// The code that converts the value on the stack to another type.
fn conversion(from: Kind, to: Kind) -> Vec<u8> {
    // A mask as bits is all ones or zero.
    let spread = [I64_FROM_I32, I64_CONST, 63, I64_SHIFT_LEFT, I64_CONST, 63, I64_SHIFT_RIGHT];
    let negative = [I64_CONST, 0, I64_LESS];
    match (from, to) {
        (Kind::Number, Kind::Bits) => vec![I64_FROM_BITS],
        (Kind::Bits, Kind::Number) => vec![F64_FROM_BITS],
        (Kind::Bits, Kind::Mask) => negative.to_vec(),
        (Kind::Number, Kind::Mask) => [&[I64_FROM_BITS], &negative[..]].concat(),
        (Kind::Mask, Kind::Bits) => spread.to_vec(),
        (Kind::Mask, Kind::Number) => [&spread[..], &[F64_FROM_BITS]].concat(),
        _ => Vec::new(),
    }
}
