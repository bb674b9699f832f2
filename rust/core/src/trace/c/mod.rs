//! Programs as C: the text of routines, the functions that they share, headers and CMake files.
//!
//! The text is C99. It uses only `math.h` and `string.h`, allocates nothing and does not recurse. It gives the bits of the engine if the
//! compiler fuses only the products and sums of `fma()`: `-ffp-contract=off`.

mod comment;
mod fold;
mod routine;
mod sines;
mod source;

pub use comment::comment;
pub use routine::{Printed, Routine};
pub use source::{CFile, COptions, CSource, STATUSES, require_names};
