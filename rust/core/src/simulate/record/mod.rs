//! Recordings of loops. A loop is recorded once for each structure, and its recording is compiled to programs.
//!
//! `step` records whole steps of a method of fixed steps, and `step_programs` makes their programs. `rates` records the state rates, with
//! their derivatives. `attempt` records all stages of a trial step of an adaptive method, and `lane_attempt` these stages for one run per lane.
//! `metrics` and `records` are the parts of a step that update metrics and compute records. `key` and `structure` compare
//! loops, and `slots` has the slots of frames. `listing` and `slot_names` make listings, and `web` writes a loop as WebAssembly, with the
//! steps of `web_steps`.

pub mod attempt;
pub mod key;
pub mod lane_attempt;
pub mod listing;
pub mod metrics;
pub mod rates;
pub mod records;
pub mod slot_names;
pub mod slots;
pub mod step;
pub mod step_programs;
pub mod structure;
pub mod web;
pub mod web_steps;
