//! Output arrays: new, C-contiguous and owned; a `MemoryError` without sufficient memory.

use super::pieces;
use super::raw::{Bits, made, out_of_shape};
use crate::errors::Failure;
use pyo3::prelude::*;

/// A new array of this shape with these values, of float64 or bool.
pub fn copied<'py, T: Bits>(py: Python<'py>, shape: &[usize], values: &[T]) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, false, |out| pieces::copy(py, values, out))
}

/// A new array of this shape, zero except for the numbers that `fill` writes.
pub fn new_array<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, true, fill)
}

/// A new array of this shape, with every number written by `fill`, because its memory is not zeroed before. Zeroing would cost
/// another pass over memory.
pub fn written_array<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, false, fill)
}

/// Several of them, written together.
pub fn written_arrays<'py, const N: usize>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce([&mut [f64]; N]) -> Result<(), Failure>,
) -> Result<[Bound<'py, PyAny>; N], Failure> {
    let arrays = (0..N).map(|_| written_array(py, shape, |_| Ok(()))).collect::<Result<Vec<_>, _>>()?;
    let arrays: [_; N] = arrays.try_into().unwrap_or_else(|_| unreachable!("as many as were made"));
    fill(arrays.each_ref().map(|array| out_of_shape(array, shape).unwrap_or_default()))?;
    Ok(arrays)
}

/// A new vector, filled by `fill`.
pub fn new_vector<'py>(
    py: Python<'py>,
    n: usize,
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    new_array(py, &[n], fill)
}
