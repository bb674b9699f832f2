//! Where the records of a group of lanes go.

/// Receives the records of a group of lanes.
pub trait Sink {
    /// Record `i` of `lane`: time, state `[q, v, z, quadratures]` and input.
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]);
}
