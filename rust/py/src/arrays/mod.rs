//! Array arguments and array results, and the validation of other arguments.

mod convert;
mod pieces;
pub mod python;
mod raw;
mod read;
mod sequence;
mod shape;
mod single;
mod write;

pub use pieces::{PIECE, copied_to_bytes};
pub use raw::{adopted, of_lengths, of_shape, out_of_shape, out_slice, overwrite};
pub use read::{ArrayArgument, any_vector, numbers, owned, per_entry, require_finite, require_no_nan, spread, three, vector};
pub use sequence::items;
pub use shape::{Axis, Form, SCALAR, WHATEVER, elements, index_of, shown};
pub use single::{count, flag, flag_or_false, name, nonnegative_integer, number, object, optional_number, quoted, signed, text};
pub use write::{Lent, copied, new_array, new_vector, written_array, written_arrays};
