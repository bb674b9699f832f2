//! `armlet.PrioritySolver.for_arm`: a solver that computes joint velocities from joint positions and task velocities.

use super::diagnosis::fields;
use super::solution::{residual_list, status_member};
use super::stack::{Keywords, items, per_joint};
use crate::arm::Arm;
use crate::arrays::{
    Axis, Form, adopted, copied, new_array, new_vector, numbers, object, of_shape, out_of_shape, out_slice, owned, require_finite, shown,
    vector,
};
use crate::broadcast::{broadcast, require_all_finite};
use crate::errors::{Failure, input_error};
use crate::interrupts::{long, signalled};
use crate::seal::{Sealed, seal_call};
use crate::task::each;
use armlet_core::error::Error;
use armlet_core::interrupt::{self, interrupt};
use armlet_core::law::{ArmSolver as Core, with_limits};
use armlet_core::memory;
use armlet_core::simulate::{default_threads, solve_rows};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A solver of joint velocities for tasks of one arm with priorities, from `PrioritySolver.for_arm`.
///
/// `v` solves `J_i(q) v = v_i` for each level, in the order of priority. The rank decisions assume a relative error of
/// `8 eps (1 + sum|q|)` in the entries of the Jacobians, where `eps` is the machine epsilon.
#[pyclass(frozen, module = "armlet")]
pub struct ArmPrioritySolver {
    n: usize,
    rows: Vec<usize>,
    /// The arm of the tasks.
    #[pyo3(get)]
    arm: Py<Arm>,
    /// The tasks, the highest priority first.
    #[pyo3(get)]
    tasks: Py<PyTuple>,
    keywords: Vec<(&'static str, Py<PyAny>)>,
    // No Python code runs while a thread holds this lock, so no thread waits for Python code.
    state: Mutex<Core>,
}

/// The largest number of levels for the fast path, which uses no heap buffer.
const MOST: usize = 8;

/// The number of rows that are copied between two checks for Ctrl-C.
const CHECK_PERIOD: usize = 1 << 12;

const SOLVE: &str = "ArmPrioritySolver.solve";

/// Make a solver for the tasks of an arm, for `PrioritySolver.for_arm`.
pub fn for_arm(arm: &Bound<'_, PyAny>, tasks: &Bound<'_, PyAny>, keywords: Keywords<'_, '_>) -> Result<ArmPrioritySolver, Failure> {
    const NAME: &str = "PrioritySolver.for_arm";
    let py = arm.py();
    let arm = object::<Arm>(NAME, "arm", "an Arm such as planar_arm(..)", arm)?;
    let model = arm.get().model.core();
    let tree = model.tree("arm")?;
    let (tasks, functions) = each(NAME, tasks, |task| task.function(tree))?;
    let options = with_limits(&model, keywords.options(NAME, model.n(), functions.len())?)?;
    let mut core = Core::new(tree, functions, &options)?;
    core.solver_mut().keep_active_set();
    let mut named = vec![("method", keywords.method.into_pyobject(py).map_err(PyErr::from)?.into_any().unbind())];
    let Keywords { eps, weight, v_min, v_max, scale, .. } = keywords;
    for (name, value) in [("eps", eps), ("weight", weight), ("v_min", v_min), ("v_max", v_max), ("scale", scale)] {
        if let Some(value) = value {
            named.push((name, value.clone().unbind()));
        }
    }
    let (n, rows) = (core.n(), core.rows().to_vec());
    Ok(ArmPrioritySolver { n, rows, arm: arm.unbind(), tasks, keywords: named, state: Mutex::new(core) })
}

impl ArmPrioritySolver {
    fn state(&self) -> MutexGuard<'_, Core> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Solve for one `q` `(n,)`, if all arguments are contiguous float64 arrays of the right shape. The result is `None` for other
    /// arguments, and for errors, which [`ArmPrioritySolver::full`] reports.
    #[inline]
    fn quick<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        velocities: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> Option<Bound<'py, PyAny>> {
        let angles = of_shape(q, &[self.n])?;
        let list = velocities.cast_exact::<PyList>().ok()?;
        if list.len() != self.rows.len() || self.rows.len() > MOST {
            return None;
        }
        // An array on the stack, because this path uses no heap buffer.
        let held: [Option<Bound<'py, PyAny>>; MOST] = std::array::from_fn(|i| if i < list.len() { list.get_item(i).ok() } else { None });
        let mut given: [&[f64]; MOST] = [&[]; MOST];
        for ((slot, velocity), &m) in given.iter_mut().zip(&held).zip(&self.rows) {
            *slot = of_shape(velocity.as_ref()?, &[m])?;
        }
        let given = &given[..self.rows.len()];
        let solve = |v: &mut [f64]| -> Result<(), Failure> {
            let core = &mut *self.state();
            let command = core.prepare(angles);
            let mut at = 0;
            for velocity in given {
                command[at..at + velocity.len()].copy_from_slice(velocity);
                at += velocity.len();
            }
            core.solver_mut().used();
            v.copy_from_slice(&core.solver_mut().run()?.v);
            Ok(())
        };
        match out {
            None => new_vector(py, self.n, solve).ok(),
            Some(out) => {
                // All arrays are contiguous, so comparing their address ranges detects an overlap.
                let place = of_shape(out, &[self.n])?.as_ptr_range();
                let apart = |x: &[f64]| x.as_ptr_range().end <= place.start || place.end <= x.as_ptr_range().start;
                if !(apart(angles) && given.iter().all(|x| apart(x))) {
                    return None;
                }
                solve(out_of_shape(out, &[self.n])?).ok()?;
                Some(out.clone())
            }
        }
    }

    /// Solve for all other arguments: lists, other types of arrays, and leading axes. Invalid arguments are an error.
    fn full<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        velocities: &[Bound<'py, PyAny>],
        out: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        if velocities.len() != self.rows.len() {
            let problem = format!("has the wrong number of levels: expected {}, got {}", self.rows.len(), velocities.len());
            return Err(input_error(py, SOLVE, "velocities", problem).into());
        }
        let (total, count) = (self.rows.iter().sum::<usize>(), |shape: &[usize]| shape.iter().product::<usize>());
        // The leading axes and the velocities of each level.
        let mut parts = Vec::with_capacity(velocities.len());
        for (i, (velocity, &m)) in velocities.iter().zip(&self.rows).enumerate() {
            let name = format!("velocities[{i}]");
            let (mut shape, values) = numbers(SOLVE, &name, velocity, &[Form(&[Axis::Leading, Axis::Is(m)])])?;
            require_finite(py, SOLVE, &name, &shape, &values)?;
            shape.pop();
            parts.push((shape, values));
        }
        let given = broadcast(SOLVE, ["q"], [q], [self.n])?;
        require_all_finite(SOLVE, ["q"], [q])?;
        let mut shapes: Vec<Vec<usize>> = parts.iter().map(|(shape, _)| shape.clone()).collect();
        shapes.push(given.shape.clone());
        let lead = crate::broadcast::common_shape(&shapes).ok_or_else(|| {
            let all = shapes.iter().map(|s| shown(s)).collect::<Vec<_>>().join(", ");
            input_error(py, SOLVE, "q, velocities", format!("do not broadcast: expected leading axes that agree, got {all}"))
        })?;
        let rows = count(&lead);
        let one = parts.iter().all(|(shape, _)| count(shape) == 1);
        let commands = if one { 1 } else { rows };
        // Use copies, because other threads may write to the caller's arrays.
        let (shape, angles) = (given.shape.clone(), given.given(0)?);
        let parts = parts.into_iter().map(|(shape, values)| Ok((shape, owned(values)?))).collect::<Result<Vec<_>, Failure>>()?;
        let inputs = || -> Result<(Vec<f64>, Vec<f64>), Error> {
            let angles = if shape == lead { angles } else { crate::broadcast::stretch(&shape, &lead, &angles, self.n)? };
            let mut stacked = memory::zeros(commands * total)?;
            let mut at = 0;
            for ((shape, values), &m) in parts.into_iter().zip(&self.rows) {
                let values = if one || shape == lead { values } else { crate::broadcast::stretch(&shape, &lead, &values, m)? };
                for row in 0..commands {
                    if row % CHECK_PERIOD == 0 {
                        interrupt::check();
                    }
                    stacked[row * total + at..row * total + at + m].copy_from_slice(&values[row * m..(row + 1) * m]);
                }
                at += m;
            }
            Ok((angles, stacked))
        };
        let shape: Vec<usize> = lead.iter().copied().chain([self.n]).collect();
        match out {
            None => new_array(py, &shape, |v| self.fill(py, inputs, v, lead.is_empty(), true)),
            Some(out) => {
                let given: Vec<&Bound<'_, PyAny>> = std::iter::once(q).chain(velocities).collect();
                self.fill(py, inputs, out_slice(SOLVE, out, &shape, &given)?, lead.is_empty(), false)?;
                Ok(out.clone())
            }
        }
    }

    /// Write the results of all rows to `v`. `private` is true if no other thread can access `v`.
    fn fill(
        &self,
        py: Python<'_>,
        inputs: impl FnOnce() -> Result<(Vec<f64>, Vec<f64>), Error> + Send,
        v: &mut [f64],
        one: bool,
        private: bool,
    ) -> Result<(), Failure> {
        if one {
            let (q, velocities) = inputs()?;
            let core = &mut *self.state();
            v.copy_from_slice(&core.solve(&q, &velocities)?.v);
            return Ok(());
        }
        let solver = self.state().clone();
        let mut fresh = if private { Vec::new() } else { memory::zeros(v.len())? };
        let target: &mut [f64] = if private { v } else { &mut fresh };
        long(py, || {
            let (q, velocities) = inputs()?;
            let mut status = memory::filled(target.len() / self.n, Status::Success)?;
            if solve_rows(&solver, &q, &velocities, target, &mut status, default_threads(), &mut signalled) {
                interrupt();
            }
            Ok(())
        })?;
        if !private {
            v.copy_from_slice(&fresh);
        }
        Ok(())
    }
}

#[entered]
#[pymethods]
impl ArmPrioritySolver {
    /// Compute joint velocities `(..., n)` at `q` `(..., n)`, rad or m, for a list with one task velocity `(..., rows_i)` per level.
    ///
    /// `out`: an array for the result. Leading axes make a batch, in which every row is equal, bit for bit, to a single solve. A row whose
    /// result overflows is NaN. A batch does not change `residuals`, `ranks` and `status`, which belong to the last single solve.
    #[arguments(q, velocities, *, out=None)]
    fn solve<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        match self.quick(py, q, velocities, out) {
            Some(answer) => Ok(answer),
            None => self.full(py, q, &items(SOLVE, "velocities", velocities)?, out),
        }
    }

    /// Return a dict with the fields of the result of `diagnose`.
    #[arguments(q, velocities=None)]
    fn _diagnose<'py>(&self) -> Result<Bound<'py, PyDict>, Failure> {
        const NAME: &str = "ArmPrioritySolver.diagnose";
        let angles = vector(NAME, "q", q, self.n)?;
        let command = match velocities {
            None => None,
            Some(velocities) => {
                let parts = items(NAME, "velocities", velocities)?;
                if parts.len() != self.rows.len() {
                    let problem = format!("has the wrong number of levels: expected {}, got {}", self.rows.len(), parts.len());
                    return Err(input_error(py, NAME, "velocities", problem).into());
                }
                let read = |(i, (part, &m)): (usize, (&Bound<'_, PyAny>, &usize))| vector(NAME, &format!("velocities[{i}]"), part, m);
                Some(parts.iter().zip(&self.rows).enumerate().map(read).collect::<Result<Vec<_>, _>>()?.concat())
            }
        };
        let d = self.state().diagnose(&angles, command.as_deref())?;
        fields(py, &d)
    }

    /// Return a `PriorityDiagnosis`: the feasible directions of each task at `q` `(n,)`, and the infeasible part of `velocities`.
    #[arguments(q, velocities=None)]
    fn diagnose<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let fields = slf.get()._diagnose(slf.py(), q, velocities)?;
        slf.py().import("armlet.priority")?.getattr("PriorityDiagnosis")?.call((), Some(&fields))
    }

    /// Return a list with the Jacobian `(rows_i, n)` of each task at `q` `(n,)`.
    fn jacobians<'py>(&self, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyList>, Failure> {
        let angles = vector(NAME, "q", q, self.n)?;
        let mut stacked = vec![0.0; self.rows.iter().sum::<usize>() * self.n];
        self.state().jacobians(&angles, &mut stacked);
        let (mut at, mut parts) = (0, Vec::with_capacity(self.rows.len()));
        for &m in &self.rows {
            parts.push(copied(py, &[m, self.n], &stacked[at * self.n..(at + m) * self.n])?);
            at += m;
        }
        Ok(PyList::new(py, parts)?)
    }

    /// Set the velocity bounds of the next solves, a number or `(n,)` each, rad/s or m/s. A solver that was made
    /// without bounds raises `InputError`.
    fn set_bounds(&self, v_min: &Bound<'_, PyAny>, v_max: &Bound<'_, PyAny>) -> Result<(), Failure> {
        let (low, high) = (per_joint(NAME, "v_min", v_min, self.n)?, per_joint(NAME, "v_max", v_max, self.n)?);
        Ok(self.state().solver_mut().set_bounds(&low, &high)?)
    }

    /// Number of joints.
    #[getter]
    fn n(&self) -> usize {
        self.n
    }

    /// Number of rows of each task.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.rows)
    }

    /// Name of the method that computes the velocities: "clamp", "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
    #[getter]
    fn method(&self) -> &'static str {
        self.state().solver().method().name()
    }

    /// Residuals `v_i - J_i v` of the last single solve, a list of `(rows_i,)` per level.
    #[getter]
    fn residuals<'py>(&self) -> Result<Bound<'py, PyList>, Failure> {
        let stacked = self.state().solver().solution().residuals.clone();
        residual_list(py, &self.rows, &stacked)
    }

    /// Number of directions of each level that the last single solve realised.
    #[getter]
    fn ranks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let ranks: Vec<i64> = self.state().solver().solution().levels.iter().map(|level| level.rank as i64).collect();
        let array = adopted(py, &[ranks.len()], ranks)?;
        array.call_method0("tolist")
    }

    /// Status of the last single solve.
    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let status = self.state().solver().solution().status;
        status_member(py, status)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let arm = self.arm.bind(py).repr()?.to_string();
        let arm = arm.lines().next().unwrap_or_default().to_string();
        Ok(format!("PrioritySolver.for_arm({arm}, {}, method='{}')", PyList::new(py, self.tasks.bind(py).iter())?.repr()?, self.method()?))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let keywords = PyDict::new(py);
        for (name, value) in &self.keywords {
            keywords.set_item(name, value)?;
        }
        let arguments = PyTuple::new(py, [self.arm.bind(py).as_any(), self.tasks.bind(py).as_any(), keywords.as_any()])?;
        seal_call(py, "_restore_arm_solver", arguments)
    }
}
