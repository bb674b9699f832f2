//! One run with the types of nalgebra: records as matrices.

use super::single::{Run, simulate};
use crate::error::Result;
use crate::simulate::problem::Problem;
use nalgebra::DMatrixView;
use std::sync::atomic::AtomicBool;

impl Problem<'_> {
    /// Simulate the run on the calling thread. [`Run::status`] is the reason of its end. Errors: an invalid argument, or records that
    /// exceed the memory.
    pub fn run(&self) -> Result<Run> {
        simulate(self, &AtomicBool::new(false))
    }
}

impl Run {
    /// The joint positions, shape `(n, K)`, rad or m. Column `k` is `q` at time `t[k]`.
    pub fn positions(&self) -> DMatrixView<'_, f64> {
        self.columns(&self.q)
    }

    /// The joint velocities, shape `(n, K)`, rad/s or m/s. Column `k` is `v` at time `t[k]`.
    pub fn velocities(&self) -> DMatrixView<'_, f64> {
        self.columns(&self.v)
    }

    /// The inputs of the plant, shape `(n, K)`, N m or N. They are velocities, rad/s or m/s, for a velocity-controlled plant. Column `k` is
    /// the input at time `t[k]`.
    pub fn inputs(&self) -> DMatrixView<'_, f64> {
        self.columns(&self.tau)
    }

    /// The values of the monitor `name`, shape `(K,)`. The result is `None` if the run has no monitor of this name.
    pub fn monitor(&self, name: &str) -> Option<&[f64]> {
        self.monitors.iter().find(|(known, _)| *known == name).map(|(_, series)| series.as_slice())
    }

    /// Return a series as a matrix whose columns are records. Time is the first axis of the series.
    fn columns<'a>(&self, series: &'a [f64]) -> DMatrixView<'a, f64> {
        let records = self.t.len();
        DMatrixView::from_slice(series, series.len().checked_div(records).unwrap_or(0), records)
    }
}
