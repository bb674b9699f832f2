//! Pickles with a checksum: `payload = SHA-256(body) || body`, where `body` is a pickle of `(make, arguments, keywords)`.
//!
//! The restored object is `make(*arguments, **keywords)`. The checksum covers the whole body with all nested objects. So a changed bit
//! raises `FormatError`, and cannot make another object. The checksum detects damage, but not manipulation: unpickle only trusted data.
//!
//! Large bodies are stored in *shares*, so that other threads can run between two shares.

use crate::errors::format_error;
use crate::interrupts::pause_in_turn;
use armlet_macros::entered;
use pyo3::exceptions::{PyException, PyMemoryError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyMemoryView, PySlice, PyTuple};
use std::collections::VecDeque;
use std::ops::Range;

/// The result of `__reduce__`: the function `_restore`, and the payload in one part or in several.
pub type Sealed<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>);

/// The number of bytes that are copied or hashed between two pauses, in which other threads can run.
const PIECE: usize = 1 << 20;
/// The number of bytes of a share. `pickle` copies a share while no other thread can run and no signal is checked.
pub const SHARE: usize = 1 << 22;
/// The number of bytes of the SHA-256 digest.
const DIGEST: usize = 32;
/// The pickle protocol. It is fixed, so that all versions of Python write the same bytes.
const PROTOCOL: u8 = 4;

/// The dispatch table of a pickler: the global table of `copyreg`, with `_stored_array` for numpy arrays.
fn array_table(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let table = py.import("copyreg")?.getattr("dispatch_table")?.cast_into::<PyDict>()?.copy()?;
    table.set_item(py.import("numpy")?.getattr("ndarray")?, py.import("armlet._core")?.getattr("_stored_array")?)?;
    Ok(table)
}

/// Make the result of `__reduce__` for the object `make(*arguments, **keywords)`.
pub fn seal<'py>(make: &Bound<'py, PyAny>, arguments: Bound<'py, PyTuple>, keywords: Option<Bound<'py, PyDict>>) -> PyResult<Sealed<'py>> {
    let py = make.py();
    let keywords = keywords.unwrap_or_else(|| PyDict::new(py));
    let file = Bound::new(py, Written { parts: Vec::new(), last: Vec::new(), hash: sha256(py)?.unbind() })?;
    let pickler = py.import("pickle")?.call_method1("Pickler", (&file, PROTOCOL))?;
    pickler.setattr("dispatch_table", array_table(py)?)?;
    pickler.call_method1("dump", ((make, arguments, keywords),))?;
    // The pickler holds references to the pickled objects. Dropping the pickler frees temporary objects.
    drop(pickler);
    pause_in_turn(py)?;
    let mut file = file.borrow_mut();
    let digest = digest_of(file.hash.bind(py))?;
    let payload = if file.parts.is_empty() {
        PyTuple::new(py, [bytes(py, &[digest.as_bytes(), &file.last])?])?
    } else {
        file.end_part(py)?;
        let shares = file.parts.iter().map(|part| Share::of(py, part.bind(py).clone()));
        PyTuple::new(py, std::iter::once(Ok(digest.into_any())).chain(shares).collect::<PyResult<Vec<_>>>()?)?
    };
    Ok((py.import("armlet._core")?.getattr("_restore")?, payload))
}

/// Make the result of `__reduce__` for the object `make(*arguments)`, for classes that are written in Python.
#[entered]
#[pyfunction]
pub fn _seal<'py>(make: &Bound<'py, PyAny>, arguments: &Bound<'py, PyTuple>) -> PyResult<Sealed<'py>> {
    seal(make, arguments.clone(), None)
}

/// Make the result of `__reduce__` for an object. Unpickling calls its class with the arguments that `__getnewargs_ex__` returns.
pub fn seal_new<'py>(object: &Bound<'py, PyAny>) -> PyResult<Sealed<'py>> {
    let (arguments, keywords): (Bound<'_, PyTuple>, Bound<'_, PyDict>) = object.call_method0("__getnewargs_ex__")?.extract()?;
    seal(object.get_type().as_any(), arguments, Some(keywords))
}

/// Make the result of `__reduce__` for the object that `armlet._core.<function>(*arguments)` returns.
pub fn seal_call<'py>(py: Python<'py>, function: &str, arguments: Bound<'py, PyTuple>) -> PyResult<Sealed<'py>> {
    seal(&py.import("armlet._core")?.getattr(function)?, arguments, None)
}

/// Concatenate these bytes to a Python `bytes` object.
pub fn bytes<'py>(py: Python<'py>, parts: &[&[u8]]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, parts.iter().map(|part| part.len()).sum(), |mut out| {
        for piece in parts.iter().flat_map(|part| part.chunks(PIECE)) {
            let (to, unread) = out.split_at_mut(piece.len());
            to.copy_from_slice(piece);
            out = unread;
            pause_in_turn(py)?;
        }
        Ok(())
    })
}

/// A memory view of the bytes `first..last`, without a copy.
fn view<'py>(bytes: &Bound<'py, PyAny>, first: usize, last: usize) -> PyResult<Bound<'py, PyAny>> {
    PyMemoryView::from(bytes)?.get_item(PySlice::new(bytes.py(), first as isize, last as isize, 1))
}

fn sha256(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import("hashlib")?.call_method0("sha256")
}

/// Add the bytes `first..last` to a hash. Pieces of a megabyte are hashed one by one, because `hashlib` does not check for signals.
fn update(hash: &Bound<'_, PyAny>, bytes: &Bound<'_, PyAny>, first: usize, last: usize) -> PyResult<()> {
    for first in (first..last).step_by(PIECE) {
        hash.call_method1("update", (view(bytes, first, (first + PIECE).min(last))?,))?;
        pause_in_turn(hash.py())?;
    }
    Ok(())
}

fn digest_of<'py>(hash: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    Ok(hash.call_method0("digest")?.cast_into::<PyBytes>()?)
}

/// The file object to which `pickle` writes a body. Other threads can run between two writes, which `pickle.dumps` does not allow.
///
/// Large `bytes` objects are stored without a copy, because no other thread can run while a copy is freed.
#[pyclass(module = "armlet._core", name = "_Written")]
struct Written {
    parts: Vec<Py<PyBytes>>,
    last: Vec<u8>,
    hash: Py<PyAny>,
}

impl Written {
    fn end_part(&mut self, py: Python<'_>) -> PyResult<()> {
        if !self.last.is_empty() {
            self.parts.push(bytes(py, &[&self.last])?.unbind());
            self.last.clear();
        }
        Ok(())
    }
}

#[entered]
#[pymethods]
impl Written {
    fn write(&mut self, data: &Bound<'_, PyBytes>) -> PyResult<usize> {
        let (py, count) = (data.py(), data.as_bytes().len());
        update(self.hash.bind(py), data, 0, count)?;
        if self.last.len() + count > SHARE {
            self.end_part(py)?;
        }
        if count >= PIECE {
            self.end_part(py)?;
            for first in (0..count).step_by(SHARE) {
                let part = if count <= SHARE { data.clone() } else { bytes(py, &[&data.as_bytes()[first..count.min(first + SHARE)]])? };
                self.parts.push(part.unbind());
            }
        } else {
            self.last.try_reserve(count).map_err(|_| PyMemoryError::new_err("no memory for a pickle"))?;
            self.last.extend_from_slice(data.as_bytes());
        }
        pause_in_turn(py)?;
        Ok(count)
    }
}

/// A part of a large payload. `pickle` calls `__reduce__` of each part, and in this call other threads can run.
#[pyclass(module = "armlet._core", name = "_Share", frozen)]
pub struct Share {
    bytes: Py<PyBytes>,
}

impl Share {
    pub fn of<'py>(py: Python<'py>, bytes: Bound<'py, PyBytes>) -> PyResult<Bound<'py, PyAny>> {
        Ok(Bound::new(py, Share { bytes: bytes.unbind() })?.into_any())
    }
}

#[entered]
#[pymethods]
impl Share {
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        pause_in_turn(py)?;
        Ok((py.import("armlet._core")?.getattr("_share")?, (self.bytes.bind(py).clone(),)))
    }
}

/// Return a part of a large payload unchanged. Before it returns, other threads can run.
#[entered]
#[pyfunction]
pub fn _share<'py>(bytes: &Bound<'py, PyBytes>) -> PyResult<Bound<'py, PyBytes>> {
    pause_in_turn(bytes.py())?;
    Ok(bytes.clone())
}

/// The file object from which `pickle` reads a body. `at` is the index of the next unread byte of the first part.
#[pyclass(module = "armlet._core", name = "_Reading")]
struct Reading {
    parts: VecDeque<Py<PyBytes>>,
    at: usize,
}

impl Reading {
    /// The next bytes of the front part: at most `most` of them, or with `None` up to the end of the line.
    fn next(&mut self, py: Python<'_>, most: Option<usize>) -> Option<(Py<PyBytes>, Range<usize>)> {
        loop {
            let part = self.parts.front()?;
            let unread = part.as_bytes(py).get(self.at..).unwrap_or_default();
            if unread.is_empty() {
                (self.at, _) = (0, self.parts.pop_front());
                continue;
            }
            let line = || unread.iter().position(|&byte| byte == b'\n').map_or(unread.len(), |end| end + 1);
            let taken = self.at..self.at + most.unwrap_or_else(line).min(unread.len());
            self.at = taken.end;
            return Some((part.clone_ref(py), taken));
        }
    }
}

#[entered]
#[pymethods]
impl Reading {
    fn read<'py>(&mut self, py: Python<'py>, most: usize) -> PyResult<Bound<'py, PyBytes>> {
        let (mut left, mut found) = (most, Vec::new());
        while left > 0
            && let Some((part, range)) = self.next(py, Some(left))
        {
            if range.len() == most && range == (0..part.as_bytes(py).len()) {
                return Ok(part.into_bound(py));
            }
            left -= range.len();
            found.push((part, range));
        }
        bytes(py, &found.iter().map(|(part, range)| &part.as_bytes(py)[range.clone()]).collect::<Vec<_>>())
    }

    fn readline<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let (mut ended, mut found) = (false, Vec::new());
        while !ended && let Some((part, range)) = self.next(py, None) {
            ended = part.as_bytes(py)[range.clone()].ends_with(b"\n");
            found.push((part, range));
        }
        bytes(py, &found.iter().map(|(part, range)| &part.as_bytes(py)[range.clone()]).collect::<Vec<_>>())
    }
}

/// Restore an object from the payload of its pickle. A payload that is damaged, or from which this version cannot make the object, raises
/// `FormatError`.
#[entered]
#[pyfunction]
#[pyo3(signature = (*payload))]
pub fn _restore<'py>(payload: &Bound<'py, PyTuple>) -> PyResult<Bound<'py, PyAny>> {
    let py = payload.py();
    let damaged = || format_error(py, "unpickle: the stored object is damaged: its checksum does not match");
    // `copy.copy` passes objects of the class `Share`, and an unpickler passes their bytes.
    let part = |part: Bound<'py, PyAny>| match part.cast::<Share>() {
        Ok(share) => Ok(share.get().bytes.bind(py).clone()),
        Err(_) => part.cast_into::<PyBytes>().map_err(|_| damaged()),
    };
    let parts = payload.iter().map(part).collect::<PyResult<Vec<_>>>()?;
    let Some((stored, _)) = parts.first().and_then(|first| first.as_bytes().split_at_checked(DIGEST)) else { return Err(damaged()) };
    let hash = sha256(py)?;
    for (k, part) in parts.iter().enumerate() {
        update(&hash, part, if k == 0 { DIGEST } else { 0 }, part.as_bytes().len())?;
    }
    if digest_of(&hash)?.as_bytes() != stored {
        return Err(damaged());
    }
    let parts = parts.iter().map(|part| part.clone().unbind()).collect();
    let made = (|| {
        let file = Bound::new(py, Reading { parts, at: DIGEST })?;
        let parts = py.import("pickle")?.call_method1("load", (file,))?;
        let (make, arguments, keywords): (Bound<'_, PyAny>, Bound<'_, PyTuple>, Bound<'_, PyDict>) = parts.extract()?;
        make.call(arguments, Some(&keywords))
    })();
    // The checksum matches. If the object cannot be restored, another version of armlet wrote it, or its class is not installed.
    made.map_err(|error| {
        let passes = error.is_instance_of::<PyMemoryError>(py) || !error.is_instance_of::<PyException>(py);
        if passes { error } else { format_error(py, &format!("unpickle: the stored object is of another version: {error}")) }
    })
}
