//! Runs of a problem by any method. `single` simulates one run. `division` has the time grid of a problem, and `timed_functions` adapts
//! it to functions of time.
//!
//! `run_group` runs the loops of one or several lanes. `adaptive_lanes` runs the loops of a batch with adaptive steps, one per lane, and
//! `adaptive_lane` has one of these runs. `structures` has the programs of all runs of a problem. `stepper` computes one
//! step per call, and `stepped_programs` has its programs. `typed` has the types of nalgebra.

pub mod adaptive_lane;
pub mod adaptive_lanes;
pub mod division;
pub mod run_group;
pub mod single;
pub mod stepped_programs;
pub mod stepper;
pub mod structures;
pub mod timed_functions;
pub mod typed;
