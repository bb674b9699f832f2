//! The conversion of an array argument to float64. Only the fast path of the module `raw` reads arguments without this conversion.
//!
//! The type, the number of axes and the shape are checked before any copy. A C-contiguous, aligned float64 array of at most `PIECE` numbers
//! is read in place. Larger arrays, lists, integers, float32, strided, reversed and Fortran arrays are copied. Masked, complex, object,
//! boolean and string arrays are refused. Integers that float64 does not represent are also refused. The module `sequence` reads lists and
//! other sequences.

use super::convert::{Wrong, array_of, copy, object, real, require_unmasked};
use super::pieces::{self, PIECE};
use super::raw::in_place;
use super::sequence;
use super::shape::{Axis, Form, SCALAR, elements, expected, index_of, shown};
use crate::errors::{Failure, input_error};
use armlet_core::memory;
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::borrow::Cow;

/// The shape of an argument, and its elements in C order.
pub type Converted<'a> = Result<(Vec<usize>, Cow<'a, [f64]>), Failure>;

/// Read the shape and the numbers of an argument. Its shape must match one of `forms`.
pub fn numbers<'a>(function: &str, name: &str, value: &'a Bound<'_, PyAny>, forms: &[Form<'_>]) -> Converted<'a> {
    ArrayArgument::new(function, name, value)?.of(forms)?.values()
}

/// Read and copy a finite vector of length `n`.
pub fn vector(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    finite(function, name, value, &[Form(&[Axis::Is(n)])])
}

/// Read a finite vector of length `n`, or one finite number, which is repeated `n` times.
pub fn per_entry(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
    require_finite(value.py(), function, name, &shape, &values)?;
    spread(&shape, values, n)
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

/// Refuse numbers that are not finite.
pub fn require_finite(py: Python<'_>, function: &str, name: &str, shape: &[usize], values: &[f64]) -> Result<(), Failure> {
    if pieces::all_finite(py, values)? {
        return Ok(());
    }
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(k) if shape.is_empty() => {
            Err(input_error(py, function, name, format!("is not finite: expected a finite number, got {}", values[k])).into())
        }
        Some(k) => {
            let index = index_of(shape, k);
            Err(input_error(
                py,
                function,
                name,
                format!("is not finite: expected finite numbers, got {} (first bad index {index})", values[k]),
            )
            .into())
        }
    }
}

/// Refuse NaN. Infinity is accepted, because it means that there is no limit.
pub fn require_no_nan(py: Python<'_>, function: &str, name: &str, shape: &[usize], values: &[f64]) -> Result<(), Failure> {
    let Some(k) = values.iter().position(|x| x.is_nan()) else { return Ok(()) };
    let place = if shape.is_empty() { String::new() } else { format!(" (first bad index {})", index_of(shape, k)) };
    Err(input_error(py, function, name, format!("is not a number: expected numbers or infinity, got nan{place}")).into())
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
pub struct ArrayArgument<'n, 'a, 'py> {
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

impl<'n, 'a, 'py> ArrayArgument<'n, 'a, 'py> {
    pub fn new(function: &'n str, name: &'n str, value: &'a Bound<'py, PyAny>) -> Result<Self, Failure> {
        let (shape, source) = kind(value).map_err(|wrong| wrong.refusal(value.py(), function, name, ""))?;
        Ok(ArrayArgument { function, name, value, shape, source })
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
                let mut out = memory::reserved(elements(&self.shape)?)?;
                copy(&array, &mut out).map_err(|(wrong, k)| {
                    let at = if self.shape.is_empty() { String::new() } else { format!(" (first bad index {})", index_of(&self.shape, k)) };
                    wrong.refusal(value.py(), function, name, &at)
                })?;
                Cow::Owned(out)
            }
            Source::Sequence => {
                let mut out = memory::reserved(elements(&self.shape)?)?;
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
