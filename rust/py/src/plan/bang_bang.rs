//! `armlet.bang_bang_time`, for one problem and for arrays of them.

use super::{LinkProblem, NAMES, again, float, part, problem, scalar, symmetric, truth};
use crate::arrays::{copied, index_of, items, new_array, require_finite, shown, signed, written_arrays};
use crate::broadcast::{Columns, columns};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::{Breaks, long};
use crate::seal::{Sealed, seal_call};
use armlet_core::error::Error;
use armlet_core::interrupt::look;
use armlet_core::memory;
use armlet_core::plan::{self, Bind as Core};
use armlet_macros::entered;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};

/// The shortest and the longest duration of the symmetric bang-bang acceleration profile, rest to rest, under torque limits.
///
/// `inertia * theta_ddot + gravity_moment sin theta = tau`, `tau_min <= tau <= tau_max`; the acceleration is `+A`, then `-A`,
/// `A = 4 |thetaf - theta0| / T^2`, and `a = inertia * A`.
///
/// Args:
///     theta0, thetaf: start and end, rad from the downward vertical; nothing wraps.
///     inertia: about the joint, kg m^2, > 0.
///     gravity_moment: `m g0 d`, N m; negative measures from the upward vertical.
///     tau_max: largest torque, N m, >= 0.
///     tau_min: least torque, N m, <= 0; `-tau_max` if None.
///
/// Returns:
///     A `BangBangReport` for numbers. Arrays broadcast, and give a `BangBangBatch` with arrays in its fields. No feasible duration is
///     an answer, not an error: `feasible` is false, the durations are NaN, and `reason` says which limit, where, by how much.
///
/// Raises:
///     InputError: a number is not finite, the inertia not positive, or the limits do not hold 0 between them.
///
/// Source: docs/minimum_time.md.
///
/// >>> import armlet as al, math
/// >>> r = al.bang_bang_time(-math.pi / 2, math.pi / 2, inertia=1.0, gravity_moment=1.5, tau_max=1.0)
/// >>> r.feasible, round(r.t_min, 6), round(r.t_max, 6)
/// (True, 3.544908, 5.013257)
/// >>> al.bang_bang_time(-math.pi / 2, math.pi / 2, 1.0, 2.5, 1.0).reason[:60]
/// 'tau_max at theta = 0.000000 rad (phase1:switch) needs a slow'
#[entered]
#[pyfunction]
#[pyo3(signature = (theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None))]
pub fn bang_bang_time<'py>(
    py: Python<'py>,
    theta0: &Bound<'py, PyAny>,
    thetaf: &Bound<'py, PyAny>,
    inertia: &Bound<'py, PyAny>,
    gravity_moment: &Bound<'py, PyAny>,
    tau_max: &Bound<'py, PyAny>,
    tau_min: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    const NAME: &str = "bang_bang_time";
    entry(py, NAME, || {
        let values = [theta0, thetaf, inertia, gravity_moment, tau_max];
        match problem(py, NAME, values, tau_min)? {
            Some(p) => Ok(Bound::new(py, BangBangReport::solve(p)?)?.into_any()),
            None => {
                // Symmetric limits borrow tau_max's array; its sign is turned below.
                let mut c = columns(
                    NAME,
                    NAMES,
                    [theta0, thetaf, inertia, gravity_moment, tau_max, tau_min.unwrap_or(tau_max)],
                    require_finite,
                    ANSWER,
                )?;
                if tau_min.is_none() {
                    let [.., most, least] = &mut c.columns;
                    let bad = long(py, || {
                        for (most, least) in most.chunks(CHUNK).zip(least.chunks_mut(CHUNK)) {
                            look();
                            if let Some(&bad) = most.iter().find(|&&x| x <= 0.0) {
                                return Ok(Some(bad));
                            }
                            least.iter_mut().for_each(|x| *x = -*x);
                        }
                        Ok(None)
                    })?;
                    bad.map_or(Ok(0.0), |bad| symmetric(py, NAME, bad))?;
                }
                Ok(Bound::new(py, BangBangBatch::solve(py, c)?)?.into_any())
            }
        }
    })
}

/// What the symmetric bang-bang profile can and cannot do: see `bang_bang_time`.
#[pyclass(frozen, module = "armlet", name = "BangBangReport")]
pub struct BangBangReport {
    core: plan::BangBangReport,
    problem: LinkProblem,
}

impl BangBangReport {
    #[inline]
    fn core([theta0, thetaf, inertia, gravity_moment, tau_max, tau_min]: LinkProblem) -> Result<plan::BangBangReport, Error> {
        plan::bang_bang_time(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max)
    }

    fn solve(problem: LinkProblem) -> Result<Self, Error> {
        Ok(BangBangReport { core: Self::core(problem)?, problem })
    }
}

impl BangBangReport {
    fn why(&self) -> String {
        if self.core.feasible { String::new() } else { self.core.reason().to_string() }
    }
}

#[entered]
#[pymethods]
impl BangBangReport {
    /// Whether some duration obeys the limits.
    #[getter]
    fn feasible(&self) -> bool {
        self.core.feasible
    }

    /// Shortest duration, s; NaN if infeasible.
    #[getter]
    fn t_min(&self) -> f64 {
        self.core.t_min
    }

    /// Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible.
    #[getter]
    fn t_max(&self) -> f64 {
        self.core.t_max
    }

    /// Least `inertia * acceleration` that the limits demand, N m.
    #[getter]
    fn a_min(&self) -> f64 {
        self.core.a_min
    }

    /// Largest `inertia * acceleration` that the limits allow, N m.
    #[getter]
    fn a_max(&self) -> f64 {
        self.core.a_max
    }

    /// Whether the torque can hold the link at rest at the start.
    #[getter]
    fn hold_start(&self) -> bool {
        self.core.hold_start
    }

    /// Whether the torque can hold the link at rest at the end.
    #[getter]
    fn hold_end(&self) -> bool {
        self.core.hold_end
    }

    /// Why no duration works: the limits, where they bind, and the missing torque; empty if feasible.
    #[getter]
    fn reason(&self) -> String {
        self.why()
    }

    /// The limit that decides `t_min`.
    #[getter]
    fn active_upper(slf: &Bound<'_, Self>) -> Bind {
        Bind { core: slf.get().core.active_upper(), owner: slf.clone().unbind(), field: "active_upper" }
    }

    /// The limit that decides `t_max`; None if the motion may be arbitrarily slow.
    #[getter]
    fn active_lower(slf: &Bound<'_, Self>) -> Option<Bind> {
        let core = slf.get().core.active_lower()?;
        Some(Bind { core, owner: slf.clone().unbind(), field: "active_lower" })
    }

    /// Torque, N m, of the motion of duration `t` (s): at its start, just before and just after the switch, and at its end.
    fn torques(&self, py: Python<'_>, t: &Bound<'_, PyAny>) -> PyResult<(f64, f64, f64, f64)> {
        entry(py, "BangBangReport.torques", || {
            let t = scalar("BangBangReport.torques", "t", t)?;
            if !(t > 0.0 && t.is_finite()) {
                return Err(input_error(
                    py,
                    "BangBangReport.torques",
                    "t",
                    format!("is not positive: expected a finite number > 0, got {}", float(t)),
                )
                .into());
            }
            Ok(self.core.torques(t).into())
        })
    }

    fn __repr__(&self) -> String {
        let c = &self.core;
        format!(
            "BangBangReport(feasible={}, t_min={}, t_max={}, a_min={}, a_max={}, hold_start={}, hold_end={}, reason={:?})",
            truth(c.feasible),
            float(c.t_min),
            float(c.t_max),
            float(c.a_min),
            float(c.a_max),
            truth(c.hold_start),
            truth(c.hold_end),
            self.why()
        )
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().problem == self.problem)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        again(py, "bang_bang_time", &self.problem)
    }
}

/// A torque limit that decides a duration: which, in which phase, where and when.
#[pyclass(frozen, module = "armlet._core", name = "Bind")]
pub struct Bind {
    core: Core,
    owner: Py<BangBangReport>,
    field: &'static str,
}

#[entered]
#[pymethods]
impl Bind {
    /// `"tau_min"` or `"tau_max"`.
    #[getter]
    fn limit(&self) -> String {
        self.core.limit.to_string()
    }

    /// 1 while accelerating, 2 while braking.
    #[getter]
    fn phase(&self) -> u8 {
        self.core.phase
    }

    /// `"start"`, `"interior"`, `"switch"` or `"end"`: where in its phase.
    #[getter]
    fn place(&self) -> String {
        self.core.place.to_string()
    }

    /// The angle where the limit is reached, rad.
    #[getter]
    fn theta(&self) -> f64 {
        self.core.theta
    }

    /// The time since the start at which it is reached, s; NaN if the motion is infeasible.
    #[getter]
    fn time(&self) -> f64 {
        self.core.time
    }

    /// Whether the other phase reaches its limit at the same duration.
    #[getter]
    fn tie(&self) -> bool {
        self.core.tie
    }

    /// `phase1:switch`.
    fn __str__(&self) -> String {
        self.core.to_string()
    }

    fn __repr__(&self) -> String {
        let c = &self.core;
        let (limit, place) = (c.limit, c.place);
        let (theta, time, tie) = (float(c.theta), float(c.time), truth(c.tie));
        format!("Bind(limit='{limit}', phase={}, place='{place}', theta={theta}, time={time}, tie={tie})", c.phase)
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            let (a, b) = (&other.get().core, &self.core);
            // The time of an infeasible motion is NaN, and equal to itself here.
            (a.limit, a.phase, a.place, a.theta, a.tie) == (b.limit, b.phase, b.place, b.theta, b.tie)
                && (a.time == b.time || a.time.is_nan() && b.time.is_nan())
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        part(py, &self.owner, self.field)
    }
}

/// The answers of `bang_bang_time` to arrays of problems: the fields of `BangBangReport` as arrays of the broadcast shape.
#[pyclass(frozen, module = "armlet", name = "BangBangBatch")]
pub struct BangBangBatch {
    problems: Columns<6>,
    #[pyo3(get)]
    feasible: Py<PyAny>,
    #[pyo3(get)]
    t_min: Py<PyAny>,
    #[pyo3(get)]
    t_max: Py<PyAny>,
    #[pyo3(get)]
    a_min: Py<PyAny>,
    #[pyo3(get)]
    a_max: Py<PyAny>,
    #[pyo3(get)]
    hold_start: Py<PyAny>,
    #[pyo3(get)]
    hold_end: Py<PyAny>,
    /// How many problems are feasible.
    solved: usize,
}

/// Problems solved between two looks at the keyboard: some milliseconds.
const CHUNK: usize = 1 << 13;

/// Bytes of an answer: four numbers, and three flags that are copied once.
const ANSWER: usize = 4 * 8 + 3 * 2;

/// The most axes of an index: those of numpy's arrays.
const MOST_AXES: usize = 64;

/// A refused problem of a batch, with its index.
fn refused(py: Python<'_>, function: &str, shape: &[usize], i: usize, error: Error) -> Failure {
    match error {
        Error::Input { argument, problem } => {
            input_error(py, function, &argument, format!("{problem} (first bad index {})", index_of(shape, i))).into()
        }
        other => other.into(),
    }
}

impl BangBangBatch {
    fn solve(py: Python<'_>, problems: Columns<6>) -> Result<Self, Failure> {
        let n = problems.count;
        let shape = &problems.shape;
        let mut flags: [Vec<bool>; 3] = [memory::filled(n, false)?, memory::filled(n, false)?, memory::filled(n, false)?];
        let column = |k: usize, start: usize, end: usize| {
            let column = &problems.columns[k];
            if column.len() == 1 { &column[..] } else { &column[start..end] }
        };
        let [t_min, t_max, a_min, a_max] = written_arrays(py, shape, |mut times| {
            let solved = long(py, || {
                for start in (0..n).step_by(CHUNK) {
                    look();
                    let end = n.min(start + CHUNK);
                    // The planner's order: the lower bound first.
                    let columns = [0, 1, 2, 3, 5, 4].map(|k| column(k, start, end));
                    let (numbers, flags) = (times.each_mut().map(|x| &mut x[start..end]), flags.each_mut().map(|x| &mut x[start..end]));
                    if let Err((i, error)) = plan::bang_bang_times(columns, plan::BangBangTimes { numbers, flags }) {
                        return Ok(Err((start + i, error)));
                    }
                }
                Ok(Ok(()))
            })?;
            solved.map_err(|(i, error)| refused(py, "bang_bang_time", shape, i, error))?;
            Ok(())
        })?
        .map(Bound::unbind);
        let solved = flags[0].iter().filter(|&&f| f).count();
        let [feasible, hold_start, hold_end] = flags;
        let flag = |x: Vec<bool>| Ok::<_, Failure>(copied(py, shape, &x)?.unbind());
        Ok(BangBangBatch {
            feasible: flag(feasible)?,
            hold_start: flag(hold_start)?,
            hold_end: flag(hold_end)?,
            t_min,
            t_max,
            a_min,
            a_max,
            solved,
            problems,
        })
    }

    /// The report of problem `i` in C order.
    fn report(&self, i: usize) -> Result<BangBangReport, Error> {
        BangBangReport::solve(self.problems.row(i))
    }
}

#[entered]
#[pymethods]
impl BangBangBatch {
    /// The shape that the arguments broadcast to.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.problems.shape)
    }

    /// Why no duration works, as in `BangBangReport.reason`: an array of strings, empty where feasible.
    #[getter]
    fn reason<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        entry(py, "BangBangBatch.reason", || {
            let numpy = py.import("numpy")?;
            let mut breaks = Breaks::new();
            let parts = (0..self.problems.count.max(1)).step_by(CHUNK).map(|first| {
                breaks.pause(py)?;
                let last = (first + CHUNK).min(self.problems.count);
                let words = (first..last).map(|i| Ok(self.report(i)?.why())).collect::<Result<Vec<_>, Error>>()?;
                Ok(numpy.call_method1("array", (words, PyString::new(py, "str")))?)
            });
            let words = numpy.call_method1("concatenate", (parts.collect::<Result<Vec<_>, Failure>>()?,))?;
            Ok(words.call_method1("reshape", (PyTuple::new(py, &self.problems.shape)?,))?)
        })
    }

    /// The report of one problem: its index in C order, or one index for each axis.
    fn __getitem__(&self, py: Python<'_>, index: &Bound<'_, PyAny>) -> PyResult<BangBangReport> {
        entry(py, "BangBangBatch", || {
            let what = "an index: expected an integer, or one for each axis";
            let parts = match index.cast::<PyTuple>() {
                Ok(parts) => items("BangBangBatch", "index", what, parts, MOST_AXES)?,
                Err(_) => vec![index.clone()],
            };
            let shape: &[usize] = if parts.len() == 1 { &[self.problems.count] } else { &self.problems.shape };
            let mut flat = Some(0).filter(|_| parts.len() == shape.len());
            for (part, &n) in parts.iter().zip(shape) {
                let i = signed(part)
                    .ok_or_else(|| input_error(py, "BangBangBatch", "index", format!("is not {what}, got {}", part.get_type())))?;
                let inside = if i < 0 { i.saturating_add_unsigned(n) } else { i };
                flat = flat.filter(|_| inside >= 0 && inside < n as isize).map(|k| k * n + inside as usize);
            }
            let outside = || PyIndexError::new_err(format!("BangBangBatch: index is out of range: expected one in shape {}", shown(shape)));
            Ok(self.report(flat.ok_or_else(outside)?)?)
        })
    }

    fn __repr__(&self) -> String {
        format!("BangBangBatch({} problems of shape {}, {} feasible)", self.problems.count, shown(&self.problems.shape), self.solved)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let shape = &self.problems.shape;
        let mut kept = Vec::new();
        for (k, column) in self.problems.columns.iter().enumerate() {
            // The first column carries the shape, the others only their numbers.
            let full = k == 0 || column.len() != 1;
            let axes: &[usize] = if full { shape } else { &[] };
            let fill = |out: &mut [f64]| {
                if column.len() == out.len() {
                    out.copy_from_slice(column)
                } else {
                    out.fill(column[0])
                }
                Ok(())
            };
            kept.push(entry(py, "BangBangBatch", || new_array(py, axes, fill))?);
        }
        seal_call(py, "_restore_plan", ("bang_bang_time", PyTuple::new(py, kept)?).into_pyobject(py)?)
    }
}
