//! Who looks at the steps of an adaptive method, and may cut one short.

use crate::status::Status;

/// Where a step is not taken as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// The system switches at this time: the step is taken again up to there.
    Switch(f64),
    /// The run ends at this time.
    End(f64),
}

/// Who looks at every step of a run.
pub trait Watcher<F, B, M> {
    /// Whether there is anything to look for.
    fn active(&self) -> bool;
    /// The run begins at `t` and `x`.
    fn begin(&mut self, system: &mut F, t: f64, x: &B) -> Result<(), Status>;
    /// Look at the step that `method` has just accepted.
    fn look(&mut self, system: &mut F, method: &mut M) -> Result<Option<Cut>, Status>;
    /// The last step of `method` is part of the run up to `t`.
    fn keep(&mut self, system: &mut F, method: &mut M, t: f64);
    /// The system switches now, at `t` and `x`, which may be put exactly where it does.
    fn switch(&mut self, system: &mut F, t: f64, x: &mut B);
}
