//! The result of `armlet.solve_priority`, and results that the solvers share.

use crate::arrays::copied;
use crate::constructor_call::short_repr;
use crate::errors::{Failure, entry};
use crate::seal::{Sealed, seal};
use armlet_core::priority::PrioritySolver as Core;
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};
use std::sync::Arc;

/// The result of `solve_priority`: joint velocities, and the outcome of each level.
///
/// - `v`: joint velocities, `(n,)`, rad/s or m/s.
/// - `residuals`: a list of `v_i - J_i v` per level, `(rows_i,)`, in the unit of the task.
/// - `ranks`: number of directions of each level that were realised.
/// - `scales`: scale of each level's command, `(levels,)`; it is 1 except for "sns".
/// - `status`: `Status.SUCCESS`, or `Status.DEGRADED` if some level lost a direction or was scaled.
///
/// In a batch, the fields are arrays with leading axes: `v` is `(..., n)`, `residuals` a list of `(..., rows_i)`, and `ranks` and `scales`
/// are `(..., levels)`. `status` `(...)` has integer codes of `Status`.
#[pyclass(frozen, module = "armlet")]
pub struct PrioritySolution {
    /// The result of a single solve. The Python objects of its fields are made at their first use.
    found: Option<SingleSolution>,
    v: PyOnceLock<Py<PyAny>>,
    residuals: PyOnceLock<Py<PyAny>>,
    ranks: PyOnceLock<Py<PyAny>>,
    scales: PyOnceLock<Py<PyAny>>,
    status: PyOnceLock<Py<PyAny>>,
}

/// The result of a single solve: the numbers `[v, residuals, scales, ranks]` in one allocation.
struct SingleSolution {
    n: usize,
    rows: Arc<[usize]>,
    numbers: Vec<f64>,
    status: Status,
}

impl SingleSolution {
    /// The residuals, the scales and the ranks.
    fn parts(&self) -> [&[f64]; 3] {
        let (rest, ranks) = self.numbers.split_at(self.numbers.len() - self.rows.len());
        let (rest, scales) = rest.split_at(rest.len() - self.rows.len());
        [&rest[self.n..], scales, ranks]
    }
}

impl PrioritySolution {
    /// Copy the result of the solver's last run.
    pub fn of(solver: &Core, rows: Arc<[usize]>) -> Self {
        let solution = solver.solution();
        let mut numbers = Vec::with_capacity(solver.n() + solution.residuals.len() + 2 * rows.len());
        numbers.extend_from_slice(&solution.v);
        numbers.extend_from_slice(&solution.residuals);
        numbers.extend(solution.levels.iter().map(|level| level.scale));
        numbers.extend(solution.levels.iter().map(|level| level.rank as f64));
        let found = SingleSolution { n: solver.n(), rows, numbers, status: solution.status };
        let [v, residuals, ranks, scales, status] = [const { PyOnceLock::new() }; 5];
        PrioritySolution { found: Some(found), v, residuals, ranks, scales, status }
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
}

#[entered]
#[pymethods]
impl PrioritySolution {
    #[new]
    pub fn new(py: Python<'_>, v: Py<PyAny>, residuals: Py<PyAny>, ranks: Py<PyAny>, scales: Py<PyAny>, status: Py<PyAny>) -> Self {
        let [v, residuals, ranks, scales, status] = [v, residuals, ranks, scales, status].map(|object| {
            let field = PyOnceLock::new();
            let _ = field.set(py, object);
            field
        });
        PrioritySolution { found: None, v, residuals, ranks, scales, status }
    }

    #[getter]
    fn v(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.v, |found| copied(py, &[found.n], &found.numbers[..found.n]))
    }

    #[getter]
    fn residuals(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.residuals, |found| Ok(residual_list(py, &found.rows, found.parts()[0])?.into_any()))
    }

    #[getter]
    fn ranks(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.ranks, |found| Ok(PyList::new(py, found.parts()[2].iter().map(|&rank| rank as usize))?.into_any()))
    }

    #[getter]
    fn scales(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.scales, |found| copied(py, &[found.rows.len()], found.parts()[1]))
    }

    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.status, |found| Ok(status_member(py, found.status)?.into_bound(py)))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let parts = PyTuple::new(py, [self.v(py)?, self.residuals(py)?, self.ranks(py)?, self.scales(py)?, self.status(py)?])?;
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
