//! The fastest timing of a path under limits of torque, acceleration and speed (`docs/time_path.md`).
//!
//! The path is `q(s)`, with `q' = dq/ds`. A timing is `s(t)`, with the path speed `r = ds/dt`, its square `x = r^2`, and the path
//! acceleration `u = d^2 s/dt^2`.
//!
//! Terms of this folder:
//! - A *piece* is one polynomial of the path, between two knots.
//! - A *segment* is the interval between two neighbouring grid points.
//! - A *row* is one limited quantity, for example the torque of one joint. In `passes`, it is a linear function of `u` and `x`.
//! - A *profile* is `x` at all grid points.
//! - A *cap* is an upper bound of `x` at a grid point.
//! - A *controllable* `x` at a grid point allows a motion to the end of the path within all limits.
//!
//! The search (`search`) has these steps. `tuning` has its constants.
//! 1. Compute `A, B, g` of the torques `tau = A u + B x + g` on a grid (`rows`, `problem`) [Bobrow, Dubowsky and Gibson 1985].
//! 2. Compute the fastest profile on this grid (`passes`): the controllable sets backwards, then greedily forwards [Pham and Pham 2018].
//!    Viscous friction is not linear in `x`, so lines replace it in several passes (`friction`).
//! 3. Check the limits at samples, ten steps per segment (`check`, `samples`, `examine`). Reduce each exceeded limit in its segment by a
//!    multiple of the excess (`corrections`). Repeat step 2 until no limit is exceeded.
//! 4. If this does not succeed, or the profile loses time, halve segments (`grid`) and start again.
//! 5. With friction, step 3 may end without a feasible speed. Then slow down the profile that exceeded its limits least (`slow`).
//! 6. With limits of the torque rate, average the timing over time and slow it down (`rate`).
//! 7. Without a feasible timing, report the joint or the frame, the path position, the limit, and the missing amount (`reason`,
//!    `infeasibility`).
//!
//! Further limits are part of these steps: speed and acceleration of a frame's origin (`tip`), and limits that vary along the path (`along`).
//! Position limits are checked separately (`positions`).
//!
//! The folder is flat, because every file is one step or one kind of limit, and all files share these terms.

mod along;
mod caps;
mod check;
mod corrections;
mod examine;
mod friction;
mod given;
mod grid;
mod infeasibility;
mod limits;
mod lines;
mod mover;
mod passes;
mod positions;
mod problem;
mod rate;
mod reason;
mod rows;
mod samples;
mod search;
mod slow;
mod stencil;
mod timing;
mod tip;
mod tuning;

pub use given::{PathLimits, TimePathOptions};
pub use mover::Mover;
pub use reason::{LimitKind, PathReason, Shortfall};
pub use rows::Friction;
pub use timing::TimePath;
pub use tip::TipLimits;

use crate::error::Result;
use crate::motion::Path;
use problem::PathProblem;
use search::Search;
use std::sync::Arc;

/// Compute the fastest timing of `path` for the arm `mover` under `limits`.
///
/// If no timing is found, the result has the reason. Errors: `Input` or `WrongShape` for an invalid argument, `Memory` for a grid that does
/// not fit.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Functions;
/// use armlet_core::motion::{Ends, Path};
/// use armlet_core::plan::{Mover, PathLimits, TimePathOptions, time_path};
/// use std::sync::Arc;
///
/// // One uniform rod of 1 m and 1 kg without gravity: I = 1/3, so that T = 2 sqrt(I D / tau) for D = 1 rad and tau = 3 N m.
/// let arm = Functions::new(Arc::new(Arm::planar(&[1.0], None, None, None, [0.0, 0.0])?));
/// let (path, _) = Path::waypoints(&[0.0, 1.0], 1, None, Ends::Natural)?;
/// let limits = PathLimits { torque: Some((vec![-3.0], vec![3.0])), ..PathLimits::default() };
/// let plan = time_path(Mover::Tree(&arm), Arc::new(path), &limits, &TimePathOptions::default())?;
/// assert!(plan.reason.is_none() && (plan.motion.duration() - 2.0 / 3.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn time_path(mover: Mover, path: Arc<Path>, limits: &PathLimits, options: &TimePathOptions) -> Result<TimePath> {
    let problem = PathProblem::new(mover, path, limits, options)?;
    if let Some((lower, upper)) = &limits.position
        && let Some(reason) = positions::largest_violation(mover, &problem.path, lower, upper)
    {
        return problem.refuse(reason);
    }
    if problem.path.is_point() {
        return problem.hold();
    }
    problem.require_motion()?;
    Search::new(problem, options).run()
}
