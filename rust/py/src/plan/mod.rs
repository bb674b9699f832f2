//! Minimum-time planning of one link under gravity, and of an arm along a path. This file restores the pickled results of one link.

pub mod bang_bang;
pub mod bang_bang_batch;
pub mod bang_bang_report;
mod link;
pub mod path_limits;
pub mod profiles;
pub mod time_path;
pub mod timed_path;
pub mod torque;

use crate::errors::{entry, input_error};
use armlet_macros::entered;
use bang_bang::bang_bang_time;
use profiles::ProfileReport;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use torque::TorqueOptimum;

/// Restore a result: call its function again with the same numbers.
#[entered]
#[pyfunction]
pub fn _restore_plan<'py>(py: Python<'py>, function: &str, arguments: &Bound<'py, PyTuple>) -> PyResult<Bound<'py, PyAny>> {
    let all: Vec<Bound<'py, PyAny>> = arguments.iter().collect();
    if let ("bang_bang_time", [theta0, thetaf, inertia, gravity_moment, tau_max, tau_min]) = (function, &all[..]) {
        return bang_bang_time(py, theta0, thetaf, inertia, gravity_moment, tau_max, &PyTuple::empty(py), Some(tau_min));
    }
    let x: Vec<f64> = all.iter().map(|x| x.extract()).collect::<PyResult<_>>()?;
    entry(py, function, || match (function, &x[..]) {
        ("trapezoid_time", &[a, b, c, d, e, f, ramp]) => {
            Ok(Bound::new(py, ProfileReport::solve([a, b, c, d, e, f], Some(ramp))?)?.into_any())
        }
        ("minimum_jerk_time", &[a, b, c, d, e, f]) => Ok(Bound::new(py, ProfileReport::solve([a, b, c, d, e, f], None)?)?.into_any()),
        ("torque_optimal_time", &[a, b, c, d, e, f, viscous, coulomb]) => {
            Ok(Bound::new(py, TorqueOptimum::solve([a, b, c, d, e, f], [viscous, coulomb])?)?.into_any())
        }
        _ => Err(input_error(py, "_restore_plan", "function", format!("is unknown: got {function} with {} numbers", x.len())).into()),
    })
}
