//! The receiver of the records of a group of lanes.

use super::log::Block;

/// Receives the records of a group of lanes.
pub trait Sink {
    /// Receive record `i` of `lane`: time `t`, s, state `x = [plant, law, integrals]` and input `tau`.
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]);

    /// Receive records of all lanes with their monitors, which programs stored within steps.
    fn block(&mut self, block: &Block);

    /// Receive the stored numbers of a run's metrics up to its last record. `time(i)` is the time of record `i`, s.
    fn take(&mut self, _lane: usize, _kept: &[f64], _time: &dyn Fn(usize) -> f64) {}
}
