//! The bounds of a solution as a Python dict, from which `armlet.active_bounds` makes the fields `violations`, `active`, `limits`, `changes` and
//! `certificate`, and the sentence `why`.
//!
//! The dict has `limits` (`(v_min, v_max)` or None), `levels` (one `(jacobian, lower, upper)` per level, or None for a batch), and the arrays
//! `violations`, `sides` and `multipliers`. These have one column per row: first the joints if they have bounds, then the levels. They are
//! None without bounds. If commands are scaled, the dict also has the array `scales` `(levels,)`. `limit_levels` is the number of first levels
//! that are limits: torques, then accelerations.

use super::single::SingleSolution;
use crate::arrays::{WHATEVER, adopted, copied, count, flag, numbers};
use crate::errors::{Failure, input_error};
use armlet_core::priority::{BoundedRows, PriorityMethod, certificate, reasons, scale_reasons};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

/// Make the dict of a single solution.
pub fn details<'py>(py: Python<'py>, found: &SingleSolution) -> Result<Bound<'py, PyDict>, Failure> {
    let [v, _, scales, _, jacobian, command, upper] = found.parts();
    let details = PyDict::new(py);
    details.set_item("limits", limits(py, &found.options, found.n)?)?;
    let (levels, mut start) = (PyList::empty(py), 0);
    for (i, &m) in found.rows.iter().enumerate() {
        let rows = start..start + m;
        let above = if found.options.intervals.get(i) == Some(&true) { &upper[rows.clone()] } else { &command[rows.clone()] };
        let jacobian = copied(py, &[m, found.n], &jacobian[rows.start * found.n..rows.end * found.n])?;
        levels.append((jacobian, copied(py, &[m], &command[rows])?, copied(py, &[m], above)?))?;
        start += m;
    }
    details.set_item("levels", levels)?;
    details.set_item("limit_levels", found.options.limit_levels)?;
    match &found.bounded {
        Some(bounded) => {
            let count = [bounded.violations.len()];
            let sides: Vec<i64> = bounded.sides.iter().map(|side| i64::from(*side)).collect();
            details.set_item("violations", copied(py, &count, &bounded.violations)?)?;
            details.set_item("sides", adopted(py, &count, sides)?)?;
            details.set_item("multipliers", copied(py, &count, &bounded.multipliers)?)?;
            details.set_item("changes", bounded.changes)?;
            // The solution of "sns" that meets no bound has no certificate yet.
            let known = !bounded.certificate.is_nan() || v.iter().any(|v| v.is_nan());
            let certificate = || certificate(&found.rows, &found.options, jacobian, command, v);
            details.set_item("certificate", if known { bounded.certificate } else { certificate()? })?;
            if found.options.keep_direction || found.options.method == PriorityMethod::Sns {
                details.set_item("scales", copied(py, &[scales.len()], scales)?)?;
            }
        }
        None => {
            details.set_item("violations", py.None())?;
            details.set_item("changes", 0)?;
            details.set_item("certificate", certificate(&found.rows, &found.options, jacobian, command, v)?)?;
        }
    }
    Ok(details)
}

/// The bounds of the joint velocities, as arrays; None without bounds.
pub fn limits<'py>(
    py: Python<'py>,
    options: &armlet_core::priority::PriorityOptions,
    n: usize,
) -> Result<Option<Bound<'py, PyTuple>>, Failure> {
    let Some((low, high)) = options.velocity_bounds() else { return Ok(None) };
    Ok(Some(PyTuple::new(py, [copied(py, &[n], &low)?, copied(py, &[n], &high)?])?))
}

/// Return `(violations, [(level, row, side, share), ..])` of level `k`, which counts from 1. `levels`: level 0, then the levels of a stack.
/// `scaled`: whether the shares are those of the scale of the level.
#[entered]
#[pyfunction]
#[arguments(levels, v, k, scaled)]
pub fn _priority_reasons<'py>() -> Result<Bound<'py, PyTuple>, Failure> {
    let read = |value: &Bound<'_, PyAny>| -> Result<Vec<f64>, Failure> { Ok(numbers(NAME, "levels", value, &[WHATEVER])?.1.into_owned()) };
    let v = read(v)?;
    let parts = levels.try_iter()?.map(|level| level?.try_iter()?.map(|part| read(&part?)).collect::<Result<Vec<_>, Failure>>());
    let parts = parts.collect::<Result<Vec<Vec<Vec<f64>>>, Failure>>()?;
    let (n, k) = (v.len(), count(NAME, "k", k)?);
    let fits = |level: &Vec<Vec<f64>>| matches!(&level[..], [a, low, high] if a.len() == n * low.len() && low.len() == high.len());
    if k >= parts.len() || !parts.iter().all(fits) {
        return Err(input_error(py, NAME, "levels", "is not a list of (jacobian, lower, upper): expected more than k levels").into());
    }
    let rows: Vec<BoundedRows> = parts.iter().map(|level| (&level[0][..], &level[1][..], &level[2][..])).collect();
    let mut found = reasons(n, &rows, &v, k)?;
    if flag(NAME, "scaled", scaled)? {
        found.reasons = scale_reasons(n, &rows, &v, k)?;
    }
    let reasons: Vec<_> = found.reasons.iter().map(|reason| (reason.level, reason.row, reason.side, reason.share)).collect();
    let violations = copied(py, &[found.violations.len()], &found.violations)?;
    Ok(PyTuple::new(py, [violations, reasons.into_pyobject(py)?.into_any()])?)
}
