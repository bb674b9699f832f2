//! From a recorded computation to a program. A loop is recorded once with the number [`Sym`] and simplified. Then it is lowered to
//! straight-line instructions of one instruction set, for one run or for many lanes.
//!
//! `sym`, `tape`, `memo`: recording and folding. `differentiate`, `tangents`, `adjoint`: derivatives of a recording. `straight`, `lower`:
//! straight-line instructions. `lifetimes`, `emit`, `x86`, `aarch64`, `memory`: machine code. `portable`: the same bits without machine
//! code. `frame`: the memory of a running program; `pages`: large memory; `rows`: copies between the caller's rows and a frame. `function`:
//! stored functions of numbers. `program`: the common interface. `label`, `listing`: text for readers.

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
