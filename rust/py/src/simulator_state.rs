//! States that `Simulator.set_state` and `Simulator.reset` are given, and what is said of one that runs away.

use crate::arrays::{require_finite, vector};
use crate::errors::{Failure, input_error};
use armlet_core::plant::PlantSpec;
use pyo3::prelude::*;

/// `(n,)` finite numbers.
pub fn finite_vector(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let values = vector(function, name, value, n)?;
    require_finite(value.py(), function, name, &[n], &values)?;
    Ok(values)
}

/// The same of motors, which only plants with elastic joints have.
pub fn of_motors(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>, plant: &PlantSpec) -> Result<Option<Vec<f64>>, Failure> {
    let Some(value) = value else { return Ok(None) };
    if !plant.kind().has_motors() {
        let problem = format!("is not used: expected None for {}", plant.kind().name());
        return Err(input_error(value.py(), function, name, problem).into());
    }
    Ok(Some(finite_vector(function, name, value, plant.n())?))
}

/// The fastest joint of a state, in words.
pub fn fastest(v: &[f64]) -> String {
    let fastest = v.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    fastest.map_or(String::new(), |(i, v)| format!("; the fastest joint before it: v[{i}] = {v:.4}"))
}
