//! A closed loop as a run advances it. In addition to the rates that an integration method reads, a loop has samples of its controller,
//! modes that switch between steps, metrics and records.

use super::sink::Sink;
use crate::integrate::System;
use crate::scalar::Real;
use crate::simulate::sampled::control::Control;
use crate::simulate::sampled::sampler::Sampler;
use crate::simulate::world::Exogenous;

/// A loop whose run can be simulated.
pub trait SimulatedLoop<S: Real>: System<S, Input = Exogenous<S>> {
    /// The plant's input, and the clock of a sampled controller.
    fn control(&mut self) -> &mut Control<S>;
    /// Evaluate the law at time `t` and state `x = [plant, law, ..]`, and write its results to the control. With a held input, the programs
    /// hold these results from now on.
    fn observe(&mut self, t: f64, x: &[S]);
    /// Hold the results of the law in the control from now on.
    fn hold(&mut self);
    /// Evaluate the sampled law at time `t` and state `x`. Its output is then held until the next sample.
    fn sample(&mut self, t: f64, x: &[S]) {
        if let Some(mut sampler) = self.control().sampler.take() {
            self.sample_by(&mut sampler, t, x);
            self.control().sampler = Some(sampler);
            self.hold();
        } else if self.control().held {
            self.observe(t, x);
        }
    }
    /// Let `sampler` take a sample at time `t` and state `x`, if one is due. Use the output that acts at `t`.
    fn sample_by(&mut self, sampler: &mut Sampler<S>, t: f64, x: &[S]) {
        let control = self.control();
        let (states, (mut tau, mut dz)) = (control.states, std::mem::take(&mut control.acting));
        let mut measured = std::mem::take(&mut control.measured);
        measured.copy_from_slice(x);
        let law = |seen: &[S], tau: &mut [S], dz: &mut [S]| {
            measured[..states].copy_from_slice(seen);
            self.observe(t, &measured);
            let control = self.control();
            tau.copy_from_slice(&control.tau);
            dz.copy_from_slice(&control.dz);
        };
        sampler.run(t, &x[..states], tau.len(), law, &mut tau, &mut dz);
        let control = self.control();
        control.tau.copy_from_slice(&tau);
        control.dz.copy_from_slice(&dz);
        (control.acting, control.measured) = ((tau, dz), measured);
    }
    /// Return the plant's input at time `t` and state `x`.
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S] {
        if !self.control().held {
            self.observe(t, x);
        }
        &self.control().tau
    }
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
