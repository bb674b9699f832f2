//! External forces from Python objects: a constant force, a list `[(t_start, F), ...]`, or a callable `F(t)`.

use crate::arrays::{Axis, Form, items, number, numbers, require_finite, text};
use crate::errors::{Failure, input_error};
use armlet_core::memory;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{Force, Wrench};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::sync::{Arc, Mutex};

/// The first exception of a Python callable during a run. It is raised after the run.
pub type Raised = Arc<Mutex<Option<PyErr>>>;

/// Whether a Python callable has raised an exception. Then the run ends, and neither the force nor the law is called again.
pub fn failed(raised: &Raised) -> bool {
    raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).is_some()
}

/// Read the argument `force_frame`, and return the index of the frame.
pub fn force_frame(function: &str, plant: &PlantSpec, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    const NAME: &str = "force_frame";
    let name = text(function, NAME, value)?;
    Ok(plant.model().tree(NAME)?.frame_index(&name).map_err(|error| error.of_argument(NAME))?)
}

/// The largest number of pairs in a list `[(t_start, F), ...]`.
const MOST_STEPS: usize = 1 << 24;

/// Read a force, and return its wrench `[f; m]`, N and N m. Entry `k` of the force is entry `rows[k]` of the wrench.
fn wrench(function: &str, value: &Bound<'_, PyAny>, rows: &[usize]) -> Result<Wrench, Failure> {
    let (shape, values) = numbers(function, "force", value, &[Form(&[Axis::Is(rows.len())])])?;
    require_finite(value.py(), function, "force", &shape, &values)?;
    let mut full = [0.0; 6];
    for (&row, &x) in rows.iter().zip(values.iter()) {
        full[row] = x;
    }
    Ok(full)
}

/// Return the index in the wrench `[f; m]` of each entry of a force. `law` has the indices of the law's coordinates. If it is `None`, a
/// force `(6,)` is the whole wrench, and a force `(3,)` is `f`.
fn rows_of(value: &Bound<'_, PyAny>, law: Option<&[usize]>) -> Vec<usize> {
    match law {
        Some(rows) => rows.to_vec(),
        None => (0..if value.len().unwrap_or(3) == 6 { 6 } else { 3 }).collect(),
    }
}

/// Read a constant force, and return its wrench `[f; m]`. `rows` has the same meaning as in [`force`].
pub fn constant_force(function: &str, value: &Bound<'_, PyAny>, rows: Option<&[usize]>) -> Result<Wrench, Failure> {
    wrench(function, value, &rows_of(value, rows))
}

/// Read a force. `rows` has the indices of the law's coordinates: entry `k` of the force is entry `rows[k]` of the wrench `[f; m]`. If
/// `rows` is `None`, the force is `(3,)` or `(6,)` in world axes.
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
                result.map_err(|failure| store_error(&raised, py, function, failure)).ok()
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

/// Store an exception, unless an earlier exception is stored.
pub fn store_error(raised: &Raised, py: Python<'_>, function: &str, failure: Failure) {
    let error = failure.into_python(py, function);
    raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).get_or_insert(error);
}

/// Return the stored exception of a Python callable as an error.
pub fn raise(raised: &Raised) -> Result<(), Failure> {
    let inside = raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
    inside.map_or(Ok(()), |error| Err(Failure::Python(error)))
}
