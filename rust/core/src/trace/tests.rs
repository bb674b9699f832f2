//! Random programs: machine code and the interpreter of the tape have equal bits, and both compute the recorded value. The tape is the list
//! of recorded operations, so these tests check the lowering of operations to instructions, too.

use super::emit::{Emitted, emit};
use super::frame::Frame;
use super::instruction::{Assemble, Form, Set};
use super::lower::lower;
use super::program::{Engine, Program};
use super::segments::{self, Cut};
use super::simulator::simulate;
use super::straight::{Part, Scratch, SlotTable, Straight, Stream};
use super::sym::{self, Sym};
use super::tape::Op;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::scalar::{Array8, Isa, Real, isa};

/// A small random generator (xorshift, Marsaglia 2003).
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n
    }
    pub fn number(&mut self) -> f64 {
        self.below(2_000_001) as f64 * 2e-6 - 2.0
    }
}

/// The forms of code that this machine can run.
pub fn forms() -> Vec<Form> {
    let sets: &[Set] = match isa() {
        _ if cfg!(target_arch = "aarch64") => &[Set::Neon],
        Isa::Baseline => &[Set::Sse2],
        Isa::Avx2 => &[Set::Sse2, Set::Avx2],
        Isa::Avx512 => &[Set::Sse2, Set::Avx2, Set::Avx512],
    };
    sets.iter().flat_map(|&set| [true, false].map(|packed| Form { set, packed })).collect()
}

/// A random tape with its outputs, as pairs `(slot, entry)`, and its stream.
pub struct RandomTape {
    ops: Vec<Op>,
    outputs: Vec<(u32, u32)>,
    pub inputs: usize,
    pub stream: Option<Stream>,
}

impl RandomTape {
    /// The number of slots of inputs, outputs and the largest angle.
    pub fn slots(&self) -> usize {
        self.inputs + 9
    }

    pub fn scratch(&self) -> Scratch {
        Scratch { reach: self.inputs as u32 + 8, free: self.slots() }
    }

    fn part<'a>(&'a self, places: &'a SlotTable) -> Part<'a> {
        Part { ops: &self.ops, start: 0, outputs: &self.outputs, places }
    }

    /// Emit machine code for `form`.
    pub fn emitted<A: Assemble>(&self, form: Form) -> Emitted {
        let straight = lower(self.part(&SlotTable::default()), self.scratch().reach, form.has_fused());
        emit::<A>(&Straight { stream: self.stream, ..straight }, form, self.slots())
    }

    pub fn program(&self, form: Form, engine: Engine) -> Program {
        let program = Program::new(self.part(&SlotTable::default()), self.stream, self.scratch(), form, engine);
        assert_eq!(program.engine(), engine);
        program
    }

    /// Divide the tape into two programs. The first program stores the values that the second program reads.
    fn divided(&self, form: Form, engine: Engine) -> [Program; 2] {
        let end = self.ops.len() as u32;
        let mut cuts = [Cut { end: end / 2, outputs: Vec::new() }, Cut { end, outputs: self.outputs.clone() }];
        let (places, mut free) = segments::join(&self.ops, &mut cuts, self.slots() as u32);
        [0, 1].map(|k| {
            let part = Part { ops: &self.ops, start: k * (end / 2), outputs: &cuts[k as usize].outputs, places: &places };
            let program = Program::new(part, None, Scratch { free: free as usize, ..self.scratch() }, form, engine);
            free = program.slots() as u32;
            program
        })
    }

    /// In half of all cases with at least four inputs, declare some inputs from the third on as a stream. Return its memory for `turns`
    /// iterations, in cache lines.
    pub fn random_stream(&mut self, random: &mut Random, lanes: usize, turns: usize) -> Frame {
        if self.inputs < 4 || random.below(2) == 0 {
            return Frame::new(0, 1);
        }
        let first = 2 + random.below(self.inputs - 3);
        let count = 1 + random.below(self.inputs - first);
        let stream =
            Stream { first: first as u32, count: count as u32, advance: random.below(count + 2) as u32, spread: random.below(2) == 0 };
        self.stream = Some(stream);
        let mut numbers = Frame::new(stream.slots(turns), if stream.spread { 1 } else { lanes });
        numbers.numbers_mut().iter_mut().for_each(|x| *x = random.number());
        numbers
    }

    /// Clear the slots of the stream in the frame. Only the interpreter writes to them.
    pub fn forget_stream(&self, frame: &mut Frame) {
        if let Some(Stream { first, count, .. }) = self.stream {
            (first..first + count).for_each(|slot| frame.fill(slot as usize, 0.0));
        }
    }
}

/// Run a program. A program with a stream runs `turns` iterations.
pub fn run(program: &Program, frame: &mut Frame, stream: &Frame, turns: usize) {
    if stream.numbers().is_empty() {
        program.run(frame);
    } else {
        program.run_along(frame, stream.numbers(), turns);
    }
}

/// Return a tape of about `length` operations with `inputs` inputs. An operand is one of the last `window` values.
pub fn random_tape(random: &mut Random, inputs: usize, length: usize, window: usize) -> RandomTape {
    let mut ops: Vec<Op> = (0..inputs as u32).map(Op::Input).collect();
    // The constants 2 and -2 limit the results. Otherwise NaN would occur, and the sign and payload of a NaN may come from either operand.
    ops.extend([1.5f64, -0.25, -0.0, 2.0, -2.0, 0.5, 700.0].map(|x| Op::Const(x.to_bits())));
    let [most, least, half, many] = [3, 4, 5, 6].map(|k| inputs as u32 + k);
    // Masks and numbers are separate, because SSE2 requires masks whose bits are all set or all clear.
    let mut masks = Vec::new();
    let mut numbers: Vec<u32> = (0..ops.len() as u32 - 1).collect();
    while ops.len() < length {
        let (i, n) = (ops.len() as u32, numbers.len());
        let mut any = || numbers[n - 1 - random.below(window.min(n))];
        let (a, b, c) = (any(), any(), any());
        let mask = masks.last().copied();
        match random.below(20) {
            0 => ops.push(Op::Add(a, b)),
            1 => ops.push(Op::Sub(a, b)),
            2 => ops.push(Op::Mul(a, b)),
            3 => ops.extend([Op::Max(a, half), Op::Div(b, i)]),
            4 => ops.push(Op::Max(a, b)),
            5 => ops.push(Op::Min(a, b)),
            6 => ops.push(Op::Abs(b)),
            7 => ops.push(Op::Neg(a)),
            8 => ops.push(Op::Fma(a, b, c)),
            9 => ops.extend([Op::Neg(c), Op::Fma(a, b, i)]),
            10 => ops.push(Op::Fnma(a, b, c)),
            11 => ops.extend([Op::Neg(c), Op::Fnma(a, b, i)]),
            12 => {
                ops.push(Op::Less(a, b));
                masks.push(i);
                continue;
            }
            13 | 14 if mask.is_some() => ops.push(Op::Select(mask.unwrap(), a, b)),
            15 => ops.extend([Op::Abs(a), Op::Sqrt(i)]),
            // Angles in all quadrants. Some results are not read.
            kind @ (16 | 17) => {
                ops.extend([Op::Mul(a, many), Op::Sin(i), Op::Cos(i)]);
                match kind {
                    16 => numbers.extend([i + 1, i + 2]),
                    _ => numbers.push(i + 1 + random.below(2) as u32),
                }
                continue;
            }
            _ => ops.push(Op::Add(b, c)),
        }
        let last = ops.len() as u32 - 1;
        ops.extend([Op::Min(last, most), Op::Max(last + 1, least)]);
        numbers.push(last + 2);
    }
    // The last values are outputs, in new slots and in slots of inputs. Some values are in two slots.
    let tail: Vec<u32> = numbers.iter().rev().take(6).copied().collect();
    let mut outputs: Vec<(u32, u32)> = tail.iter().enumerate().map(|(k, &value)| (inputs as u32 + k as u32, value)).collect();
    outputs.extend([(0, tail[0]), (1, tail[2]), (inputs as u32 + 6, 2), (inputs as u32 + 7, inputs as u32)]);
    RandomTape { ops, outputs, inputs, stream: None }
}

#[test]
fn machine_code_and_interpreter_give_the_same_bits() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for form in forms() {
        for trial in 0..400 {
            let (inputs, length, window) = (3 + random.below(20), 20 + random.below(400), 2 + random.below(120));
            let mut tape = random_tape(&mut random, inputs, length, window);
            let turns = 1 + random.below(5);
            let stream = tape.random_stream(&mut random, form.lanes(), turns);
            let given: Vec<f64> = (0..inputs * form.lanes()).map(|_| random.number()).collect();
            let mut results = [Engine::Machine, Engine::Interpreter].map(|engine| {
                let program = tape.program(form, engine);
                let mut frame = Frame::new(program.slots(), form.lanes());
                program.prepare(&mut frame);
                frame.numbers_mut()[..given.len()].copy_from_slice(&given);
                run(&program, &mut frame, &stream, turns);
                tape.forget_stream(&mut frame);
                frame.numbers()[..tape.slots() * form.lanes()].iter().map(|x| x.to_bits()).collect::<Vec<_>>()
            });
            let interpreted = results[1].clone();
            assert_eq!(results[0], interpreted, "{form:?}, trial {trial}");
            // The comparison must detect a change of one bit.
            results[0][0] ^= 1;
            assert_ne!(results[0], interpreted);
        }
    }
}

#[test]
fn parts_of_a_tape_give_the_bits_of_the_whole_tape() {
    let mut random = Random(3);
    for form in forms() {
        for trial in 0..200 {
            let (inputs, length, window) = (3 + random.below(20), 20 + random.below(400), 2 + random.below(120));
            let tape = random_tape(&mut random, inputs, length, window);
            let given: Vec<f64> = (0..inputs * form.lanes()).map(|_| random.number()).collect();
            let whole = [tape.program(form, Engine::Interpreter)];
            let parts = [Engine::Machine, Engine::Interpreter].map(|engine| tape.divided(form, engine));
            let programs: [&[Program]; 3] = [&whole, &parts[0], &parts[1]];
            let results = programs.map(|programs| {
                let mut frame = Frame::new(programs.iter().map(Program::slots).max().unwrap(), form.lanes());
                programs.iter().for_each(|program| program.prepare(&mut frame));
                frame.numbers_mut()[..given.len()].copy_from_slice(&given);
                programs.iter().for_each(|program| program.run(&mut frame));
                frame.numbers()[..tape.scratch().reach as usize * form.lanes()].iter().map(|x| x.to_bits()).collect::<Vec<_>>()
            });
            assert!(results.iter().all(|result| *result == results[0]), "{form:?}, trial {trial}");
        }
    }
}

/// Code for all instruction sets of x86-64, on any machine: an interpreter runs its bytes.
#[test]
fn simulated_machine_code_gives_the_bits_of_the_interpreter() {
    let mut random = Random(11);
    for form in [Set::Sse2, Set::Avx2, Set::Avx512].into_iter().flat_map(|set| [true, false].map(|packed| Form { set, packed })) {
        for trial in 0..25 {
            let (inputs, length, window) = (3 + random.below(40), 20 + random.below(500), 2 + random.below(200));
            let mut tape = random_tape(&mut random, inputs, length, window);
            let turns = 1 + random.below(5);
            let stream = tape.random_stream(&mut random, form.lanes(), turns);
            let emitted = tape.emitted::<super::x86::Assembler>(form);
            let interpreter = tape.program(form, Engine::Interpreter);
            let [mut frame, mut expected] = [emitted.slots, interpreter.slots()].map(|slots| Frame::new(slots, form.lanes()));
            interpreter.prepare(&mut expected);
            for k in 0..inputs * form.lanes() {
                let x = random.number();
                (frame.numbers_mut()[k], expected.numbers_mut()[k]) = (x, x);
            }
            simulate(&emitted.bytes, frame.numbers_mut(), &emitted.constants, stream.numbers(), turns);
            run(&interpreter, &mut expected, &stream, turns);
            [&mut frame, &mut expected].into_iter().for_each(|frame| tape.forget_stream(frame));
            for k in 0..tape.slots() * form.lanes() {
                assert_eq!(frame.numbers()[k].to_bits(), expected.numbers()[k].to_bits(), "{form:?}, trial {trial}, number {k}");
            }
        }
    }
}

fn turned<S: Real>(x: S) -> (f64, f64) {
    let (sin, cos) = x.sin_cos();
    (sin.lane(0), cos.lane(0))
}

/// The interpreter is valid beyond the range of machine code, and does not report these angles.
#[test]
fn interpreter_reduces_every_angle_like_direct_evaluation() {
    let ops = [Op::Input(0), Op::Sin(0), Op::Cos(0)];
    let outputs = [(1, 1), (2, 2)];
    for form in forms() {
        let part = Part { ops: &ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        let program = Program::new(part, None, Scratch { reach: 3, free: 4 }, form, Engine::Interpreter);
        let mut frame = Frame::new(program.slots(), form.lanes());
        let angles = [0.3, 1.0e6, -7.1e5, 4.0e8, -1.0e300, 999_999.9, f64::INFINITY, 2.0];
        frame.slot_mut(0).copy_from_slice(&angles[..form.lanes()]);
        for angle in angles {
            frame.slot_mut(0)[0] = angle;
            frame.fill(3, 0.0);
            program.run(&mut frame);
            for lane in 0..form.lanes() {
                let angle = frame.slot_mut(0)[lane];
                // On x86-64, an `Array8` never fuses, like `Set::Sse2`.
                let (sin, cos) = match form.set {
                    Set::Sse2 => turned(Array8::splat(angle)),
                    _ => turned(angle),
                };
                for (k, expected) in [sin, cos].into_iter().enumerate() {
                    let found = frame.slot_mut(1 + k)[lane];
                    assert!(found.to_bits() == expected.to_bits() || angle.is_infinite() && found.is_nan(), "{form:?} {angle} {k}");
                }
                assert_eq!(frame.slot_mut(3)[lane], if angle.abs() < REDUCTION_LIMIT { angle.abs() } else { 0.0 });
            }
        }
    }
}

/// A computation with the arithmetic, the comparison and the selection of `Real`.
fn computation<S: Real>(x: &[S], gain: S) -> [S; 5] {
    let (s, c) = (x[0] * x[1]).sin_cos();
    let far = S::select(x[2].lt(x[3]), s, c.neg_mul_add(x[1], s));
    let sum = x.iter().fold(S::zero(), |sum, &x| gain.mul_add(x, sum));
    let known = S::splat(0.3).sin_cos().0 + S::splat(0.1).mul_add(S::splat(0.7), x[2] * x[3] + x[0] * x[1]);
    let folded = S::zero() * x[0] + S::splat(1.0) * x[1] - (-x[2]) + known;
    [far, sum / (x[4].abs() + S::splat(1.0)), folded, x[3].max(x[4]).min(S::splat(0.5)), (x[0] * x[0] + x[1] * x[1]).sqrt().recip() + c * s]
}

#[test]
fn a_recording_has_the_bits_of_what_was_recorded() {
    let mut random = Random(7);
    sym::begin();
    let gain = Sym::varying(3.0);
    assert_eq!(sym::end_set_up(), 1);
    let x: Vec<Sym> = (0..5).map(|_| sym::input()).collect();
    let outputs = computation(&x, gain);
    let recording = sym::finish();
    assert!(!recording.failed);
    assert_eq!(recording.values, [3.0]);
    let values: Vec<(u32, u32)> = outputs.iter().enumerate().map(|(k, y)| (6 + k as u32, y.index())).collect();
    for form in forms() {
        let part = Part { ops: &recording.ops, start: 0, outputs: &values, places: &SlotTable::default() };
        let programs =
            [Engine::Machine, Engine::Interpreter].map(|engine| Program::new(part, None, Scratch { reach: 11, free: 12 }, form, engine));
        for program in programs.iter().flat_map(|program| [program; 200]) {
            let mut frame = Frame::new(program.slots(), form.lanes());
            program.prepare(&mut frame);
            frame.fill(0, 3.0);
            frame.fill(11, 0.0);
            let x: Vec<Vec<f64>> = (0..form.lanes()).map(|_| (0..5).map(|_| 10.0 * random.number()).collect()).collect();
            for (lane, x) in x.iter().enumerate() {
                x.iter().enumerate().for_each(|(k, &x)| frame.slot_mut(1 + k)[lane] = x);
            }
            program.run(&mut frame);
            for (lane, x) in x.iter().enumerate() {
                let expected = match form.set {
                    Set::Sse2 => {
                        let x: Vec<Array8> = x.iter().map(|&x| Array8::splat(x)).collect();
                        computation(&x, Array8::splat(3.0)).map(|y| y.lane(0))
                    }
                    _ => computation(x, 3.0),
                };
                for (k, expected) in expected.iter().enumerate() {
                    let got = frame.slot_mut(6 + k)[lane];
                    assert_eq!(got.to_bits(), expected.to_bits(), "{form:?} {k}: {got} {expected}");
                }
                assert!(frame.slot_mut(11)[lane] >= (x[0] * x[1]).abs());
            }
        }
    }
}

#[test]
fn code_that_looks_at_a_value_fails_the_recording() {
    sym::begin();
    let x = Sym::varying(2.0);
    assert!(x.lane(0).is_nan());
    assert!(sym::finish().failed);
    sym::begin();
    assert_eq!(Sym::splat(2.0).lane(0), 2.0);
    assert!(!sym::finish().failed);
}

#[test]
fn a_number_of_the_set_up_that_is_one_has_another_structure_than_an_input() {
    let structure = |values: [f64; 3]| {
        sym::begin();
        for x in values {
            Sym::varying(x);
        }
        sym::finish().structure
    };
    assert_eq!(structure([2.5, 3.5, 4.5]), structure([-2.5, 7.0, 0.5]));
    for special in [0.0, 1.0, -1.0] {
        assert_ne!(structure([2.5, 3.5, 4.5]), structure([2.5, special, 4.5]), "{special}");
    }
}
