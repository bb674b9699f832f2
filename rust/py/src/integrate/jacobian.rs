//! The Jacobian `df/dy` of a Python callable: a constant matrix, a callable, or difference quotients of `f`.
//!
//! One difference computes one column, or a group of columns of which no two have a nonzero element in the same row. Sparse matrices are
//! converted to dense matrices, because the methods use dense decompositions.

use super::slope::{Slope, States};
use crate::arrays::{Axis, Form, numbers, owned, require_finite, shown};
use crate::errors::{Failure, input_error};
use armlet_core::integrate::{Method, column_groups};
use armlet_core::memory;
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

pub enum Jacobian {
    Constant(Vec<f64>),
    Callable(Py<PyAny>),
    Differences(Differences),
}

/// Difference quotients: forward ones for methods that tolerate their error (Newton iterations, W-methods), otherwise central ones.
pub struct Differences {
    central: bool,
    /// The groups of columns that one difference computes. `pattern` has the elements that may differ from zero; `None`: all elements.
    groups: Vec<Vec<usize>>,
    pattern: Option<Vec<bool>>,
    /// The number of groups that one call of `f` computes.
    width: usize,
    at: Vec<f64>,
    up: Vec<f64>,
    down: Vec<f64>,
    steps: Vec<f64>,
}

impl Jacobian {
    /// Read the arguments `jac` and `jac_sparsity`. Only difference quotients use the second one.
    pub fn new(
        function: &str,
        jac: Option<&Bound<'_, PyAny>>,
        sparsity: Option<&Bound<'_, PyAny>>,
        n: usize,
        states: States,
        method: Method,
    ) -> Result<Self, Failure> {
        match jac {
            None => Ok(Jacobian::Differences(Differences::new(function, sparsity, n, states, method)?)),
            Some(jac) if jac.is_callable() => Ok(Jacobian::Callable(jac.clone().unbind())),
            Some(jac) => {
                let jac = dense(jac.py(), function, "jac", jac, n)?;
                let (shape, values) = numbers(function, "jac", &jac, &[Form(&[Axis::Is(n), Axis::Is(n)])])?;
                require_finite(jac.py(), function, "jac", &shape, &values)?;
                Ok(Jacobian::Constant(owned(values)?))
            }
        }
    }

    /// Write `df/dx` at `(s, x)` to `j`; `dx` is the right-hand side at this point. The result is false for a constant Jacobian.
    pub fn at(&mut self, slope: &mut Slope, s: f64, x: &[f64], dx: &[f64], j: &mut [f64]) -> bool {
        let n = x.len();
        match self {
            Jacobian::Constant(matrix) => {
                for (j, m) in j.iter_mut().zip(matrix) {
                    *j = slope.direction * *m;
                }
                return false;
            }
            Jacobian::Callable(_) if slope.error.is_some() => j.fill(f64::NAN),
            Jacobian::Callable(jac) => {
                let result = Python::attach(|py| {
                    let value = slope.call_other(py, jac.bind(py), s, x)?;
                    read(py, slope.function, &value, j, n)
                });
                if let Err(error) = result {
                    slope.error = Some(error);
                    j.fill(f64::NAN);
                }
                for j in j.iter_mut() {
                    *j *= slope.direction;
                }
            }
            Jacobian::Differences(differences) => differences.at(slope, s, x, dx, j),
        }
        true
    }
}

impl Differences {
    fn new(function: &str, sparsity: Option<&Bound<'_, PyAny>>, n: usize, states: States, method: Method) -> Result<Self, Failure> {
        let pattern = sparsity.map(|sparsity| pattern(function, sparsity, n)).transpose()?;
        let groups = match &pattern {
            _ if !method.is_implicit() => Vec::new(),
            Some(pattern) => column_groups(pattern, n),
            None => (0..n).map(|column| vec![column]).collect(),
        };
        let width = if states == States::Columns { groups.len() } else { 1 };
        // An explicit method uses no difference quotients, so the buffers are empty.
        let n = if method.is_implicit() { n } else { 0 };
        let state = || memory::zeros(n * width);
        let (at, up, down, steps) = (state()?, state()?, state()?, memory::zeros(n)?);
        Ok(Differences { central: method.needs_exact_derivatives(), groups, pattern, width, at, up, down, steps })
    }

    fn at(&mut self, slope: &mut Slope, s: f64, x: &[f64], dx: &[f64], j: &mut [f64]) {
        let n = x.len();
        if self.pattern.is_some() {
            j.fill(0.0);
        }
        for (step, x) in self.steps.iter_mut().zip(x) {
            // The step balances the rounding error and the truncation error. Magnitudes below 1e-5 count as 1e-5. For magnitudes below one,
            // the forward step is `sqrt(eps |x|)`, as in radau5.f of Hairer and Wanner.
            let size = x.abs().max(1e-5);
            *step = if self.central { f64::EPSILON.cbrt() * size } else { f64::EPSILON.sqrt() * size.max(size.sqrt()) };
        }
        for groups in self.groups.chunks(self.width.max(1)) {
            let w = groups.len();
            let (at, up, down) = (&mut self.at[..n * w], &mut self.up[..n * w], &mut self.down[..n * w]);
            for (row, x) in at.chunks_exact_mut(w).zip(x) {
                row.fill(*x);
            }
            for (g, k) in each(groups) {
                at[k * w + g] = x[k] + self.steps[k];
            }
            slope.at(s, at, w, up);
            if self.central {
                for (g, k) in each(groups) {
                    at[k * w + g] = x[k] - self.steps[k];
                }
                slope.at(s, at, w, down);
            }
            for (g, k) in each(groups) {
                let above = x[k] + self.steps[k];
                let width = above - if self.central { x[k] - self.steps[k] } else { x[k] };
                for i in 0..n {
                    if self.pattern.as_ref().is_none_or(|pattern| pattern[i * n + k]) {
                        let base = if self.central { down[i * w + g] } else { dx[i] };
                        j[i * n + k] = (up[i * w + g] - base) / width;
                    }
                }
            }
        }
    }
}

/// Pairs `(group, column)` for all columns of all groups.
fn each(groups: &[Vec<usize>]) -> impl Iterator<Item = (usize, usize)> {
    groups.iter().enumerate().flat_map(|(g, group)| group.iter().map(move |&k| (g, k)))
}

/// Convert a sparse matrix of the shape `(n, n)` to a dense matrix. Other objects are returned unchanged.
fn dense<'py>(py: Python<'py>, function: &str, name: &str, value: &Bound<'py, PyAny>, n: usize) -> PyResult<Bound<'py, PyAny>> {
    let Some(toarray) = value.getattr_opt("toarray")? else { return Ok(value.clone()) };
    let shape: Vec<usize> = value.getattr("shape")?.extract()?;
    if shape != [n, n] {
        let problem = format!("has the wrong shape: expected ({n}, {n}), got {}", shown(&shape));
        return Err(input_error(py, function, name, problem));
    }
    toarray.call0()
}

/// Write a result of `jac(t, y)`, `(n, n)`, to `out`.
fn read(py: Python<'_>, function: &str, value: &Bound<'_, PyAny>, out: &mut [f64], n: usize) -> PyResult<()> {
    let value = dense(py, function, "jac", value, n)?;
    let form = Form(&[Axis::Is(n), Axis::Is(n)]);
    let (_, values) = numbers(function, "jac", &value, &[form]).map_err(|failure| failure.into_python(py, function))?;
    out.copy_from_slice(&values);
    Ok(())
}

/// Read the argument `jac_sparsity`, `(n, n)`, numbers or flags: for each element whether it is not zero.
fn pattern(function: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<bool>, Failure> {
    const NAME: &str = "jac_sparsity";
    let value = dense(value.py(), function, NAME, value, n)?;
    let value = match value.cast::<PyArrayDyn<bool>>() {
        Ok(flags) if flags.shape() == [n, n] => flags.call_method1("astype", ("float64",))?,
        _ => value,
    };
    let (_, values) = numbers(function, NAME, &value, &[Form(&[Axis::Is(n), Axis::Is(n)])])?;
    Ok(values.iter().map(|&x| x != 0.0).collect())
}
