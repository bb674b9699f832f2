//! The common parts of the planners of one link: their arguments, and the properties, texts and pickles of their results.

use crate::broadcast::number_or_array;
use crate::errors::{Failure, input_error};
use crate::seal::{Sealed, seal, seal_call};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Define the common properties of the reports of rest-to-rest profiles. They read the field `core`.
macro_rules! link_report {
    ($report:ident) => {
        $crate::properties::properties!($report {
            /// Whether some duration satisfies the torque limits.
            feasible: bool;
            /// Shortest duration, s; NaN if infeasible.
            t_min: f64;
            /// Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible.
            t_max: f64;
            /// Whether the torque can hold the link at rest at the start.
            hold_start: bool;
            /// Whether the torque can hold the link at rest at the end.
            hold_end: bool;
        });
    };
}
pub(super) use link_report;

/// The names of the arguments of the planners of one link: start and end, rad; inertia, kg m^2; gravity moment and torque limits, N m.
pub const NAMES: [&str; 6] = ["theta0", "thetaf", "inertia", "gravity_moment", "tau_max", "tau_min"];

/// The six numbers with the names [`NAMES`].
pub type LinkProblem = [f64; 6];

/// Read the six numbers of one problem. The result is `None` if an argument is an array with axes. `tau_min` defaults to `-tau_max`.
pub fn problem(
    py: Python<'_>,
    function: &str,
    values: [&Bound<'_, PyAny>; 5],
    tau_min: Option<&Bound<'_, PyAny>>,
) -> Result<Option<LinkProblem>, Failure> {
    let mut p = [0.0; 6];
    for k in 0..5 {
        match number_or_array(function, NAMES[k], values[k])? {
            Some(x) => p[k] = x,
            None => return Ok(None),
        }
    }
    p[5] = match tau_min {
        None => symmetric(py, function, p[4])?,
        Some(value) => match number_or_array(function, "tau_min", value)? {
            Some(x) => x,
            None => return Ok(None),
        },
    };
    Ok(Some(p))
}

/// Return `-tau_max` as the default of `tau_min`. An invalid `tau_max` is an error about `tau_max`.
pub fn symmetric(py: Python<'_>, function: &str, tau_max: f64) -> Result<f64, Failure> {
    if tau_max > 0.0 && tau_max.is_finite() {
        return Ok(-tau_max);
    }
    Err(input_error(py, function, "tau_max", format!("is not positive: expected a finite number > 0, got {tau_max}")).into())
}

/// Read the problem of a planner that accepts numbers only.
pub fn single(
    py: Python<'_>,
    function: &str,
    values: [&Bound<'_, PyAny>; 5],
    tau_min: Option<&Bound<'_, PyAny>>,
) -> Result<LinkProblem, Failure> {
    if let Some(p) = problem(py, function, values, tau_min)? {
        return Ok(p);
    }
    for (name, value) in NAMES.into_iter().zip(values.into_iter().chain(tau_min)) {
        scalar(function, name, value)?;
    }
    unreachable!("an argument has axes")
}

/// Read a number. Arrays with axes are refused.
pub fn scalar(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<f64, Failure> {
    let got = || value.getattr("shape").and_then(|s| s.str()).map_or("an array".to_string(), |s| format!("shape {s}"));
    number_or_array(function, name, value)?
        .ok_or_else(|| input_error(value.py(), function, name, format!("is not a number: expected a number, got {}", got())).into())
}

/// The Python text of a float or a truth value.
pub fn float(x: f64) -> String {
    if x.is_nan() || x.is_infinite() { x.to_string().to_lowercase() } else { format!("{x:?}") }
}

pub fn truth(x: bool) -> &'static str {
    if x { "True" } else { "False" }
}

/// The pickled form of a result: the name of its function, and the numbers of the call.
pub fn pickled_call<'py>(py: Python<'py>, function: &str, arguments: &[f64]) -> PyResult<Sealed<'py>> {
    seal_call(py, "_restore_plan", (function, PyTuple::new(py, arguments)?).into_pyobject(py)?)
}

/// The pickled form of a part of a result: the result, and the name of the field that has the part.
pub fn part<'py, T>(py: Python<'py>, owner: &Py<T>, name: &str) -> PyResult<Sealed<'py>> {
    seal(&py.import("builtins")?.getattr("getattr")?, (owner.clone_ref(py).into_any(), name).into_pyobject(py)?, None)
}
