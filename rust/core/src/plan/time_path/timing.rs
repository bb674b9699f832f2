//! The result of the planner.

use super::reason::PathReason;
use crate::motion::TimedPath;

/// A timing of a path, or the reason why none was found.
///
/// ```
/// use armlet_core::plan::{Mover, PathLimits, TimePath, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = PlanarPr::new(3.0, 0.5, 0.2)?;
/// // Both joints move by 1, in m and in rad, with at most 4 m/s^2 and 4 rad/s^2: T = 2 sqrt(1 / 4).
/// let (path, _) = Path::waypoints(&[0.0, 0.0, 1.0, 1.0], 2, None, Ends::Natural)?;
/// let limits = PathLimits { acceleration: Some(vec![4.0, 4.0]), ..PathLimits::default() };
/// let TimePath { motion, margin, reason } = time_path(Mover::PlanarPr(arm), Arc::new(path), &limits, &TimePathOptions::default())?;
/// assert!(reason.is_none() && margin.abs() < 1e-9);
/// assert!((motion.duration() - 1.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TimePath {
    /// The motion `q(t)` along the path. Its duration is NaN if no timing was found.
    pub motion: TimedPath,
    /// The smallest relative distance to a limit over the samples of the check; NaN if no timing was found. With limits of the torque rate,
    /// it includes bounds of the values between samples.
    pub margin: f64,
    /// The reason why no timing was found; `None` if one was found.
    pub reason: Option<PathReason>,
}
