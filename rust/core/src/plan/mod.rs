//! Minimum-time planning of one link under gravity: `I theta_ddot + G sin theta = tau`, `tau_min <= tau <= tau_max`.
//!
//! - [`bang_bang_time`]: the exact interval of durations of the symmetric bang-bang acceleration profile.
//! - [`trapezoid_time`]: the exact interval of durations of the trapezoidal-speed profile. [`minimum_jerk_time`]: the interval of the
//!   quintic, by a search.
//! - [`torque_optimal_time`]: the minimum time with any torque between the bounds, over three families of motions.
//! - [`torque_optimal_time_with_friction`]: the minimum time with viscous and Coulomb friction, by integration.
//! - [`TorqueProfile`]: the motion of minimum time as a function of time.
//!
//! [`time_path`] plans the motion of any arm along a path.
//!
//! Terms of this folder:
//! - `I` is the inertia and `G` the gravity moment. The *gravity torque* is `G sin theta`.
//! - `x = direction theta` is the angle along the motion. `direction` is 1 or -1, so that the motion from `x0` to `x1` has `x1 >= x0`. `D`
//!   is `x1 - x0`.
//! - A *phase* is a part of a motion with constant torque. A *push* starts at rest. A *brake* ends at rest, and is computed backwards in
//!   time.
//! - A *swing* is a motion with one reversal, the *turn*. A *back-swing* first moves away from the goal. An *overshoot* first passes it.
//! - The three *families* of motions are monotone motions, back-swings and overshoots.
//! - `e` is the distance from the start of a back-swing to its turn.
//! - A *maximum of gravity* is an angle where the kinetic energy of a phase has a local minimum. Gravity slows the link down before this
//!   angle, and no longer after it.
//!
//! The folder is flat, because each problem has one file, and all problems share the phases, curves and sines of one link.

mod bang_bang;
mod curve;
mod detour;
mod friction;
mod link;
mod monotone;
mod phase;
mod profiles;
mod quadrature;
mod report;
mod search;
mod sine;
mod steps;
mod swing;
mod time_path;
mod torque_optimal;
mod trajectory;
mod windows;

pub use bang_bang::{BangBangReport, BangBangTimes, bang_bang_time, bang_bang_times};
pub use friction::torque_optimal_time_with_friction;
pub use profiles::{ProfileReport, minimum_jerk_time, trapezoid_time};
pub use report::{Bind, Limit, MonotoneReason, Place, Reason};
pub use time_path::{Friction, LimitKind, Mover, PathLimits, PathReason, Shortfall, TimePath, TimePathOptions, TipLimits, time_path};
pub use torque_optimal::{Best, Family, TorqueOptimum, torque_optimal_time};
pub use trajectory::{Sample, TorqueProfile};
