//! Random programs: machine code and portable evaluation have equal bits, and both compute the recorded value.

use super::emit::emit;
use super::frame::Frame;
use super::instruction::{Form, Set};
use super::program::{Engine, Program, Scratch};
use super::simulator::simulate;
use super::straight::{Instruction, Part, SlotTable, Straight, Stream};
use super::sym::{self, Sym};
use crate::scalar::{Float, Real};
use crate::scalar::{Isa, isa};

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
fn forms() -> Vec<Form> {
    let sets: &[Set] = match isa() {
        _ if cfg!(target_arch = "aarch64") => &[Set::Neon],
        Isa::Baseline => &[Set::Sse2],
        Isa::Avx2 => &[Set::Sse2, Set::Avx2],
        Isa::Avx512 => &[Set::Sse2, Set::Avx2, Set::Avx512],
    };
    sets.iter().flat_map(|&set| [true, false].map(|packed| Form { set, packed })).collect()
}

/// In half of all cases with at least four inputs, declare some inputs from the third on as a stream. Return its memory for `turns`
/// iterations, in cache lines.
pub fn random_stream(random: &mut Random, program: &mut Straight, inputs: usize, lanes: usize, turns: usize) -> Frame {
    if inputs < 4 || random.below(2) == 0 {
        return Frame::new(0, 1);
    }
    let first = 2 + random.below(inputs - 3);
    let count = 1 + random.below(inputs - first);
    let stream = Stream { first: first as u32, count: count as u32, advance: random.below(count + 2) as u32, spread: random.below(2) == 0 };
    program.stream = Some(stream);
    let mut numbers = Frame::new(stream.slots(turns), if stream.spread { 1 } else { lanes });
    numbers.numbers_mut().iter_mut().for_each(|x| *x = random.number());
    numbers
}

/// Run a program. A program with a stream runs `turns` iterations.
fn run(program: &Program, frame: &mut Frame, stream: &Frame, turns: usize) {
    if stream.numbers().is_empty() {
        program.run(frame);
    } else {
        program.run_along(frame, stream.numbers(), turns);
    }
}

/// Clear the slots of the stream in the frame. Only portable evaluation writes to them.
pub fn forget_stream(stream: Option<Stream>, frame: &mut Frame) {
    if let Some(Stream { first, count, .. }) = stream {
        (first..first + count).for_each(|slot| frame.fill(slot as usize, 0.0));
    }
}

/// Return a program of `length` instructions with `inputs` inputs. An operand is one of the last `back` values.
pub fn random_program(random: &mut Random, inputs: usize, length: usize, back: usize, fused: bool) -> Straight {
    use Instruction::*;
    let mut instructions: Vec<Instruction> = (0..inputs as u32).map(Input).collect();
    // The constants 2 and -2 limit the results. Otherwise NaN would occur, and the sign and payload of a NaN may come from either operand.
    instructions.extend([1.5f64, -0.25, -0.0, 2.0, -2.0, 0.5].map(|x| Const(x.to_bits())));
    let (sign, most, least, half) = (inputs as u32 + 2, inputs as u32 + 3, inputs as u32 + 4, inputs as u32 + 5);
    // Masks and numbers are separate, because SSE2 requires masks whose bits are all set or all clear.
    let mut masks = Vec::new();
    let mut numbers: Vec<u32> = (0..instructions.len() as u32).collect();
    while instructions.len() < length {
        let (i, n) = (instructions.len() as u32, numbers.len());
        let mut any = || numbers[n - 1 - random.below(back.min(n))];
        let (a, b, c) = (any(), any(), any());
        let mask = masks.last().copied();
        match random.below(18) {
            0 => instructions.push(Add(a, b)),
            1 => instructions.push(Sub(a, b)),
            2 | 3 => instructions.push(Mul(a, b)),
            4 => {
                instructions.push(Max(a, half));
                instructions.push(Div(b, i));
            }
            5 => instructions.push(Max(a, b)),
            6 => instructions.push(Min(a, b)),
            7 => instructions.push(AndNot(sign, b)),
            8 => instructions.push(Xor(a, sign)),
            9 if fused => instructions.push(Fma(a, b, c)),
            10 if fused => instructions.push(Fms(a, b, c)),
            11 if fused => instructions.push(Fnma(a, b, c)),
            17 if fused => instructions.push(Fnms(a, b, c)),
            12 => {
                instructions.push(Less(a, b));
                masks.push(i);
                continue;
            }
            13 => {
                instructions.push(Signs(a));
                masks.push(i);
                continue;
            }
            14 if mask.is_some() => instructions.push(Select(mask.unwrap(), a, b)),
            15 => {
                // Make a number that is not negative.
                instructions.push(AndNot(sign, a));
                instructions.push(Sqrt(i));
                numbers.push(i);
                numbers.push(i + 1);
                continue;
            }
            16 => instructions.push(And(a, b)),
            _ => instructions.push(Add(b, c)),
        }
        let last = instructions.len() as u32 - 1;
        instructions.push(Min(last, most));
        instructions.push(Max(last + 1, least));
        numbers.push(last + 2);
    }
    // The last values are outputs, in new slots and in slots of inputs.
    let tail: Vec<u32> = numbers.iter().rev().take(6).copied().collect();
    let mut outputs: Vec<(u32, u32)> = tail.iter().enumerate().map(|(k, &value)| (inputs as u32 + k as u32, value)).collect();
    outputs.extend([(0, tail[0]), (1, tail[2]), (inputs as u32 + 6, 2), (inputs as u32 + 7, inputs as u32)]);
    Straight { instructions, outputs, reach: None, stream: None }
}

#[test]
fn machine_code_and_portable_evaluation_give_the_same_bits() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for form in forms() {
        for trial in 0..400 {
            let (inputs, length, back) = (3 + random.below(20), 20 + random.below(400), 2 + random.below(120));
            let mut program = random_program(&mut random, inputs, length, back, form.set > Set::Sse2);
            let turns = 1 + random.below(5);
            let stream = random_stream(&mut random, &mut program, inputs, form.lanes(), turns);
            let [machine, portable] = [Engine::Machine, Engine::Portable].map(|engine| Program::of(&program, inputs + 8, form, engine));
            let program_stream = program.stream;
            assert_eq!((machine.engine(), portable.engine()), (Engine::Machine, Engine::Portable));
            let given: Vec<f64> = (0..inputs * form.lanes()).map(|_| random.number()).collect();
            let mut results = [&machine, &portable].map(|program| {
                let mut frame = Frame::new(program.slots(), form.lanes());
                program.prepare(&mut frame);
                frame.numbers_mut()[..given.len()].copy_from_slice(&given);
                run(program, &mut frame, &stream, turns);
                forget_stream(program_stream, &mut frame);
                frame.numbers()[..(inputs + 8) * form.lanes()].iter().map(|x| x.to_bits()).collect::<Vec<_>>()
            });
            let portable = results[1].clone();
            assert_eq!(results[0], portable, "{form:?}, trial {trial}");
            // The comparison must detect a change of one bit.
            results[0][0] ^= 1;
            assert_ne!(results[0], portable);
        }
    }
}

/// Code for all instruction sets of x86-64, on any machine: an interpreter runs its bytes.
#[test]
fn interpreted_machine_code_gives_the_bits_of_portable_evaluation() {
    let mut random = Random(11);
    for form in [Set::Sse2, Set::Avx2, Set::Avx512].into_iter().flat_map(|set| [true, false].map(|packed| Form { set, packed })) {
        for trial in 0..25 {
            let (inputs, length, back) = (3 + random.below(40), 20 + random.below(500), 2 + random.below(200));
            let mut program = random_program(&mut random, inputs, length, back, form.set > Set::Sse2);
            let turns = 1 + random.below(5);
            let stream = random_stream(&mut random, &mut program, inputs, form.lanes(), turns);
            let emitted = emit::<super::x86::Assembler>(&program, form, inputs + 8);
            let portable = Program::of(&program, inputs + 8, form, Engine::Portable);
            let [mut frame, mut expected] = [emitted.slots, portable.slots()].map(|slots| Frame::new(slots, form.lanes()));
            portable.prepare(&mut expected);
            for k in 0..inputs * form.lanes() {
                let x = random.number();
                (frame.numbers_mut()[k], expected.numbers_mut()[k]) = (x, x);
            }
            simulate(&emitted.bytes, frame.numbers_mut(), &emitted.constants, stream.numbers(), turns);
            run(&portable, &mut expected, &stream, turns);
            [&mut frame, &mut expected].into_iter().for_each(|frame| forget_stream(program.stream, frame));
            for k in 0..(inputs + 8) * form.lanes() {
                assert_eq!(frame.numbers()[k].to_bits(), expected.numbers()[k].to_bits(), "{form:?}, trial {trial}, number {k}");
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
    has_the_bits_of_what_was_recorded(false);
}

#[test]
fn a_recording_without_fusing_has_the_bits_of_plain_numbers() {
    has_the_bits_of_what_was_recorded(true);
}

fn has_the_bits_of_what_was_recorded(unfused: bool) {
    let mut random = Random(7);
    sym::begin();
    let gain = Sym::from_lanes(|_| 3.0);
    assert_eq!(sym::end_set_up(), 1);
    let x: Vec<Sym> = (0..5).map(|_| sym::input()).collect();
    let outputs = if unfused { sym::unfused(|| computation(&x, gain)) } else { computation(&x, gain) };
    let recording = sym::finish();
    assert!(!recording.failed);
    assert_eq!(recording.values, [3.0]);
    let values: Vec<(u32, u32)> = outputs.iter().enumerate().map(|(k, y)| (6 + k as u32, y.index())).collect();
    for form in forms() {
        let part = Part { ops: &recording.ops, start: 0, outputs: &values, places: &SlotTable::default() };
        let program = Program::new(part, None, Scratch { reach: 11, free: 12 }, form, Engine::Machine);
        let mut frame = Frame::new(program.slots(), form.lanes());
        for _ in 0..200 {
            frame.fill(0, 3.0);
            frame.fill(11, 0.0);
            let x: Vec<Vec<f64>> = (0..form.lanes()).map(|_| (0..5).map(|_| 10.0 * random.number()).collect()).collect();
            for (lane, x) in x.iter().enumerate() {
                x.iter().enumerate().for_each(|(k, &x)| frame.slot_mut(1 + k)[lane] = x);
            }
            program.run(&mut frame);
            for (lane, x) in x.iter().enumerate() {
                let expected = match form.set {
                    set if unfused || set == Set::Sse2 => computation(x, 3.0),
                    _ => computation(Float::of(x), Float(3.0)).map(|x| x.lane(0)),
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
    let x = Sym::from_lanes(|_| 2.0);
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
            Sym::from_lanes(|_| x);
        }
        sym::finish().structure
    };
    assert_eq!(structure([2.5, 3.5, 4.5]), structure([-2.5, 7.0, 0.5]));
    for special in [0.0, 1.0, -1.0] {
        assert_ne!(structure([2.5, 3.5, 4.5]), structure([2.5, special, 4.5]), "{special}");
    }
}
