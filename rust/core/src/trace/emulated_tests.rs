//! Random NEON programs, which `make test-aarch64` runs in an emulator.

use super::aarch64::Assembler;
use super::frame::Frame;
use super::harness::{self, Cases};
use super::instruction::{Form, Set};
use super::program::Engine;
use super::tests::{Random, random_tape, run};

/// Write programs with their expected results, which the interpreter of the tape computes.
#[test]
fn neon_programs_are_written_for_the_emulator() {
    let mut random = Random(0xfedc_ba98_7654_3211);
    let (mut cases, mut spilling) = (Cases::default(), 0);
    for trial in 0..300 {
        let form = Form { set: Set::Neon, packed: trial % 2 == 0 };
        let (inputs, length, window) = (3 + random.below(20), 20 + random.below(400), 2 + random.below(120));
        let mut tape = random_tape(&mut random, inputs, length, window);
        let turns = 1 + random.below(5);
        let stream = tape.random_stream(&mut random, form.lanes(), turns);
        let turns = if tape.stream.is_some() { turns } else { 1 };
        let (emitted, interpreter) = (tape.emitted::<Assembler>(form), tape.program(form, Engine::Interpreter));
        let [mut frame, mut expected] = [emitted.slots, interpreter.slots()].map(|slots| Frame::new(slots, form.lanes()));
        interpreter.prepare(&mut expected);
        for k in 0..inputs * form.lanes() {
            let x = random.number();
            (frame.numbers_mut()[k], expected.numbers_mut()[k]) = (x, x);
        }
        run(&interpreter, &mut expected, &stream, turns);
        // Clear the slots of the stream. The machine code does not write to them, and the interpreter does.
        [&mut frame, &mut expected].into_iter().for_each(|frame| tape.forget_stream(frame));
        spilling += usize::from(emitted.slots > tape.slots());
        cases.add(
            &emitted.bytes,
            frame.numbers(),
            &emitted.constants,
            (stream.numbers(), turns),
            &expected.numbers()[..tape.slots() * form.lanes()],
        );
    }
    assert!(cases.len() == 300 && spilling > 50, "{spilling} programs of 300 spill");
    harness::write("programs.s", &cases.finish());
}
