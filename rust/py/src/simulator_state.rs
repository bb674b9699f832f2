//! The states of `Simulator.set_state` and `Simulator.reset`, and the message about a state that diverges.

use crate::arrays::vector;
use crate::errors::{Failure, input_error};
use crate::force::constant_force;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::Wrench;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Read `(n,)` finite numbers for the motors. For a plant without elastic joints, such an argument is an error.
fn of_motors(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>, plant: &PlantSpec) -> Result<Option<Vec<f64>>, Failure> {
    let Some(value) = value else { return Ok(None) };
    if !plant.kind().has_motors() {
        let problem = format!("is not used: expected None for {}", plant.kind().name());
        return Err(input_error(value.py(), function, name, problem).into());
    }
    Ok(Some(vector(function, name, value, plant.n())?))
}

/// Read `(n,)` finite numbers for the bristles of LuGre friction. For a plant without LuGre friction, such an argument is an error.
fn of_bristles(function: &str, value: Option<&Bound<'_, PyAny>>, plant: &PlantSpec) -> Result<Option<Vec<f64>>, Failure> {
    let Some(value) = value else { return Ok(None) };
    if plant.bristles() == 0 {
        return Err(input_error(value.py(), function, "bristles", "is not used: expected None for a plant without LuGre friction").into());
    }
    Ok(Some(vector(function, "bristles", value, plant.n())?))
}

/// Read the state of a law, which has `size` numbers.
pub fn law_state(function: &str, value: &Bound<'_, PyAny>, size: usize) -> Result<Vec<f64>, Failure> {
    if size == 0 {
        return Err(input_error(value.py(), function, "estimate", "is not used: expected None for a law without a state").into());
    }
    vector(function, "estimate", value, size)
}

/// Read the states of links, motors and bristles, and return the state of the plant.
pub fn state_of(
    function: &str,
    plant: &PlantSpec,
    (q, v): (&Bound<'_, PyAny>, &Bound<'_, PyAny>),
    (theta, theta_dot): (Option<&Bound<'_, PyAny>>, Option<&Bound<'_, PyAny>>),
    bristles: Option<&Bound<'_, PyAny>>,
) -> Result<Vec<f64>, Failure> {
    let n = plant.n();
    let (q, v) = (vector(function, "q", q, n)?, vector(function, "v", v, n)?);
    let motors = |name: &str, value| of_motors(function, name, value, plant);
    let (theta, theta_dot) = (motors("theta", theta)?, motors("theta_dot", theta_dot)?);
    let v = if plant.kind().has_speeds() { v } else { Vec::new() };
    let mut state = plant.initial_state(&q, &v, theta.as_deref(), theta_dot.as_deref());
    if let Some(deflections) = of_bristles(function, bristles, plant)? {
        state[plant.seen()..].copy_from_slice(&deflections);
    }
    Ok(state)
}

/// The end of a message: the joint with the largest speed, and its velocity.
pub fn fastest(v: &[f64]) -> String {
    let fastest = v.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    fastest.map_or(String::new(), |(i, v)| format!("; the fastest joint before it: v[{i}] = {v:.4}"))
}

/// The keywords of `Simulator`.
const KNOWN: [&str; 11] =
    ["dt", "v0", "theta0", "theta_dot0", "method", "sample_time", "force", "force_frame", "tau_max", "state_limit", "check_limits"];

/// Refuse unknown keywords of `Simulator`, and add the keywords that a run requires.
pub fn complete(function: &str, keywords: &Bound<'_, PyDict>) -> Result<(), Failure> {
    if let Some(key) = keywords.keys().iter().map(|key| key.to_string()).find(|key| !KNOWN.contains(&key.as_str())) {
        return Err(input_error(keywords.py(), function, &key, format!("is unknown: expected some of {}", KNOWN.join(", "))).into());
    }
    for (name, value) in [("record_every", 1), ("t_end", 0)] {
        keywords.set_item(name, value)?;
    }
    keywords.set_item("monitors", false)?;
    if !keywords.contains("method")? {
        keywords.set_item("method", "rk4")?;
    }
    Ok(())
}

/// Read the force of one step as a wrench `[f; m]`. Without a frame for the force the result is an error; see `Simulator::pushed`.
pub fn wrench(pushed: &Option<Option<Vec<usize>>>, force: &Bound<'_, PyAny>) -> Result<Wrench, Failure> {
    const NAME: &str = "Simulator.step";
    let Some(rows) = pushed else {
        let problem = "has no frame to act at: expected a Simulator with a force_frame, or with a law that has a frame";
        return Err(input_error(force.py(), NAME, "force", problem).into());
    };
    constant_force(NAME, force, rows.as_deref())
}
