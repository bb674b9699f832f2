//! `armlet.trapezoid_time` and `armlet.minimum_jerk_time`.

use super::{LinkProblem, again, float, link_report, scalar, single, truth};
use crate::errors::entry;
use crate::seal::Sealed;
use armlet_core::error::Error;
use armlet_core::plan;
use armlet_macros::entered;
use pyo3::prelude::*;

/// The shortest and the longest duration of the trapezoidal-speed motion, rest to rest, under torque limits.
///
/// Acceleration for `ramp * T`, constant speed, braking for `ramp * T`; `ramp = 1/2` is the profile of `bang_bang_time`. While the speed is
/// constant, the torque balances gravity.
///
/// Args:
///     theta0, thetaf, inertia, gravity_moment, tau_max, tau_min: as in `bang_bang_time`; numbers only.
///     ramp: fraction of the duration, in (0, 1/2].
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
#[pyo3(signature = (theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None, ramp=None))]
pub fn trapezoid_time<'py>(
    py: Python<'py>,
    theta0: &Bound<'py, PyAny>,
    thetaf: &Bound<'py, PyAny>,
    inertia: &Bound<'py, PyAny>,
    gravity_moment: &Bound<'py, PyAny>,
    tau_max: &Bound<'py, PyAny>,
    tau_min: Option<&Bound<'py, PyAny>>,
    ramp: Option<&Bound<'py, PyAny>>,
) -> PyResult<ProfileReport> {
    const NAME: &str = "trapezoid_time";
    entry(py, NAME, || {
        let problem = single(py, NAME, [theta0, thetaf, inertia, gravity_moment, tau_max], tau_min)?;
        let ramp = ramp.map_or(Ok(1.0 / 3.0), |ramp| scalar(NAME, "ramp", ramp))?;
        Ok(ProfileReport::solve(problem, Some(ramp))?)
    })
}

/// The shortest and the longest duration of the minimum-jerk motion (quintic, zero end accelerations) under torque limits.
///
/// `theta = theta0 + (thetaf - theta0) (10 u^3 - 15 u^4 + 6 u^5)`, `u = t/T`.
///
/// Args:
///     theta0, thetaf, inertia, gravity_moment, tau_max, tau_min: as in `bang_bang_time`; numbers only.
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
#[pyo3(signature = (theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None))]
pub fn minimum_jerk_time<'py>(
    py: Python<'py>,
    theta0: &Bound<'py, PyAny>,
    thetaf: &Bound<'py, PyAny>,
    inertia: &Bound<'py, PyAny>,
    gravity_moment: &Bound<'py, PyAny>,
    tau_max: &Bound<'py, PyAny>,
    tau_min: Option<&Bound<'py, PyAny>>,
) -> PyResult<ProfileReport> {
    const NAME: &str = "minimum_jerk_time";
    entry(py, NAME, || {
        let problem = single(py, NAME, [theta0, thetaf, inertia, gravity_moment, tau_max], tau_min)?;
        Ok(ProfileReport::solve(problem, None)?)
    })
}

/// The feasible durations of a trapezoidal or minimum-jerk motion: see `trapezoid_time` and `minimum_jerk_time`.
#[pyclass(frozen, module = "armlet", name = "ProfileReport")]
pub struct ProfileReport {
    core: plan::ProfileReport,
    problem: LinkProblem,
    /// Of the trapezoid; None for minimum jerk.
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

#[entered]
#[pymethods]
impl ProfileReport {
    /// Least `inertia * |thetaf - theta0| / T^2` that the limits require, N m.
    #[getter]
    fn k_min(&self) -> f64 {
        self.core.k_min
    }

    /// Largest `inertia * |thetaf - theta0| / T^2` that the limits allow, N m.
    #[getter]
    fn k_max(&self) -> f64 {
        self.core.k_max
    }

    /// The angle where the limit that decides `t_min` is reached, rad.
    #[getter]
    fn theta_upper(&self) -> f64 {
        self.core.theta_upper
    }

    /// The angle where the limit that decides `t_max` is reached, rad; NaN if there is none.
    #[getter]
    fn theta_lower(&self) -> f64 {
        self.core.theta_lower
    }

    /// The torque by which both limits must widen, N m; 0 if feasible.
    #[getter]
    fn missing(&self) -> f64 {
        self.core.missing
    }

    /// Why no duration is feasible, with the missing torque; empty if feasible.
    #[getter]
    fn reason(&self) -> String {
        self.why()
    }

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
        again(py, if self.ramp.is_some() { "trapezoid_time" } else { "minimum_jerk_time" }, &all)
    }
}
