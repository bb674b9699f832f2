//! Runs with fixed steps, and single steps.
//!
//! `schedule` has the times of a run, and `steps` advances any loop along them. `step_loop` is a loop whose whole steps are programs,
//! and `step_method` is the method that runs them. `structures` has the programs of all runs of a problem. `log` stores the records
//! that programs compute. `stepper` computes one step per call.

pub mod log;
pub mod schedule;
pub mod step_loop;
pub mod step_method;
pub mod stepper;
pub mod steps;
pub mod structures;
