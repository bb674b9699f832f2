//! A program without machine code: a loop over its instructions. Each instruction computes all lanes of the frame, which is the memory of
//! the program.
//!
//! The results have the same bits as the emitted code of the same instruction set. Tests compare both results. The portable program runs
//! where the system refuses executable memory, on processors other than x86-64 and AArch64, and if the environment variable
//! `ARMLET_PROGRAMS` is `portable`. Computed values are in slots after the slots of the program. After the last read of a value, its slot
//! is reused.

use super::frame::Frame;
use super::lifetimes::{Lifetimes, NEVER};
use super::straight::{Instruction, Straight, Stream};
use crate::scalar::{Isa, isa};

/// An instruction. The operands of `what` are slots, and `to` is the slot of the result.
#[derive(Clone, Copy, Debug)]
struct Step {
    what: Instruction,
    to: u32,
}

/// A program that is evaluated instruction by instruction. All its values are in slots of its frame.
#[derive(Clone, Debug)]
pub struct Portable {
    steps: Vec<Step>,
    /// The copies between slots at the end of a run, in order, as pairs `(from, to)`.
    copies: Vec<(u32, u32)>,
    /// The constants: `(slot, number)`.
    constants: Vec<(u32, f64)>,
    stream: Option<Stream>,
    slots: usize,
}

impl Portable {
    /// Assign slots to the values of `program`. New slots begin at `first`.
    pub fn new(program: &Straight, first: usize) -> Self {
        let lifetimes = Lifetimes::of(program);
        let (mut place, mut free, mut next) = (vec![0u32; program.instructions.len()], Vec::new(), first as u32);
        let mut constants = Vec::new();
        for (i, instruction) in program.instructions.iter().enumerate() {
            match *instruction {
                Instruction::Input(slot) => place[i] = slot,
                Instruction::Const(bits) => {
                    (place[i], next) = (next, next + 1);
                    constants.push((place[i], f64::from_bits(bits)));
                }
                _ => {}
            }
        }
        let mut steps = Vec::with_capacity(lifetimes.order.len());
        let mut early = lifetimes.early.iter().peekable();
        for (at, &i) in lifetimes.order.iter().enumerate() {
            let at = at as u32;
            let instruction = program.instructions[i as usize];
            let to = free.pop().unwrap_or(next);
            next = next.max(to + 1);
            place[i as usize] = to;
            steps.push(Step { what: instruction.on(|a| place[a as usize]), to });
            while let Some((_, slot)) = early.next_if(|(position, _)| *position == at) {
                // A selection between a value and itself is a copy.
                steps.push(Step { what: Instruction::Select(to, to, to), to: *slot });
            }
            let mut dead: Vec<u32> = instruction.operands().chain([i]).collect();
            dead.sort_unstable();
            dead.dedup();
            for a in dead {
                let computed = !program.instructions[a as usize].is_leaf();
                if computed && lifetimes.next_read(a, at + 1) == NEVER {
                    free.push(place[a as usize]);
                }
            }
        }
        let copies = lifetimes.late.iter().map(|&(slot, value)| (place[value as usize], slot)).collect();
        Portable { steps, copies, constants, stream: program.stream, slots: next as usize }
    }

    /// The number of slots that a frame of the program requires.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Write the constants into a new frame.
    pub fn prepare(&self, frame: &mut Frame) {
        for &(slot, x) in &self.constants {
            frame.fill(slot as usize, x);
        }
    }

    /// Run on a prepared frame. `turns` is the number of iterations along the stream.
    pub fn run(&self, frame: &mut Frame, stream: &[f64], turns: usize) {
        assert!(frame.numbers().len() >= self.slots * frame.lanes(), "the frame has too few slots");
        for turn in 0..turns {
            if let Some(inputs) = &self.stream {
                let width = if inputs.spread { 1 } else { frame.lanes() };
                let from = stream[inputs.advance as usize * turn * width..].chunks_exact(width);
                for (slot, from) in (inputs.first..inputs.first + inputs.count).zip(from) {
                    let to = frame.slot_mut(slot as usize);
                    if inputs.spread { to.fill(from[0]) } else { to.copy_from_slice(from) }
                }
            }
            self.turn(frame);
        }
    }

    fn turn(&self, frame: &mut Frame) {
        let lanes = frame.lanes();
        let numbers = frame.numbers_mut();
        match (lanes, isa() >= Isa::Avx2) {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `isa()` reports AVX2, which includes FMA here.
            (1, true) => unsafe { self.fused::<1>(numbers) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `isa()` reports AVX2, which includes FMA here.
            (4, true) => unsafe { self.fused::<4>(numbers) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `isa()` reports AVX2, which includes FMA here.
            (8, true) => unsafe { self.fused::<8>(numbers) },
            (1, _) => self.all::<1>(numbers),
            (2, _) => self.all::<2>(numbers),
            (4, _) => self.all::<4>(numbers),
            (8, _) => self.all::<8>(numbers),
            _ => unreachable!("a frame has 1, 2, 4 or 8 lanes"),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn fused<const L: usize>(&self, numbers: &mut [f64]) {
        self.all::<L>(numbers);
    }

    fn all<const L: usize>(&self, numbers: &mut [f64]) {
        let (slots, _) = numbers.as_chunks_mut::<L>();
        for step in &self.steps {
            let value = evaluate::<L>(step.what, slots);
            slots[step.to as usize] = value;
        }
        for &(from, to) in &self.copies {
            slots[to as usize] = slots[from as usize];
        }
    }
}

fn evaluate<const L: usize>(what: Instruction, slots: &[[f64; L]]) -> [f64; L] {
    use Instruction::*;
    let at = |a: u32| slots[a as usize];
    let bits = |a: u32, b: u32, f: fn(u64, u64) -> u64| each(at(a), at(b), |x, y| f64::from_bits(f(x.to_bits(), y.to_bits())));
    match what {
        Input(a) => at(a),
        Const(bits) => [f64::from_bits(bits); L],
        Add(a, b) => each(at(a), at(b), |x, y| x + y),
        Sub(a, b) => each(at(a), at(b), |x, y| x - y),
        Mul(a, b) => each(at(a), at(b), |x, y| x * y),
        Div(a, b) => each(at(a), at(b), |x, y| x / y),
        Max(a, b) => each(at(a), at(b), |x, y| if x < y { y } else { x }),
        Min(a, b) => each(at(a), at(b), |x, y| if y < x { y } else { x }),
        And(a, b) => bits(a, b, |x, y| x & y),
        AndNot(a, b) => bits(a, b, |x, y| !x & y),
        Xor(a, b) => bits(a, b, |x, y| x ^ y),
        Fma(a, b, c) => fused(at(a), at(b), at(c)),
        Fms(a, b, c) => fused(at(a), at(b), at(c).map(|x| -x)),
        Fnma(a, b, c) => fused(at(a).map(|x| -x), at(b), at(c)),
        Fnms(a, b, c) => fused(at(a).map(|x| -x), at(b), at(c).map(|x| -x)),
        Sqrt(a) => at(a).map(f64::sqrt),
        Less(a, b) => each(at(a), at(b), |x, y| mask(x < y)),
        Signs(a) => at(a).map(|x| mask(x.is_sign_negative())),
        Select(m, yes, no) => {
            let (mask, yes, no) = (at(m), at(yes), at(no));
            std::array::from_fn(|i| if mask[i].is_sign_negative() { yes[i] } else { no[i] })
        }
        Shift(a, by) => at(a).map(|x| f64::from_bits(x.to_bits() << by)),
    }
}

fn each<const L: usize>(a: [f64; L], b: [f64; L], f: impl Fn(f64, f64) -> f64) -> [f64; L] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

fn fused<const L: usize>(a: [f64; L], b: [f64; L], c: [f64; L]) -> [f64; L] {
    std::array::from_fn(|i| a[i].mul_add(b[i], c[i]))
}

fn mask(set: bool) -> f64 {
    f64::from_bits(if set { u64::MAX } else { 0 })
}
