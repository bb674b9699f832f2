//! `armlet._core.diagnose_priority`, which computes the fields of `armlet.PriorityDiagnosis`, and `armlet.velocity_bounds`.

use super::stack::{Stack, items, per_joint};
use crate::arrays::{any_vector, copied, new_vector, number, optional_number, shown};
use crate::errors::{Failure, input_error};
use armlet_core::memory;
use armlet_core::priority::{Diagnosis, diagnose, velocity_bounds as core_bounds};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Diagnose a stack of Jacobians, and return a dict with the fields of `armlet.PriorityDiagnosis`.
#[entered]
#[pyfunction]
#[arguments(jacobians, rhs, rounding)]
pub fn diagnose_priority<'py>(
    rhs: Option<&Bound<'py, PyAny>>,
    rounding: Option<&Bound<'py, PyAny>>,
) -> Result<Bound<'py, PyDict>, Failure> {
    let rounding = optional_number(NAME, "rounding", rounding)?;
    let jacobians = items(NAME, "jacobians", jacobians)?;
    let rhs = rhs.map(|rhs| items(NAME, "rhs", rhs)).transpose()?;
    let stack = Stack::read(py, NAME, ["jacobians", "rhs"], &jacobians, rhs.as_deref())?;
    if !stack.lead.is_empty() {
        let problem = format!("has leading axes: expected (rows, n), got leading axes {}", shown(&stack.lead));
        return Err(input_error(py, NAME, "jacobians", problem).into());
    }
    stack.require_finite(py, NAME)?;
    let levels = 0..stack.rows.len();
    let blocks: Vec<&[f64]> = levels.clone().map(|i| stack.jacobian(i, 0)).collect();
    let commands: Option<Vec<&[f64]>> = rhs.as_ref().map(|_| levels.map(|i| stack.velocity(i, 0)).collect());
    let d = diagnose(stack.n, &stack.rows, &blocks, commands.as_deref(), rounding)?;
    fields(py, &d)
}

/// Convert a diagnosis to a dict with the fields of `armlet.PriorityDiagnosis`.
pub fn fields<'py>(py: Python<'py>, d: &Diagnosis) -> Result<Bound<'py, PyDict>, Failure> {
    let vectors = |parts: Vec<&[f64]>| -> Result<Bound<'py, PyList>, Failure> {
        let arrays = parts.iter().map(|x| copied(py, &[x.len()], x)).collect::<Result<Vec<_>, _>>()?;
        Ok(PyList::new(py, arrays)?)
    };
    let fields = PyDict::new(py);
    fields.set_item("n", d.n)?;
    fields.set_item("kind", d.kind.name())?;
    fields.set_item("ranks", d.ranks())?;
    fields.set_item("projected_ranks", d.projected_ranks())?;
    fields.set_item("stacked_rank", d.stacked_rank)?;
    fields.set_item("overlap", d.overlap)?;
    fields.set_item("singular_values", vectors(d.levels.iter().map(|l| l.singular_values.as_slice()).collect())?)?;
    fields.set_item("projected_singular_values", vectors(d.levels.iter().map(|l| l.projected_singular_values.as_slice()).collect())?)?;
    fields.set_item("kinematic", d.levels.iter().map(|l| l.kinematic).collect::<Vec<_>>())?;
    fields.set_item("algorithmic", d.levels.iter().map(|l| l.algorithmic).collect::<Vec<_>>())?;
    let lost = d.levels.iter().map(|l| copied(py, &[l.lost.len(), l.rows], &l.lost.concat())).collect::<Result<Vec<_>, _>>()?;
    fields.set_item("lost", PyList::new(py, lost)?)?;
    if let Some(parts) = &d.compatibility {
        fields.set_item("losses", vectors(parts.iter().map(|c| c.loss.as_slice()).collect())?)?;
        fields.set_item("compatible", parts.iter().all(|c| c.compatible))?;
    }
    fields.set_item("text", d.to_string())?;
    Ok(fields)
}

/// Convert joint limits to velocity bounds for one sample.
///
/// The upper bound is `min((q_max - q)/dt, v_max, sqrt(2 a_max (q_max - q)))`. The lower bound is computed from `q_min` and `-v_max` in the
/// same form.
///
/// Args:
///     q: joint positions, `(n,)`, rad or m.
///     q_min, q_max: position limits, a number or `(n,)`, rad or m; infinite numbers are allowed.
///     v_max: velocity limit, a number or `(n,)`, rad/s or m/s.
///     dt: the sample time, s, > 0 (keyword only).
///     a_max: deceleration before a limit, a number or `(n,)`, rad/s^2 or m/s^2; None: without the square root (keyword only).
///
/// Returns:
///     `(v_min, v_max)`, `(n,)` each, rad/s or m/s, for the method "sns". For a joint outside of a limit, both bounds lead back inside.
///
/// Raises:
///     InputError: limits are out of order, `dt` is not positive, `v_max` or `a_max` is negative, a shape is wrong, or `q` is not finite.
///
/// Source: Flacco, De Luca and Khatib, Control of redundant robots under hard joint constraints, T-RO 31(3), 2015.
///
/// >>> import armlet as al
/// >>> al.velocity_bounds([0.0, 1.0], -1.0, 1.0, 2.0, dt=0.01)
/// (array([-2., -2.]), array([2., 0.]))
#[entered]
#[pyfunction]
#[arguments(q, q_min, q_max, v_max, *, dt, a_max=None)]
pub fn velocity_bounds<'py>() -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Failure> {
    let q = any_vector(NAME, "q", q)?;
    let (n, dt) = (q.len(), number(NAME, "dt", dt)?);
    let (q_min, q_max, v_max) =
        (per_joint(NAME, "q_min", q_min, n)?, per_joint(NAME, "q_max", q_max, n)?, per_joint(NAME, "v_max", v_max, n)?);
    let a_max = a_max.map_or_else(|| Ok(memory::filled(n, f64::INFINITY)?), |a| per_joint(NAME, "a_max", a, n))?;
    let mut upper = memory::zeros(n)?;
    let lower = new_vector(py, n, |lower| Ok(core_bounds(&q, (&q_min, &q_max), &v_max, &a_max, dt, (lower, &mut upper))?))?;
    Ok((lower, copied(py, &[n], &upper)?))
}
