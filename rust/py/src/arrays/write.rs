//! New C-contiguous arrays for results, and for the arguments of Python callables ([`Lent`]). Insufficient memory is a `MemoryError`.

use super::pieces;
use super::raw::{Bits, made, out_of_shape, overwrite_unseen};
use crate::errors::Failure;
use numpy::PyArray1;
use pyo3::prelude::*;

/// Make an array of this shape with these values, float64 or bool.
pub fn copied<'py, T: Bits>(py: Python<'py>, shape: &[usize], values: &[T]) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, false, |out| pieces::copy(py, values, out))
}

/// Make an array of this shape that is zero except for the numbers that `fill` writes.
pub fn new_array<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, true, fill)
}

/// Make an array of this shape whose numbers `fill` writes. `fill` must write all of them, because the memory is not zeroed before.
#[inline]
pub fn written_array<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, false, fill)
}

/// Make `N` arrays whose numbers `fill` writes together. `fill` must write all of them, because the memory is not zeroed before.
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

/// Make a vector whose numbers `fill` writes.
pub fn new_vector<'py>(
    py: Python<'py>,
    n: usize,
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    new_array(py, &[n], fill)
}

/// A vector for repeated calls of Python callables. Its memory is reused if no callable has kept a reference to it.
#[derive(Default)]
pub struct Lent(Option<Py<PyArray1<f64>>>);

impl Lent {
    /// Return an array that contains `values`, in reused memory if possible.
    pub fn array<'py>(&mut self, py: Python<'py>, values: &[f64]) -> Result<Bound<'py, PyAny>, Failure> {
        if let Some(reused) = self.0.as_ref().map(|reused| reused.bind(py))
            && overwrite_unseen(reused, values)
        {
            return Ok(reused.clone().into_any());
        }
        let made = copied(py, &[values.len()], values)?;
        self.0 = Some(made.clone().cast_into::<PyArray1<f64>>().map_err(PyErr::from)?.unbind());
        Ok(made)
    }
}
