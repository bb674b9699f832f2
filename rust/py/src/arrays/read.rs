//! The conversion of an array argument to float64. Only the fast path of the module `raw` reads arguments without this conversion.
//!
//! The type, the number of axes and the shape are checked before any copy. A C-contiguous, aligned float64 array of at most `PIECE` numbers
//! is read in place. Larger arrays, lists, integers, float32, strided, reversed and Fortran arrays are copied. Masked, complex, object,
//! boolean and string arrays are refused. Integers that float64 does not represent are also refused. The module `sequence` reads lists and
//! other sequences.

use super::pieces::{self, PIECE};
use super::raw::in_place;
use super::sequence;
use super::shape::{Axis, Form, expected, index_of, require_finite, shown};
use crate::errors::{Failure, input_error};
use crate::interrupts::Breaks;
use armlet_core::memory;
use numpy::{Element, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyByteArray, PyBytes, PyDict, PyFloat, PyInt, PyList, PyMemoryView, PySlice, PyString, PyTuple};
use std::borrow::Cow;

/// The shape of an argument, and its elements in C order.
pub type Converted<'a> = Result<(Vec<usize>, Cow<'a, [f64]>), Failure>;

/// Read the shape and the numbers of an argument. Its shape must match one of `forms`.
pub fn numbers<'a>(function: &str, name: &str, value: &'a Bound<'_, PyAny>, forms: &[Form<'_>]) -> Converted<'a> {
    Looked::at(function, name, value)?.of(forms)?.values()
}

/// Read and copy a finite vector of length `n`.
pub fn vector(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    finite(function, name, value, &[Form(&[Axis::Is(n)])])
}

/// Read three finite numbers. They are zero if the argument is missing.
pub fn three(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<[f64; 3], Failure> {
    let Some(value) = value else { return Ok([0.0; 3]) };
    let values = vector(function, name, value, 3)?;
    Ok([values[0], values[1], values[2]])
}

/// Read and copy a finite vector of any length.
pub fn any_vector(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<Vec<f64>, Failure> {
    finite(function, name, value, &[Form(&[Axis::Any("n")])])
}

fn finite(function: &str, name: &str, value: &Bound<'_, PyAny>, forms: &[Form<'_>]) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value, forms)?;
    require_finite(value.py(), function, name, &shape, &values)?;
    owned(values)
}

/// Convert numbers to an owned vector. Insufficient memory is an error.
pub fn owned(values: Cow<'_, [f64]>) -> Result<Vec<f64>, Failure> {
    match values {
        Cow::Borrowed(values) => Ok(memory::copied(values)?),
        Cow::Owned(values) => Ok(values),
    }
}

/// Repeat a single number `n` times, or return the `n` numbers of a vector.
pub fn spread(shape: &[usize], values: Cow<'_, [f64]>, n: usize) -> Result<Vec<f64>, Failure> {
    if shape.is_empty() { Ok(memory::filled(n, values[0])?) } else { owned(values) }
}

/// An array argument whose type and shape are known, before its elements are read.
pub struct Looked<'n, 'a, 'py> {
    function: &'n str,
    name: &'n str,
    value: &'a Bound<'py, PyAny>,
    pub shape: Vec<usize>,
    source: Source<'py>,
}

enum Source<'py> {
    Number(f64),
    InPlace,
    Array(Bound<'py, PyAny>),
    Sequence,
}

impl<'n, 'a, 'py> Looked<'n, 'a, 'py> {
    pub fn at(function: &'n str, name: &'n str, value: &'a Bound<'py, PyAny>) -> Result<Self, Failure> {
        let (shape, source) = kind(value).map_err(|wrong| wrong.refusal(value.py(), function, name, ""))?;
        Ok(Looked { function, name, value, shape, source })
    }

    /// Return the argument if its shape matches one of `forms`. Otherwise the result is an error.
    pub fn of(self, forms: &[Form<'_>]) -> Result<Self, Failure> {
        if forms.iter().any(|form| form.fits(&self.shape)) { Ok(self) } else { Err(self.of_another_shape(forms)) }
    }

    /// The error for a shape that matches none of `forms`.
    pub fn of_another_shape(&self, forms: &[Form<'_>]) -> Failure {
        let problem = format!("has the wrong shape: expected {}, got {}", expected(forms), shown(&self.shape));
        input_error(self.value.py(), self.function, self.name, problem).into()
    }

    /// Whether the argument is an array that can be read without conversion.
    pub fn is_in_place(&self) -> bool {
        matches!(self.source, Source::InPlace)
    }

    /// Append the elements to `out`, and return the shape. Call this after the shape is accepted.
    pub fn append_to(self, out: &mut Vec<f64>) -> Result<Vec<usize>, Failure> {
        if let (Source::InPlace, Ok(array)) = (&self.source, self.value.cast::<PyArrayDyn<f64>>())
            && array.len() > PIECE
        {
            memory::ensure(out, array.len())?;
            pieces::append(self.function, self.name, array, out)?;
            return Ok(self.shape);
        }
        let (shape, values) = self.values()?;
        memory::ensure(out, values.len())?;
        out.extend_from_slice(&values);
        Ok(shape)
    }

    /// Read the elements, and return them with the shape. Call this after the shape is accepted.
    pub fn values(self) -> Converted<'a> {
        let (function, name, value) = (self.function, self.name, self.value);
        let values = match self.source {
            Source::Number(x) => Cow::Owned(vec![x]),
            Source::InPlace => match value.cast::<PyArrayDyn<f64>>() {
                // A large array is copied, because the work on it may release the interpreter lock.
                Ok(array) if array.len() > PIECE => Cow::Owned(pieces::read(function, name, array)?),
                array => Cow::Borrowed(array.ok().and_then(in_place).unwrap_or_default()),
            },
            Source::Array(array) => {
                let mut out = memory::reserved(super::elements(&self.shape)?)?;
                copy(&array, &mut out).map_err(|(wrong, k)| {
                    let at = if self.shape.is_empty() { String::new() } else { format!(" (first bad index {})", index_of(&self.shape, k)) };
                    wrong.refusal(value.py(), function, name, &at)
                })?;
                Cow::Owned(out)
            }
            Source::Sequence => {
                let mut out = memory::reserved(super::elements(&self.shape)?)?;
                sequence::fill(value, &self.shape, &mut out).map_err(|wrong| {
                    let at = index_of(&self.shape, out.len());
                    wrong.refusal(value.py(), function, name, &format!(" (first bad index {at})"))
                })?;
                Cow::Owned(out)
            }
        };
        Ok((self.shape, values))
    }
}

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
    fn refusal(self, py: Python<'_>, function: &str, name: &str, at: &str) -> Failure {
        let problem = match self {
            Wrong::Kind(got) => format!("is not an array of real numbers: expected float64, got {got}{at}"),
            Wrong::Inexact(got) => format!("is not exact in float64: expected real numbers that float64 represents, got {got}{at}"),
            Wrong::Failure(failure) => return failure,
        };
        input_error(py, function, name, problem).into()
    }
}

/// The shape of an argument, and the method that reads it.
fn kind<'py>(value: &Bound<'py, PyAny>) -> Result<(Vec<usize>, Source<'py>), Wrong> {
    if let Ok(array) = value.cast::<PyArrayDyn<f64>>()
        && in_place(array).is_some()
    {
        require_unmasked(value)?;
        return Ok((array.shape().to_vec(), Source::InPlace));
    }
    if let Some(x) = real(value)? {
        return Ok((Vec::new(), Source::Number(x)));
    }
    if value.cast_exact::<PyList>().is_ok() || value.cast_exact::<PyTuple>().is_ok() {
        return Ok((sequence::shape(value, 0)?, Source::Sequence));
    }
    if let Some(array) = array_of(value)? {
        return Ok((array.getattr("shape")?.extract()?, Source::Array(array)));
    }
    if sequence::is_sequence(value) {
        return Ok((sequence::shape(value, 0)?, Source::Sequence));
    }
    Err(Wrong::Kind(object(value)))
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

/// The shape of an entry of a sequence that is nested `depth` levels deep.
pub fn shape_of(value: &Bound<'_, PyAny>, depth: usize) -> Result<Vec<usize>, Wrong> {
    if real(value)?.is_some() {
        return Ok(Vec::new());
    }
    if let Some(array) = array_of(value)? {
        return Ok(array.getattr("shape")?.extract()?);
    }
    if sequence::is_sequence(value) {
        return sequence::shape(value, depth);
    }
    Err(Wrong::Kind(object(value)))
}

/// Convert a value to a numpy array of integers or floating-point numbers, if it is an array or has a conversion. Otherwise the result is
/// `None`, as for lists. Strings, masked arrays, and arrays of other elements are an error.
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
    static MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = value.py();
    let class = MASKED.get_or_try_init(py, || PyResult::Ok(py.import("numpy.ma")?.getattr("MaskedArray")?.unbind()))?;
    if value.is_instance(class.bind(py))? { Err(Wrong::Kind("a masked array".into())) } else { Ok(()) }
}

fn numpy_function<'py>(py: Python<'py>, name: &'static str) -> PyResult<Bound<'py, PyAny>> {
    static NUMPY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let numpy = NUMPY.get_or_try_init(py, || PyResult::Ok(py.import("numpy")?.into_any().unbind()))?;
    numpy.bind(py).getattr(name)
}

/// Describe a value that is not a number, for a message: the numpy type of its conversion, and its class.
pub fn object(value: &Bound<'_, PyAny>) -> String {
    format!("object ({})", type_name(value))
}

fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map(|name| name.to_string()).unwrap_or_default()
}
