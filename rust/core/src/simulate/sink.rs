//! The destination of the records of a group of lanes.

use super::log::Block;

/// Receives the records of a group of lanes.
pub trait Sink {
    /// Record `i` of `lane`: time, state `[q, v, z, quadratures]` and input.
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]);

    /// Records of all lanes that were noted within the steps of a program, monitors included.
    fn block(&mut self, block: &Block);

    /// The stored numbers of the metrics up to the last record of a run; `time(i)` is the time of record `i`.
    fn take(&mut self, _lane: usize, _kept: &[f64], _time: &dyn Fn(usize) -> f64) {}
}
