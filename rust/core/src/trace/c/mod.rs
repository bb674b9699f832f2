//! C code of recordings: routines, the functions that routines share, headers and CMake files. A *program* is the compiled form of a
//! recording on this machine.
//!
//! The code is C99. It uses only `math.h` and `string.h`, allocates no memory and does not recurse. Its results have the same bits as the
//! program under two conditions. [`COptions::fused`] must equal `scalar::fuses()`. The compiler must fuse nothing but calls of `fma()`
//! (`-ffp-contract=off`).

mod comment;
mod fold;
mod routine;
mod sines;
mod source;

pub use comment::comment;
pub use routine::{Printed, Routine};
pub use source::{CFile, COptions, CSource, STATUSES, array, require_names};
