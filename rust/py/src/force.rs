//! External forces as Python objects: None, a constant, `[(t_start, F), ...]` or `F(t)`.

use crate::arrays::{Axis, Form, items, number, numbers, require_finite, text};
use crate::errors::{Failure, input_error};
use armlet_core::memory;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{Force, Wrench};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::sync::{Arc, Mutex};

/// The error of a callable, kept until the run has ended.
pub type Raised = Arc<Mutex<Option<PyErr>>>;

/// Whether an error was raised. Then Python is not called again, and the run ends.
pub fn failed(raised: &Raised) -> bool {
    raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).is_some()
}

/// The frame that `force_frame` names.
pub fn force_frame(function: &str, plant: &PlantSpec, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    const NAME: &str = "force_frame";
    let name = text(function, NAME, value)?;
    Ok(plant.model().tree(NAME)?.frame_index(&name).map_err(|error| error.of_argument(NAME))?)
}

/// The most steps of a force.
const MOST_STEPS: usize = 1 << 24;

/// `rows[k]` is the place in `[f; m]` of entry `k`.
fn wrench(function: &str, value: &Bound<'_, PyAny>, rows: &[usize]) -> Result<Wrench, Failure> {
    let (shape, values) = numbers(function, "force", value, &[Form(&[Axis::Is(rows.len())])])?;
    require_finite(value.py(), function, "force", &shape, &values)?;
    let mut full = [0.0; 6];
    for (&row, &x) in rows.iter().zip(values.iter()) {
        full[row] = x;
    }
    Ok(full)
}

/// With `force_frame`, the number of entries of the first sample decides between (3,) and (6,).
fn rows_of(value: &Bound<'_, PyAny>, law: Option<&[usize]>) -> Vec<usize> {
    match law {
        Some(rows) => rows.to_vec(),
        None => (0..if value.len().unwrap_or(3) == 6 { 6 } else { 3 }).collect(),
    }
}

/// A constant force, as [`force`] reads one.
pub fn constant_force(function: &str, value: &Bound<'_, PyAny>, rows: Option<&[usize]>) -> Result<Wrench, Failure> {
    wrench(function, value, &rows_of(value, rows))
}

/// A force whose entries are the law's `rows`; `None`: (3,) or (6,) in world axes.
pub fn force(function: &'static str, value: &Bound<'_, PyAny>, rows: Option<&[usize]>, raised: &Raised) -> Result<Force, Failure> {
    if value.is_callable() {
        let (call, rows, raised) = (value.clone().unbind(), rows.map(<[usize]>::to_vec), raised.clone());
        return Ok(Force::Signal(Arc::new(move |t| {
            if failed(&raised) {
                return None;
            }
            Python::attach(|py| {
                let sample = call.bind(py).call1((t,)).map_err(Failure::Python);
                let result = sample.and_then(|sample| wrench(function, &sample, &rows_of(&sample, rows.as_deref())));
                result.map_err(|failure| keep(&raised, py, function, failure)).ok()
            })
        })));
    }
    let is_steps = (value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>())
        && value.get_item(0).is_ok_and(|first| first.is_instance_of::<PyTuple>() || first.is_instance_of::<PyList>());
    if !is_steps {
        return Ok(Force::steps(vec![0.0], vec![constant_force(function, value, rows)?])?);
    }
    let steps = items(function, "force", "made of pairs: expected [(t_start, F), ...]", value, MOST_STEPS)?;
    let (mut starts, mut values) = (memory::reserved(steps.len())?, memory::reserved(steps.len())?);
    for (i, step) in steps.iter().enumerate() {
        let pair = items(function, "force", "made of pairs: expected [(t_start, F), ...]", step, 2).unwrap_or_default();
        let (start, value) = match pair.as_slice() {
            [start, value] => (start, value),
            _ => {
                let problem = format!("is not made of pairs: expected [(t_start, F), ...] (first bad index {i})");
                return Err(input_error(step.py(), function, "force", problem).into());
            }
        };
        starts.push(number(function, "force", start)?);
        values.push(wrench(function, value, &rows_of(value, rows))?);
    }
    Ok(Force::steps(starts, values)?)
}

/// Keep the first exception.
pub fn keep(raised: &Raised, py: Python<'_>, function: &str, failure: Failure) {
    let error = match failure {
        Failure::Python(error) => error,
        Failure::Core(error) => crate::errors::to_python(py, function, error),
    };
    raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).get_or_insert(error);
}

/// Raise the error of a callable inside a run.
pub fn raise(raised: &Raised) -> Result<(), Failure> {
    let inside = raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
    inside.map_or(Ok(()), |error| Err(Failure::Python(error)))
}
