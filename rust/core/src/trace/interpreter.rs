//! The interpreter of the tape (the list of recorded operations). It defines the result of a program: tests compare machine code with it.
//!
//! Each step computes one operation for all lanes of the frame, which is the memory of the program. The results have the bits of machine
//! code of the same instruction set. Machine code is valid only for angles whose magnitude is below `REDUCTION_LIMIT`. The interpreter is
//! valid for every angle: it computes sine and cosine of larger angles as direct evaluation does.
//!
//! Programs are interpreted where the system refuses executable memory, on processors other than x86-64 and AArch64, and if the environment
//! variable `ARMLET_PROGRAMS` is `interpreter`.

use super::frame::Frame;
use super::instruction::Form;
use super::steps::{Action, Step, Steps, steps};
use super::straight::{Part, Scratch, Stream};
use crate::scalar::trig::{self, REDUCTION_LIMIT};
use crate::scalar::{Isa, isa};

/// A part of a tape that is evaluated operation by operation. All its values are in slots of its frame.
#[derive(Clone, Debug)]
pub struct Interpreter {
    steps: Vec<Step>,
    /// The constants: `(slot, number)`.
    constants: Vec<(u32, f64)>,
    stream: Option<Stream>,
    fused: bool,
    /// The slot of the largest magnitude of all angles below `REDUCTION_LIMIT`.
    reach: usize,
    slots: usize,
}

impl Interpreter {
    /// Assign slots to the values of a part of a tape. `form` is the form of machine code whose bits the results have.
    pub fn new(part: Part, stream: Option<Stream>, scratch: Scratch, form: Form) -> Self {
        let fused = form.has_fused();
        let Steps { steps, constants, slots } = steps(part, scratch.free, fused);
        Interpreter { steps, constants, stream, fused, reach: scratch.reach as usize, slots }
    }

    /// The number of slots that a frame of the program requires.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// The number of operations in one run.
    pub fn operations(&self) -> usize {
        self.steps.len()
    }

    /// Whether the program computes sines.
    pub fn turns(&self) -> bool {
        self.steps.iter().any(|step| matches!(step.action, Action::Turn))
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
            (1, true) => unsafe { self.fast::<1>(numbers) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `isa()` reports AVX2, which includes FMA here.
            (4, true) => unsafe { self.fast::<4>(numbers) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `isa()` reports AVX2, which includes FMA here.
            (8, true) => unsafe { self.fast::<8>(numbers) },
            (1, _) => self.rounded::<1>(numbers),
            (2, _) => self.rounded::<2>(numbers),
            (4, _) => self.rounded::<4>(numbers),
            (8, _) => self.rounded::<8>(numbers),
            _ => unreachable!("a frame has 1, 2, 4 or 8 lanes"),
        }
    }

    /// Evaluate with code for AVX2 and FMA, in which a fused multiply-add is one instruction.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn fast<const L: usize>(&self, numbers: &mut [f64]) {
        self.rounded::<L>(numbers);
    }

    #[inline(always)]
    fn rounded<const L: usize>(&self, numbers: &mut [f64]) {
        if self.fused { self.evaluate::<L, true>(numbers) } else { self.evaluate::<L, false>(numbers) }
    }

    #[inline(always)]
    fn evaluate<const L: usize, const FUSED: bool>(&self, numbers: &mut [f64]) {
        let (slots, _) = numbers.as_chunks_mut::<L>();
        for &Step { action, to, from: [a, b, c] } in &self.steps {
            let at = |a: u32| slots[a as usize];
            let value = match action {
                Action::Add => each(at(a), at(b), |x, y| x + y),
                Action::Sub => each(at(a), at(b), |x, y| x - y),
                Action::Mul => each(at(a), at(b), |x, y| x * y),
                Action::Div => each(at(a), at(b), |x, y| x / y),
                Action::Neg => at(a).map(|x| -x),
                Action::Fma => multiply_add::<L, FUSED>(at(a), at(b), at(c)),
                Action::Fms => multiply_add::<L, FUSED>(at(a), at(b), at(c).map(|x| -x)),
                Action::Fnma => multiply_add::<L, FUSED>(at(a).map(|x| -x), at(b), at(c)),
                Action::Fnms => multiply_add::<L, FUSED>(at(a).map(|x| -x), at(b), at(c).map(|x| -x)),
                Action::Sqrt => at(a).map(f64::sqrt),
                Action::Abs => at(a).map(f64::abs),
                Action::Max => each(at(a), at(b), |x, y| if x < y { y } else { x }),
                Action::Min => each(at(a), at(b), |x, y| if y < x { y } else { x }),
                Action::Less => each(at(a), at(b), |x, y| f64::from_bits(if x < y { u64::MAX } else { 0 })),
                Action::Select => {
                    let (mask, yes, no) = (at(a), at(b), at(c));
                    std::array::from_fn(|i| if mask[i].is_sign_negative() { yes[i] } else { no[i] })
                }
                Action::Turn => {
                    let x = at(a);
                    let (sin, cos) = sin_cos::<L, FUSED>(x);
                    slots[b as usize] = cos;
                    let reach = &mut slots[self.reach];
                    *reach = std::array::from_fn(|i| if reach[i] < x[i].abs() && !is_far(x[i]) { x[i].abs() } else { reach[i] });
                    sin
                }
                Action::Copy => at(a),
            };
            slots[to as usize] = value;
        }
    }
}

#[inline(always)]
fn each<const L: usize>(a: [f64; L], b: [f64; L], f: impl Fn(f64, f64) -> f64) -> [f64; L] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

#[inline(always)]
fn multiply_add<const L: usize, const FUSED: bool>(a: [f64; L], b: [f64; L], c: [f64; L]) -> [f64; L] {
    std::array::from_fn(|i| if FUSED { a[i].mul_add(b[i], c[i]) } else { a[i] * b[i] + c[i] })
}

/// Whether an angle, rad, requires the full reduction by the library function.
#[inline(always)]
fn is_far(x: f64) -> bool {
    x.abs() >= REDUCTION_LIMIT
}

#[inline(always)]
fn sin_cos<const L: usize, const FUSED: bool>(x: [f64; L]) -> ([f64; L], [f64; L]) {
    let (mut sin, mut cos) = (x, x);
    for i in 0..L {
        (sin[i], cos[i]) = trig::sin_cos_near_by(x[i], |a, b, c| if FUSED { a.mul_add(b, c) } else { a * b + c });
    }
    if x.iter().any(|&x| is_far(x)) {
        for i in (0..L).filter(|&i| is_far(x[i])) {
            (sin[i], cos[i]) = trig::sin_cos_far(x[i]);
        }
    }
    (sin, cos)
}
