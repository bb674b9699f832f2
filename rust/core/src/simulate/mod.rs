//! Closed loops: an arm, a law and a motion, run by a method, alone or in batches, with the theory's
//! identities monitored.

mod adaptive_steps;
mod batch;
mod bound;
mod closed_loop;
mod columns;
mod elastic_2r;
mod elastic_2r_loop;
mod elastic_monitor;
mod event;
mod fixed_steps;
mod force;
mod general;
mod monitors;
mod motor_loop;
mod planar_pr;
mod priority_batch;
mod problem;
mod reference;
mod rigid_loop;
mod sampler;
mod sampling;
mod schedule;
mod single;
mod sink;
mod stepper;
mod stop;
mod switching;
mod torque_sensing;
mod watcher;
mod watching;

pub use crate::parallel::default_threads;
pub use batch::{BatchRuns, Keep, lanes, simulate_batch};
pub use bound::DEFAULT_STATE_LIMIT;
pub use event::{Event, Found, Signal, What};
pub use force::{Force, Wrench};
pub use general::{Twins, twins};
pub use priority_batch::{solve_rows, solve_stacks};
pub use problem::{Method, Options, Problem};
pub use sampling::{CHANNELS, Sampling};
pub use schedule::Times;
pub use single::{Run, simulate, simulate_asked};
pub use stepper::{Stepping, stepper};
pub use stop::{Poller, Stop};
pub use watching::{Asked, Polynomials};
