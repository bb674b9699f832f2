//! The sampled controllers of the lanes of one frame, which is the memory of the programs of their steps. Programs evaluate the law, and
//! limit the rate of its output. Native code measures the state, and queues the outputs.

use super::clock::Clock;
use super::outputs::Outputs;
use super::sensors::Sensors;
use crate::simulate::problem::sampling::Sampling;
use crate::trace::{Frame, Slots};

/// The slots of the controllers in a frame.
#[derive(Clone, Copy, Debug)]
pub struct ControllerSlots {
    /// The state of the plant, and the measurement of it. The measurement has no slots if the law receives the exact state.
    pub state: Slots,
    pub measured: Slots,
    /// The largest change of the output since the previous sample. It has no slot without a limit.
    pub change: Slots,
    /// The output of the last sample. These are the slots of the plant's input, if outputs are not delayed.
    pub output: Slots,
    /// The plant's input, and the other results of the law.
    pub tau: Slots,
    pub others: Slots,
}

/// The controllers of one frame, which do more than hold the last output of the law.
#[derive(Clone, Debug)]
pub struct FrameController {
    slots: ControllerSlots,
    /// The sensors of each lane.
    sensors: Vec<Sensors>,
    /// Memory for the measured state of one lane.
    state: Vec<f64>,
    outputs: Outputs,
}

impl FrameController {
    /// Create the controllers of a frame with one lane for each of `sensors`.
    pub fn new(slots: ControllerSlots, sampling: &Sampling, sensors: Vec<Sensors>) -> Self {
        let sizes = [slots.output.count, slots.others.count].map(|count| count * sensors.len());
        FrameController { sensors, state: vec![0.0; slots.measured.count], outputs: Outputs::new(sampling, sizes), slots }
    }

    /// Copy one part of the results of sample `k` to the slots `to`: the output, or with `others` the other results. Before the first
    /// sample, they are zero. If the sample was not taken, because the caller gave the input, the slots do not change.
    fn recall(&self, frame: &mut Frame, k: Option<usize>, (others, to): (bool, Slots)) {
        match k.map(|k| self.outputs.get(k as u64)) {
            None => frame.group_mut(to).fill(0.0),
            Some(Some(results)) => frame.group_mut(to).copy_from_slice(results[usize::from(others)]),
            Some(None) => (),
        }
    }

    /// Prepare step `step`: select the output that acts. If a sample is due, measure the state in the frame for the law.
    pub fn begin(&mut self, frame: &mut Frame, clock: &Clock, step: usize) {
        let (slots, due) = (self.slots, clock.due(step));
        if due.is_none() || slots.output != slots.tau {
            self.recall(frame, clock.acting(step), (false, slots.tau));
        }
        let Some(k) = due else {
            self.recall(frame, clock.last(step), (true, slots.others));
            return;
        };
        if slots.change.count > 0 {
            // The first output changes from zero.
            let previous = k.checked_sub(1).filter(|&previous| self.outputs.get(previous as u64).is_some());
            self.recall(frame, previous, (false, slots.output));
            frame.group_mut(slots.change).fill(self.sensors[0].largest_change(previous.map_or(0, |_| k as u64)));
        }
        let lanes = frame.lanes();
        for (lane, sensors) in self.sensors.iter_mut().enumerate().filter(|_| slots.measured.count > 0) {
            frame.read(slots.state, lane, self.state.iter_mut());
            let measured = frame.group_mut(slots.measured)[lane..].iter_mut().step_by(lanes);
            measured.zip(sensors.measure(k as u64, &self.state)).for_each(|(to, &from)| *to = from);
        }
    }

    /// Store the results of the law, if step `step` began with a sample.
    pub fn end(&mut self, frame: &Frame, clock: &Clock, step: usize) {
        let Some(k) = clock.due(step) else { return };
        let [output, others] = self.outputs.store(k as u64);
        output.copy_from_slice(frame.group(self.slots.output));
        others.copy_from_slice(frame.group(self.slots.others));
    }

    /// Discard the sample of step `step`, if one is due. With `failed`, discard it only if a result is not finite.
    pub fn discard(&mut self, clock: &Clock, step: usize, failed: bool) {
        if let Some(k) = clock.due(step) {
            self.outputs.discard(k as u64, failed);
        }
    }

    /// Discard all samples, because the run restarts.
    pub fn clear(&mut self) {
        self.outputs.clear();
        self.sensors.iter_mut().for_each(Sensors::clear);
    }
}
