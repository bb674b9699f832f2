//! Bounds of the coordinates of a task, in place of a target.

use crate::arrays::{Axis, Form, SCALAR, numbers, owned, require_no_nan, spread};
use crate::constructor_call::{NamedValues, stored_form};
use crate::errors::Failure;
use armlet_core::error::Error;
use pyo3::prelude::*;

/// A lower and an upper bound as the caller passed them: a number, or one per row, `(rows,)`.
pub(super) struct Bounds([(Vec<usize>, Vec<f64>); 2]);

impl Bounds {
    /// Read the arguments `lower` and `upper`, and store them. A missing bound is infinite, and without both there are no bounds.
    pub fn read(
        function: &str,
        arguments: &mut NamedValues,
        given: [(&'static str, Option<&Bound<'_, PyAny>>); 2],
    ) -> Result<Option<Self>, Failure> {
        if given.iter().all(|(_, bound)| bound.is_none()) {
            return Ok(None);
        }
        let mut bounds = [(Vec::new(), vec![f64::NEG_INFINITY]), (Vec::new(), vec![f64::INFINITY])];
        for (bound, (name, value)) in bounds.iter_mut().zip(given) {
            let Some(value) = value else { continue };
            let (shape, values) = numbers(function, name, value, &[SCALAR, Form(&[Axis::Any("rows")])])?;
            require_no_nan(value.py(), function, name, &shape, &values)?;
            *bound = (shape, owned(values)?);
            arguments.push((name, stored_form(value)?));
        }
        Ok(Some(Bounds(bounds)))
    }

    /// The bounds of a task with this number of rows, `(rows,)` each.
    pub fn of_rows(&self, rows: usize) -> Result<[Vec<f64>; 2], Error> {
        let mut all = [Vec::new(), Vec::new()];
        for ((to, name), (shape, values)) in all.iter_mut().zip(["lower", "upper"]).zip(&self.0) {
            if shape.first().is_some_and(|m| *m != rows) {
                return Err(Error::wrong_shape(name, &[rows], shape));
            }
            *to = spread(shape, values.as_slice().into(), rows).map_err(|_| Error::wrong_shape(name, &[rows], shape))?;
        }
        Ok(all)
    }
}
