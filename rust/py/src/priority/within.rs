//! `armlet.Within`: the bounds of a level in place of its task velocity.

use crate::arrays::{WHATEVER, numbers, of_shape, require_no_nan, written_array};
use crate::broadcast::{common_shape, stretch};
use crate::errors::{Failure, input_error};
use crate::seal::{Sealed, seal};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Bounds `lower <= J_i v <= upper` of a level, in place of its task velocity `v_i`.
///
/// A row with `lower = upper` is a task.
///
/// Args:
///     lower: lower bounds, `(..., rows_i)`, in the unit of the task; `-inf` for none.
///     upper: upper bounds, `(..., rows_i)`; `inf` for none.
///
/// Raises:
///     InputError: a bound is NaN, or the shapes do not broadcast. Bounds out of order are refused by the solver, which names the level.
///
/// Source: [kanoun2011priority]; docs/inequalities.md.
///
/// >>> import armlet as al
/// >>> sol = al.solve_priority([[[1.0, 0.0]], [[1.0, 1.0]]], [al.Within([-0.5], [0.5]), [3.0]], method="exact")
/// >>> sol.v.round(12)
/// array([0.5, 2.5])
#[pyclass(frozen, module = "armlet")]
pub struct Within {
    lower: Py<PyAny>,
    upper: Py<PyAny>,
}

#[entered]
#[pymethods]
impl Within {
    #[new]
    #[arguments(lower, upper)]
    fn new() -> Result<Self, Failure> {
        let (first, low) = numbers(NAME, "lower", lower, &[WHATEVER])?;
        let (second, high) = numbers(NAME, "upper", upper, &[WHATEVER])?;
        require_no_nan(py, NAME, "lower", &first, &low)?;
        require_no_nan(py, NAME, "upper", &second, &high)?;
        let shapes = [vec![1], first.clone(), second.clone()];
        let Some(shape) = common_shape(&shapes) else {
            let problem = format!(
                "do not broadcast: expected shapes that agree, got {} and {}",
                crate::arrays::shown(&first),
                crate::arrays::shown(&second)
            );
            return Err(input_error(py, NAME, "lower, upper", problem).into());
        };
        let array = |from: &[usize], values: &[f64]| -> Result<Py<PyAny>, Failure> {
            let values = stretch(from, &shape, values, 1)?;
            Ok(written_array(py, &shape, |to| {
                to.copy_from_slice(&values);
                Ok(())
            })?
            .unbind())
        };
        Ok(Within { lower: array(&first, &low)?, upper: array(&second, &high)? })
    }

    /// Lower bounds, `(..., rows_i)`, in the unit of the task.
    #[getter]
    fn lower(&self, py: Python<'_>) -> Py<PyAny> {
        self.lower.clone_ref(py)
    }

    /// Upper bounds, `(..., rows_i)`, in the unit of the task.
    #[getter]
    fn upper(&self, py: Python<'_>) -> Py<PyAny> {
        self.upper.clone_ref(py)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let show = |bound: &Py<PyAny>| crate::constructor_call::short_repr(bound.bind(py));
        Ok(format!("Within({}, {})", show(&self.lower)?, show(&self.upper)?))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        seal(py.get_type::<Self>().as_any(), PyTuple::new(py, [&self.lower, &self.upper])?, None)
    }
}

impl Within {
    /// The arrays of the lower and of the upper bounds.
    pub fn bounds<'py>(&self, py: Python<'py>) -> [Bound<'py, PyAny>; 2] {
        [&self.lower, &self.upper].map(|bound| bound.bind(py).clone())
    }
}

/// The targets of a stack: task velocities or lower bounds, and upper bounds if a level has bounds.
pub struct Targets<'py> {
    pub lower: Vec<Bound<'py, PyAny>>,
    /// For a task, the upper bound is its velocity. Empty if no level has bounds.
    pub upper: Vec<Bound<'py, PyAny>>,
    /// Whether each level has bounds. Empty if no level has bounds.
    pub intervals: Vec<bool>,
}

impl<'py> Targets<'py> {
    /// Separate the bounds of the levels.
    pub fn new(velocities: Vec<Bound<'py, PyAny>>) -> Self {
        if !velocities.iter().any(|target| target.is_instance_of::<Within>()) {
            return Targets { lower: velocities, upper: Vec::new(), intervals: Vec::new() };
        }
        let intervals = velocities.iter().map(|target| target.is_instance_of::<Within>()).collect();
        let bound = |of: fn(&Within) -> &Py<PyAny>| -> Vec<Bound<'py, PyAny>> {
            let part = |target: &Bound<'py, PyAny>| match target.cast::<Within>() {
                Ok(within) => of(within.get()).clone_ref(target.py()).into_bound(target.py()),
                Err(_) => target.clone(),
            };
            velocities.iter().map(part).collect()
        };
        Targets { lower: bound(|within| &within.lower), upper: bound(|within| &within.upper), intervals }
    }

    /// The slices of the bounds of level `i`, if they are contiguous arrays with `m` entries.
    pub fn in_place(&self, i: usize, m: usize) -> Option<[&[f64]; 2]> {
        let lower = of_shape(&self.lower[i], &[m])?;
        let upper = if self.upper.is_empty() { lower } else { of_shape(&self.upper[i], &[m])? };
        Some([lower, upper])
    }
}
