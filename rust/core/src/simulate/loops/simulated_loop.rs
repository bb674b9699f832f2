//! A closed loop as a run advances it. In addition to the rates that an integration method reads, a loop has samples of its controller,
//! modes that switch between steps, metrics and records.

use super::sink::Sink;
use crate::integrate::System;
use crate::scalar::Real;
use crate::simulate::world::Exogenous;

/// A loop whose run can be simulated.
pub trait SimulatedLoop<S: Real>: System<S, Input = Exogenous<S>> {
    /// At time `t` and state `x = [plant, law, ..]`, evaluate the sampled law if a sample is due. Its output is then held until the next
    /// sample. Without sampling, nothing happens.
    fn sample(&mut self, t: f64, x: &[S]);
    /// Return the plant's input at time `t` and state `x`.
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S];
    /// Update the modes of the joints at time `t` and state `x`, before a fixed step. A joint sticks or slips. Return whether the slope
    /// jumps.
    fn enter_step(&mut self, _t: f64, _x: &[S]) -> bool {
        false
    }
    /// Update the modes of the joints at state `x`, after a fixed step. The function may change `x`, for example to stop a sliding joint.
    /// Return whether `x` changed.
    fn leave_step(&mut self, _x: &mut [S]) -> bool {
        false
    }
    /// Add the contribution of time `t` to the metrics. `x` contains the state, and then the metrics. `h` is the time to the next step, s,
    /// and zero at the end of the run.
    fn sum_up(&mut self, _t: f64, _h: f64, _x: &mut [S]) {}
    /// Store the state at time `t` as record `i`. Only a loop that stores the records of a run itself implements this function.
    fn note(&mut self, _i: usize, _t: f64, _x: &[S]) {}
    /// Pass the stored records to the sink. A program stores them if it computes several steps. `time(k)` is the time at the start of step
    /// `k`.
    fn pass_on(&mut self, _time: &dyn Fn(usize) -> f64, _: &mut dyn Sink) {}
}
