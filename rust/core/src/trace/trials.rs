//! Tests of single operations. A trial has machine code, memory before the run, and memory after the run as plain Rust computes it. The
//! frame is the memory that the code changes.

use super::checks::{Machine, Operation, Random};
use super::instruction::{Assemble, Base, CallingConvention, Form, Set, Source};

/// The number of slots that operations use, in the frame and in the constants.
pub const SLOTS: usize = 32;
/// The size of a memory in numbers. Its three parts are the slots of operations, the registers after the operations, and the registers
/// before the operations.
pub const SIZE: usize = 3 * PART;
const PART: usize = 8 * SLOTS;

#[repr(align(64))]
pub struct Memory(pub [f64; SIZE]);

pub struct Trial {
    pub form: Form,
    pub operation: Operation,
    pub code: Vec<u8>,
    pub frame: [f64; SIZE],
    pub constants: [f64; SIZE],
    /// The frame after the run.
    pub expected: [f64; SIZE],
}

impl Trial {
    /// Compare the frame after the run with the expected frame. Any NaN equals any other NaN.
    pub fn check(&self, frame: &[f64]) {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        let wrong = frame.iter().zip(&self.expected).position(|pair| !same(pair));
        let describe = |i: usize| format!("{:?} {:?}: number {i} is {} not {}", self.form, self.operation, frame[i], self.expected[i]);
        assert_eq!(wrong.map(describe), None);
    }
}

/// The offset in bytes of a register in part `part` of the frame.
fn slot(form: Form, part: usize, register: usize) -> i32 {
    8 * (PART * part + form.lanes() * register) as i32
}

/// Return code that loads all registers, runs the operations and stores all registers.
pub fn between_files<A: Assemble>(form: Form, operations: &[Operation]) -> Vec<u8> {
    let mut code = A::new(form);
    code.enter(CallingConvention::HERE);
    (0..form.registers()).for_each(|r| code.load(r as u8, Source::Slot(Base::Frame, slot(form, 2, r))));
    operations.iter().for_each(|operation| operation.emit(&mut code));
    (0..form.registers()).for_each(|r| code.store(Base::Frame, slot(form, 1, r), r as u8));
    code.leave(CallingConvention::HERE);
    code.ret();
    code.finish()
}

/// Return `count` trials with random operations and numbers. Every kind of operation of this form occurs.
pub fn trials<A: Assemble>(form: Form, count: usize, seed: u64) -> impl Iterator<Item = Trial> {
    let mut random = Random(seed);
    let mut seen = [0; 9];
    (0..count).map(move |i| {
        let operation = random.operation(form, form.registers(), SLOTS);
        seen[operation.kind()] += 1;
        let fused = |kind| kind == 1 && form.set == Set::Sse2;
        let rare = |(kind, &n): (usize, &usize)| n < count / 20 && !fused(kind);
        assert!(i + 1 < count || !seen.iter().enumerate().any(rare), "{seen:?}");
        trial::<A>(form, operation, &mut random)
    })
}

fn trial<A: Assemble>(form: Form, operation: Operation, random: &mut Random) -> Trial {
    let mut machine = Machine {
        form,
        registers: (0..form.registers()).map(|_| std::array::from_fn(|_| random.number())).collect(),
        frame: (0..PART).map(|_| random.number()).collect(),
        constants: (0..PART).map(|_| random.number()).collect(),
    };
    let memory = |machine: &Machine, part: usize| {
        let mut memory = [0.0; SIZE];
        memory[..PART].copy_from_slice(&machine.frame);
        for (r, values) in machine.registers.iter().enumerate() {
            memory[slot(form, part, r) as usize / 8..][..form.lanes()].copy_from_slice(&values[..form.lanes()]);
        }
        memory
    };
    let frame = memory(&machine, 2);
    let constants = std::array::from_fn(|i| machine.constants.get(i).copied().unwrap_or(0.0));
    machine.apply(operation);
    let mut expected = memory(&machine, 1);
    expected[2 * PART..].copy_from_slice(&frame[2 * PART..]);
    Trial { form, operation, code: between_files::<A>(form, &[operation]), frame, constants, expected }
}
