//! The samples of a loop whose steps are programs, in the frames of all its lanes. A frame is the memory of the programs.

use super::clock::Clock;
use super::frame_controller::FrameController;
use crate::trace::Frame;

/// The clock and the controllers of the frames of a loop.
pub struct Samples {
    pub clock: Clock,
    /// The step size, s.
    pub dt: f64,
    /// The controllers of each frame. Empty if they only hold the last output of the law.
    pub controllers: Vec<FrameController>,
}

impl Samples {
    /// Return the step that begins at time `t`, s.
    pub fn step(&self, t: f64) -> usize {
        (t / self.dt).round() as usize
    }

    /// Prepare frame `k`, which contains the state, for step `step`. Return whether the step begins with a sample.
    pub fn begin(&mut self, frame: &mut Frame, k: usize, step: usize) -> bool {
        if let Some(controller) = self.controllers.get_mut(k) {
            controller.begin(frame, &self.clock, step);
        }
        self.clock.due(step).is_some()
    }

    /// Store the results of the law in frame `k`, if step `step` began with a sample.
    pub fn end(&mut self, frame: &Frame, k: usize, step: usize) {
        if let Some(controller) = self.controllers.get_mut(k) {
            controller.end(frame, &self.clock, step);
        }
    }

    /// Discard the sample of step `step` in all frames, if one is due. With `failed`, discard it only if its results are not finite.
    pub fn discard(&mut self, step: usize, failed: bool) {
        self.controllers.iter_mut().for_each(|controller| controller.discard(&self.clock, step, failed));
    }

    /// Discard all samples, because the run restarts.
    pub fn clear(&mut self) {
        self.controllers.iter_mut().for_each(FrameController::clear);
    }

    /// Return the number of steps from step `step` on, up to `most`, that one program computes. Either they all begin with a sample, or the
    /// same output acts in all of them.
    pub fn alike(&self, step: usize, most: usize) -> usize {
        if self.controllers.is_empty() && self.clock.is_every_step() {
            most
        } else if self.clock.due(step).is_some() {
            1
        } else {
            most.min(self.clock.next(step) - step)
        }
    }
}
