//! `armlet.solve_priority` and its result, for one stack or for a batch of stacks.

use super::stack::{Keywords, Stack, items, method_name};
use super::stacks;
use crate::arrays::{copied, of_shape, optional_number};
use crate::errors::{Failure, entry};
use crate::seal::{Sealed, seal};
use armlet_core::error::Error;
use armlet_core::priority::{DEFAULT_ROUNDING, PrioritySolver as Core};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};
use std::cell::RefCell;
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
        let show = |value: &Py<PyAny>| PyResult::Ok(value.bind(py).repr()?.to_string());
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

/// A solver with default options, and the number of rows of each level.
struct Kept {
    solver: Core,
    rows: Arc<[usize]>,
}

thread_local! {
    /// The solver of the last single solve with default options on this thread. A loop over stacks of equal sizes therefore allocates its
    /// buffers once.
    static LAST: RefCell<Option<Kept>> = const { RefCell::new(None) };
}

fn solver(function: &str, n: usize, rows: &[usize], keywords: &Keywords) -> Result<Core, Failure> {
    if keywords.plain()
        && let Some(Kept { solver: mut last, .. }) = LAST.take()
        && last.n() == n
        && last.rows() == rows
        && last.method().name() == keywords.method
    {
        last.set_rounding(keywords.rounding.unwrap_or(DEFAULT_ROUNDING))?;
        return Ok(last);
    }
    Ok(Core::new(n, rows, &keywords.options(function, n, rows.len())?)?)
}

/// Copy one stack to the inputs of the solver, and solve it.
fn solve_row(solver: &mut Core, stack: &Stack) -> Result<Status, Error> {
    let (jacobian, command) = solver.inputs();
    let (mut at, mut to) = (0, 0);
    for (level, m) in stack.rows.iter().enumerate() {
        jacobian[at..at + m * stack.n].copy_from_slice(stack.jacobian(level, 0));
        command[to..to + m].copy_from_slice(stack.velocity(level, 0));
        at += m * stack.n;
        to += m;
    }
    solver.run()
}

/// Compute joint velocities for tasks `J_i v = v_i` with priorities: a task does not disturb the tasks of higher priority.
///
/// `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..` with the pseudoinverse `#` and the null-space projector `P1 = I - J1# J1`. Rank decisions
/// compare singular values with the size of the unprojected Jacobians.
///
/// Args:
///     jacobians: one `(..., rows_i, n)` per level, the highest priority first. Zero rows, and more rows than joints, are allowed.
///     velocities: one `(..., rows_i)` per level, in the unit of the task.
///     method: "exact" is the equation above. "clamp" is continuous and bounded, and equals "exact" where all singular values are at least
///         `eps`. "damped" and "chiaverini" use damped pseudoinverses. "sns" satisfies `v_min` and `v_max` (keyword only, as all below).
///     eps: threshold on singular values, one number or one per level; None: 0.02 times each level's largest row norm.
///     rounding: relative error of the entries of the Jacobians; None: 8 times the machine epsilon. For Jacobians that were computed from
///         angles `q`, pass `8 (1 + sum|q|)` times the machine epsilon.
///     weight: joint metric `W`, `(n, n)`, symmetric and positive definite: `v' W v` is minimised; None: the identity.
///     v_min, v_max: bounds for "sns", a number or `(n,)`, rad/s or m/s. A missing bound is minus the other bound.
///
/// Returns:
///     A `PrioritySolution`. A batch does not raise for one invalid row. A row whose numbers are not finite, or whose result overflows, is
///     NaN with `Status.DIVERGED`.
///
/// Raises:
///     InputError: shapes do not fit, the stack is empty, or the method is unknown. For a single stack, a number is not finite.
///     SolveError: the result of a single stack overflows.
///
/// Source: Siciliano and Slotine, A general framework for managing multiple tasks in highly redundant robotic systems, ICAR 1991.
///
/// >>> import armlet as al
/// >>> sol = al.solve_priority([[[1.0, 0.0]], [[1.0, 1.0]]], [[1.0], [3.0]], method="exact")
/// >>> sol.v.round(12)
/// array([1., 2.])
/// >>> sol.status
/// <Status.SUCCESS: 0>
#[entered]
#[pyfunction]
#[pyo3(
    signature = (jacobians, velocities, *, method=None, eps=None, rounding=None, weight=None, v_min=None, v_max=None),
    text_signature = "(jacobians, velocities, *, method='clamp', eps=None, rounding=None, weight=None, v_min=None, v_max=None)"
)]
pub fn solve_priority<'py>(
    py: Python<'py>,
    jacobians: &Bound<'py, PyAny>,
    velocities: &Bound<'py, PyAny>,
    method: Option<&Bound<'py, PyAny>>,
    eps: Option<&Bound<'py, PyAny>>,
    rounding: Option<&Bound<'py, PyAny>>,
    weight: Option<&Bound<'py, PyAny>>,
    v_min: Option<&Bound<'py, PyAny>>,
    v_max: Option<&Bound<'py, PyAny>>,
) -> PyResult<PrioritySolution> {
    const NAME: &str = "solve_priority";
    entry(py, NAME, || {
        let (method, rounding) = (method_name(NAME, method)?, optional_number(NAME, "rounding", rounding)?);
        let keywords = Keywords { method, eps, rounding, weight, v_min, v_max };
        if let Some(solution) = again(jacobians, velocities, &keywords) {
            return Ok(solution);
        }
        let (jacobians, velocities) = (items(NAME, "jacobians", jacobians)?, items(NAME, "velocities", velocities)?);
        let stack = Stack::read_or_lend(py, NAME, ["jacobians", "velocities"], &jacobians, Some(&velocities), true)?;
        let solver = solver(NAME, stack.n, &stack.rows, &keywords)?;
        if stack.lead.is_empty() {
            return single(py, solver, &stack, keywords.plain());
        }
        // If the work is long, the stack is read again into copies.
        let copied = || Stack::read(py, NAME, ["jacobians", "velocities"], &jacobians, Some(&velocities));
        stacks::solve(py, NAME, &solver, stack, copied)
    })
}

/// Entry `i` of a list or a tuple.
#[inline]
fn at<'py>(items: &Bound<'py, PyAny>, i: usize) -> Option<Bound<'py, PyAny>> {
    match items.cast_exact::<PyList>() {
        Ok(list) => list.get_item(i).ok(),
        Err(_) => items.cast_exact::<PyTuple>().ok()?.get_item(i).ok(),
    }
}

/// The length of a list or a tuple.
#[inline]
fn length(items: &Bound<'_, PyAny>) -> Option<usize> {
    items.cast_exact::<PyList>().map(|list| list.len()).or_else(|_| items.cast_exact::<PyTuple>().map(|tuple| tuple.len())).ok()
}

/// Solve a single stack of contiguous arrays with the solver of the last call, if the sizes and the method are equal. `None` for other
/// stacks, and for errors, which the general path reports.
fn again(jacobians: &Bound<'_, PyAny>, velocities: &Bound<'_, PyAny>, keywords: &Keywords) -> Option<PrioritySolution> {
    if !keywords.plain() {
        return None;
    }
    // No Python code runs in this closure, so `LAST` is not borrowed twice.
    LAST.with(|last| {
        let mut last = last.try_borrow_mut().ok()?;
        let Kept { solver, rows } = last.as_mut()?;
        if solver.method().name() != keywords.method || [length(jacobians)?, length(velocities)?] != [rows.len(); 2] {
            return None;
        }
        solver.set_rounding(keywords.rounding.unwrap_or(DEFAULT_ROUNDING)).ok()?;
        let (n, mut to) = (solver.n(), 0);
        for (i, &m) in rows.iter().enumerate() {
            let (jacobian, velocity) = (at(jacobians, i)?, at(velocities, i)?);
            let (jacobian, velocity) = (of_shape(&jacobian, &[m, n])?, of_shape(&velocity, &[m])?);
            let (j, v) = solver.inputs();
            j[to * n..(to + m) * n].copy_from_slice(jacobian);
            v[to..to + m].copy_from_slice(velocity);
            to += m;
        }
        solver.used();
        solver.run().ok()?;
        Some(answer(solver, rows.clone()))
    })
}

/// Copy the result of the solver's last run.
fn answer(solver: &Core, rows: Arc<[usize]>) -> PrioritySolution {
    let mut numbers = Vec::with_capacity(solver.n() + solver.residuals().len() + 2 * rows.len());
    numbers.extend_from_slice(solver.v());
    numbers.extend_from_slice(solver.residuals());
    numbers.extend_from_slice(solver.scales());
    numbers.extend(solver.ranks().iter().map(|&rank| rank as f64));
    let found = SingleSolution { n: solver.n(), rows, numbers, status: solver.status() };
    let [v, residuals, ranks, scales, status] = [const { PyOnceLock::new() }; 5];
    PrioritySolution { found: Some(found), v, residuals, ranks, scales, status }
}

fn single(py: Python<'_>, mut solver: Core, stack: &Stack, keep: bool) -> Result<PrioritySolution, Failure> {
    if let Err(error) = solve_row(&mut solver, stack) {
        stack.require_finite(py, "solve_priority")?;
        return Err(error.into());
    }
    let rows: Arc<[usize]> = solver.rows().into();
    let solution = answer(&solver, rows.clone());
    if keep {
        LAST.set(Some(Kept { solver, rows }));
    }
    Ok(solution)
}
