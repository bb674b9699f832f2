//! Large arrays in pickles, in several parts (*shares*).
//!
//! numpy would write and read a large array in one step, in which no other thread can run and no signal is checked. So a C-contiguous
//! float64 array of more than one share is stored as `_restore_array(shape, share, ..)`, with little-endian numbers.

use crate::arrays::{copied_to_bytes, written_array};
use crate::errors::{Failure, entry, format_error};
use crate::interrupts::pause_in_turn;
use crate::seal::{SHARE, Share};
use armlet_macros::entered;
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

/// The count of float64 numbers in a share.
const NUMBERS: usize = SHARE / size_of::<f64>();

/// Return the pickled form of an array, in shares if the array is large.
#[entered]
#[pyfunction]
pub fn _stored_array<'py>(array: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = array.py();
    match array.cast_exact::<PyArrayDyn<f64>>() {
        Ok(numbers) if numbers.len() > NUMBERS && numbers.is_c_contiguous() => {
            let make = py.import("armlet._core")?.getattr("_restore_array")?;
            let shape = PyTuple::new(py, numbers.shape())?.into_any();
            let shares = (0..numbers.len()).step_by(NUMBERS).map(|first| {
                let last = (first + NUMBERS).min(numbers.len());
                entry(py, "pickle", || copied_to_bytes(numbers, first..last)).and_then(|bytes| Share::of(py, bytes))
            });
            let arguments = PyTuple::new(py, std::iter::once(Ok(shape)).chain(shares).collect::<PyResult<Vec<_>>>()?)?;
            Ok((make, arguments).into_pyobject(py)?.into_any())
        }
        _ => array.call_method1("__reduce_ex__", (4,)),
    }
}

/// Restore an array from its shape and its shares.
#[entered]
#[pyfunction]
#[pyo3(signature = (shape, *shares))]
pub fn _restore_array<'py>(shape: &Bound<'py, PyTuple>, shares: &Bound<'py, PyTuple>) -> PyResult<Bound<'py, PyAny>> {
    let py = shape.py();
    let damaged = || format_error(py, "unpickle: the stored array is damaged");
    let shares: Vec<Bound<'py, PyBytes>> = shares.extract().map_err(|_| damaged())?;
    let shape: Vec<usize> = shape.extract().map_err(|_| damaged())?;
    let numbers = shape.iter().try_fold(1_usize, |count, &n| count.checked_mul(n)).ok_or_else(damaged)?;
    if shares.iter().any(|share| share.as_bytes().len() % 8 > 0)
        || shares.iter().map(|share| share.as_bytes().len() / 8).sum::<usize>() != numbers
    {
        return Err(damaged());
    }
    let fill = |mut out: &mut [f64]| -> Result<(), Failure> {
        for piece in shares.iter().flat_map(|share| share.as_bytes().as_chunks::<8>().0.chunks(1 << 16)) {
            let (to, rest) = out.split_at_mut(piece.len());
            to.iter_mut().zip(piece).for_each(|(x, bytes)| *x = f64::from_le_bytes(*bytes));
            out = rest;
            pause_in_turn(py)?;
        }
        Ok(())
    };
    entry(py, "unpickle", || written_array(py, &shape, fill))
}
