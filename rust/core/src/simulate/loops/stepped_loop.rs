//! A closed loop that its caller advances by single steps. The law or the caller provides the input of a step.

use super::simulated_loop::SimulatedLoop;
use crate::simulate::problem::force::Wrench;

/// A loop whose steps are computed by separate calls.
pub trait SteppedLoop: SimulatedLoop<f64> {
    /// Use `tau` as the plant's input instead of the law's output. If `tau` is `None`, the law computes the input, and `held` selects
    /// whether this input is held.
    fn drive(&mut self, tau: Option<&[f64]>, held: bool);
    /// Apply `wrench` instead of the external forces. `None` restores the forces.
    fn push(&mut self, wrench: Option<&Wrench>);
    /// Restart at `t = 0`.
    fn rewind(&mut self);
    /// The modes of the joints that stick and slip.
    fn sides(&self) -> &[i8] {
        &[]
    }
    /// Store what a step may change, before it begins.
    fn begin_step(&mut self) {}
    /// If the results of the step are not valid, prepare its repetition, and return true.
    fn declines(&mut self) -> bool {
        false
    }
    /// Undo a step from time `t`, s. `sides` are the modes of the joints before this step. A sample at `t` remains, unless its output is
    /// not finite.
    fn undo_step(&mut self, t: f64, sides: &[i8]);
    /// Continue at time `t`, s, from a state that the caller has set. A sample at `t` is taken again.
    fn replace_state(&mut self, t: f64);
}
