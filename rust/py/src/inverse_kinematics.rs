//! `armlet.inverse_kinematics` and its answer.

use crate::arm::Arm;
use crate::arrays::{Axis, Form, SCALAR, copied, flag, number, numbers, object, owned, vector, whole};
use crate::errors::entry;
use crate::interrupts::long;
use crate::priority::{method_name, residual_list, status_member};
use crate::seal::{Sealed, seal};
use crate::task::each;
use armlet_core::analysis::inverse_kinematics::{IkOptions, inverse_kinematics as core};
use armlet_core::priority::PriorityMethod;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Joint positions and what became of each task.
///
/// `q`: joint positions, `(n,)`, rad or m. `errors`: the error of each task at `q`, `(rows_i,)` each, m or rad. `reached`: whether
/// each task is reached. `iterations`: steps from all starts together. `restarts`: random starts used. `status`: `Status.SUCCESS`
/// when every task is reached; `DEGRADED` when the first is and some lower one is not; `INFEASIBLE` when the first is not and
/// the search came to rest; `MAX_STEPS` when it was still moving.
#[pyclass(frozen, get_all, module = "armlet")]
pub struct InverseKinematics {
    pub q: Py<PyAny>,
    pub errors: Py<PyAny>,
    pub reached: Py<PyAny>,
    pub iterations: usize,
    pub restarts: usize,
    pub status: Py<PyAny>,
}

#[entered]
#[pymethods]
impl InverseKinematics {
    #[new]
    fn new(q: Py<PyAny>, errors: Py<PyAny>, reached: Py<PyAny>, iterations: usize, restarts: usize, status: Py<PyAny>) -> Self {
        InverseKinematics { q, errors, reached, iterations, restarts, status }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let counts = [self.iterations, self.restarts].map(|k| k.into_pyobject(py).map(|k| k.into_any()));
        let [iterations, restarts] = counts;
        let parts = [self.q.bind(py).clone(), self.errors.bind(py).clone(), self.reached.bind(py).clone(), iterations?, restarts?];
        let parts = PyTuple::new(py, parts.into_iter().chain([self.status.bind(py).clone()]).collect::<Vec<_>>())?;
        seal(py.get_type::<Self>().as_any(), parts, None)
    }

    fn __bool__(&self, py: Python<'_>) -> PyResult<bool> {
        self.reached.bind(py).try_iter()?.try_fold(true, |all, one| Ok(all && one?.is_truthy()?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let show = |value: &Py<PyAny>| PyResult::Ok(value.bind(py).repr()?.to_string());
        let (q, reached, status) = (show(&self.q)?, show(&self.reached)?, show(&self.status)?);
        Ok(format!(
            "InverseKinematics(q={q}, reached={reached}, iterations={}, restarts={}, status={status})",
            self.iterations, self.restarts
        ))
    }
}

const NAME: &str = "inverse_kinematics";

/// Joint positions at which tasks are reached, the highest first: prioritised damped Newton steps within the joint limits.
///
/// `q <- clip(q + s dq)`, `dq` from `J_i dq = e_i` in priority. Where a start leads nowhere, random ones within the limits follow,
/// always the same for the same `seed`. A lower task that conflicts with a higher one is reached as far as the map allows.
///
/// Args:
///     arm: the arm, of links.
///     tasks: `Task` and its kin with constant targets, the highest first; gains play no part.
///     q0: where to start, `(n,)`, rad or m.
///     method: the map of a step: "clamp", "damped", "exact" or "chiaverini" (keyword only, as all that follow).
///     eps: threshold on singular values, one number or one per task; None: 0.02 of each task's largest row norm.
///     tolerance: a task is reached when every entry of its error is at most this, m or rad.
///     max_iterations: steps from each start.
///     restarts: random starts after `q0`.
///     seed: of the random starts.
///     step_max: largest step of a joint, rad or m.
///     limits: keep to the arm's joint limits.
///
/// Returns:
///     An `InverseKinematics`; it is true when every task is reached. Never raises for a target out of reach: see its `status`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a task has no constant target, the method is unknown.
///
/// Source: Nakamura and Hanafusa, Inverse kinematic solutions with singularity robustness, J. Dyn. Sys. Meas. Control 108, 1986.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4, 0.3])
/// >>> found = al.inverse_kinematics(arm, [al.Task("link3", "xy", [0.6, 0.5])], [0.1, 0.2, 0.3])
/// >>> found.status, arm.position(found.q, "link3").round(9)
/// (<Status.SUCCESS: 0>, array([0.6, 0.5, 0. ]))
#[entered]
#[pyfunction]
#[pyo3(
    signature = (arm, tasks, q0, *, method=None, eps=None, tolerance=None, max_iterations=None, restarts=None, seed=None, step_max=None,
                 limits=None),
    text_signature = "(arm, tasks, q0, *, method='clamp', eps=None, tolerance=None, max_iterations=None, restarts=None, seed=None, \
                      step_max=None, limits=True)"
)]
pub fn inverse_kinematics<'py>(
    py: Python<'py>,
    arm: &Bound<'py, PyAny>,
    tasks: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    method: Option<&Bound<'py, PyAny>>,
    eps: Option<&Bound<'py, PyAny>>,
    tolerance: Option<&Bound<'py, PyAny>>,
    max_iterations: Option<&Bound<'py, PyAny>>,
    restarts: Option<&Bound<'py, PyAny>>,
    seed: Option<&Bound<'py, PyAny>>,
    step_max: Option<&Bound<'py, PyAny>>,
    limits: Option<&Bound<'py, PyAny>>,
) -> PyResult<InverseKinematics> {
    entry(py, NAME, || {
        let arm = object::<Arm>(NAME, "arm", "an Arm such as planar_arm(..)", arm)?;
        let model = arm.get().model.core();
        let tree = model.tree("arm")?;
        let (_, goals) = each(NAME, tasks, |task| task.goal(tree))?;
        let q0 = vector(NAME, "q0", q0, model.n())?;
        let plain = IkOptions::default();
        let eps = match eps {
            None => None,
            Some(eps) => {
                let (_, values) = numbers(NAME, "eps", eps, &[SCALAR, Form(&[Axis::Is(goals.len())])])?;
                Some(owned(values)?)
            }
        };
        let search = IkOptions {
            tolerance: tolerance.map_or(Ok(plain.tolerance), |x| number(NAME, "tolerance", x))?,
            max_iterations: max_iterations.map_or(Ok(plain.max_iterations), |x| whole(NAME, "max_iterations", x))?,
            restarts: restarts.map_or(Ok(plain.restarts), |x| whole(NAME, "restarts", x))?,
            seed: seed.map_or(Ok(plain.seed), |x| whole(NAME, "seed", x).map(|x| x as u64))?,
            step_max: step_max.map_or(Ok(plain.step_max), |x| number(NAME, "step_max", x))?,
            limits: limits.map_or(Ok(plain.limits), |x| flag(NAME, "limits", x))?,
            method: PriorityMethod::from_name(method_name(NAME, method)?)?,
            eps,
        };
        let rows: Vec<usize> = goals.iter().map(|(function, _)| function.rows()).collect();
        let found = long(py, || core(tree, &goals, &q0, &search))?;
        Ok(InverseKinematics {
            q: copied(py, &[found.q.len()], &found.q)?.unbind(),
            errors: residual_list(py, &rows, &found.errors)?.into_any().unbind(),
            reached: pyo3::types::PyList::new(py, &found.reached)?.into_any().unbind(),
            iterations: found.iterations,
            restarts: found.restarts,
            status: status_member(py, found.status)?,
        })
    })
}
