//! Where the records of a group of lanes go.

use super::schedule::Schedule;
use crate::scalar::Real;

/// Receives the records of a group of lanes.
pub trait Sink {
    /// Record `i` of `lane`: time, state `[q, v, z, quadratures]` and input.
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]);
}

/// Recording in a function of its own, on a copy: the loop's state keeps its registers.
#[inline(never)]
pub fn record_apart<S: Real, const X: usize>(sink: &mut dyn Sink, i: usize, t: f64, x: [S; X], tau: [S; 2]) {
    for lane in 0..S::LANES {
        sink.record(i, lane, t, &x.map(|x| x.lane(lane)), &tau.map(|tau| tau.lane(lane)));
    }
}

/// The records of a fixed-step run.
pub struct Records<'a> {
    pub schedule: &'a Schedule,
    pub sink: &'a mut dyn Sink,
}
