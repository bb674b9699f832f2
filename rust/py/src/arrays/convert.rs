//! The conversion of one number or of one array to float64, and the reason why a value has no conversion.

use super::pieces::PIECE;
use super::raw::{in_place, is_masked};
use crate::errors::{Failure, input_error};
use crate::interrupts::Breaks;
use numpy::{Element, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyByteArray, PyBytes, PyDict, PyFloat, PyInt, PyList, PyMemoryView, PySlice, PyString, PyTuple};

/// The reason why a value is not an array of numbers.
pub enum Wrong {
    /// The value has another type, which the text describes.
    Kind(String),
    /// An integer, with this text, is not exact in float64.
    Inexact(String),
    Failure(Failure),
}

impl From<PyErr> for Wrong {
    fn from(error: PyErr) -> Self {
        Wrong::Failure(error.into())
    }
}

impl From<Failure> for Wrong {
    fn from(failure: Failure) -> Self {
        Wrong::Failure(failure)
    }
}

impl Wrong {
    pub fn refusal(self, py: Python<'_>, function: &str, name: &str, at: &str) -> Failure {
        let problem = match self {
            Wrong::Kind(got) => format!("is not an array of real numbers: expected float64, got {got}{at}"),
            Wrong::Inexact(got) => format!("is not exact in float64: expected real numbers that float64 represents, got {got}{at}"),
            Wrong::Failure(failure) => return failure,
        };
        input_error(py, function, name, problem).into()
    }
}

/// Read a Python float or integer; `None` for other values. Booleans, and integers that float64 does not represent, are an error.
pub fn real(value: &Bound<'_, PyAny>) -> Result<Option<f64>, Wrong> {
    if let Ok(x) = value.cast::<PyFloat>() {
        return Ok(Some(x.value()));
    }
    if value.is_instance_of::<PyBool>() {
        return Err(Wrong::Kind("bool".into()));
    }
    let Ok(integer) = value.cast::<PyInt>() else { return Ok(None) };
    if let Ok(x) = integer.extract::<i64>() {
        return exact(x).map(Some).ok_or_else(|| Wrong::Inexact(x.to_string()));
    }
    // An integer outside the range of int64 is accepted if float64 represents it, such as 10**20.
    let same = |x: &f64| PyFloat::new(value.py(), *x).as_any().eq(value).unwrap_or(false);
    match integer.extract::<f64>().ok().filter(same) {
        Some(x) => Ok(Some(x)),
        None => Err(Wrong::Inexact("a large integer".into())),
    }
}

/// Convert an object with an array protocol or a buffer to a numpy array of integers or floating-point numbers. The result is `None` for
/// other objects, such as lists. Strings, masked arrays, and arrays with other types of elements are an error.
pub fn array_of<'py>(value: &Bound<'py, PyAny>) -> Result<Option<Bound<'py, PyAny>>, Wrong> {
    let py = value.py();
    if value.is_instance_of::<PyString>() || value.is_instance_of::<PyBytes>() || value.is_instance_of::<PyByteArray>() {
        return Err(Wrong::Kind(type_name(value)));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() || value.is_instance_of::<PyDict>() || value.is_none() {
        return Ok(None);
    }
    let protocols = ["__array__", "__array_interface__", "__array_struct__"];
    if !protocols.iter().any(|name| value.hasattr(*name).unwrap_or(false)) && PyMemoryView::from(value).is_err() {
        return Ok(None);
    }
    require_unmasked(value)?;
    let array = match numpy_function(py, "asarray")?.call1((value,)) {
        Ok(array) => array,
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyValueError>(py) => return Err(Wrong::Kind(object(value))),
        Err(error) => return Err(error.into()),
    };
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    if !matches!(kind.as_str(), "i" | "u" | "f") {
        return Err(Wrong::Kind(dtype.str()?.to_string()));
    }
    Ok(Some(array))
}

/// Append the elements of an array of integers or floating-point numbers to `out`. An error has the index of the first element that float64
/// does not represent.
pub fn copy(array: &Bound<'_, PyAny>, out: &mut Vec<f64>) -> Result<(), (Wrong, usize)> {
    let failed = |error: PyErr| (Wrong::from(error), 0);
    let py = array.py();
    let shape: Vec<usize> = array.getattr("shape").and_then(|shape| shape.extract()).map_err(failed)?;
    let row = shape.iter().skip(1).product::<usize>().max(1);
    if shape.first().is_some_and(|&rows| rows.saturating_mul(row) > PIECE) {
        // A large array is converted in groups of rows, with a check for Ctrl-C after each, because numpy does not check for signals.
        let (start, mut breaks) = (out.len(), Breaks::new());
        for first in (0..shape[0]).step_by((PIECE / row).max(1)) {
            let last = (first + (PIECE / row).max(1)).min(shape[0]);
            let before = out.len() - start;
            let rows = array.get_item(PySlice::new(py, first as isize, last as isize, 1));
            let rows = rows.and_then(|rows| breaks.pause(py).map(|()| rows)).map_err(|error| (Wrong::from(error), before))?;
            copy(&if last - first == 1 { rows.get_item(0).map_err(failed)? } else { rows }, out)
                .map_err(|(wrong, k)| (wrong, before + k))?;
        }
        return Ok(());
    }
    let dtype = array.getattr("dtype").map_err(failed)?;
    let kind: String = dtype.getattr("kind").and_then(|kind| kind.extract()).map_err(failed)?;
    let size: usize = dtype.getattr("itemsize").and_then(|size| size.extract()).map_err(failed)?;
    let to = match kind.as_str() {
        "i" if size > 4 => "int64",
        "u" if size > 4 => "uint64",
        _ => "float64",
    };
    let order = pyo3::types::PyDict::new(py);
    order.set_item("order", "C").map_err(failed)?;
    // `numpy.array` makes an aligned, contiguous copy. `ascontiguousarray` may return an array that is not aligned.
    let array = numpy_function(py, "array").and_then(|function| function.call((array, to), Some(&order))).map_err(failed)?;
    let start = out.len();
    match to {
        "int64" => integers::<i64>(&array, out, exact),
        "uint64" => integers::<u64>(&array, out, exact_unsigned),
        _ => {
            let array = array.cast::<PyArrayDyn<f64>>().ok().and_then(in_place);
            out.extend_from_slice(array.ok_or_else(|| (Wrong::Kind("an array that numpy could not copy".into()), 0))?);
            Ok(())
        }
    }
    .map_err(|wrong| (wrong, out.len() - start))
}

fn integers<T: Element + Copy + std::fmt::Display>(
    array: &Bound<'_, PyAny>,
    out: &mut Vec<f64>,
    number: impl Fn(T) -> Option<f64>,
) -> Result<(), Wrong> {
    let array = array.cast::<PyArrayDyn<T>>().ok().and_then(in_place);
    for &x in array.ok_or_else(|| Wrong::Kind("an array that numpy could not copy".into()))? {
        out.push(number(x).ok_or_else(|| Wrong::Inexact(x.to_string()))?);
    }
    Ok(())
}

fn exact(x: i64) -> Option<f64> {
    let y = x as f64;
    (y as i128 == i128::from(x)).then_some(y)
}

fn exact_unsigned(x: u64) -> Option<f64> {
    let y = x as f64;
    (y as i128 == i128::from(x)).then_some(y)
}

/// Refuse a masked array, because its masked elements have no meaning.
pub fn require_unmasked(value: &Bound<'_, PyAny>) -> Result<(), Wrong> {
    if is_masked(value)? { Err(Wrong::Kind("a masked array".into())) } else { Ok(()) }
}

fn numpy_function<'py>(py: Python<'py>, name: &'static str) -> PyResult<Bound<'py, PyAny>> {
    static NUMPY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let numpy = NUMPY.get_or_try_init(py, || PyResult::Ok(py.import("numpy")?.into_any().unbind()))?;
    numpy.bind(py).getattr(name)
}

/// Describe a value that is not a number, for a message: the numpy type `object`, and the name of its class.
pub fn object(value: &Bound<'_, PyAny>) -> String {
    format!("object ({})", type_name(value))
}

fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map(|name| name.to_string()).unwrap_or_default()
}
