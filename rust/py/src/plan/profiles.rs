//! `armlet.trapezoid_time` and `armlet.minimum_jerk_time`: the feasible durations of two rest-to-rest profiles.

use super::link::{LinkProblem, float, link_report, pickled_call, scalar, single, truth};
use crate::errors::Failure;
use crate::properties::properties;
use crate::seal::Sealed;
use armlet_core::error::Error;
use armlet_core::plan;
use armlet_macros::entered;
use pyo3::prelude::*;

/// The shortest and the longest duration of a rest-to-rest motion with a trapezoidal speed profile, under torque limits.
///
/// The link accelerates for `ramp * T`, moves with constant speed, and brakes for `ramp * T`, where `T` is the duration. With `ramp = 1/2`
/// it is the profile of `bang_bang_time`. While the speed is constant, the torque balances gravity.
///
/// Args:
///     theta0, thetaf, inertia, gravity_moment, tau_max, tau_min: as for `bang_bang_time`, but numbers only.
///     ramp: duration of the acceleration as a fraction of `T`, in (0, 1/2]; 1/3 if None (keyword only).
///
/// Returns:
///     A `ProfileReport` of the trapezoid.
///
/// Raises:
///     InputError: a number is not finite, or outside its range.
///
/// Source: docs/minimum_time.md.
///
/// >>> import armlet as al
/// >>> r = al.trapezoid_time(0.0, 1.0, 1.0, 0.5, 1.0, ramp=0.25)
/// >>> r.feasible, round(r.t_min, 4)
/// (True, 2.4116)
#[entered]
#[pyfunction]
#[arguments(theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None, ramp=None)]
pub fn trapezoid_time() -> Result<ProfileReport, Failure> {
    let problem = single(py, NAME, [theta0, thetaf, inertia, gravity_moment, tau_max], tau_min)?;
    let ramp = ramp.map_or(Ok(1.0 / 3.0), |ramp| scalar(NAME, "ramp", ramp))?;
    Ok(ProfileReport::solve(problem, Some(ramp))?)
}

/// The shortest and the longest duration of the minimum-jerk motion, rest to rest, under torque limits.
///
/// `theta = theta0 + (thetaf - theta0) (10 u^3 - 15 u^4 + 6 u^5)` with `u = t/T`, so the acceleration at both ends is zero.
///
/// Args:
///     theta0, thetaf, inertia, gravity_moment, tau_max, tau_min: as for `bang_bang_time`, but numbers only.
///
/// Returns:
///     A `ProfileReport` of the quintic.
///
/// Raises:
///     InputError: a number is not finite, or outside its range.
///
/// Source: docs/minimum_time.md.
///
/// >>> import armlet as al
/// >>> r = al.minimum_jerk_time(0.0, 1.0, 1.0, 0.0, 1.0)
/// >>> r.feasible, round(r.t_min**2, 6)
/// (True, 5.773503)
#[entered]
#[pyfunction]
#[arguments(theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None)]
pub fn minimum_jerk_time() -> Result<ProfileReport, Failure> {
    let problem = single(py, NAME, [theta0, thetaf, inertia, gravity_moment, tau_max], tau_min)?;
    Ok(ProfileReport::solve(problem, None)?)
}

/// The feasible durations of a trapezoidal or minimum-jerk motion, from `trapezoid_time` or `minimum_jerk_time`.
#[pyclass(frozen, module = "armlet", name = "ProfileReport")]
pub struct ProfileReport {
    core: plan::ProfileReport,
    problem: LinkProblem,
    /// The argument `ramp` of a trapezoidal motion; None for minimum jerk.
    ramp: Option<f64>,
}

impl ProfileReport {
    pub fn solve(problem: LinkProblem, ramp: Option<f64>) -> Result<Self, Error> {
        let [theta0, thetaf, inertia, gravity_moment, tau_max, tau_min] = problem;
        let core = match ramp {
            Some(ramp) => plan::trapezoid_time(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max, ramp)?,
            None => plan::minimum_jerk_time(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max)?,
        };
        Ok(ProfileReport { core, problem, ramp })
    }

    fn why(&self) -> String {
        if self.core.feasible {
            return String::new();
        }
        format!("no duration keeps the torque between tau_min and tau_max: {:.6e} N m are missing on each side", self.core.missing)
    }
}

link_report!(ProfileReport);

properties!(ProfileReport {
    /// The smallest `inertia * |thetaf - theta0| / T^2` that the limits allow, N m.
    k_min: f64;
    /// The largest `inertia * |thetaf - theta0| / T^2` that the limits allow, N m.
    k_max: f64;
    /// The angle, rad, at which the torque reaches the limit that decides `t_min`.
    theta_upper: f64;
    /// The angle, rad, at which the torque reaches the limit that decides `t_max`; NaN if no limit decides it.
    theta_lower: f64;
    /// The torque, N m, by which both limits must be widened to make a duration feasible; 0 if a duration is feasible.
    missing: f64;
    /// The reason why no duration is feasible, with the missing torque. It is empty if a duration is feasible.
    reason: String = |report| report.why();
});

#[entered]
#[pymethods]
impl ProfileReport {
    fn __repr__(&self) -> String {
        let c = &self.core;
        format!(
            "ProfileReport(feasible={}, t_min={}, t_max={}, k_min={}, k_max={}, hold_start={}, hold_end={}, reason={:?})",
            truth(c.feasible),
            float(c.t_min),
            float(c.t_max),
            float(c.k_min),
            float(c.k_max),
            truth(c.hold_start),
            truth(c.hold_end),
            self.why()
        )
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().problem == self.problem && other.get().ramp == self.ramp)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let mut all = self.problem.to_vec();
        all.extend(self.ramp);
        pickled_call(py, if self.ramp.is_some() { "trapezoid_time" } else { "minimum_jerk_time" }, &all)
    }
}
