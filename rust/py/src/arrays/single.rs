//! Arguments that are not arrays: a number, a flag, a name, an object.

use super::Looked;
use crate::errors::{Failure, input_error};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyString};

/// An argument in a message: its type, and its value if that is short.
pub fn quoted(value: &Bound<'_, PyAny>) -> String {
    let shown = value.repr().map(|text| text.to_string()).unwrap_or_default();
    let kind = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
    if shown.is_empty() || shown.len() > 40 { format!("{kind:?}") } else { format!("{shown} ({kind})") }
}

/// A real number; not a boolean, not a string, not an array of one.
pub fn number(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<f64, Failure> {
    if let Ok(number) = value.cast::<PyFloat>() {
        return Ok(number.value());
    }
    match Looked::at(function, name, value) {
        Ok(looked) if looked.shape.is_empty() => Ok(looked.values()?.1[0]),
        Err(Failure::Python(error)) if !error.is_instance_of::<pyo3::exceptions::PyValueError>(value.py()) => Err(error.into()),
        _ => Err(input_error(value.py(), function, name, format!("is not a number: expected a real number, got {}", quoted(value))).into()),
    }
}

/// A real number, or None.
pub fn optional_number(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<Option<f64>, Failure> {
    value.map(|value| number(function, name, value)).transpose()
}

/// An integer of at least one.
pub fn count(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    let problem = || format!("is not a positive integer: expected an integer >= 1, got {}", quoted(value));
    Ok(integer(value).filter(|&count| count > 0).ok_or_else(|| input_error(value.py(), function, name, problem()))?)
}

/// An integer of at least zero.
pub fn whole(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    let problem = || format!("is not a count: expected an integer >= 0, got {}", quoted(value));
    Ok(integer(value).ok_or_else(|| input_error(value.py(), function, name, problem()))?)
}

/// An integer of at least zero, numpy's too; not a boolean.
fn integer(value: &Bound<'_, PyAny>) -> Option<usize> {
    value.extract::<usize>().ok().filter(|_| !value.is_instance_of::<PyBool>())
}

/// An integer, numpy's too; not a boolean. An integer beyond 64 bits becomes the largest or the smallest one.
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

/// True or False, numpy's too.
pub fn flag(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<bool, Failure> {
    let refused = |_| input_error(value.py(), function, name, format!("is not a flag: expected True or False, got {}", quoted(value)));
    Ok(value.extract::<bool>().map_err(refused)?)
}

/// True or False, numpy's too; False if the argument is missing.
pub fn flag_or_false(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<bool, Failure> {
    value.map_or(Ok(false), |value| flag(function, name, value))
}

/// A text, copied.
pub fn text(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<String, Failure> {
    self::name(function, name, value).map(str::to_string)
}

/// A text, in place.
pub fn name<'a>(function: &str, name: &str, value: &'a Bound<'_, PyAny>) -> Result<&'a str, Failure> {
    match value.cast::<PyString>().ok().and_then(|text| text.to_str().ok()) {
        // Many readers of names stop at NUL, so two names would become one.
        Some(text) if text.contains('\0') => {
            Err(input_error(value.py(), function, name, format!("holds the character NUL: expected a name, got {text:?}")).into())
        }
        Some(text) => Ok(text),
        None => Err(input_error(value.py(), function, name, format!("is not a name: expected a string, got {}", quoted(value))).into()),
    }
}

/// An object of a class of this module.
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
