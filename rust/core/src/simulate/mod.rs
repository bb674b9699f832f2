//! Closed loops: an arm, a law and a motion, run by a method, alone or in batches, with the theory's
//! identities monitored.

mod adaptive_steps;
mod batch;
mod fixed_steps;
mod monitors;
mod planar_pr;
mod problem;
mod reference;
mod rigid_loop;
mod schedule;
mod single;

pub use crate::parallel::{default_threads, on_worker};
pub use batch::{BatchRuns, Keep, lanes, simulate_batch};
pub use problem::{Method, Options, Problem};
pub use schedule::Times;
pub use single::{Run, simulate};
