//! Copies of large arrays, piece by piece. Between two pieces other threads can get the interpreter lock, and Ctrl-C is checked.
//!
//! Even a copy can take long, because the system provides each page of new memory at its first access.

use super::raw::in_place;
use crate::errors::{Failure, input_error};
use crate::interrupts::{Breaks, long, pause_in_turn};
use armlet_core::{error, memory};
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::ops::Range;

/// The largest count of float64 numbers in a piece: half a megabyte. Larger arrays are copied in pieces.
pub const PIECE: usize = 1 << 16;

/// Copy `from` to `to`. The interpreter lock is released for large arrays, so no other thread may read or write `to`, or write to `from`.
pub fn copy<T: Copy + Send + Sync>(py: Python<'_>, from: &[T], to: &mut [T]) -> Result<(), Failure> {
    if from.len() <= PIECE {
        to.copy_from_slice(from);
        return Ok(());
    }
    long(py, || {
        memory::copy(from, to);
        Ok(())
    })
}

/// Copy the numbers of a large array whose memory is contiguous and aligned.
pub fn read(function: &str, name: &str, array: &Bound<'_, PyArrayDyn<f64>>) -> Result<Vec<f64>, Failure> {
    let mut values = memory::reserved(array.len())?;
    append(function, name, array, &mut values)?;
    Ok(values)
}

/// Append the numbers of a large array to `values`, which must have the capacity for them. Each piece looks up the address of the array
/// again, because another thread may have changed the array between two pieces.
pub fn append(function: &str, name: &str, array: &Bound<'_, PyArrayDyn<f64>>, values: &mut Vec<f64>) -> Result<(), Failure> {
    let (py, count, start) = (array.py(), array.len(), values.len());
    let mut breaks = Breaks::new();
    while values.len() - start < count {
        let Some(all) = in_place(array).filter(|all| all.len() == count) else {
            let problem = "was changed while it was read: expected an array that keeps its size and layout";
            return Err(input_error(py, function, name, problem).into());
        };
        let at = values.len() - start;
        values.extend_from_slice(&all[at..(at + PIECE).min(count)]);
        breaks.pause(py)?;
    }
    Ok(())
}

/// Copy the elements with the indices `range` of a large C-contiguous array to little-endian bytes.
pub fn copied_to_bytes<'py>(array: &Bound<'py, PyArrayDyn<f64>>, range: Range<usize>) -> Result<Bound<'py, PyBytes>, Failure> {
    let py = array.py();
    let changed = || input_error(py, "pickle", "array", "was changed while it was read: expected an array that keeps its size and layout");
    let mut at = range.start;
    let bytes = PyBytes::new_with(py, range.len() * size_of::<f64>(), |out| {
        for out in out.as_chunks_mut::<8>().0.chunks_mut(PIECE) {
            // Each piece looks up the address again, because another thread may have changed the array between two pieces.
            let values = in_place(array).and_then(|all| all.get(at..at + out.len())).ok_or_else(changed)?;
            out.iter_mut().zip(values).for_each(|(bytes, x)| *bytes = x.to_le_bytes());
            at += out.len();
            pause_in_turn(py)?;
        }
        Ok(())
    })?;
    Ok(bytes)
}

/// Whether all `values` are finite.
pub fn all_finite(py: Python<'_>, values: &[f64]) -> Result<bool, Failure> {
    if values.len() <= PIECE { Ok(error::all_finite(values)) } else { long(py, || Ok(error::all_finite(values))) }
}
