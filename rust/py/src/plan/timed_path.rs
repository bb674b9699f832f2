//! `armlet.TimedPath`: the motion that `armlet.time_path` returns, and its pickle.

use crate::arrays::{WHATEVER, copied, items, numbers, owned};
use crate::errors::{Failure, entry, input_error};
use crate::motion::{Motion, Triple, rows};
use crate::properties::properties;
use crate::seal::{Sealed, seal_call};
use armlet_core::error::Error;
use armlet_core::motion::{Motion as Core, Path, TimedPath as CorePath};
use armlet_core::plan::TimePath;
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

/// The reason why a path has no timing.
#[derive(Clone, Debug, PartialEq)]
struct Why {
    text: String,
    joint: Option<usize>,
    joint_name: String,
    s: f64,
    limit: String,
    missing: f64,
    missing_units: f64,
}

/// The timing of a path, from `time_path`: a motion whose call `p(t)` returns `q, v, a`.
///
/// Between the points of a grid, the path acceleration is linear in `s`. For a motion with `torque_rate` it is linear in time. The motion
/// rests at the start before time 0, and at the end after `duration`.
#[pyclass(frozen, extends = Motion, module = "armlet")]
pub struct TimedPath {
    core: CorePath,
    margin: f64,
    why: Option<Why>,
}

impl TimedPath {
    /// Convert the result of the planner to a Python object.
    pub fn answer(answer: TimePath) -> PyClassInitializer<Self> {
        let why = answer.reason.map(|reason| Why {
            text: reason.to_string(),
            joint: reason.joint,
            joint_name: reason.joint_name.clone(),
            s: reason.s,
            limit: reason.limit.name().to_string(),
            missing: reason.missing,
            missing_units: reason.missing_units,
        });
        TimedPath::of(answer.motion, answer.margin, why)
    }

    fn of(core: CorePath, margin: f64, why: Option<Why>) -> PyClassInitializer<Self> {
        let motion = Motion::new(Core::TimedPath(core.clone()), Vec::new());
        PyClassInitializer::from(motion).add_subclass(TimedPath { core, margin, why })
    }

    fn require(&self) -> Result<(), Failure> {
        match &self.why {
            None => Ok(()),
            Some(why) => {
                Err(Error::Solve { status: Status::Infeasible, t: 0.0, problem: format!("the path has no timing: {}", why.text) }.into())
            }
        }
    }
}

fn array<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    entry(py, "TimedPath", || copied(py, &[values.len()], values))
}

properties!(TimedPath {
    /// Duration, s; NaN without a timing.
    duration: f64 = |path| path.core.duration();
    /// Whether the limits allow a timing.
    feasible: bool = |path| path.why.is_none();
    /// The smallest relative distance to a limit, on ten points per grid segment. It is at least -1e-9, and NaN without a timing.
    margin: f64 = |path| path.margin;
    /// The reason for an infeasible path: the joint, the path position, the limit, and the missing amount. None if there is a timing.
    reason: Option<&str> = |path| path.why.as_ref().map(|why| why.text.as_str());
    /// Path positions of the grid, `(N + 1,)`.
    s: PyResult<Bound<'py, PyAny>> = |path, py| array(py, path.core.grid());
    /// Path speed ds/dt at the grid points, 1/s, `(N + 1,)`.
    s_dot: PyResult<Bound<'py, PyAny>> = |path, py| array(py, &path.core.squared_speeds().iter().map(|x| x.sqrt()).collect::<Vec<f64>>());
    /// Times of the grid points, s, `(N + 1,)`.
    t: PyResult<Bound<'py, PyAny>> = |path, py| array(py, path.core.times());
});

#[entered]
#[pymethods]
impl TimedPath {
    /// Compute `q, v, a` at the time `t` in s: each `(n,)` for a number, and `(..., n)` for an array of times.
    ///
    /// Raises:
    ///     InputError: a time is not finite.
    ///     SolveError: the path has no timing.
    fn __call__<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Triple<'py>, Failure> {
        const NAME: &str = "TimedPath";
        self.require()?;
        rows(self.core.dof(), NAME, "t", t, |_, t, row| {
            self.core.sample(t, row);
            Ok(())
        })
    }

    /// Compute the path `q` and its derivatives `dq/ds`, `d2q/ds2` at path positions `s`: each `(n,)` for a number, `(..., n)` for an
    /// array.
    ///
    /// Raises:
    ///     InputError: a position is not finite, or not on the path.
    fn path<'py>(&self, s: &Bound<'py, PyAny>) -> Result<Triple<'py>, Failure> {
        let path = self.core.path();
        let (n, knots) = (path.dof(), path.knots());
        let (first, last) = (knots[0], knots[knots.len() - 1]);
        rows(n, NAME, "s", s, |k, s, row| {
            if !(first..=last).contains(&s) {
                return Err(Error::input("s", format!("is not on the path: expected {first} to {last} (first bad index {k})")));
            }
            path.evaluate(path.piece(s), s, |j, values| [row[j], row[n + j], row[2 * n + j]] = values);
            Ok(())
        })
    }

    /// The reason for an infeasible path as a dict; None if there is a timing.
    ///
    /// The keys are `joint`, `joint_name`, `s`, `limit`, `missing` (relative), and `missing_units` (in N m, rad/s^2, ..). For limits of a
    /// frame, `joint` is None and `joint_name` is the frame's name. For position limits, `missing` is relative to their range.
    #[getter]
    fn shortfall<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(why) = &self.why else { return Ok(None) };
        let all = PyDict::new(py);
        all.set_item("joint", why.joint)?;
        all.set_item("joint_name", &why.joint_name)?;
        all.set_item("s", why.s)?;
        all.set_item("limit", &why.limit)?;
        all.set_item("missing", why.missing)?;
        all.set_item("missing_units", why.missing_units)?;
        Ok(Some(all))
    }

    fn __repr__(&self) -> String {
        let points = self.core.grid().len();
        match &self.why {
            None => {
                format!("TimedPath(n={}, duration={:?}, margin={:.3e}, grid={points})", self.core.dof(), self.core.duration(), self.margin)
            }
            Some(why) => format!("TimedPath(n={}, reason={:?})", self.core.dof(), why.text),
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let path = self.core.path();
        let core = &self.core;
        let timing = [core.grid(), core.squared_speeds(), core.acceleration_slopes(), core.times(), core.node_accelerations()];
        let numbers = [path.knots(), path.coefficients(), path.ends().1].into_iter().chain(timing);
        let arrays = numbers.map(|values| array(py, values)).collect::<PyResult<Vec<_>>>()?;
        let why = self.why.as_ref().map(|w| (&w.text, w.joint, &w.joint_name, w.s, &w.limit, w.missing, w.missing_units));
        seal_call(py, "_restore_time_path", (PyTuple::new(py, arrays)?, self.margin, why).into_pyobject(py)?)
    }
}

type PickledReason = (String, Option<usize>, String, f64, String, f64, f64);

/// Restore a `TimedPath` from the content of its pickle.
#[entered]
#[pyfunction]
pub fn _restore_time_path<'py>(
    parts: &Bound<'py, PyAny>,
    margin: f64,
    why: Option<PickledReason>,
) -> Result<Bound<'py, TimedPath>, Failure> {
    let mut arrays = Vec::new();
    for part in &items(NAME, "parts", "a list: expected eight arrays", parts, 8)? {
        arrays.push(owned(numbers(NAME, "parts", part, &[WHATEVER])?.1)?);
    }
    let [knots, coefficients, end, s, x, u_slope, t, u] =
        <[Vec<f64>; 8]>::try_from(arrays).map_err(|_| input_error(py, NAME, "parts", "has the wrong length: expected eight arrays"))?;
    let path = Arc::new(Path::from_parts(knots, coefficients, end)?);
    let core = if x.iter().all(|x| x.is_infinite()) {
        CorePath::still(path)
    } else if u.is_empty() {
        CorePath::new(path, s, x, u_slope)?
    } else {
        CorePath::cubic(path, t, s, x, u)?
    };
    let why = why.map(|(text, joint, joint_name, s, limit, missing, missing_units)| Why {
        text,
        joint,
        joint_name,
        s,
        limit,
        missing,
        missing_units,
    });
    Ok(Bound::new(py, TimedPath::of(core, margin, why))?)
}
