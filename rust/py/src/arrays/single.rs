//! Arguments that are not arrays: numbers, flags, names and objects.

use super::ArrayArgument;
use crate::errors::{Failure, input_error};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

/// The text of an argument in a message: its type, and its value if the value is short.
pub fn quoted(value: &Bound<'_, PyAny>) -> String {
    let shown = value.repr().map(|text| text.to_string()).unwrap_or_default();
    let kind = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
    if shown.is_empty() || shown.len() > 40 { format!("{kind:?}") } else { format!("{shown} ({kind})") }
}

/// Read a real number. Booleans, strings and arrays with axes are refused, also of the shape `(1,)`.
pub fn number(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<f64, Failure> {
    if let Ok(number) = value.cast::<PyFloat>() {
        return Ok(number.value());
    }
    match ArrayArgument::new(function, name, value) {
        Ok(argument) if argument.shape.is_empty() => Ok(argument.values()?.1[0]),
        Err(Failure::Python(error)) if !error.is_instance_of::<pyo3::exceptions::PyValueError>(value.py()) => Err(error.into()),
        _ => Err(input_error(value.py(), function, name, format!("is not a number: expected a real number, got {}", quoted(value))).into()),
    }
}

/// Read a real number, or `None` for a missing argument.
pub fn optional_number(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<Option<f64>, Failure> {
    value.map(|value| number(function, name, value)).transpose()
}

/// Read an integer that is at least one.
pub fn count(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    let problem = || format!("is not a positive integer: expected an integer >= 1, got {}", quoted(value));
    Ok(integer(value).filter(|&count| count > 0).ok_or_else(|| input_error(value.py(), function, name, problem()))?)
}

/// Read an integer that is at least zero.
pub fn nonnegative_integer(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    let problem = || format!("is not a count: expected an integer >= 0, got {}", quoted(value));
    Ok(integer(value).ok_or_else(|| input_error(value.py(), function, name, problem()))?)
}

/// A Python or numpy integer that is at least zero; `None` for other values and for booleans.
fn integer(value: &Bound<'_, PyAny>) -> Option<usize> {
    value.extract::<usize>().ok().filter(|_| !value.is_instance_of::<PyBool>())
}

/// A Python or numpy integer; `None` for other values and for booleans. An integer outside the range of 64 bits becomes `isize::MAX`.
pub fn signed(value: &Bound<'_, PyAny>) -> Option<isize> {
    if value.is_instance_of::<PyBool>() {
        return None;
    }
    match value.extract::<isize>() {
        Ok(integer) => Some(integer),
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyOverflowError>(value.py()) => Some(isize::MAX),
        Err(_) => None,
    }
}

/// Read True or False of Python or numpy.
pub fn flag(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<bool, Failure> {
    let refused = |_| input_error(value.py(), function, name, format!("is not a flag: expected True or False, got {}", quoted(value)));
    Ok(value.extract::<bool>().map_err(refused)?)
}

/// Read True or False of Python or numpy. A missing argument is False.
pub fn flag_or_false(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<bool, Failure> {
    value.map_or(Ok(false), |value| flag(function, name, value))
}

/// Read and copy a string.
pub fn text(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<String, Failure> {
    self::name(function, name, value).map(str::to_string)
}

/// Borrow a string without a copy.
pub fn name<'a>(function: &str, name: &str, value: &'a Bound<'_, PyAny>) -> Result<&'a str, Failure> {
    match value.cast::<PyString>().ok().and_then(|text| text.to_str().ok()) {
        // C functions end a name at the character NUL, so two different names could become equal.
        Some(text) if text.contains('\0') => {
            Err(input_error(value.py(), function, name, format!("holds the character NUL: expected a name, got {text:?}")).into())
        }
        Some(text) => Ok(text),
        None => Err(input_error(value.py(), function, name, format!("is not a name: expected a string, got {}", quoted(value))).into()),
    }
}

/// Check that an argument is an object of the class `T` of this extension.
pub fn object<'py, T: pyo3::PyClass>(
    function: &str,
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> Result<Bound<'py, T>, Failure> {
    let wrong = |_| {
        let kind = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
        input_error(value.py(), function, name, format!("is of the wrong type: expected {expected}, got {kind}")).into()
    };
    value.cast::<T>().cloned().map_err(wrong)
}
