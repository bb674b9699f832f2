//! Closed loops: an arm, a law and a motion, run by a method, alone or in batches, with the theory's
//! identities monitored.

mod adaptive_steps;
mod batch;
mod closed_loop;
mod columns;
mod fixed_steps;
mod force;
mod general;
mod monitors;
mod planar_pr;
mod pool;
mod priority_batch;
mod problem;
mod reference;
mod rigid_loop;
mod sampler;
mod sampling;
mod schedule;
mod single;
mod stepper;
mod stop;

pub use batch::{BatchRuns, Keep, lanes, simulate_batch};
pub use force::{Force, Wrench};
pub use pool::default_threads;
pub use priority_batch::solve_rows;
pub use problem::{Method, Options, Problem};
pub use sampling::{CHANNELS, Sampling};
pub use schedule::Times;
pub use single::{Run, simulate};
pub use stepper::{Stepping, stepper};
pub use stop::{Poller, Stop};
