//! C code of programs: routines, the functions that routines share, headers and CMake files.
//!
//! The code is C99. It uses only `math.h` and `string.h`, allocates no memory and does not recurse. Its results have the bits of the engine
//! if the compiler fuses nothing but calls of `fma()`: `-ffp-contract=off`.

mod comment;
mod fold;
mod routine;
mod sines;
mod source;

pub use comment::comment;
pub use routine::{Printed, Routine};
pub use source::{CFile, COptions, CSource, STATUSES, require_names};
