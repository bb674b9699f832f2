//! The validation of array arguments for functions that are written in Python.

use super::read::ArrayArgument;
use super::sequence::items;
use super::shape::{Axis, Form, WHATEVER};
use super::single::{name as text, nonnegative_integer};
use super::write::copied;
use crate::errors::Failure;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};

/// The largest number of axes of an array.
const MOST_AXES: usize = 64;

/// Check an array argument, and return it as float64: the caller's array if it needs no conversion, otherwise a copy.
///
/// Args:
///     function, name: names of the function and of the argument, for messages.
///     value: any object.
///     shapes: the valid shapes, each a tuple. An entry is the length of an axis, a name for any length, or "..." for any leading axes.
///         Without `shapes`, any shape is valid.
///
/// Raises:
///     InputError: `value` is not an array of real numbers, or its shape is not valid.
///
/// >>> from armlet import _core
/// >>> _core.numbers("f", "x", [1, 2], (2,), ("K", 2))
/// array([1., 2.])
#[entered]
#[pyfunction]
#[pyo3(signature = (function, name, value, *shapes))]
pub fn numbers<'py>(
    function: &Bound<'py, PyAny>,
    name: &Bound<'py, PyAny>,
    value: &Bound<'py, PyAny>,
    shapes: &Bound<'py, PyTuple>,
) -> Result<Bound<'py, PyAny>, Failure> {
    let (function, name) = (text(NAME, "function", function)?, text(NAME, "name", name)?);
    let shapes: Vec<Vec<Bound<'py, PyAny>>> =
        shapes.iter().map(|shape| items(NAME, "shapes", "a shape: expected a tuple", &shape, MOST_AXES)).collect::<Result<_, _>>()?;
    let axes: Vec<Vec<Axis<'_>>> =
        shapes.iter().map(|shape| shape.iter().map(axis).collect::<Result<_, _>>()).collect::<Result<_, Failure>>()?;
    let forms: Vec<Form<'_>> = if axes.is_empty() { vec![WHATEVER] } else { axes.iter().map(|axes| Form(axes)).collect() };
    let read = || -> Result<Bound<'py, PyAny>, Failure> {
        let argument = ArrayArgument::new(function, name, value)?.of(&forms)?;
        if argument.is_in_place() {
            return Ok(value.clone());
        }
        let (shape, values) = argument.values()?;
        copied(py, &shape, &values)
    };
    // The message of a memory error starts with the name of the calling function.
    read().map_err(|failure| failure.into_python(py, function).into())
}

fn axis<'a>(given: &'a Bound<'_, PyAny>) -> Result<Axis<'a>, Failure> {
    if !given.is_instance_of::<PyString>() {
        return Ok(Axis::Is(nonnegative_integer("numbers", "shapes", given)?));
    }
    let name = text("numbers", "shapes", given)?;
    Ok(if name == "..." { Axis::Leading } else { Axis::Any(name) })
}
