//! Random NEON programs, which `make test-aarch64` runs in an emulator.

use super::aarch64::Assembler;
use super::emit::emit;
use super::frame::Frame;
use super::harness::{self, Cases};
use super::instruction::{Form, Set};
use super::portable::Portable;
use super::tests::{Random, forget_stream, random_program, random_stream};

/// Write programs with their expected results, which portable evaluation computes.
#[test]
fn neon_programs_are_written_for_the_emulator() {
    let mut random = Random(0xfedc_ba98_7654_3211);
    let (mut cases, mut spilling) = (Cases::default(), 0);
    for trial in 0..300 {
        let form = Form { set: Set::Neon, packed: trial % 2 == 0 };
        let (inputs, length, back) = (3 + random.below(20), 20 + random.below(400), 2 + random.below(120));
        let mut program = random_program(&mut random, inputs, length, back, true);
        let turns = 1 + random.below(5);
        let stream = random_stream(&mut random, &mut program, inputs, form.lanes(), turns);
        let turns = if program.stream.is_some() { turns } else { 1 };
        let (emitted, portable) = (emit::<Assembler>(&program, form, inputs + 8), Portable::new(&program, inputs + 8));
        let [mut frame, mut expected] = [emitted.slots, portable.slots()].map(|slots| Frame::new(slots, form.lanes()));
        portable.prepare(&mut expected);
        for k in 0..inputs * form.lanes() {
            let x = random.number();
            (frame.numbers_mut()[k], expected.numbers_mut()[k]) = (x, x);
        }
        portable.run(&mut expected, stream.numbers(), turns);
        // Clear the slots of the stream. The machine code does not write to them, and portable evaluation does.
        [&mut frame, &mut expected].into_iter().for_each(|frame| forget_stream(program.stream, frame));
        spilling += usize::from(emitted.slots > inputs + 8);
        cases.add(
            &emitted.bytes,
            frame.numbers(),
            &emitted.constants,
            (stream.numbers(), turns),
            &expected.numbers()[..(inputs + 8) * form.lanes()],
        );
    }
    assert!(cases.len() == 300 && spilling > 50, "{spilling} programs of 300 spill");
    harness::write("programs.s", &cases.finish());
}
