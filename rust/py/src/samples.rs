//! The selection of samples for concurrent learning, for `armlet.select_samples`.

use crate::arrays::{ArrayArgument, adopted, flag, nonnegative_integer, number, object, owned, require_finite, shown, vector};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use crate::law::Law;
use armlet_core::analysis::sample_selection::select;
use armlet_core::law::{LawSpec, Record, StoredRows, Windows};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Return a dict of the selected samples: `W` `(N, n, p)`, `tau` `(N, n)`, `indices` `(N,)`, `singular_value` and `rank`.
#[entered]
#[pyfunction]
#[arguments(law, record, a, windows, count)]
pub fn _select_samples<'py>(a: Option<&Bound<'py, PyAny>>) -> Result<Bound<'py, PyDict>, Failure> {
    const NAME: &str = "select_samples";
    let (q, v, tau): (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>) = record.extract()?;
    let (t, window, held): (Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>, Bound<'py, PyAny>) = windows.extract()?;
    let law = object::<Law>(NAME, "law", "an Adaptive law", law)?;
    let LawSpec::Adaptive(spec) = &law.get().spec else {
        let problem = format!("adapts nothing: expected an Adaptive law, got {}", law.get().spec.name());
        return Err(input_error(py, NAME, "law", problem).into());
    };
    let n = spec.parameter_sizes().0;
    let mut shape: Option<Vec<usize>> = None;
    let mut read = |name: &str, value: &Bound<'py, PyAny>| -> Result<Vec<f64>, Failure> {
        let argument = ArrayArgument::new(NAME, name, value)?;
        let given = argument.shape.clone();
        if given.len() != 2 || given[0] == 0 || given[1] != n || shape.as_ref().is_some_and(|first| *first != given) {
            let wanted = shape.as_ref().map_or(format!("(K, {n}), K > 0"), |first| shown(first));
            return Err(input_error(py, NAME, name, format!("has the wrong shape: expected {wanted}, got {}", shown(&given))).into());
        }
        let (given, values) = argument.values()?;
        require_finite(py, NAME, name, &given, &values)?;
        shape = Some(given);
        owned(values)
    };
    let [q, v, tau] = [read("q", &q)?, read("v", &v)?, read("tau", &tau)?];
    let a = a.map(|a| read("a", a)).transpose()?;
    let held = flag(NAME, "held", &held)?;
    let count = nonnegative_integer(NAME, "count", count)?;
    let windows = match (&a, t, window) {
        (Some(_), None, None) if !held => None,
        (Some(_), t, window) => {
            let name = if window.is_some() { "window" } else { t.map_or("held", |_| "t") };
            let expected = if name == "held" { "False" } else { "None" };
            return Err(input_error(py, NAME, name, format!("is not used: expected {expected} with accelerations a=")).into());
        }
        (None, Some(t), Some(window)) => {
            let t = vector(NAME, "t", &t, q.len() / n)?;
            Some(Windows::of_times(&t, number(NAME, "window", &window)?, held)?)
        }
        (None, t, _) => {
            let name = if t.is_none() { "t" } else { "window" };
            let problem = "is missing: expected the times of the records and the length of a window, or accelerations a=";
            return Err(input_error(py, NAME, name, problem).into());
        }
    };
    let (stored, chosen) = long(py, || {
        let record = Record { q: &q, v: &v, tau: &tau };
        let stored = match (windows, &a) {
            (Some(windows), _) => spec.window_samples(record, windows)?,
            (None, a) => spec.samples(record, a.as_deref().unwrap_or_default())?,
        };
        let p = spec.parameter_sizes().1;
        let chosen = select(&stored.rows, n, p, count)?;
        let pick = |values: &[f64], width: usize| -> Vec<f64> {
            chosen.indices.iter().flat_map(|&j| values[j * width..(j + 1) * width].iter().copied()).collect()
        };
        let picked = StoredRows { rows: pick(&stored.rows, n * p), torques: pick(&stored.torques, n) };
        Ok((picked, chosen))
    })?;
    let p = spec.parameter_sizes().1;
    let found = PyDict::new(py);
    found.set_item("W", adopted(py, &[chosen.indices.len(), n, p], stored.rows)?)?;
    found.set_item("tau", adopted(py, &[chosen.indices.len(), n], stored.torques)?)?;
    let indices: Vec<i64> = chosen.indices.iter().map(|&j| j as i64).collect();
    found.set_item("indices", adopted(py, &[indices.len()], indices)?)?;
    found.set_item("singular_value", chosen.singular_value)?;
    found.set_item("rank", chosen.rank)?;
    Ok(found)
}
