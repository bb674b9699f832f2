//! A program: a recorded computation that runs on frames. A frame is the memory of a running program.
//!
//! It is machine code on x86-64 and AArch64, if the system allows executable memory. Otherwise the recorded operations are interpreted, with
//! the same bits. The environment variable `ARMLET_PROGRAMS=interpreter` selects the interpreter.

#[cfg(target_arch = "aarch64")]
use super::aarch64::Assembler;
use super::emit::emit;
use super::frame::Frame;
use super::instruction::{Form, Set};
use super::interpreter::Interpreter;
use super::lower::lower;
use super::memory::Code;
use super::pieces::{self, Call, Pieces};
use super::straight::{Part, Scratch, Straight, Stream};
#[cfg(not(target_arch = "aarch64"))]
use super::x86::Assembler;
use crate::scalar::{Isa, isa};
use std::sync::OnceLock;

/// Whether machine code for this processor can be emitted.
const HAS_EMITTER: bool = cfg!(any(target_arch = "x86_64", target_arch = "aarch64"));

/// How programs run in this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Programs are machine code.
    Machine,
    /// The recorded operations are interpreted.
    Interpreter,
}

impl Engine {
    pub fn name(self) -> &'static str {
        match self {
            Engine::Machine => "machine",
            Engine::Interpreter => "interpreter",
        }
    }
}

/// The engine of this process. The first call determines it from the environment and the system.
pub fn engine() -> Engine {
    static ENGINE: OnceLock<Engine> = OnceLock::new();
    *ENGINE.get_or_init(|| {
        // "portable" is the name in earlier versions.
        let interpreted = std::env::var("ARMLET_PROGRAMS").is_ok_and(|value| matches!(value.as_str(), "interpreter" | "portable"));
        let machine = HAS_EMITTER && !interpreted && Code::new(&[0; 4]).is_ok();
        if machine { Engine::Machine } else { Engine::Interpreter }
    })
}

/// The form of code on this machine: packed for several lanes, scalar for one lane.
pub fn form(packed: bool) -> Form {
    let set = match isa() {
        _ if cfg!(target_arch = "aarch64") => Set::Neon,
        Isa::Baseline => Set::Sse2,
        Isa::Avx2 => Set::Avx2,
        Isa::Avx512 => Set::Avx512,
    };
    Form { set, packed }
}

enum Backend {
    Machine { code: Code, constants: Frame },
    Interpreter(Interpreter),
}

/// Straight-line code, and the native code that is called after it.
struct Piece {
    backend: Backend,
    call: Option<Call>,
}

/// A computation on the slots of a frame. It is straight-line code, unless the recording has cuts.
pub struct Program {
    /// The code between the cuts of the recording.
    pieces: Vec<Piece>,
    form: Form,
    slots: usize,
    operations: usize,
    turns: bool,
    stream: Option<Stream>,
}

impl Program {
    /// Make a program from a part of a recording. The inputs of the stream are read from an array outside of the frame. Any other input `k`
    /// is in slot `k` of the frame.
    pub fn new(part: Part, stream: Option<Stream>, scratch: Scratch, form: Form, engine: Engine) -> Self {
        let mut program = Program { pieces: Vec::new(), form, slots: scratch.free, operations: 0, turns: false, stream };
        match pieces::divide(part, scratch.free) {
            None => program.add(part, scratch.reach, None, engine),
            Some(Pieces { all, places, free }) => {
                program.slots = free;
                for pieces::Piece { start, outputs, call } in all {
                    program.add(Part { ops: part.ops, start, outputs: &outputs, places: &places }, scratch.reach, call, engine);
                }
            }
        }
        program
    }

    /// Add straight-line code, and the native code that is called after it.
    fn add(&mut self, part: Part, reach: u32, call: Option<Call>, engine: Engine) {
        let (form, free, stream) = (self.form, self.slots, self.stream);
        let machine = if engine == Engine::Machine && HAS_EMITTER {
            let straight = Straight { stream, ..lower(part, reach, form.has_fused()) };
            machine(&straight, free, form).map(|(code, constants, slots)| {
                (Backend::Machine { code, constants }, slots, straight.operations(), straight.reach.is_some())
            })
        } else {
            None
        };
        let (backend, slots, operations, turns) = machine.unwrap_or_else(|| {
            let interpreter = Interpreter::new(part, stream, Scratch { reach, free }, form);
            let (slots, operations, turns) = (interpreter.slots(), interpreter.operations(), interpreter.turns());
            (Backend::Interpreter(interpreter), slots, operations, turns)
        });
        (self.slots, self.operations, self.turns) = (slots, self.operations + operations, self.turns || turns);
        self.pieces.push(Piece { backend, call });
    }

    /// The number of slots that a frame of the program requires.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// The number of operations in one run.
    pub fn operations(&self) -> usize {
        self.operations
    }

    /// Whether the program computes sines. The results of machine code are then valid only for angles whose magnitude is below
    /// `REDUCTION_LIMIT`.
    pub fn turns(&self) -> bool {
        self.turns
    }

    /// The engine that runs the program.
    pub fn engine(&self) -> Engine {
        match self.pieces[0].backend {
            Backend::Machine { .. } => Engine::Machine,
            Backend::Interpreter(_) => Engine::Interpreter,
        }
    }

    /// Write the constants of the program into a new frame, and allocate the memory of its native code.
    pub fn prepare(&self, frame: &mut Frame) {
        for Piece { backend, call } in &self.pieces {
            if let Backend::Interpreter(interpreter) = backend {
                interpreter.prepare(frame);
            }
            if let Some(call) = call {
                call.prepare(frame);
            }
        }
    }

    /// Run the program once on a prepared frame.
    #[inline]
    pub fn run(&self, frame: &mut Frame) {
        assert!(self.stream.is_none(), "the program has a stream");
        self.repeat(frame, &[], 1, 0);
    }

    /// Run `turns` iterations along the stream. The stream has slots with one number per lane, or single numbers that are broadcast.
    pub fn run_along(&self, frame: &mut Frame, stream: &[f64], turns: usize) {
        let Some(inputs) = self.stream else { unreachable!("the program has no stream") };
        let lanes = if inputs.spread { 1 } else { self.form.lanes() };
        assert!(
            turns > 0 && stream.len() >= inputs.slots(turns) * lanes && stream.as_ptr().addr().is_multiple_of(8 * lanes),
            "the stream is of another program"
        );
        self.repeat(frame, stream, turns, inputs.advance as usize * lanes);
    }

    /// Run `turns` iterations. The stream advances by `width` numbers in each.
    #[inline]
    fn repeat(&self, frame: &mut Frame, stream: &[f64], turns: usize, width: usize) {
        assert!(
            frame.lanes() == self.form.lanes() && frame.numbers().len() >= self.slots * frame.lanes(),
            "the frame is of another program"
        );
        if let [Piece { backend, call: None }] = &self.pieces[..] {
            return backend.run(frame, stream, turns);
        }
        for turn in 0..turns {
            for Piece { backend, call } in &self.pieces {
                backend.run(frame, &stream[turn * width..], 1);
                if let Some(call) = call {
                    call.run(frame);
                }
            }
        }
    }
}

impl Backend {
    /// Run `turns` iterations. `Program::repeat` and its callers have checked the frame and the stream.
    #[inline]
    fn run(&self, frame: &mut Frame, stream: &[f64], turns: usize) {
        match self {
            // SAFETY: this processor has the instruction set of the code, and the frame and constants fit the code. The assertions check
            // that every slot is in the frame, and the length and alignment of the stream. Frames are aligned to 64 bytes.
            Backend::Machine { code, constants } => unsafe {
                code.run(frame.numbers_mut().as_mut_ptr(), constants.numbers().as_ptr(), stream.as_ptr(), turns);
            },
            Backend::Interpreter(interpreter) => interpreter.run(frame, stream, turns),
        }
    }
}

/// Return the length of the machine code for `form`, in bytes, and the number of spilled values. `None` means that no emitter exists.
pub fn size(straight: &Straight, free: usize, form: Form) -> Option<(usize, usize)> {
    let emitted = HAS_EMITTER.then(|| emit::<Assembler>(straight, form, free))?;
    Some((emitted.bytes.len(), emitted.spilled))
}

/// Return the machine code, its constants and its number of slots. `None` means that the system refuses it.
fn machine(straight: &Straight, free: usize, form: Form) -> Option<(Code, Frame, usize)> {
    let emitted = emit::<Assembler>(straight, form, free);
    let mut constants = Frame::new(emitted.constants.len().max(1), 1);
    constants.numbers_mut()[..emitted.constants.len()].copy_from_slice(&emitted.constants);
    Some((Code::new(&emitted.bytes).ok()?, constants, emitted.slots))
}
