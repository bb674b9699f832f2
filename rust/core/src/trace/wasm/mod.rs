//! Recordings as WebAssembly: the instructions of a program as bytes of a module that a browser runs.
//!
//! All functions of a module share one memory, the *frame*: slot `k` is the number at byte `8 k`. The functions have no arguments and no
//! results. They read and write slots, as programs do ([`super::program`]).
//!
//! WebAssembly has no fused multiply-add. So the results have the bits of programs of the baseline instruction set, except for the
//! payloads of NaN. At a cut ([`super::decision`]), a function executes the closed form of the native code where the results of the formula
//! are not valid. Native code without a closed form cannot be exported, and [`Module::function`] reports it.

mod body;
mod encode;

use super::lower::lower;
use super::pieces::{self, Piece, Pieces};
use super::signature::Slots;
use super::straight::{Part, Scratch, SlotTable};
use super::tape::Op;
use body::body;
use encode::{CALL, EMPTY, END, F64_CONST, F64_LOAD, F64_NOT_EQUAL, F64_STORE, I32_CONST, IF, access, name, section, unsigned};

/// The size of a page of WebAssembly memory, in bytes.
const PAGE: usize = 1 << 16;

/// One action of a [`Module::sequence`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Call the function of this name, which the module already contains.
    Call(String),
    /// Call the function of this name if the number in slot `valid` is not one.
    CallUnless { valid: usize, called: String },
    /// Copy these slots to the slots from `to` on.
    Copy { from: Slots, to: usize },
}

/// A module with functions and their common memory.
///
/// ```
/// use armlet_core::trace::wasm::Module;
/// use armlet_core::trace::{Part, Scratch, SlotTable, sym};
///
/// // y = x + x, from slot 0 to slot 1.
/// sym::begin();
/// sym::end_set_up();
/// let x = sym::input();
/// let y = (x + x).index();
/// let recording = sym::finish();
/// let part = Part { ops: &recording.ops, start: 0, outputs: &[(1, y)], places: &SlotTable::default() };
/// let mut module = Module::default();
/// assert!(module.function("twice", part, Scratch { reach: 2, free: 3 }));
/// assert_eq!(module.slots(), 2);
/// assert_eq!(&module.finish()[..8], b"\0asm\x01\0\0\0");
/// ```
#[derive(Clone, Debug, Default)]
pub struct Module {
    /// The names of the functions and their code.
    functions: Vec<(String, Vec<u8>)>,
    slots: usize,
}

impl Module {
    /// Add a function that computes a part of a recording. `scratch` has the slot of the largest magnitude of all angles. Return false, and
    /// add nothing, if the part has a cut whose native code has no closed form.
    #[must_use]
    pub fn function(&mut self, name: &str, part: Part, scratch: Scratch) -> bool {
        let Some(Pieces { all, places, .. }) = pieces::divide(part, scratch.free) else {
            self.straight(name, part, scratch.reach);
            return true;
        };
        let calls = all.iter().filter_map(|piece| piece.call.as_ref());
        let Some(forms) = calls.map(|call| Some((call.validity(), call.closed_form()?))).collect::<Option<Vec<_>>>() else {
            return false;
        };
        let (mut actions, mut forms) = (Vec::new(), forms.into_iter());
        for (k, Piece { start, outputs, .. }) in all.into_iter().enumerate() {
            let piece = format!("{name}_{k}");
            self.straight(&piece, Part { ops: part.ops, start, outputs: &outputs, places: &places }, scratch.reach);
            actions.push(Action::Call(piece));
            if let Some((valid, (ops, outputs))) = forms.next() {
                let called = format!("{name}_cut{k}");
                self.straight(&called, Part { ops: &ops, start: 0, outputs: &outputs, places: &SlotTable::default() }, scratch.reach);
                actions.push(Action::CallUnless { valid, called });
            }
        }
        self.sequence(name, &actions);
        true
    }

    /// Add a function that computes a part without cuts.
    fn straight(&mut self, name: &str, part: Part, reach: u32) {
        let (code, slots) = body(&lower(part, reach, false));
        self.add(name, code, slots);
    }

    /// Add a function that computes `answer` from the inputs of a recording. `inputs` has the slot of each input, or its value if it is
    /// constant. The results are in the slots from `first` on.
    #[must_use]
    pub fn formula(&mut self, name: &str, ops: &[Op], inputs: &[Input], (answer, first, reach): (&[u32], usize, u32)) -> bool {
        let ops: Vec<Op> = ops.iter().map(|&op| if let Op::Input(k) = op { inputs[k as usize].op() } else { op }).collect();
        let outputs = Slots { first, count: answer.len() }.outputs(answer);
        let part = Part { ops: &ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        self.function(name, part, Scratch { reach, free: first + answer.len() })
    }

    /// Add a function that performs actions in their order.
    pub fn sequence(&mut self, name: &str, actions: &[Action]) {
        let (mut code, mut slots) = (vec![0], 0);
        let call = |called: &String| {
            let index = self.functions.iter().position(|(known, _)| known == called)?;
            let mut bytes = vec![CALL];
            unsigned(&mut bytes, index as u64);
            Some(bytes)
        };
        for action in actions {
            match action {
                Action::Call(called) => code.extend(call(called).into_iter().flatten()),
                Action::CallUnless { valid, called } => {
                    let Some(call) = call(called) else { continue };
                    code.extend([I32_CONST, 0]);
                    access(&mut code, F64_LOAD, *valid);
                    code.push(F64_CONST);
                    code.extend(1.0f64.to_le_bytes());
                    code.extend([F64_NOT_EQUAL, IF, EMPTY]);
                    code.extend(call);
                    code.push(END);
                }
                Action::Copy { from, to } => {
                    slots = slots.max(from.end()).max(to + from.count);
                    for k in 0..from.count {
                        code.extend([I32_CONST, 0, I32_CONST, 0]);
                        access(&mut code, F64_LOAD, from.first + k);
                        access(&mut code, F64_STORE, to + k);
                    }
                }
            }
        }
        code.push(END);
        self.add(name, code, slots);
    }

    fn add(&mut self, name: &str, code: Vec<u8>, slots: usize) {
        self.functions.push((name.to_owned(), code));
        self.slots = self.slots.max(slots);
    }

    /// The number of slots that the functions use.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Reserve slots after all slots in use.
    pub fn reserve(&mut self, count: usize) -> Slots {
        let slots = Slots { first: self.slots, count };
        self.slots += count;
        slots
    }

    /// Return the bytes of the module. It exports `memory` and all functions.
    pub fn finish(self) -> Vec<u8> {
        let mut bytes = b"\0asm\x01\0\0\0".to_vec();
        let count = self.functions.len() as u64;
        let counted = |each: &mut dyn FnMut(usize, &mut Vec<u8>)| {
            let mut content = Vec::new();
            unsigned(&mut content, count);
            (0..count as usize).for_each(|k| each(k, &mut content));
            content
        };
        // One type, without arguments and results.
        section(&mut bytes, 1, &[1, 0x60, 0, 0]);
        section(&mut bytes, 3, &counted(&mut |_, content| content.push(0)));
        let mut memory = vec![1, 0];
        unsigned(&mut memory, (8 * self.slots).div_ceil(PAGE).max(1) as u64);
        section(&mut bytes, 5, &memory);
        let mut exports = Vec::new();
        unsigned(&mut exports, count + 1);
        name(&mut exports, "memory");
        exports.extend([2, 0]);
        for (k, (function, _)) in self.functions.iter().enumerate() {
            name(&mut exports, function);
            exports.push(0);
            unsigned(&mut exports, k as u64);
        }
        section(&mut bytes, 7, &exports);
        let code = counted(&mut |k, content| {
            let body = &self.functions[k].1;
            unsigned(content, body.len() as u64);
            content.extend_from_slice(body);
        });
        section(&mut bytes, 10, &code);
        bytes
    }
}

/// An input of [`Module::formula`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    Slot(usize),
    Value(f64),
}

impl Input {
    fn op(self) -> Op {
        match self {
            Input::Slot(slot) => Op::Input(slot as u32),
            Input::Value(x) => Op::Const(x.to_bits()),
        }
    }
}
