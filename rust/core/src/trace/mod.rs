//! From a recorded computation to a program. A loop is recorded once with the number [`Sym`], simplified, and lowered to straight-line
//! instructions of one instruction set. It runs for one run or for many lanes.
//!
//! `sym`, `tape`, `memo`: recording and folding. `differentiate`, `tangents`, `adjoint`: derivatives of a recording. `straight`, `lower`: straight-line instructions.
//! `lifetimes`, `emit`, `x86`, `aarch64`, `memory`: machine code. `portable`: the same bits without it. `frame`: the memory a program
//! runs on; `pages`: large memory; `rows`: the caller's rows to it and back. `function`: functions of numbers that are kept.
//! `program`: all of it behind one door. `label`, `listing`: what a reader sees of it.

pub mod aarch64;
pub mod adjoint;
pub mod c;
pub mod cache;
#[cfg(test)]
mod checks;
pub mod differentiate;
#[cfg(test)]
mod differentiate_tests;
pub mod emit;
#[cfg(test)]
mod emulated_tests;
pub mod frame;
pub mod function;
#[cfg(test)]
mod harness;
pub mod instruction;
pub mod label;
mod lifetimes;
pub mod listing;
mod listing_code;
mod lower;
pub mod memo;
pub mod memory;
#[cfg(any(test, not(target_arch = "aarch64")))]
mod opcode;
pub mod pages;
mod portable;
pub mod program;
pub mod rows;
pub mod segments;
#[cfg(test)]
mod simulator;
pub mod straight;
pub mod sym;
pub mod tangents;
pub mod tape;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod trials;
#[cfg(any(test, not(target_arch = "aarch64")))]
pub mod x86;

pub use frame::Frame;
pub use function::Evaluation;
pub use program::{Engine, Program, Scratch, engine, form};
pub use segments::Cut;
pub use straight::{Part, SlotTable, Stream};
pub use sym::{Recording, Sym};
