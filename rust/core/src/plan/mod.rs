//! Minimum-time planning of one link under gravity: `I theta_ddot + G sin theta = tau`, `tau_min <= tau <= tau_max`.
//!
//! - [`bang_bang_time`]: the exact interval of durations of the symmetric bang-bang acceleration profile.

mod bang_bang;
mod link;
mod report;
pub mod sine;

pub use bang_bang::{BangBangReport, bang_bang_time};
pub use link::Link;
pub use report::{Bind, Limit, Place, Reason};
