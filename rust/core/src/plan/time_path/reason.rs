//! The reason why a path has no timing: the joint or the frame, the path position, the limit, and the missing amount. `infeasibility` finds
//! it.

use std::fmt;

/// The kind of a limit.
///
/// ```
/// use armlet_core::plan::{LimitKind, Mover, PathLimits, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?);
/// # let path = Arc::new(Path::waypoints(&[0.0, 0.0, 1.0, 1.0], 2, None, Ends::Natural)?.0);
/// // The path ends at 1 rad, and the second joint has the limit 0.75 rad.
/// let position = Some((vec![-2.0, -2.0], vec![2.0, 0.75]));
/// let limits = PathLimits { acceleration: Some(vec![4.0, 4.0]), position, ..PathLimits::default() };
/// let reason = time_path(arm, path, &limits, &TimePathOptions::default())?.reason.expect("beyond a limit");
/// assert_eq!((reason.limit, reason.joint, reason.position), (LimitKind::PositionMax, Some(1), 1.0));
/// assert_eq!(LimitKind::PositionMax.name(), "q_max");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitKind {
    /// Upper torque limit.
    TorqueMax,
    /// Lower torque limit.
    TorqueMin,
    /// Acceleration limit.
    Acceleration,
    /// Speed limit.
    Velocity,
    /// Limit of the torque rate.
    TorqueRate,
    /// Limit of the speed of the frame's origin.
    TipSpeed,
    /// Limit of the acceleration of the frame's origin.
    TipAcceleration,
    /// Upper position limit.
    PositionMax,
    /// Lower position limit.
    PositionMin,
}

impl LimitKind {
    /// The name used in Python.
    pub fn name(self) -> &'static str {
        match self {
            LimitKind::TorqueMax => "tau_max",
            LimitKind::TorqueMin => "tau_min",
            LimitKind::Acceleration => "a_max",
            LimitKind::Velocity => "v_max",
            LimitKind::TorqueRate => "torque_rate",
            LimitKind::TipSpeed => "tip_speed",
            LimitKind::TipAcceleration => "tip_acceleration",
            LimitKind::PositionMax => "q_max",
            LimitKind::PositionMin => "q_min",
        }
    }
}

/// The condition that a path or its timing violates.
///
/// ```
/// use armlet_core::plan::{Mover, PathLimits, Shortfall, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?);
/// # let path = Arc::new(Path::waypoints(&[0.0, 0.0, 1.0, 1.0], 2, None, Ends::Natural)?.0);
/// # let limits = PathLimits { acceleration: Some(vec![4.0, 4.0]), ..PathLimits::default() };
/// // From a very high speed, the arm cannot come to rest within the path.
/// let options = TimePathOptions { start_speed: 100.0, ..TimePathOptions::default() };
/// let reason = time_path(arm, path, &limits, &options)?.reason.expect("too fast");
/// assert_eq!(reason.what, Shortfall::StartSpeed);
/// assert!(reason.speed < 100.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shortfall {
    /// The limits allow no path speed here, or none from which the motion can continue.
    NoSpeed,
    /// The start speed is infeasible.
    StartSpeed,
    /// The end speed is infeasible.
    EndSpeed,
    /// The path speed is zero on a whole segment.
    Standstill,
    /// On the last grid, a limit is exceeded between grid points.
    Unresolved,
    /// With limits of the torque rate: the averaged timing exceeds a limit, however much it is slowed down.
    Slow,
    /// The path itself leaves the position limits.
    Position,
}

/// The reason why a path has no timing.
///
/// ```
/// use armlet_core::plan::{LimitKind, Mover, PathLimits, Shortfall, TimePathOptions, time_path};
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Functions;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Functions::new(Arc::new(Arm::planar(&[1.0], None, None, None, [0.0, -9.81])?));
/// # let path = Arc::new(Path::waypoints(&[-1.5, 0.0], 1, None, Ends::Natural)?.0);
/// // A rod of 1 kg and 1 m, lifted slowly from -1.5 rad to the level. There it needs 4.905 N m, and has 3 N m.
/// let limits = PathLimits { torque: Some((vec![-3.0], vec![3.0])), velocity: Some(vec![0.01]), ..PathLimits::default() };
/// let reason = time_path(Mover::Tree(&arm), path, &limits, &TimePathOptions::default())?.reason.expect("too weak");
/// assert_eq!((reason.what, reason.limit, reason.joint_name.as_str()), (Shortfall::NoSpeed, LimitKind::TorqueMax, "joint1"));
/// assert!(reason.s > 0.99 && (reason.missing_units - 1.905).abs() < 0.01);
/// assert!(reason.to_string().starts_with("the limits leave no path speed: tau_max of joint 0 (joint1)"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PathReason {
    /// The violated condition.
    pub what: Shortfall,
    /// Index of the joint; `None` for a limit of a frame's origin.
    pub joint: Option<usize>,
    /// Name of the joint, or of the frame.
    pub joint_name: String,
    /// Path position `s`, in the unit of the path's parameter.
    pub s: f64,
    /// The violated limit.
    pub limit: LimitKind,
    /// The missing amount, as a fraction of the limit. For a position, it is a fraction of `q_max - q_min` if that is finite. For a start
    /// or end speed, it is the relative difference of that speed from `speed`, or from an exceeded speed limit. For a standstill, it is
    /// zero.
    pub missing: f64,
    /// The missing amount in the unit of the limit. For a start or end speed, it is `missing` times the limit.
    pub missing_units: f64,
    /// For an infeasible start speed, the feasible path speed `ds/dt` nearest to it. For an infeasible end speed, the largest `ds/dt` that
    /// the speed limits and stops allow there. The unit is the unit of `s` per second. For every other condition, `speed` is NaN.
    pub speed: f64,
    /// The joint position that exceeds its limit, rad or m; else NaN.
    pub position: f64,
}

impl fmt::Display for PathReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PathReason { joint, joint_name, s, limit, missing, missing_units, speed, position, .. } = self;
        let limited = match joint {
            Some(joint) => format!("{} of joint {joint} ({joint_name})", limit.name()),
            None => format!("{} of frame {joint_name}", limit.name()),
        };
        let (units, share) = (missing_units.abs(), missing.abs());
        let short = format!("{limited} is {units:.6e} short ({share:.3e} of it) at s = {s:.9}");
        match self.what {
            Shortfall::NoSpeed => write!(f, "the limits leave no path speed: {short}"),
            Shortfall::StartSpeed => {
                let bound = if *missing < 0.0 { "least" } else { "most" };
                write!(f, "start_speed is not possible: expected at {bound} {speed:.9e} (the nearest that is): {short}")
            }
            Shortfall::EndSpeed => write!(f, "end_speed is not possible: expected at most {speed:.9e}: {short}"),
            Shortfall::Standstill => {
                write!(f, "the limits allow no motion from s = {s:.9}: {limited} holds the arm there")
            }
            Shortfall::Position => {
                write!(f, "the path leaves the position limits: q = {position:.9} is {missing_units:.6e} beyond {limited} at s = {s:.9}")
            }
            Shortfall::Slow => write!(f, "no timing keeps the torque rate, however slow: {short}"),
            Shortfall::Unresolved => write!(f, "no grid resolves the limits: {short}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_speed_is_too_large_or_too_small() {
        for (missing, bound) in [(0.25, "at most"), (-0.25, "at least")] {
            let reason = PathReason {
                what: Shortfall::StartSpeed,
                joint: Some(0),
                joint_name: "joint1".into(),
                s: 0.0,
                limit: LimitKind::TorqueMax,
                missing,
                missing_units: 4.0 * missing,
                speed: 0.5,
                position: f64::NAN,
            };
            assert!(reason.to_string().contains(&format!("expected {bound} 5.000000000e-1")), "{reason}");
            assert!(reason.to_string().contains("is 1.000000e0 short (2.500e-1 of it)"), "{reason}");
        }
    }
}
