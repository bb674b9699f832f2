//! Minimum-time planning of one link under gravity: `I theta_ddot + G sin theta = tau`, `tau_min <= tau <= tau_max`.
//!
//! - [`bang_bang_time`]: the exact interval of durations of the symmetric bang-bang acceleration profile.
//! - [`trapezoid_time`], [`minimum_jerk_time`]: the same for trapezoidal speed and for the quintic.
//! - [`torque_optimal_time`]: the optimum under full torque: monotone, back-swing, overshoot.
//! - [`torque_optimal_time_with_friction`]: the same with viscous and Coulomb friction, by integration.
//! - [`TorqueProfile`]: the motion of that optimum, to follow.
//!
//! For any arm along a path: [`time_path`].

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
pub mod sine;
mod steps;
mod swing;
mod time_path;
mod torque_optimal;
mod trajectory;
mod windows;

pub use bang_bang::{BangBangReport, BangBangTimes, bang_bang_time, bang_bang_times};
pub use friction::torque_optimal_time_with_friction;
pub use link::Link;
pub use profiles::{ProfileReport, minimum_jerk_time, trapezoid_time};
pub use report::{Bind, Limit, MonotoneReason, Place, Reason};
pub use time_path::{Bound, FINE, Friction, Mover, PathLimits, PathReason, Shortfall, TimePath, TimePathOptions, TipLimits, time_path};
pub use torque_optimal::{Best, Family, TorqueOptimum, torque_optimal_time};
pub use trajectory::{Sample, TorqueProfile};
