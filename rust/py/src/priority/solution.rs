//! `armlet.solve_priority` and its answer, for one stack or for a batch of stacks.

use super::stack::{Keywords, Stack, items, method_name};
use crate::arrays::{adopted, copied, of_shape, optional_number};
use crate::errors::{Failure, entry};
use crate::interrupts::{long, signalled};
use crate::seal::{Sealed, seal};
use armlet_core::error::Error;
use armlet_core::interrupt::interrupt;
use armlet_core::memory;
use armlet_core::priority::{DEFAULT_ROUNDING, PrioritySolver as Core, StackAnswers, StackRows};
use armlet_core::simulate::{default_threads, solve_stacks};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};
use std::cell::RefCell;

/// The result of `solve_priority`: joint velocities, and the outcome of each level.
///
/// `v`: joint velocities, `(n,)`, rad/s or m/s. `residuals`: `v_i - J_i v` per level, `(rows_i,)` each, in the unit of the task.
/// `ranks`: directions of each level that were realised. `scales`: scale of each level's command, `(levels,)`, 1 except for "sns".
/// `status`: `Status.SUCCESS`, or `Status.DEGRADED` when some level lost a direction or was scaled.
/// In a batch all have the leading axes in front: `ranks` and `scales` are `(..., levels)`, `status` holds integers of `Status`.
#[pyclass(frozen, module = "armlet")]
pub struct PrioritySolution {
    /// What a single solve found: its objects are made when they are asked for.
    found: Option<SingleSolution>,
    v: PyOnceLock<Py<PyAny>>,
    residuals: PyOnceLock<Py<PyAny>>,
    ranks: PyOnceLock<Py<PyAny>>,
    scales: PyOnceLock<Py<PyAny>>,
    status: PyOnceLock<Py<PyAny>>,
}

/// The answer of a single solve: `[v, residuals, scales]`.
struct SingleSolution {
    n: usize,
    rows: Vec<usize>,
    numbers: Vec<f64>,
    ranks: Vec<usize>,
    status: Status,
}

impl PrioritySolution {
    /// The object of a field, made by `make` the first time.
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
    fn new(py: Python<'_>, v: Py<PyAny>, residuals: Py<PyAny>, ranks: Py<PyAny>, scales: Py<PyAny>, status: Py<PyAny>) -> Self {
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
        self.once(py, &self.residuals, |found| Ok(residual_list(py, &found.rows, &found.numbers[found.n..])?.into_any()))
    }

    #[getter]
    fn ranks(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.once(py, &self.ranks, |found| Ok(PyList::new(py, &found.ranks)?.into_any()))
    }

    #[getter]
    fn scales(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let of = |found: &SingleSolution| copied(py, &[found.rows.len()], &found.numbers[found.numbers.len() - found.rows.len()..]);
        self.once(py, &self.scales, of)
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

/// The member of `armlet.Status`.
pub fn status_member(py: Python<'_>, status: Status) -> PyResult<Py<PyAny>> {
    static MEMBERS: PyOnceLock<Vec<Py<PyAny>>> = PyOnceLock::new();
    let members = MEMBERS.get_or_try_init(py, || {
        let class = py.import("armlet.status")?.getattr("Status")?;
        Status::ALL.iter().map(|s| Ok(class.call1((s.code(),))?.unbind())).collect::<PyResult<Vec<_>>>()
    })?;
    Ok(members[status.code() as usize].clone_ref(py))
}

/// The residuals of the last solve as a list of vectors.
pub fn residual_list<'py>(py: Python<'py>, rows: &[usize], stacked: &[f64]) -> Result<Bound<'py, PyList>, Failure> {
    let (mut start, mut parts) = (0, Vec::with_capacity(rows.len()));
    for m in rows {
        parts.push(copied(py, &[*m], &stacked[start..start + m])?);
        start += m;
    }
    Ok(PyList::new(py, parts)?)
}

thread_local! {
    /// The last solver without options of its own: a loop over stacks of one size builds its buffers once.
    static LAST: RefCell<Option<Core>> = const { RefCell::new(None) };
}

fn solver(function: &str, n: usize, rows: &[usize], keywords: &Keywords) -> Result<Core, Failure> {
    if keywords.plain()
        && let Some(mut last) = LAST.take()
        && last.n() == n
        && last.rows() == rows
        && last.method().name() == keywords.method
    {
        last.set_rounding(keywords.rounding.unwrap_or(DEFAULT_ROUNDING))?;
        return Ok(last);
    }
    Ok(Core::new(n, rows, &keywords.options(function, n, rows.len())?)?)
}

/// Fill the solver's inputs from one stack and solve.
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

/// Joint velocities that execute tasks `J_i v = v_i` in priority: each level uses only the freedom that those above leave.
///
/// `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..`, `P1 = I - J1# J1`, with ranks decided on the scale of the unprojected tasks.
///
/// Args:
///     jacobians: one `(..., rows_i, n)` per level, the highest first; zero rows and more rows than joints are allowed.
///     velocities: one `(..., rows_i)` per level, in the unit of the task.
///     method: "exact" (the equation), "clamp" (continuous and bounded, equal to it where all singular values reach `eps`),
///         "damped", "chiaverini", or "sns" (within `v_min`, `v_max`).
///     eps: threshold on singular values, one number or one per level; None: 0.02 of each level's largest row norm.
///     rounding: relative error of the entries of the Jacobians; None: 8 machine epsilons; `8 eps (1 + sum|q|)` where angles made them.
///     weight: joint metric `W`, `(n, n)`, symmetric positive definite: `v' W v` is minimised; None: the identity.
///     v_min, v_max: bounds for "sns", a number or `(n,)`, rad/s or m/s; a single one holds for both signs.
///
/// Returns:
///     A `PrioritySolution`. Batches never raise for one bad row: `status` has one entry per row, and a row whose numbers are not
///     finite, or whose answer overflows, is NaN with `Status.DIVERGED`.
///
/// Raises:
///     InputError: shapes that do not fit, an empty stack, an unknown method; in one stack also numbers that are not finite.
///     SolveError: the answer of one stack overflows.
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
        let (jacobians, velocities) = (items(NAME, "jacobians", jacobians)?, items(NAME, "velocities", velocities)?);
        let (method, rounding) = (method_name(NAME, method)?, optional_number(NAME, "rounding", rounding)?);
        let keywords = Keywords { method, eps, rounding, weight, v_min, v_max };
        if let Some(solver) = again(&jacobians, &velocities, &keywords) {
            let solution = answer(&solver);
            LAST.set(Some(solver));
            return Ok(solution);
        }
        let stack = Stack::read(py, NAME, ["jacobians", "velocities"], &jacobians, Some(&velocities))?;
        let solver = solver(NAME, stack.n, &stack.rows, &keywords)?;
        if stack.lead.is_empty() { single(py, solver, &stack, keywords.plain()) } else { batch(py, solver, stack) }
    })
}

/// One stack of contiguous arrays of the sizes and with the method of the last call: solved without a look at anything else.
/// None where that is not so, or where there is something to refuse; the full path then finds out what.
fn again(jacobians: &[Bound<'_, PyAny>], velocities: &[Bound<'_, PyAny>], keywords: &Keywords) -> Option<Core> {
    if !keywords.plain() {
        return None;
    }
    let mut solver = LAST.take()?;
    let levels = solver.rows().len();
    if solver.method().name() != keywords.method || [jacobians.len(), velocities.len()] != [levels; 2] {
        return None;
    }
    solver.set_rounding(keywords.rounding.unwrap_or(DEFAULT_ROUNDING)).ok()?;
    let (n, mut at) = (solver.n(), 0);
    for i in 0..levels {
        let m = solver.rows()[i];
        let (jacobian, velocity) = (of_shape(&jacobians[i], &[m, n])?, of_shape(&velocities[i], &[m])?);
        let (j, v) = solver.inputs();
        j[at * n..(at + m) * n].copy_from_slice(jacobian);
        v[at..at + m].copy_from_slice(velocity);
        at += m;
    }
    solver.used();
    solver.run().ok()?;
    Some(solver)
}

/// What the solver found last.
fn answer(solver: &Core) -> PrioritySolution {
    let found = SingleSolution {
        n: solver.n(),
        rows: solver.rows().to_vec(),
        numbers: [solver.v(), solver.residuals(), solver.scales()].concat(),
        ranks: solver.ranks().to_vec(),
        status: solver.status(),
    };
    let [v, residuals, ranks, scales, status] = [const { PyOnceLock::new() }; 5];
    PrioritySolution { found: Some(found), v, residuals, ranks, scales, status }
}

fn single(py: Python<'_>, mut solver: Core, stack: &Stack, keep: bool) -> Result<PrioritySolution, Failure> {
    if let Err(error) = solve_row(&mut solver, stack) {
        stack.require_finite(py, "solve_priority")?;
        return Err(error.into());
    }
    let solution = answer(&solver);
    if keep {
        LAST.set(Some(solver));
    }
    Ok(solution)
}

fn batch(py: Python<'_>, solver: Core, stack: Stack) -> Result<PrioritySolution, Failure> {
    let (count, levels) = (stack.count, stack.rows.len());
    // Copied: other threads may write to the caller's arrays.
    let stack = stack.owned()?;
    let (v, residuals, ranks, scales, status) = long(py, || {
        let room = |width: usize| memory::zeros(count.saturating_mul(width));
        let mut residuals = stack.rows.iter().map(|m| room(*m)).collect::<Result<Vec<_>, _>>()?;
        let (mut v, mut scales) = (room(stack.n)?, room(levels)?);
        let (mut ranks, mut status) = (memory::filled(count.saturating_mul(levels), 0)?, memory::filled(count, 0)?);
        let (jacobians, velocities): (Vec<&[f64]>, Vec<&[f64]>) = (0..levels).map(|i| stack.level(i)).unzip();
        let given = StackRows { jacobians: &jacobians, velocities: &velocities };
        let answers = StackAnswers {
            v: &mut v,
            residuals: residuals.iter_mut().map(Vec::as_mut_slice).collect(),
            ranks: &mut ranks,
            scales: &mut scales,
            status: &mut status,
        };
        if solve_stacks(&solver, &given, answers, default_threads(), &mut signalled) {
            interrupt();
        }
        Ok((v, residuals, ranks, scales, status))
    })?;
    let shape = |last: &[usize]| -> Vec<usize> { stack.lead.iter().chain(last).copied().collect() };
    let residuals =
        stack.rows.iter().zip(residuals).map(|(m, r)| Ok(adopted(py, &shape(&[*m]), r)?)).collect::<Result<Vec<_>, Failure>>()?;
    let (v, residuals) = (adopted(py, &shape(&[stack.n]), v)?, PyList::new(py, residuals)?.into_any());
    let (ranks, scales) = (adopted(py, &shape(&[levels]), ranks)?, adopted(py, &shape(&[levels]), scales)?);
    let status = adopted(py, &stack.lead, status)?;
    Ok(PrioritySolution::new(py, v.unbind(), residuals.unbind(), ranks.unbind(), scales.unbind(), status.unbind())?)
}
