//! One revolute link under gravity: `I theta_ddot + G sin theta = tau`, theta on the real line, from the downward vertical.

use super::sine::{select, sin_cos};
use crate::error::{Error, Result, finite, positive};

/// The tolerance of a comparison with a torque bound, relative to the larger absolute bound. It covers rounding errors only.
pub const SLACK: f64 = 1e-12;

/// A link and its torque bounds. If `gravity_moment` is negative, theta is measured from the upward vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Inertia about the joint axis, kg m^2.
    pub inertia: f64,
    /// Gravity moment `m g0 d`, N m: mass, gravity, and distance of the centre of mass from the axis.
    pub gravity_moment: f64,
    /// Lower torque bound, N m, at most 0.
    pub tau_min: f64,
    /// Upper torque bound, N m, at least 0.
    pub tau_max: f64,
}

impl Link {
    /// Whether the goal is in the positive direction. For equal ends the direction is against gravity, so that a mirrored link has the
    /// mirrored motion.
    pub fn is_ahead(&self, theta0: f64, thetaf: f64) -> bool {
        thetaf > theta0 || thetaf == theta0 && self.gravity_moment * sin_cos(theta0).0 >= 0.0
    }

    /// Create a link. Errors: `Input` unless all numbers are finite, `inertia > 0`, `tau_min <= 0 <= tau_max`, and `tau_min < tau_max`.
    #[inline]
    pub fn new(inertia: f64, gravity_moment: f64, tau_min: f64, tau_max: f64) -> Result<Self> {
        let width = tau_max - tau_min;
        let valid = (inertia > 0.0)
            & (inertia < f64::INFINITY)
            & (gravity_moment.abs() < f64::INFINITY)
            & (tau_min <= 0.0)
            & (tau_max >= 0.0)
            & (width > 0.0)
            & (width < f64::INFINITY);
        if valid { Ok(Link { inertia, gravity_moment, tau_min, tau_max }) } else { Err(refuse(inertia, gravity_moment, tau_min, tau_max)) }
    }

    /// The tolerance of the torque bounds for rounding errors, N m.
    #[inline(always)]
    pub fn slack(&self) -> f64 {
        SLACK * self.tau_max.max(-self.tau_min)
    }

    /// The link in the coordinate along the motion, `x = direction theta`. For a negative direction, the two torque bounds are exchanged
    /// and change their signs. The gravity torque keeps its form, because the sine is odd.
    #[inline(always)]
    pub(super) fn along(&self, forward: bool) -> Self {
        let reverse = u64::from(!forward);
        Link { tau_min: select(reverse, -self.tau_max, self.tau_min), tau_max: select(reverse, -self.tau_min, self.tau_max), ..*self }
    }
}

#[cold]
fn refuse(inertia: f64, gravity_moment: f64, tau_min: f64, tau_max: f64) -> Error {
    if let Err(e) = positive("inertia", inertia) {
        return e;
    }
    for (name, x) in [("gravity_moment", gravity_moment), ("tau_min", tau_min), ("tau_max", tau_max)] {
        if let Err(e) = finite(name, &[x]) {
            return e;
        }
    }
    if tau_min > 0.0 {
        return Error::input("tau_min", format!("is positive: expected a number <= 0, got {tau_min}"));
    }
    if tau_max < 0.0 || tau_max - tau_min <= 0.0 {
        return Error::input("tau_max", format!("leaves no torque: expected a number >= 0 and above tau_min = {tau_min}, got {tau_max}"));
    }
    Error::input("tau_max", format!("is too large: expected tau_max - tau_min to be finite, got {tau_max} and {tau_min}"))
}

/// Check the end angles. Errors: `Input` if an angle or the distance is not finite.
#[inline]
pub(super) fn check_ends(theta0: f64, thetaf: f64) -> Result<()> {
    if (thetaf - theta0).abs() < f64::INFINITY {
        return Ok(());
    }
    finite("theta0", &[theta0])?;
    finite("thetaf", &[thetaf])?;
    Err(Error::input("thetaf", format!("is too far away: expected thetaf - theta0 to be finite, got {thetaf} and {theta0}")))
}
