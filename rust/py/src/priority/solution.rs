//! The result of `armlet.solve_priority`, and results that the solvers share.

use super::details::details;
use super::single::{Memory, SingleSolution};
use crate::arrays::{copied, count};
use crate::constructor_call::short_repr;
use crate::errors::{Failure, entry};
use crate::seal::{Sealed, seal};
use armlet_core::priority::{PriorityOptions, PrioritySolver as Core};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};
use std::sync::Arc;

/// The result of `solve_priority`: joint velocities, and the outcome of each level.
///
/// - `v`: joint velocities, `(n,)`, rad/s or m/s.
/// - `residuals`: a list of `v_i - J_i v` per level, `(rows_i,)`, in the unit of the task; NaN for a level with bounds.
/// - `violations`: a list of `w_i = J_i v - clip(J_i v, lower, upper)` per level, `(rows_i,)`; zero within the bounds.
/// - `ranks`: number of directions of each level that were realised.
/// - `scales`: scale of each level's command, `(levels,)`; it is 1 except for "sns" and `scale="direction"`.
/// - `active`: for each level, a list of its rows at or beyond a bound, as `Active(row, side, multiplier, name)`.
/// - `limits`: the same list for `v_min` and `v_max`, which are level 0.
/// - `changes`: number of changes of the active set; `certificate`: largest residual of the optimality conditions.
/// - `status`: `Status.SUCCESS`, or `Status.DEGRADED` if some level lost a direction, was scaled or was stopped by a bound.
///
/// At the limit of the number of changes, `v` is the last feasible point, and `status` is `Status.MAX_STEPS`.
///
/// In a batch, the fields are arrays with leading axes: `v` is `(..., n)`, `residuals` a list of `(..., rows_i)`, and `ranks` and `scales`
/// are `(..., levels)`. `status` `(...)` has integer codes of `Status`. `active(row)` and `limits(row)` are functions of the index of a row.
///
/// >>> import armlet as al
/// >>> sol = al.solve_priority([[[1.0, 1.0]]], [[3.0]], v_max=[1.0, 9.0])
/// >>> sol.v.round(12), sol.limits[0].name, sol.limits[0].side
/// (array([1., 2.]), 'joint 1', 'upper')
#[pyclass(frozen, module = "armlet")]
pub struct PrioritySolution {
    /// The result of a single solve. The Python objects of its fields are made at their first use.
    found: Option<SingleSolution>,
    v: PyOnceLock<Py<PyAny>>,
    residuals: PyOnceLock<Py<PyAny>>,
    ranks: PyOnceLock<Py<PyAny>>,
    scales: PyOnceLock<Py<PyAny>>,
    status: PyOnceLock<Py<PyAny>>,
    /// The bounds of the solve, as a dict (`details`).
    details: PyOnceLock<Py<PyAny>>,
}

impl PrioritySolution {
    /// Copy the result of the solver's last run, with the options of the solver, to `memory`.
    pub fn of(solver: &Core, rows: Arc<[usize]>, options: Arc<PriorityOptions>, memory: &mut Memory) -> Self {
        let (solution, stack) = (solver.solution(), solver.stack());
        let numbers = memory.fill(|numbers| {
            numbers
                .reserve_exact(solver.n() + solution.residuals.len() + 2 * rows.len() + stack.iter().map(|part| part.len()).sum::<usize>());
            numbers.extend_from_slice(&solution.v);
            numbers.extend_from_slice(&solution.residuals);
            numbers.extend(solution.levels.iter().map(|level| level.scale));
            numbers.extend(solution.levels.iter().map(|level| level.rank as f64));
            stack.iter().for_each(|part| numbers.extend_from_slice(part));
        });
        let bounded = solution.bounded.clone().map(Box::new);
        let found = SingleSolution { n: solver.n(), rows, numbers, status: solution.status, bounded, options };
        let [v, residuals, ranks, scales, status, details] = [const { PyOnceLock::new() }; 6];
        PrioritySolution { found: Some(found), v, residuals, ranks, scales, status, details }
    }

    /// The Python object of a field. `make` makes it at the first use.
    fn once<'py>(
        &self,
        py: Python<'py>,
        field: &PyOnceLock<Py<PyAny>>,
        make: impl FnOnce(&SingleSolution) -> Result<Bound<'py, PyAny>, Failure>,
    ) -> PyResult<Py<PyAny>> {
        let made = || match &self.found {
            Some(found) => entry(py, "PrioritySolution", || make(found)).map(Bound::unbind),
            None => Ok(py.None()),
        };
        field.get_or_try_init(py, made).map(|object| object.clone_ref(py))
    }

    /// The dict of `details`; None for a solution without one.
    fn details(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.details, |found| Ok(details(py, found)?.into_any()))
    }

    /// Call a function of `armlet.active_bounds` with the details and other fields.
    fn with_details<'py>(&self, py: Python<'py>, function: &str, others: &[Py<PyAny>]) -> PyResult<Bound<'py, PyAny>> {
        let details = self.details(py)?;
        let arguments = PyTuple::new(py, std::iter::once(&details).chain(others).collect::<Vec<_>>())?;
        py.import("armlet.active_bounds")?.getattr(function)?.call1(arguments)
    }
}

#[entered]
#[pymethods]
impl PrioritySolution {
    #[new]
    #[pyo3(signature = (v, residuals, ranks, scales, status, details=None))]
    pub fn new(
        py: Python<'_>,
        v: Py<PyAny>,
        residuals: Py<PyAny>,
        ranks: Py<PyAny>,
        scales: Py<PyAny>,
        status: Py<PyAny>,
        details: Option<Py<PyAny>>,
    ) -> Self {
        let details = details.unwrap_or_else(|| py.None());
        let [v, residuals, ranks, scales, status, details] = [v, residuals, ranks, scales, status, details].map(|object| {
            let field = PyOnceLock::new();
            let _ = field.set(py, object);
            field
        });
        PrioritySolution { found: None, v, residuals, ranks, scales, status, details }
    }

    #[getter]
    fn v(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.v, |found| copied(py, &[found.n], found.parts()[0]))
    }

    #[getter]
    fn residuals(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.residuals, |found| Ok(residual_list(py, &found.rows, found.parts()[1])?.into_any()))
    }

    #[getter]
    fn ranks(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.ranks, |found| Ok(PyList::new(py, found.parts()[3].iter().map(|&rank| rank as usize))?.into_any()))
    }

    #[getter]
    fn scales(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.scales, |found| copied(py, &[found.rows.len()], found.parts()[2]))
    }

    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.status, |found| Ok(status_member(py, found.status)?.into_bound(py)))
    }

    /// Violations `w_i = J_i v - clip(J_i v, lower, upper)` per level, a list of `(..., rows_i)`; for a task `J_i v - v_i`.
    #[getter]
    fn violations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.with_details(py, "violations", &[self.residuals(py)?])
    }

    /// For each level, a list of its rows at or beyond a bound, as `Active(row, side, multiplier, name)`. Of a batch, a function of the index
    /// of a row.
    #[getter]
    fn active<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.with_details(py, "active", &[self.v(py)?, self.residuals(py)?])
    }

    /// The joint velocities at `v_min` or `v_max`, a list of `Active(row, side, multiplier, name)`. Of a batch, a function of the index of a
    /// row.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.with_details(py, "limits", &[self.v(py)?, self.residuals(py)?])
    }

    /// Number of changes of the active set: 0 without bounds, and where the active set of the last solve was accepted.
    #[getter]
    fn changes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.with_details(py, "changes", &[self.v(py)?])
    }

    /// Largest residual of the optimality conditions (Karush, Kuhn and Tucker) of all levels, divided by their largest term. It is NaN for
    /// "chiaverini", and in a batch without bounds. In a batch of "sns" it is NaN for a row that meets no bound.
    #[getter]
    fn certificate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.with_details(py, "certificate", &[self.v(py)?])
    }

    /// Return one sentence: by how much level `k` is missed, and which rows of higher levels stop it. Levels count from 1.
    ///
    /// The share of a row is the part of its force `multiplier * row` along the gradient `J_k' w_k`. A batch raises `InputError`.
    #[arguments(k)]
    fn why<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let k = count(NAME, "k", k)?.into_pyobject(py).map_err(PyErr::from)?.into_any().unbind();
        Ok(self.with_details(py, "why", &[self.v(py)?, k])?)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let fields = [self.v(py)?, self.residuals(py)?, self.ranks(py)?, self.scales(py)?, self.status(py)?, self.details(py)?];
        let parts = PyTuple::new(py, fields)?;
        seal(py.get_type::<Self>().as_any(), parts, None)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let show = |value: &Py<PyAny>| short_repr(value.bind(py));
        let (v, ranks, status) = (self.v(py)?, self.ranks(py)?, self.status(py)?);
        Ok(format!("PrioritySolution(v={}, ranks={}, status={})", show(&v)?, show(&ranks)?, show(&status)?))
    }
}

/// The member of the Python enumeration `armlet.Status`.
pub fn status_member(py: Python<'_>, status: Status) -> PyResult<Py<PyAny>> {
    static MEMBERS: PyOnceLock<Vec<Py<PyAny>>> = PyOnceLock::new();
    let members = MEMBERS.get_or_try_init(py, || {
        let class = py.import("armlet.status")?.getattr("Status")?;
        Status::ALL.iter().map(|s| Ok(class.call1((s.code(),))?.unbind())).collect::<PyResult<Vec<_>>>()
    })?;
    Ok(members[status.code() as usize].clone_ref(py))
}

/// Split the residuals of all levels into a list of arrays, one per level.
pub fn residual_list<'py>(py: Python<'py>, rows: &[usize], stacked: &[f64]) -> Result<Bound<'py, PyList>, Failure> {
    let (mut start, mut parts) = (0, Vec::with_capacity(rows.len()));
    for m in rows {
        parts.push(copied(py, &[*m], &stacked[start..start + m])?);
        start += m;
    }
    Ok(PyList::new(py, parts)?)
}
