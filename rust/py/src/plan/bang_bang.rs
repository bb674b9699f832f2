//! `armlet.bang_bang_time`: the feasible durations of the symmetric bang-bang profile, for numbers and for arrays of problems.

use super::bang_bang_batch::{ANSWER, BangBangBatch, CHUNK};
use super::{LinkProblem, NAMES, again, float, link_report, part, problem, scalar, symmetric, truth};
use crate::arrays::require_finite;
use crate::broadcast::columns;
use crate::errors::{entry, input_error};
use crate::interrupts::long;
use crate::seal::Sealed;
use armlet_core::error::Error;
use armlet_core::interrupt::look;
use armlet_core::plan::{self, Bind as Core};
use armlet_macros::entered;
use pyo3::prelude::*;

/// The shortest and the longest duration of a rest-to-rest motion with the symmetric bang-bang acceleration, under torque limits.
///
/// The link is `inertia * theta_ddot + gravity_moment sin theta = tau` with `tau_min <= tau <= tau_max`. For the first half of the duration
/// `T` the acceleration towards `thetaf` is `A = 4 |thetaf - theta0| / T^2`. For the second half it is `-A`.
///
/// Args:
///     theta0, thetaf: start and end, rad from the downward vertical. Angles beyond +-pi are not wrapped.
///     inertia: inertia about the joint, kg m^2, > 0.
///     gravity_moment: mass times gravity times distance of the centre of mass, N m. With a negative value, the angles are measured from
///         the upward vertical.
///     tau_max: largest torque, N m, >= 0; > 0 if `tau_min` is None.
///     tau_min: smallest torque, N m, <= 0; `-tau_max` if None (keyword only).
///
/// Returns:
///     A `BangBangReport` for numbers. Arrays broadcast, and return a `BangBangBatch` whose fields are arrays. If no duration is feasible,
///     `feasible` is false, the durations are NaN, and `reason` states the limit, its place and the missing torque. This is not an error.
///
/// Raises:
///     InputError: a number is not finite, the inertia is not positive, or the torque limits are out of range.
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
                // Without `tau_min`, this column is a copy of `tau_max`, whose sign is changed below.
                let mut c = columns(
                    NAME,
                    NAMES,
                    [theta0, thetaf, inertia, gravity_moment, tau_max, tau_min.unwrap_or(tau_max)],
                    require_finite,
                    ANSWER,
                )?;
                if tau_min.is_none() {
                    let (most, least) = c.last_two();
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

/// The feasible durations of the symmetric bang-bang profile, from `bang_bang_time`.
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

    pub(super) fn solve(problem: LinkProblem) -> Result<Self, Error> {
        Ok(BangBangReport { core: Self::core(problem)?, problem })
    }
}

impl BangBangReport {
    pub(super) fn why(&self) -> String {
        if self.core.feasible { String::new() } else { self.core.reason().to_string() }
    }
}

link_report!(BangBangReport);

#[entered]
#[pymethods]
impl BangBangReport {
    /// The smallest `inertia * A` that the limits allow, N m; `A` is the magnitude of the acceleration.
    #[getter]
    fn a_min(&self) -> f64 {
        self.core.a_min
    }

    /// The largest `inertia * A` that the limits allow, N m; `A` is the magnitude of the acceleration.
    #[getter]
    fn a_max(&self) -> f64 {
        self.core.a_max
    }

    /// The reason why no duration is feasible: the limits, their places, and the missing torque. It is empty if a duration is feasible.
    #[getter]
    fn reason(&self) -> String {
        self.why()
    }

    /// The torque limit that decides `t_min`.
    #[getter]
    fn active_upper(slf: &Bound<'_, Self>) -> Bind {
        Bind { core: slf.get().core.active_upper(), owner: slf.clone().unbind(), field: "active_upper" }
    }

    /// The torque limit that decides `t_max`; None if the motion may be arbitrarily slow.
    #[getter]
    fn active_lower(slf: &Bound<'_, Self>) -> Option<Bind> {
        let core = slf.get().core.active_lower()?;
        Some(Bind { core, owner: slf.clone().unbind(), field: "active_lower" })
    }

    /// Four torques, N m, of the motion of duration `t` in s: at its start, just before and after the switch, and at its end.
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

/// A torque limit that decides a duration, and the phase, the place and the time at which the torque reaches it.
#[pyclass(frozen, module = "armlet._core", name = "Bind")]
pub struct Bind {
    core: Core,
    owner: Py<BangBangReport>,
    field: &'static str,
}

#[entered]
#[pymethods]
impl Bind {
    /// The name of the limit: `"tau_min"` or `"tau_max"`.
    #[getter]
    fn limit(&self) -> String {
        self.core.limit.to_string()
    }

    /// The phase of the motion: 1 while accelerating, 2 while braking.
    #[getter]
    fn phase(&self) -> u8 {
        self.core.phase
    }

    /// The place in its phase: `"start"`, `"interior"`, `"switch"` or `"end"`.
    #[getter]
    fn place(&self) -> String {
        self.core.place.to_string()
    }

    /// The angle, rad, at which the torque reaches the limit.
    #[getter]
    fn theta(&self) -> f64 {
        self.core.theta
    }

    /// The time since the start, s, at which the torque reaches the limit; NaN if the motion is infeasible.
    #[getter]
    fn time(&self) -> f64 {
        self.core.time
    }

    /// Whether the other phase reaches its limit at the same duration.
    #[getter]
    fn tie(&self) -> bool {
        self.core.tie
    }

    /// The phase and the place as text, such as `phase1:switch`.
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
            // Two NaN times, of infeasible motions, are equal here.
            (a.limit, a.phase, a.place, a.theta, a.tie) == (b.limit, b.phase, b.place, b.theta, b.tie)
                && (a.time == b.time || a.time.is_nan() && b.time.is_nan())
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        part(py, &self.owner, self.field)
    }
}
