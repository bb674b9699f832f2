//! Pickles with a checksum: `payload = SHA-256(body) || body`, where `body` is a pickle of `(make, arguments, keywords)`.
//!
//! The object is `make(*arguments, **keywords)`. The digest covers all of it, nested objects too, so that a changed bit is a
//! `FormatError` and never another object. It detects damage, not intent: unpickle only what you trust.

use crate::errors::format_error;
use crate::interrupts::pause;
use armlet_macros::entered;
use pyo3::exceptions::{PyException, PyMemoryError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyMemoryView, PySlice, PyTuple};

/// What `__reduce__` returns: `_restore` and the payload.
pub type Sealed<'py> = (Bound<'py, PyAny>, (Bound<'py, PyBytes>,));

/// Bytes that are handled between two moments in which other threads get the interpreter.
const PIECE: usize = 1 << 20;
/// Bytes of the digest.
const DIGEST: usize = 32;
/// Every Python that armlet supports reads it, so that all versions write the same bytes.
const PROTOCOL: u8 = 4;

/// The pickle of `make(*arguments, **keywords)`.
pub fn seal<'py>(make: &Bound<'py, PyAny>, arguments: Bound<'py, PyTuple>, keywords: Option<Bound<'py, PyDict>>) -> PyResult<Sealed<'py>> {
    let py = make.py();
    let keywords = keywords.unwrap_or_else(|| PyDict::new(py));
    let body = py.import("pickle")?.call_method1("dumps", ((make, arguments, keywords), PROTOCOL))?.cast_into::<PyBytes>()?;
    let digest = digest(&view(&body, 0, body.as_bytes().len())?, body.as_bytes().len())?;
    let payload = bytes(py, &[digest.as_bytes(), body.as_bytes()])?;
    Ok((py.import("armlet._core")?.getattr("_restore")?, (payload,)))
}

/// What `__reduce__` of a class in Python returns: the pickle of `make(*arguments)`.
#[entered]
#[pyfunction]
pub fn _seal<'py>(make: &Bound<'py, PyAny>, arguments: &Bound<'py, PyTuple>) -> PyResult<Sealed<'py>> {
    seal(make, arguments.clone(), None)
}

/// The pickle of an object that its class makes from `__getnewargs_ex__`.
pub fn seal_new<'py>(object: &Bound<'py, PyAny>) -> PyResult<Sealed<'py>> {
    let (arguments, keywords): (Bound<'_, PyTuple>, Bound<'_, PyDict>) = object.call_method0("__getnewargs_ex__")?.extract()?;
    seal(object.get_type().as_any(), arguments, Some(keywords))
}

/// The pickle of a call of `armlet._core.<function>`.
pub fn seal_call<'py>(py: Python<'py>, function: &str, arguments: Bound<'py, PyTuple>) -> PyResult<Sealed<'py>> {
    seal(&py.import("armlet._core")?.getattr(function)?, arguments, None)
}

/// These bytes, one after the other, as Python's.
pub fn bytes<'py>(py: Python<'py>, parts: &[&[u8]]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, parts.iter().map(|part| part.len()).sum(), |mut out| {
        for piece in parts.iter().flat_map(|part| part.chunks(PIECE)) {
            let (to, rest) = out.split_at_mut(piece.len());
            to.copy_from_slice(piece);
            out = rest;
            pause(py)?;
        }
        Ok(())
    })
}

/// The bytes from `first` to `last`, in place.
fn view<'py>(bytes: &Bound<'py, PyAny>, first: usize, last: usize) -> PyResult<Bound<'py, PyAny>> {
    PyMemoryView::from(bytes)?.get_item(PySlice::new(bytes.py(), first as isize, last as isize, 1))
}

/// Of a megabyte at a time: `hashlib` does not look for signals.
fn digest<'py>(body: &Bound<'py, PyAny>, length: usize) -> PyResult<Bound<'py, PyBytes>> {
    let py = body.py();
    let hash = py.import("hashlib")?.call_method0("sha256")?;
    for first in (0..length).step_by(PIECE) {
        hash.call_method1("update", (view(body, first, (first + PIECE).min(length))?,))?;
        pause(py)?;
    }
    Ok(hash.call_method0("digest")?.cast_into::<PyBytes>()?)
}

/// An object from the payload of its pickle; `FormatError` where the payload is damaged or of another version.
#[entered]
#[pyfunction]
pub fn _restore<'py>(payload: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = payload.py();
    let damaged = || format_error(py, "unpickle: the stored object is damaged: its checksum does not match");
    let bytes = payload.cast::<PyBytes>().map_err(|_| damaged())?.as_bytes();
    let Some((stored, body)) = bytes.split_at_checked(DIGEST) else { return Err(damaged()) };
    let length = body.len();
    let body = view(payload, DIGEST, bytes.len())?;
    if digest(&body, length)?.as_bytes() != stored {
        return Err(damaged());
    }
    let made = (|| {
        let parts = py.import("pickle")?.call_method1("loads", (body,))?;
        let (make, arguments, keywords): (Bound<'_, PyAny>, Bound<'_, PyTuple>, Bound<'_, PyDict>) = parts.extract()?;
        make.call(arguments, Some(&keywords))
    })();
    // What was written whole and cannot be made is of another version of armlet, or of a package that is not here.
    made.map_err(|error| {
        let passes = error.is_instance_of::<PyMemoryError>(py) || !error.is_instance_of::<PyException>(py);
        if passes { error } else { format_error(py, &format!("unpickle: the stored object is of another version: {error}")) }
    })
}
