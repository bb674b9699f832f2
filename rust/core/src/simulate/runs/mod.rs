//! Runs of a problem by any method. `single` simulates one run. `division` has the time grid of a problem, and `timed_functions` adapts
//! it to functions of time.
//!
//! `run_group` runs the loops of one or several lanes. `structures` has the programs of all runs of a problem. `stepper` computes one
//! step per call. `typed` has the types of nalgebra.

pub mod division;
pub mod run_group;
pub mod single;
pub mod stepper;
pub mod structures;
pub mod timed_functions;
pub mod typed;
