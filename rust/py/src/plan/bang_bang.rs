//! `armlet.bang_bang_time`: the feasible durations of the symmetric bang-bang profile, for numbers and for arrays of problems.

use super::bang_bang_batch::{ANSWER, BangBangBatch, CHUNK};
use super::bang_bang_report::BangBangReport;
use super::link::{NAMES, problem, symmetric};
use crate::arrays::require_finite;
use crate::broadcast::columns;
use crate::errors::Failure;
use crate::interrupts::long;
use armlet_core::interrupt;
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
#[arguments(theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None)]
pub fn bang_bang_time<'py>() -> Result<Bound<'py, PyAny>, Failure> {
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
                        interrupt::check();
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
}
