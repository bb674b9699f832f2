//! The numbers of a single solve.

use armlet_core::priority::{Bounded, PriorityOptions};
use armlet_core::status::Status;
use std::sync::Arc;

/// The result of a single solve: the numbers `[v, residuals, scales, ranks, jacobian, command, upper]` in one allocation.
pub struct SingleSolution {
    pub n: usize,
    pub rows: Arc<[usize]>,
    pub numbers: Vec<f64>,
    pub status: Status,
    pub bounded: Option<Box<Bounded>>,
    pub options: PriorityOptions,
}

impl SingleSolution {
    /// The velocities, the residuals, the scales, the ranks, the Jacobians, the commands, and the upper bounds.
    pub fn parts(&self) -> [&[f64]; 7] {
        let (total, levels) = (self.rows.iter().sum::<usize>(), self.rows.len());
        let mut rest = &self.numbers[..];
        let sizes = [self.n, total, levels, levels, total * self.n, total];
        let [v, residuals, scales, ranks, jacobian, command] = sizes.map(|size| rest.split_off(..size).unwrap_or_default());
        [v, residuals, scales, ranks, jacobian, command, rest]
    }
}
