//! The argument `stops` of a plant: an `armlet.JointStops`. Its missing position limits are the limits of the arm. An infinite limit is no stop.

use crate::arrays::{Axis, Form, SCALAR, numbers, require_no_nan, spread};
use crate::errors::{Failure, input_error};
use armlet_core::dynamics::Model;
use armlet_core::plant::Stops;
use pyo3::prelude::*;

/// Read the stops of a plant from an `armlet.JointStops`.
pub fn stops(function: &'static str, model: &Model, value: Option<&Bound<'_, PyAny>>) -> Result<Option<Stops>, Failure> {
    let Some(value) = value else { return Ok(None) };
    let n = model.n();
    let limits = |upper: bool| -> Vec<f64> {
        match model {
            Model::Tree(arm) => arm.independent().map(|joint| if upper { joint.limits.upper } else { joint.limits.lower }).collect(),
            Model::PlanarPr(_) => vec![if upper { f64::INFINITY } else { f64::NEG_INFINITY }; n],
        }
    };
    let read = |name: &str| -> Result<Option<Vec<f64>>, Failure> {
        let wrong = || input_error(value.py(), function, "stops", "is of the wrong type: expected a JointStops or None");
        let given = value.getattr(name).map_err(|_| wrong())?;
        if given.is_none() {
            return Ok(None);
        }
        let (shape, values) = numbers(function, name, &given, &[SCALAR, Form(&[Axis::Is(n)])])?;
        require_no_nan(value.py(), function, name, &shape, &values)?;
        Ok(Some(spread(&shape, values, n)?))
    };
    let lower = read("lower")?.unwrap_or_else(|| limits(false));
    let upper = read("upper")?.unwrap_or_else(|| limits(true));
    let (stiffness, damping) = (read("stiffness")?.unwrap_or_default(), read("damping")?.unwrap_or_else(|| vec![0.0; n]));
    if stiffness.len() != n {
        return Err(input_error(value.py(), function, "stiffness", "is missing: expected a scalar or (n,), got None").into());
    }
    Ok(Some(Stops::new(lower, upper, stiffness, damping)?))
}
