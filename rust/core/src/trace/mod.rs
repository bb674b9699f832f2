//! Recorded computations as programs. A control loop or a function of an arm runs once with the number type [`Sym`], which records its
//! operations on a *tape*. The recording is simplified. A *program* is its straight-line code for one instruction set. It computes one
//! evaluation, or one per *lane* (one element of a SIMD register). The lanes are runs, rows of inputs, or directions of derivatives.
//!
//! A *frame* is the memory of a running program. A *slot* of a frame has one number per lane. A program can repeat its code. The inputs
//! that change from one iteration to the next are in an array outside of the frame, the *stream*.
//!
//! Files: `sym`, `tape`, `operation` and `memo` record and fold, and `expression` has vectors and matrices of recorded values. `segments`
//! divides a recording, and `pieces` divides its parts at cuts, where native code may replace results (`decision`). `differentiate`,
//! `tangents` and `adjoint` compute derivatives of a recording, and `branches` finds its comparisons. `interpreter` computes a recording,
//! with the steps that `steps` makes. `jacobian` computes a recording and its Jacobian. `straight` and `lower` have the straight-line
//! instructions. `lifetimes`, `emit`, `instruction`, `opcode`, `x86`, `aarch64` and `memory` make machine code. `c` prints a recording as C
//! code, and `wasm` writes it as WebAssembly. `frame` is the memory of a running program, and `pages` requests large pages. `signature` has
//! the groups of slots in a frame. `rows` copies between the caller's rows and a frame. `function` makes programs of recorded functions, and `cache` stores them.
//! `by_engine` decides when machine code repays. `program` is the common interface of machine code and `interpreter`. `label`, `listing`
//! and `listing_code` produce text for readers.
//!
//! The folder is flat, because most files are steps of one compiler, in the order above.

pub mod aarch64;
pub mod adjoint;
pub mod branches;
pub mod by_engine;
pub mod c;
pub mod cache;
#[cfg(test)]
mod checks;
pub mod decision;
pub mod differentiate;
#[cfg(test)]
mod differentiate_tests;
pub mod emit;
#[cfg(test)]
mod emulated_tests;
pub mod expression;
pub mod frame;
pub mod function;
#[cfg(test)]
mod harness;
pub mod instruction;
mod interpreter;
pub mod jacobian;
pub mod label;
mod lifetimes;
pub mod listing;
mod listing_code;
mod lower;
pub mod memo;
pub mod memory;
#[cfg(any(test, not(target_arch = "aarch64")))]
mod opcode;
mod operation;
pub mod pages;
mod pieces;
pub mod program;
pub mod rows;
pub mod segments;
mod signature;
#[cfg(test)]
mod simulator;
mod steps;
pub mod straight;
pub mod sym;
pub mod tangents;
pub mod tape;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod trials;
pub mod wasm;
#[cfg(any(test, not(target_arch = "aarch64")))]
pub mod x86;

pub use by_engine::ByEngine;
pub use expression::{E, M, V};
pub use frame::Frame;
pub use function::Evaluation;
pub use jacobian::Jacobian;
pub use program::{Engine, Program, engine, form};
pub use segments::Cut;
pub use signature::{Signature, Slots};
pub use straight::{Part, Scratch, SlotTable, Stream};
pub use sym::{Recording, Sym};
