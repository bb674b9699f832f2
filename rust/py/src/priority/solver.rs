//! `armlet.PrioritySolver`: its constructor allocates buffers, so that a solve allocates nothing in the core.

use super::arm_solver::{ArmPrioritySolver, for_arm};
use super::single::Memory;
use super::solution::{PrioritySolution, residual_list, status_member};
use super::stack::{Keywords, Stack, items, method_name, per_joint, require_size};
use super::within::Targets;
use crate::arrays::{self, copied, count, new_vector, nonnegative_integer, number, of_shape, optional_number, out_slice, shown};
use crate::errors::{Failure, input_error};
use crate::seal::{Sealed, seal_new};
use crate::task::MOST_LEVELS;
use armlet_core::priority::{DEFAULT_ROUNDING, PriorityOptions, PrioritySolver as Core};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

struct State {
    core: Core,
    options: PriorityOptions,
}

/// A solver of joint velocities for tasks with priorities, which reuses its buffers for stacks of equal sizes.
///
/// Args:
///     n: number of joints.
///     rows: number of rows of each level, the highest priority first.
///     method, eps, rounding, weight, v_min, v_max, scale: as for `solve_priority` (keyword only).
///
/// Raises:
///     InputError: `n` is not positive, a number of rows is negative, a shape does not fit, or the method is unknown. It is also raised
///         for "sns" without bounds, and for an option out of its range.
///
/// Source: [siciliano1991priority]; docs/priority.md.
///
/// >>> import armlet as al
/// >>> solver = al.PrioritySolver(2, [1, 1], method="exact")
/// >>> solver.solve([[[1.0, 0.0]], [[1.0, 1.0]]], [[1.0], [3.0]]).round(12)
/// array([1., 2.])
/// >>> solver.ranks
/// [1, 1]
#[pyclass(frozen, module = "armlet")]
pub struct PrioritySolver {
    n: usize,
    counts: Vec<usize>,
    // No Python code runs while this lock is held: `solve` reads its inputs and makes its arrays before it takes the lock.
    state: Mutex<State>,
}

/// Positional and keyword arguments of the constructor.
type Arguments<'py> = ((usize, Vec<usize>), Bound<'py, PyDict>);

const SOLVE: &str = "PrioritySolver.solve";

/// The names of the arguments of a stack.
const NAMES: [&str; 2] = ["jacobians", "velocities"];

impl PrioritySolver {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Append slices of the arrays, one Jacobian and two bounds per level, to `out`. The result is false unless all are contiguous float64 arrays of the right shape.
    fn borrowed<'a>(&self, jacobians: &'a [Bound<'_, PyAny>], targets: &'a Targets<'_>, out: &mut Vec<[&'a [f64]; 3]>) -> bool {
        self.counts.iter().zip(jacobians).enumerate().all(|(i, (m, jacobian))| {
            match (of_shape(jacobian, &[*m, self.n]), targets.in_place(i, *m)) {
                (Some(jacobian), Some([lower, upper])) => {
                    out.push([jacobian, lower, upper]);
                    true
                }
                _ => false,
            }
        })
    }

    fn run(&self, levels: &[[&[f64]; 3]], intervals: &[bool], out: &mut [f64]) -> Result<(), Failure> {
        let State { core, options } = &mut *self.state();
        // Comparing two empty lists would read a masked vector at an invalid address, which takes 100 ns on some processors.
        let both_empty = options.intervals.is_empty() && intervals.is_empty();
        if !both_empty && options.intervals != intervals {
            // The levels with bounds have changed, and with them the sizes of the solver.
            let changed = PriorityOptions { intervals: intervals.to_vec(), ..options.clone() };
            *core = Core::new(self.n, &self.counts, &changed)?;
            core.keep_active_set();
            *options = changed;
        }
        let (mut at, mut to) = (0, 0);
        for [j, v, u] in levels {
            let (jacobian, command) = core.inputs();
            jacobian[at..at + j.len()].copy_from_slice(j);
            command[to..to + v.len()].copy_from_slice(v);
            if !intervals.is_empty() {
                core.upper()[to..to + u.len()].copy_from_slice(u);
            }
            at += j.len();
            to += v.len();
        }
        core.used();
        out.copy_from_slice(&core.run()?.v);
        Ok(())
    }
}

#[entered]
#[pymethods]
impl PrioritySolver {
    #[new]
    #[arguments(n, rows, *, method="clamp", eps=None, rounding=None, weight=None, v_min=None, v_max=None, scale=None)]
    fn new() -> Result<Self, Failure> {
        let (n, rows) = (count(NAME, "n", n)?, row_counts(NAME, rows)?);
        require_size(py, NAME, n, &rows)?;
        let (method, rounding) = (method_name(NAME, method)?, optional_number(NAME, "rounding", rounding)?);
        let options = Keywords { method, eps, rounding, weight, v_min, v_max, scale }.options(NAME, n, rows.len())?;
        let mut core = Core::new(n, &rows, &options)?;
        core.keep_active_set();
        Ok(PrioritySolver { n, counts: rows, state: Mutex::new(State { core, options }) })
    }

    /// Make a solver for tasks of an arm. Its `solve(q, velocities)` takes joint positions instead of Jacobians.
    ///
    /// Args:
    ///     arm: the arm; not `planar_pr`, which has no links.
    ///     tasks: `Task` and other tasks, the highest priority first. Their targets and gains are not used.
    ///     method, eps, weight, v_min, v_max, scale: as for `solve_priority` (keyword only). The bounds of "sns" default to the arm's bounds.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
    /// >>> solver = al.PrioritySolver.for_arm(arm, [al.Task("link4", "xy"), al.Task("link2", "xy")], method="exact")
    /// >>> solver.solve([0.0, 1.5707963267948966, 1.5707963267948966, 0.0], [[1.0, 1.0], [1.0, 1.0]]).round(12)
    /// array([ 1. , -2. ,  0.8,  0.4])
    #[staticmethod]
    #[arguments(arm, tasks, *, method="clamp", eps=None, weight=None, v_min=None, v_max=None, scale=None)]
    fn for_arm() -> Result<ArmPrioritySolver, Failure> {
        let method = method_name(NAME, method)?;
        for_arm(arm, tasks, Keywords { method, eps, rounding: None, weight, v_min, v_max, scale })
    }

    /// Compute joint velocities `(n,)`, rad/s or m/s, from lists with one Jacobian `(rows_i, n)` and one task velocity `(rows_i,)` per
    /// level. `Within(lower, upper)` bounds a level in place of its velocity.
    ///
    /// The active set of the last solve is tried first. `out`: an array for the result.
    #[arguments(jacobians, velocities, *, out=None)]
    fn solve<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let (jacobians, velocities) = (items(SOLVE, "jacobians", jacobians)?, items(SOLVE, "velocities", velocities)?);
        let count = self.counts.len();
        for (name, got) in [("jacobians", jacobians.len()), ("velocities", velocities.len())] {
            if got != count {
                let problem = format!("has the wrong number of levels: expected {count}, got {got}");
                return Err(input_error(py, SOLVE, name, problem).into());
            }
        }
        let (targets, mut levels) = (Targets::new(velocities), Vec::with_capacity(count));
        let (stack, above);
        if !self.borrowed(&jacobians, &targets, &mut levels) {
            stack = Stack::read(py, SOLVE, NAMES, &jacobians, Some(&targets.lower))?;
            above = if targets.upper.is_empty() { None } else { Some(Stack::read(py, SOLVE, NAMES, &jacobians, Some(&targets.upper))?) };
            if stack.n != self.n || stack.rows != self.counts || !stack.lead.is_empty() {
                let i = (0..count).find(|&i| stack.rows[i] != self.counts[i]).unwrap_or(0);
                let got: Vec<usize> = stack.lead.iter().copied().chain([stack.rows[i], stack.n]).collect();
                let problem = format!("has the wrong shape: expected {}, got {}", shown(&[self.counts[i], self.n]), shown(&got));
                return Err(input_error(py, SOLVE, &format!("jacobians[{i}]"), problem).into());
            }
            levels.clear();
            levels
                .extend((0..count).map(|i| [stack.jacobian(i, 0), stack.velocity(i, 0), above.as_ref().unwrap_or(&stack).velocity(i, 0)]));
        }
        let answer = match out {
            None => new_vector(py, self.n, |v| self.run(&levels, &targets.intervals, v)),
            Some(out) => {
                let inputs: Vec<&Bound<'_, PyAny>> = jacobians.iter().chain(&targets.lower).chain(&targets.upper).collect();
                let v = out_slice(SOLVE, out, &[self.n], &inputs)?;
                self.run(&levels, &targets.intervals, v).map(|()| out.clone())
            }
        };
        answer.map_err(|failure| {
            // If an entry is not finite, the error names its index in the caller's array.
            Stack::read(py, SOLVE, NAMES, &jacobians, Some(&targets.lower))
                .and_then(|mut stack| {
                    stack.intervals.clone_from(&targets.intervals);
                    stack.require_finite(py, SOLVE)
                })
                .err()
                .unwrap_or(failure)
        })
    }

    /// Set the relative error of the entries of the next Jacobians. For Jacobians computed from joint angles, use `8 eps (1 + sum|q|)`.
    ///
    /// Here `eps` is the machine epsilon.
    fn set_rounding(&self, rounding: &Bound<'_, PyAny>) -> Result<(), Failure> {
        let rounding = number(NAME, "rounding", rounding)?;
        let state = &mut *self.state();
        state.core.set_rounding(rounding)?;
        state.options.rounding = Some(rounding);
        Ok(())
    }

    /// Set the velocity bounds of the next solves, a number or `(n,)` each, rad/s or m/s. A solver that was made
    /// without bounds raises `InputError`.
    fn set_bounds(&self, v_min: &Bound<'_, PyAny>, v_max: &Bound<'_, PyAny>) -> Result<(), Failure> {
        let (low, high) = (per_joint(NAME, "v_min", v_min, self.n)?, per_joint(NAME, "v_max", v_max, self.n)?);
        let state = &mut *self.state();
        state.core.set_bounds(&low, &high)?;
        (state.options.v_min, state.options.v_max) = (Some(low), Some(high));
        Ok(())
    }

    /// Number of joints.
    #[getter]
    fn n(&self) -> usize {
        self.n
    }

    /// Number of rows of each level, the highest priority first.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.counts)
    }

    /// Name of the method that computes the velocities: "clamp", "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
    #[getter]
    fn method(&self) -> &'static str {
        self.state().core.method().name()
    }

    /// Result of the last solve, a `PrioritySolution`: its violations, active rows, certificate and reasons.
    #[getter]
    fn solution(&self) -> PrioritySolution {
        let State { core, options } = &*self.state();
        PrioritySolution::of(core, core.rows().into(), Arc::new(options.clone()), &mut Memory::default())
    }

    /// Residuals `v_i - J_i v` of the last solve, a list of `(rows_i,)` per level.
    #[getter]
    fn residuals<'py>(&self) -> Result<Bound<'py, PyList>, Failure> {
        let stacked = self.state().core.solution().residuals.clone();
        residual_list(py, &self.counts, &stacked)
    }

    /// Number of directions of each level that the last solve realised.
    #[getter]
    fn ranks(&self) -> Vec<usize> {
        self.state().core.solution().ranks()
    }

    /// Scale of each level's command in the last solve, `(levels,)`; 1 except for "sns" and `scale="direction"`.
    #[getter]
    fn scales<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let scales = self.state().core.solution().scales();
        copied(py, &[scales.len()], &scales)
    }

    /// Status of the last solve.
    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let status = self.state().core.solution().status;
        status_member(py, status)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("PrioritySolver({}, {}, method={:?})", self.n, PyList::new(py, &self.counts)?.repr()?, self.method()?))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<Arguments<'py>> {
        let options = self.state().options.clone();
        let (n, keywords) = (self.n, PyDict::new(py));
        keywords.set_item("method", options.method.name())?;
        keywords.set_item("eps", options.eps)?;
        keywords.set_item("rounding", options.rounding.unwrap_or(DEFAULT_ROUNDING))?;
        keywords.set_item("weight", options.weight.map(|w| w.chunks(n).map(<[f64]>::to_vec).collect::<Vec<_>>()))?;
        keywords.set_item("v_min", options.v_min)?;
        keywords.set_item("v_max", options.v_max)?;
        if options.keep_direction {
            keywords.set_item("scale", "direction")?;
        }
        Ok(((n, self.counts.clone()), keywords))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Sealed<'py>> {
        seal_new(slf.as_any())
    }
}

/// Restore a pickled `ArmPrioritySolver`.
#[entered]
#[pyfunction]
pub fn _restore_arm_solver(
    py: Python<'_>,
    arm: &Bound<'_, PyAny>,
    tasks: &Bound<'_, PyAny>,
    keywords: &Bound<'_, PyDict>,
) -> PyResult<Py<PyAny>> {
    let class = py.get_type::<PrioritySolver>();
    Ok(class.call_method("for_arm", (arm, tasks), Some(keywords))?.unbind())
}

/// Read the number of rows of each level: integers that are at least zero.
fn row_counts(function: &str, rows: &Bound<'_, PyAny>) -> Result<Vec<usize>, Failure> {
    let what = "a list of sizes: expected integers >= 0, one per level";
    let sizes = arrays::items(function, "rows", what, rows, MOST_LEVELS)?;
    sizes
        .iter()
        .map(|size| {
            nonnegative_integer(function, "rows", size)
                .map_err(|_| input_error(rows.py(), function, "rows", format!("is not {what}, got {size}")).into())
        })
        .collect()
}
