//! `armlet.inverse_kinematics` and its result.

use crate::arguments::require_partner;
use crate::arm::Arm;
use crate::arrays::{
    ArrayArgument, Axis, Form, SCALAR, adopted, copied, elements, flag, nonnegative_integer, number, numbers, object, owned, shown,
};
use crate::broadcast::{common_shape, stretch};
use crate::constructor_call::short_repr;
use crate::errors::{Failure, input_error};
use crate::interrupts::{long, signalled};
use crate::loops::threads_of;
use crate::priority::{method_name, residual_list, status_member};
use crate::seal::{Sealed, seal};
use crate::task::{Goals, each};
use crate::warnings::LimitCheck;
use armlet_core::analysis::inverse_kinematics::{Goal, IkBatch, IkOptions, inverse_kinematics as core, inverse_kinematics_batch};
use armlet_core::arm::Arm as CoreArm;
use armlet_core::error::Error;
use armlet_core::kinematics::TaskFunction;
use armlet_core::priority::PriorityMethod;
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::IntoPyObjectExt;
use pyo3::basic::CompareOp;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

/// The result of `inverse_kinematics`: joint positions, and the outcome of each task.
///
/// - `q`: joint positions, `(n,)`, rad or m.
/// - `errors`: a list with the error of each task at `q`, `(rows_i,)`, m or rad.
/// - `reached`: a flag for each task.
/// - `iterations`: number of steps from all starts together.
/// - `restarts`: number of random starts.
/// - `status`: `Status.SUCCESS` if every task is reached, and `DEGRADED` if the first task is reached, but not all.
///
/// If the first task is not reached, `status` is `INFEASIBLE` when the best search ended without further progress. It is `MAX_STEPS` when
/// `max_iterations` ended this search.
///
/// In a batch the fields are arrays: `q` `(..., n)`, and `errors` a list of `(..., rows_i)`. `reached` (every task of the row is reached),
/// `iterations`, `restarts` and `status` (integer codes of `Status`) have the shape `(...)`. With `solutions=k`, `q` is `(..., k, n)`, each
/// array of `errors` is `(..., k, rows_i)`, and `reached` and `status` are `(..., k)`.
///
/// The truth value is True if every task of every target is reached. With `solutions=k`, it considers only the best solution of each
/// target.
#[pyclass(frozen, get_all, module = "armlet")]
pub struct InverseKinematics {
    pub q: Py<PyAny>,
    pub errors: Py<PyAny>,
    pub reached: Py<PyAny>,
    pub iterations: Py<PyAny>,
    pub restarts: Py<PyAny>,
    pub status: Py<PyAny>,
}

#[entered]
#[pymethods]
impl InverseKinematics {
    #[new]
    fn new(q: Py<PyAny>, errors: Py<PyAny>, reached: Py<PyAny>, iterations: Py<PyAny>, restarts: Py<PyAny>, status: Py<PyAny>) -> Self {
        InverseKinematics { q, errors, reached, iterations, restarts, status }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let parts = [&self.q, &self.errors, &self.reached, &self.iterations, &self.restarts, &self.status];
        seal(py.get_type::<Self>().as_any(), PyTuple::new(py, parts.map(|part| part.bind(py)))?, None)
    }

    fn __bool__(&self, py: Python<'_>) -> PyResult<bool> {
        let reached = self.reached.bind(py);
        let Ok(axes) = reached.getattr("ndim") else {
            return reached.try_iter()?.try_fold(true, |all, one| Ok(all && one?.is_truthy()?));
        };
        // With several solutions, `q` has an additional axis. The array `iterations` has only the axes of the batch.
        let counts = py.import("numpy")?.call_method1("ndim", (self.iterations.bind(py),))?.extract::<usize>()?;
        let best = if axes.extract::<usize>()? > counts { reached.get_item((py.Ellipsis(), 0))? } else { reached.clone() };
        best.call_method0("all")?.is_truthy()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let reached = self.reached.bind(py);
        // In a batch `reached` is an array. A table of its rows would fill the screen.
        if let Ok(count) = reached.getattr("size") {
            let (shape, sum) = (self.q.bind(py).getattr("shape")?.repr()?, reached.call_method0("sum")?);
            let counts = statuses(self.status.bind(py))?;
            return Ok(format!("InverseKinematics(q of shape {shape}, {sum} of {count} reached, status={counts})"));
        }
        let show = |value: &Py<PyAny>| short_repr(value.bind(py));
        let (q, reached, status) = (show(&self.q)?, show(&self.reached)?, show(&self.status)?);
        let (iterations, restarts) = (show(&self.iterations)?, show(&self.restarts)?);
        Ok(format!("InverseKinematics(q={q}, reached={reached}, iterations={iterations}, restarts={restarts}, status={status})"))
    }
}

/// How often each status occurs in an array of integer codes, such as `2 success, 1 infeasible`.
fn statuses(codes: &Bound<'_, PyAny>) -> PyResult<String> {
    let py = codes.py();
    let numpy = py.import("numpy")?;
    let mut parts = Vec::new();
    for status in Status::ALL {
        let same = codes.rich_compare(status.code(), CompareOp::Eq)?;
        let count = numpy.call_method1("count_nonzero", (same,))?.extract::<usize>()?;
        if count > 0 {
            let name = status_member(py, status)?.bind(py).getattr("name")?.extract::<String>()?;
            parts.push(format!("{count} {}", name.to_lowercase()));
        }
    }
    Ok(parts.join(", "))
}

const NAME: &str = "inverse_kinematics";

/// Search for joint positions at which the tasks are reached: damped Newton steps within the joint limits.
///
/// `q <- clip(q + s dq)`, where `dq` is a damped least-squares step for all tasks together, and `s <= 1` limits it to `step_max`. If there
/// are several tasks and these steps do not reach all of them, steps in the order of priority follow. Such a `dq` solves `J_i dq = e_i` for
/// one task after the other. A lower task that conflicts with a higher one is then reached only in part. If the search from `q0` fails,
/// searches from random starts within the limits follow. Equal seeds make equal starts.
///
/// Args:
///     arm: the arm; not `planar_pr`, which has no links.
///     tasks: `Task` and other tasks with constant targets `(rows,)` or `(..., rows)`, m or rad, the highest priority first. The gains of
///         the tasks are not used. A task with `lower` or `upper`, such as a `DistanceTask`, is reached within its bounds. Its error is the
///         distance to the nearest bound.
///     q0: start of the search, `(n,)` or `(..., n)`, rad or m. Leading axes of `q0` and of all targets broadcast.
///     limits: keep `q` within the arm's joint limits.
///     solutions: number of different solutions of each target, from at most `restarts` random starts. None: one solution, without an axis
///         for it. Solutions that reach every task are first, ordered by their distance `|q - q0|`. The others follow, ordered by the error
///         of the first task in which they differ. Two solutions are equal if no joint differs by more than 1e-3 rad or m. A difference of
///         2 pi does not count if it leaves all bodies in place. If fewer are found, the remaining rows are NaN, with the status
///         `INFEASIBLE`.
///
/// Other Args:
///     method: the method of `solve_priority` for every step: "clamp", "damped", "exact" or "chiaverini" (keyword only, as all below).
///         None: steps for all tasks together, and "clamp" for steps in the order of priority.
///     eps: threshold on singular values, for steps in the order of priority: one number, or one per task. With `eps`, all steps are of
///         this kind. "exact" does not accept it. None: 0.02 times each task's largest row norm.
///     tolerance: a task is reached if the size of every entry of its error is at most this, m or rad; 1e-9 if None.
///     max_iterations: largest number of steps from each start; 100 if None.
///     restarts: largest number of random starts after `q0`; 50 if None.
///     seed: seed of the random starts; 0 if None.
///     step_max: largest change of a joint position in one step, rad or m; 0.5 if None.
///     check_limits: action for a start outside of the joint limits: None warns, True raises, and False does neither. With `limits=False`
///         it must be None.
///     threads: number of threads for a batch; None: the environment variable `ARMLET_NUM_THREADS`, otherwise the number of cores.
///
/// Threads share the rows of a batch. Every row is equal, bit for bit, to the result of a separate call, for any number of threads. A row
/// whose start or target is not finite, or whose numbers overflow, is NaN with the status `DIVERGED`. The same holds for an invalid target,
/// such as a direction of length zero. Such a row does not affect other rows.
///
/// Returns:
///     An `InverseKinematics`, which is true if every task is reached. An unreachable target is not an error: its `status` reports it.
///
/// Raises:
///     InputError: a shape is wrong, leading axes do not broadcast, a task has no constant target, or the method is unknown. A single
///         target or start that is not finite also raises it. With `check_limits=True`, a start outside of the joint limits raises it.
///
/// Warns:
///     UserWarning: a start is outside of the joint limits. The search begins at the nearest position inside.
///
/// Source: Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE Trans. Robotics 27, 2011; Nakamura
/// and Hanafusa, Inverse kinematic solutions with singularity robustness, J. Dyn. Sys. Meas. Control 108, 1986.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4, 0.3])
/// >>> found = al.inverse_kinematics(arm, [al.Task("link3", "xy", [0.6, 0.5])], [0.1, 0.2, 0.3])
/// >>> found.status, arm.position(found.q, "link3").round(9)
/// (<Status.SUCCESS: 0>, array([0.6, 0.5, 0. ]))
///
/// Many targets, and both elbows of each:
///
/// >>> points = [[0.3, 0.5], [0.5, 0.2], [2.0, 0.0]]
/// >>> found = al.inverse_kinematics(al.planar_arm([0.5, 0.4]), [al.Task("link2", "xy", points)], [0.1, 0.2], solutions=2)
/// >>> found.q.shape, found.reached
/// ((3, 2, 2), array([[ True,  True],
///        [ True,  True],
///        [False, False]]))
#[entered]
#[pyfunction]
#[arguments(
    arm, tasks, q0, *, method=None, eps=None, tolerance=None, max_iterations=None, restarts=None, seed=None, step_max=None, limits=true,
    check_limits=None, solutions=None, threads=None
)]
pub fn inverse_kinematics() -> Result<InverseKinematics, Failure> {
    let arm = object::<Arm>(NAME, "arm", "an Arm such as planar_arm(..)", arm)?;
    let model = arm.get().model.core();
    let tree = model.tree("arm")?;
    let (_, goals) = each(NAME, tasks, |task| task.goals(tree))?;
    let alone = solutions.is_none() && goals.iter().all(|goal| goal.lead.is_empty());
    // An argument `q0` with at most one axis is a single start, so the message about a wrong shape expects `(n,)`.
    let wide = ArrayArgument::new(NAME, "q0", q0)?.shape.len() > 1;
    let form = if wide { Form(&[Axis::Leading, Axis::Is(model.n())]) } else { Form(&[Axis::Is(model.n())]) };
    let (mut lead, q0) = numbers(NAME, "q0", q0, &[form])?;
    lead.pop();
    let q0 = owned(q0)?;
    let check = LimitCheck::of(NAME, check_limits)?;
    let plain = IkOptions::default();
    let thresholds = match eps {
        None => None,
        Some(eps) => {
            let (_, values) = numbers(NAME, "eps", eps, &[SCALAR, Form(&[Axis::Is(goals.len())])])?;
            Some(owned(values)?)
        }
    };
    let search = IkOptions {
        tolerance: tolerance.map_or(Ok(plain.tolerance), |x| number(NAME, "tolerance", x))?,
        max_iterations: max_iterations.map_or(Ok(plain.max_iterations), |x| nonnegative_integer(NAME, "max_iterations", x))?,
        restarts: restarts.map_or(Ok(plain.restarts), |x| nonnegative_integer(NAME, "restarts", x))?,
        seed: seed.map_or(Ok(plain.seed), |x| nonnegative_integer(NAME, "seed", x).map(|x| x as u64))?,
        step_max: step_max.map_or(Ok(plain.step_max), |x| number(NAME, "step_max", x))?,
        limits: limits.map_or(Ok(plain.limits), |x| flag(NAME, "limits", x))?,
        method: match method {
            None => None,
            given => Some(PriorityMethod::from_name(method_name(NAME, given)?)?),
        },
        eps: thresholds,
    };
    let threshold = search.method.is_none_or(PriorityMethod::has_threshold);
    require_partner(NAME, "eps", eps, "the methods clamp, damped and chiaverini", threshold)?;
    require_partner(NAME, "check_limits", check_limits, "limits=True", search.limits)?;
    if search.limits {
        check.rows(py, NAME, "q0", tree, &q0, wide)?;
    }
    let threads = threads_of(NAME, threads)?;
    if !(alone && lead.is_empty()) {
        let solutions = solutions.map(|k| positive_count("solutions", k)).transpose()?;
        return many(py, tree, goals, (lead, q0), &search, solutions, threads);
    }
    let rows: Vec<usize> = goals.iter().map(|goal| goal.function.rows()).collect();
    let goals: Vec<Goal> = goals.into_iter().map(|goal| (goal.function, goal.targets)).collect();
    let found = long(py, || core(tree, &goals, &q0, &search))?;
    Ok(InverseKinematics {
        q: copied(py, &[found.q.len()], &found.q)?.unbind(),
        errors: residual_list(py, &rows, &found.errors)?.into_any().unbind(),
        reached: PyList::new(py, &found.reached)?.into_any().unbind(),
        iterations: found.iterations.into_py_any(py)?,
        restarts: found.restarts.into_py_any(py)?,
        status: status_member(py, found.status)?,
    })
}

/// Read a count that is at least one.
fn positive_count(name: &str, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    match nonnegative_integer(NAME, name, value)? {
        0 => Err(Error::input(name, "is not positive: expected at least 1, got 0").into()),
        k => Ok(k),
    }
}

/// Solve a batch of targets, or search for several solutions of one target.
fn many(
    py: Python<'_>,
    tree: &CoreArm,
    goals: Vec<Goals>,
    (lead0, q0): (Vec<usize>, Vec<f64>),
    search: &IkOptions,
    solutions: Option<usize>,
    threads: usize,
) -> Result<InverseKinematics, Failure> {
    let shapes: Vec<Vec<usize>> = goals.iter().map(|goal| goal.lead.clone()).chain([lead0.clone()]).collect();
    let lead = common_shape(&shapes).ok_or_else(|| {
        let all = shapes.iter().map(|s| shown(s)).collect::<Vec<_>>().join(", ");
        input_error(py, NAME, "tasks, q0", format!("do not broadcast: expected leading axes that agree, got {all}"))
    })?;
    let (count, k, n) = (elements(&lead)?, solutions.unwrap_or(1), tree.n());
    let functions: Vec<TaskFunction> = goals.iter().map(|goal| goal.function.clone()).collect();
    let found = long(py, || {
        let spread = |from: &[usize], values: Vec<f64>, width: usize| {
            let single = from.iter().product::<usize>() == 1;
            if from == lead || single { Ok(values) } else { stretch(from, &lead, &values, width) }
        };
        let q0 = spread(&lead0, q0, n)?;
        let targets = goals.into_iter().map(|goal| spread(&goal.lead, goal.targets, goal.function.target_size()));
        let targets = targets.collect::<Result<Vec<_>, Error>>()?;
        let batch = IkBatch { functions: &functions, targets: &targets, q0: &q0, count };
        inverse_kinematics_batch(tree, &batch, k, search, threads, &mut signalled)
    })?;
    let slots: Vec<usize> = lead.iter().copied().chain(solutions).collect();
    let wide = |m: usize| slots.iter().copied().chain([m]).collect::<Vec<_>>();
    let all: Vec<bool> = found.reached.chunks_exact(functions.len()).map(|tasks| tasks.iter().all(|reached| *reached)).collect();
    let errors = found.errors.into_iter().zip(&functions);
    let errors = errors.map(|(errors, function)| adopted(py, &wide(function.rows()), errors)).collect::<PyResult<Vec<_>>>()?;
    let counts = |counts: Vec<i64>| if lead.is_empty() { counts[0].into_py_any(py) } else { Ok(adopted(py, &lead, counts)?.unbind()) };
    Ok(InverseKinematics {
        q: adopted(py, &wide(n), found.q)?.unbind(),
        errors: PyList::new(py, errors)?.into_any().unbind(),
        reached: copied(py, &slots, &all)?.unbind(),
        iterations: counts(found.iterations)?,
        restarts: counts(found.restarts)?,
        status: adopted(py, &slots, found.status)?.unbind(),
    })
}
