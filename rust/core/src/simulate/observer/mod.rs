//! The observation of a run: `run_observer` has the requests and the results, `event` the events, and `probe` the motion of a frame.

pub mod event;
pub mod probe;
pub mod run_observer;
