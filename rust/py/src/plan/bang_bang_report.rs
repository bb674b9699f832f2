//! The results of `armlet.bang_bang_time` for one problem: `BangBangReport` and `Bind`.

use super::link::{LinkProblem, float, link_report, part, pickled_call, scalar, truth};
use crate::errors::{Failure, input_error};
use crate::properties::properties;
use crate::seal::Sealed;
use armlet_core::error::Error;
use armlet_core::plan::{self, Bind as Core};
use armlet_macros::entered;
use pyo3::prelude::*;

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

properties!(BangBangReport {
    /// The smallest `inertia * A` that the limits allow, N m; `A` is the magnitude of the acceleration. If no duration is feasible, `a_max`
    /// is below `a_min`, or not positive.
    a_min: f64;
    /// The largest `inertia * A` that the limits allow, N m; `A` is the magnitude of the acceleration.
    a_max: f64;
    /// The reason why no duration is feasible: the limits, their places, and the missing torque. It is empty if a duration is feasible.
    reason: String = |report| report.why();
});

#[entered]
#[pymethods]
impl BangBangReport {
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
    fn torques(&self, t: &Bound<'_, PyAny>) -> Result<(f64, f64, f64, f64), Failure> {
        let t = scalar(NAME, "t", t)?;
        if !(t > 0.0 && t.is_finite()) {
            return Err(input_error(py, NAME, "t", format!("is not positive: expected a finite number > 0, got {}", float(t))).into());
        }
        Ok(self.core.torques(t).into())
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
        pickled_call(py, "bang_bang_time", &self.problem)
    }
}

/// A torque limit that decides a duration, and the phase, the place and the time at which the torque reaches it.
#[pyclass(frozen, module = "armlet._core", name = "Bind")]
pub struct Bind {
    core: Core,
    owner: Py<BangBangReport>,
    field: &'static str,
}

properties!(Bind {
    /// The name of the limit: `"tau_min"` or `"tau_max"`.
    limit: String = |report| report.core.limit.to_string();
    /// The phase of the motion: 1 while accelerating, 2 while braking.
    phase: u8;
    /// The place in its phase: `"start"`, `"interior"`, `"switch"` or `"end"`.
    place: String = |report| report.core.place.to_string();
    /// The angle, rad, at which the torque reaches the limit.
    theta: f64;
    /// The time since the start, s, at which the torque reaches the limit; NaN if the motion is infeasible.
    time: f64;
    /// Whether the other phase reaches its limit at the same duration.
    tie: bool;
});

#[entered]
#[pymethods]
impl Bind {
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
