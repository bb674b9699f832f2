//! Tests of encoded operations against plain Rust, on this processor and in the simulator.

use super::super::checks::{Operation, Random};
use super::super::memory::Code;
use super::super::simulator::simulate;
use super::super::trials::{Memory, SIZE, SLOTS, between_files, trials};
use super::*;

const SETS: [Set; 3] = [Set::Sse2, Set::Avx2, Set::Avx512];

fn forms() -> impl Iterator<Item = Form> {
    SETS.into_iter().flat_map(|set| [true, false].map(|packed| Form { set, packed }))
}

/// The forms that this processor can run.
fn available() -> impl Iterator<Item = Form> {
    forms().filter(|form| match form.set {
        Set::Sse2 => true,
        Set::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
        Set::Avx512 => is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") && is_x86_feature_detected!("avx512vl"),
        Set::Neon => false,
    })
}

/// Run the code of a program on this processor.
fn native(code: &[u8], frame: &mut [f64], constants: &[f64]) {
    let code = Code::new(code).unwrap();
    // SAFETY: the code is for this processor, and both memories contain all slots that it accesses.
    unsafe { code.run(frame.as_mut_ptr(), constants.as_ptr(), std::ptr::null(), 1) };
}

/// Check that single operations change registers and the frame like plain Rust does.
fn agrees_with_rust(form: Form, run: impl Fn(&[u8], &mut [f64], &[f64])) {
    for trial in trials::<Assembler>(form, 2_000, 1) {
        let (mut frame, constants) = (Memory(trial.frame), Memory(trial.constants));
        run(&trial.code, &mut frame.0, &constants.0);
        trial.check(&frame.0);
    }
}

#[test]
fn operations_on_this_processor_agree_with_rust() {
    available().for_each(|form| agrees_with_rust(form, native));
}

#[test]
fn simulated_operations_agree_with_rust() {
    forms().for_each(|form| agrees_with_rust(form, |code, frame, constants| simulate(code, frame, constants, &[], 1)));
}

/// Long sequences of operations have equal bits, including the bits of NaN.
#[test]
fn simulator_agrees_with_this_processor() {
    let mut random = Random(2);
    for form in available() {
        for _ in 0..200 {
            let operations: Vec<_> = (0..random.below(60)).map(|_| random.operation(form, form.registers(), SLOTS)).collect();
            let code = between_files::<Assembler>(form, &operations);
            let (mut frame, mut constants) = (Memory([0.0; SIZE]), Memory([0.0; SIZE]));
            frame.0.iter_mut().chain(&mut constants.0).for_each(|x| *x = random.number());
            let mut simulated = Memory(frame.0);
            native(&code, &mut frame.0, &constants.0);
            simulate(&code, &mut simulated.0, &constants.0, &[], 1);
            let differ = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits();
            assert_eq!(frame.0.iter().zip(&simulated.0).position(differ), None, "{form:?} {operations:#?}");
        }
    }
}

#[test]
#[should_panic(expected = "no slot at 4")]
fn simulator_refuses_slots_that_are_not_aligned() {
    let code = between_files::<Assembler>(Form { set: Set::Avx512, packed: true }, &[Operation::Load(0, Source::Slot(Base::Frame, 4))]);
    simulate(&code, &mut [0.0; SIZE], &[], &[], 1);
}

#[test]
#[should_panic(expected = "does not return")]
fn simulator_refuses_code_without_end() {
    simulate(&[], &mut [], &[], &[], 1);
}

/// Win64 code that overwrites every register is called with the convention of Windows. The compiler expects xmm6 to xmm15 unchanged.
#[test]
fn win64_code_keeps_the_callers_registers() {
    for form in available() {
        let mut code = Assembler::new(form);
        code.enter(CallingConvention::Win64);
        code.load(0, Source::Slot(Base::Frame, 0));
        (1..form.registers() as u8).for_each(|r| code.load(r, Source::Slot(Base::Constants, 0)));
        let start = code.here();
        code.binary(Binary::Add, 0, 0, Source::Register(form.registers() as u8 - 1));
        code.load(1, Source::Spread(Base::Stream, 0));
        code.binary(Binary::Add, 0, 0, Source::Register(1));
        code.store(Base::Frame, 0, 0);
        code.repeat_from(start, 8);
        code.leave(CallingConvention::Win64);
        code.ret();
        let code = Code::new(&code.finish()).unwrap();
        let (mut frame, constants, mut stream) = (Memory([2.0; SIZE]), Memory([3.0; SIZE]), Memory([0.0; SIZE]));
        (stream.0[0], stream.0[1]) = (10.0, 20.0);
        // SAFETY: `enter` and `leave` make the code a function of this type, and the memories contain its slots.
        let function: Windows = unsafe { std::mem::transmute(code.address()) };
        let registers = calls(function, frame.0.as_mut_ptr(), constants.0.as_ptr(), stream.0.as_ptr());
        assert_eq!(registers, [6, 7, 8, 9, 10, 11, 12, 13, 14, 15].map(f64::from), "{form:?}");
        // Two iterations add the constants twice, and the two numbers of the stream.
        assert_eq!(frame.0[..form.lanes()], [2.0 + 2.0 * 3.0 + 10.0 + 20.0; 8][..form.lanes()]);
        assert!(frame.0[form.lanes()..].iter().all(|&x| x == 2.0));
    }
}

type Windows = extern "win64" fn(*mut f64, *const f64, *const f64, usize);

/// Set xmm6 to xmm15, call the function with two iterations, and return the registers.
fn calls(function: Windows, frame: *mut f64, constants: *const f64, stream: *const f64) -> [f64; 10] {
    let values = [6, 7, 8, 9, 10, 11, 12, 13, 14, 15].map(f64::from);
    let mut registers = [0.0; 10];
    let (mut rdi, mut rsi) = (1u64, 2u64);
    // SAFETY: all registers that the function may change are declared. The stack is aligned and has the 32 bytes that the convention
    // reserves for the function.
    unsafe {
        std::arch::asm!(
            "push rbp", "mov rbp, rsp", "and rsp, -16", "sub rsp, 32",
            "movsd xmm6, [r12]", "movsd xmm7, [r12+8]", "movsd xmm8, [r12+16]", "movsd xmm9, [r12+24]", "movsd xmm10, [r12+32]",
            "movsd xmm11, [r12+40]", "movsd xmm12, [r12+48]", "movsd xmm13, [r12+56]", "movsd xmm14, [r12+64]", "movsd xmm15, [r12+72]",
            "call rax",
            "movsd [r13], xmm6", "movsd [r13+8], xmm7", "movsd [r13+16], xmm8", "movsd [r13+24], xmm9", "movsd [r13+32], xmm10",
            "movsd [r13+40], xmm11", "movsd [r13+48], xmm12", "movsd [r13+56], xmm13", "movsd [r13+64], xmm14", "movsd [r13+72], xmm15",
            "mov rsp, rbp", "pop rbp",
            in("r12") values.as_ptr(), in("r13") registers.as_mut_ptr(), in("rax") function,
            inout("rdi") rdi, inout("rsi") rsi, in("rcx") frame, in("rdx") constants, in("r8") stream, in("r9") 2usize,
            clobber_abi("win64"), out("xmm6") _, out("xmm7") _, out("xmm8") _, out("xmm9") _, out("xmm10") _, out("xmm11") _,
            out("xmm12") _, out("xmm13") _, out("xmm14") _, out("xmm15") _,
        );
    }
    assert_eq!((rdi, rsi), (1, 2));
    registers
}
