//! The conversion of lists, tuples and other sequences to float64.
//!
//! The length of a sequence is read first, and no entries beyond this length are converted. Ctrl-C is checked after every
//! [`POLL`] entries.

use super::convert::{Wrong, array_of, copy, object, real};
use super::shape::shown;
use crate::errors::{Failure, input_error};
use crate::interrupts::Breaks;
use armlet_core::memory;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyFloat, PyIterator, PyList, PyMapping, PyString, PyTuple};

/// The largest number of entries of a sequence other than a list or tuple. For example, a range needs no memory for its entries.
const MOST: usize = 1 << 28;
/// The largest number of entries of an iterable without a length.
const MOST_UNSIZED: usize = 1 << 20;
/// The largest number of levels of nested lists.
const DEEPEST: usize = 16;
/// The number of entries between two checks for Ctrl-C.
const POLL: usize = 1 << 12;

/// Whether an object has a length and entries by index, such as a list, a range or a deque. Strings and mappings do not count.
pub fn is_sequence(value: &Bound<'_, PyAny>) -> bool {
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        return true;
    }
    let text_or_table = value.is_instance_of::<PyString>() || value.is_instance_of::<PyDict>() || value.cast::<PyMapping>().is_ok();
    !text_or_table && value.hasattr("__len__").unwrap_or(false) && value.hasattr("__getitem__").unwrap_or(false)
}

/// The length that a sequence reports.
fn length(value: &Bound<'_, PyAny>) -> Result<usize, Wrong> {
    let py = value.py();
    let n = match value.len() {
        Ok(n) => n,
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyOverflowError>(py) => usize::MAX,
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyValueError>(py) => {
            return Err(Wrong::Kind("a sequence of negative length".into()));
        }
        Err(error) => return Err(error.into()),
    };
    if n > MOST && !value.is_instance_of::<PyList>() && !value.is_instance_of::<PyTuple>() {
        let got = if n == usize::MAX { "more".to_string() } else { n.to_string() };
        return Err(Wrong::Kind(format!("a sequence of {got} entries, where {MOST} are the most")));
    }
    Ok(n)
}

/// Entry `i` of a sequence whose reported length is larger than `i`.
fn entry<'py>(value: &Bound<'py, PyAny>, i: usize) -> Result<Bound<'py, PyAny>, Wrong> {
    value.get_item(i).map_err(|error| absent(value, error))
}

/// The error for a missing entry. A sequence may report a length that is too large, and conversions of entries may shorten a list.
fn absent(value: &Bound<'_, PyAny>, error: PyErr) -> Wrong {
    if error.is_instance_of::<pyo3::exceptions::PyLookupError>(value.py()) {
        return Wrong::Kind("a sequence with fewer entries than its length".into());
    }
    error.into()
}

/// The shape that the length and the first entry of a sequence imply.
pub fn shape(value: &Bound<'_, PyAny>, depth: usize) -> Result<Vec<usize>, Wrong> {
    if depth == DEEPEST {
        return Err(Wrong::Kind(format!("lists nested deeper than {DEEPEST}")));
    }
    let n = length(value)?;
    let mut shape = vec![n];
    if n > 0 {
        shape.extend(shape_of(&entry(value, 0)?, depth + 1)?);
    }
    Ok(shape)
}

/// The shape of an entry of a sequence that is nested `depth` levels deep.
fn shape_of(value: &Bound<'_, PyAny>, depth: usize) -> Result<Vec<usize>, Wrong> {
    if real(value)?.is_some() {
        return Ok(Vec::new());
    }
    if let Some(array) = array_of(value)? {
        return Ok(array.getattr("shape")?.extract()?);
    }
    if is_sequence(value) {
        return shape(value, depth);
    }
    Err(Wrong::Kind(object(value)))
}

/// Append the entries of a sequence to `out`. They must have the implied `shape`.
pub fn fill(value: &Bound<'_, PyAny>, shape: &[usize], out: &mut Vec<f64>) -> Result<(), Wrong> {
    let ragged = |got: String| Wrong::Kind(format!("rows of different lengths, {got}"));
    let Some((&n, inner_shape)) = shape.split_first() else {
        // The entry must be a number, or an array without axes.
        if let Some(x) = real(value)? {
            out.push(x);
            return Ok(());
        }
        return match array_of(value)? {
            Some(array) if array.getattr("ndim")?.extract::<usize>()? == 0 => copy(&array, out).map_err(|(wrong, _)| wrong),
            Some(_) => Err(ragged("an array among numbers".into())),
            None if is_sequence(value) => Err(ragged("a list among numbers".into())),
            None => Err(Wrong::Kind(object(value))),
        };
    };
    if let Some(array) = array_of(value)? {
        let got: Vec<usize> = array.getattr("shape")?.extract()?;
        if got != shape {
            return Err(ragged(format!("{} and {}", shown(shape), shown(&got))));
        }
        let start = out.len();
        return copy(&array, out).map_err(|(wrong, k)| {
            out.truncate(start + k);
            wrong
        });
    }
    if real(value)?.is_some() {
        return Err(ragged("a number among lists".into()));
    }
    if !is_sequence(value) {
        return Err(Wrong::Kind(object(value)));
    }
    let got = length(value)?;
    if got != n {
        return Err(ragged(format!("{n} and {got}")));
    }
    let (list, mut breaks) = (value.cast_exact::<PyList>().ok(), Breaks::new());
    for i in 0..n {
        if i % POLL == POLL - 1 {
            breaks.pause(value.py())?;
        }
        let item = match list {
            Some(list) => list.get_item(i).map_err(|error| absent(value, error))?,
            None => entry(value, i)?,
        };
        match item.cast::<PyFloat>() {
            Ok(x) if inner_shape.is_empty() => out.push(x.value()),
            _ => fill(&item, inner_shape, out)?,
        }
    }
    Ok(())
}

/// Return the entries of a list, a tuple or another iterable of objects. More than `most` entries are an error.
///
/// `what` is the text after "is not" in the error message, such as "a list of names: expected strings".
pub fn items<'py>(
    function: &str,
    name: &str,
    what: &str,
    value: &Bound<'py, PyAny>,
    most: usize,
) -> Result<Vec<Bound<'py, PyAny>>, Failure> {
    let py = value.py();
    let refuse = |problem: String| -> Failure { input_error(py, function, name, problem).into() };
    let not_a_list = || refuse(format!("is not {what}, got {}", value.get_type()));
    let too_long = |got: String| refuse(format!("is too long: expected at most {most} entries, got {got}"));
    if value.is_instance_of::<PyString>() || value.is_instance_of::<PyBytes>() || value.is_instance_of::<PyDict>() {
        return Err(not_a_list());
    }
    if let Ok(list) = value.cast_exact::<PyList>()
        && list.len() <= most.min(POLL)
    {
        return Ok((0..list.len()).map(|i| list.get_item(i)).collect::<PyResult<_>>()?);
    }
    let n = match value.hasattr("__len__")? {
        true => Some(length(value).map_err(|wrong| match wrong {
            Wrong::Failure(failure) => failure,
            Wrong::Kind(got) | Wrong::Inexact(got) => too_long(got),
        })?),
        false => None,
    };
    if let Some(n) = n.filter(|&n| n > most) {
        return Err(too_long(n.to_string()));
    }
    let entries = PyIterator::from_object(value).map_err(|_| not_a_list())?;
    let most = n.unwrap_or(most.min(MOST_UNSIZED));
    let (mut out, mut breaks) = (memory::reserved(n.unwrap_or(0))?, Breaks::new());
    for entry in entries {
        if out.len() == most {
            return Err(too_long("more".into()));
        }
        if out.len() % POLL == POLL - 1 {
            breaks.pause(py)?;
        }
        if out.len() == out.capacity() {
            memory::more(&mut out, (most / 8).clamp(16, POLL))?;
        }
        out.push(entry?);
    }
    Ok(out)
}
