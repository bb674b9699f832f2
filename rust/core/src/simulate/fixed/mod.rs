//! Runs with fixed steps.
//!
//! `schedule` has the times of a run, and `steps` advances any loop along them. `step_loop` is a loop whose whole steps are programs,
//! and `step_method` is the method that runs them.

pub mod schedule;
pub mod step_loop;
pub mod step_method;
pub mod steps;
