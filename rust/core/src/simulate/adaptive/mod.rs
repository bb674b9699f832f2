//! Runs with adaptive methods, and loops whose state rates are programs.
//!
//! `segments` has the times of a run, and `steps` advances a loop along them. `rates_loop` is a loop whose rates are programs,
//! `rates_evaluation` has these programs with their memory, and `loop_law` evaluates the law. `step_checks` observes the steps: `contacts`
//! that change, joints that stick and slip (`joint_modes`, `sticking_joints`), and events.

pub mod contacts;
pub mod joint_modes;
pub mod loop_law;
pub mod rates_evaluation;
#[doc(hidden)]
pub mod rates_loop;
pub mod segments;
pub mod step_checks;
pub mod steps;
pub mod sticking_joints;
