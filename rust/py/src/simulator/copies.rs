//! Copies and pickles of a `Simulator`.

use super::{NAME, Simulator};
use crate::errors::{entry, input_error};
use crate::seal::{Sealed, seal_call};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::PoisonError;

#[entered]
#[pymethods]
impl Simulator {
    /// The pickled form: the arguments of the constructor, and the state.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        seal_call(py, "_restore_simulator", self.parts(py)?)
    }

    fn __copy__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("armlet._core")?.call_method1("_restore_simulator", self.parts(py)?)
    }

    /// Make a deep copy without a pickle, because a law in Python may not support pickling.
    fn __deepcopy__<'py>(&self, py: Python<'py>, memo: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let parts = py.import("copy")?.call_method1("deepcopy", (self.parts(py)?, memo))?.cast_into::<PyTuple>()?;
        py.import("armlet._core")?.call_method1("_restore_simulator", parts)
    }
}

/// Restore a `Simulator` from the constructor's arguments `made_of` and from `at`: the number of steps, the state and the input.
#[entered]
#[pyfunction]
#[arguments(made_of, at, diverged = false)]
pub fn _restore_simulator(
    py: Python<'_>,
    made_of: (Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyDict>),
    at: (u64, Vec<f64>, Vec<f64>),
    diverged: bool,
) -> PyResult<Simulator> {
    let ((plant, law, q0, keywords), (steps, x, input)) = (made_of, at);
    // The constructor of the original object has already warned about joint limits.
    let mut simulator = Simulator::made(&plant, &law, &q0, keywords.copy()?, false)?;
    entry(py, NAME, || {
        for (name, length, expected) in [("state", x.len(), simulator.x.len()), ("input", input.len(), simulator.input.len())] {
            if length != expected {
                return Err(input_error(py, NAME, name, format!("has the wrong length: expected {expected}, got {length}")).into());
            }
        }
        simulator.stepping().resume(steps, &x, &input, diverged);
        simulator.show(py)
    })?;
    Ok(simulator)
}

impl Simulator {
    /// The arguments of `_restore_simulator`.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let stepping = self.stepping.lock().unwrap_or_else(PoisonError::into_inner);
        if !stepping.resumable() {
            let problem =
                "Simulator: can't be pickled here: expected a step at which a plain sample is due, got one with samples under way";
            return Err(PyTypeError::new_err(problem));
        }
        let at = (stepping.steps(), self.x.clone(), self.input.clone());
        (self.made_of.clone_ref(py), at, stepping.status() != Status::Success).into_pyobject(py)
    }
}
