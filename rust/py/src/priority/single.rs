//! The numbers of a single solve.

use armlet_core::priority::{Bounded, PriorityOptions};
use armlet_core::status::Status;
use std::sync::Arc;

/// The result of a single solve. Two allocations are faster than one, because the memory allocator keeps small blocks for reuse.
pub struct SingleSolution {
    pub n: usize,
    pub rows: Arc<[usize]>,
    /// The velocities, the residuals, the scales and the ranks.
    pub numbers: Vec<f64>,
    /// The Jacobians, the commands, and the upper bounds.
    pub stack: Vec<f64>,
    pub status: Status,
    pub bounded: Option<Box<Bounded>>,
    pub options: Arc<PriorityOptions>,
}

impl SingleSolution {
    /// The velocities, the residuals, the scales, the ranks, the Jacobians, the commands, and the upper bounds.
    pub fn parts(&self) -> [&[f64]; 7] {
        let (total, levels) = (self.rows.iter().sum::<usize>(), self.rows.len());
        let (v, rest) = self.numbers.split_at(self.n);
        let (residuals, rest) = rest.split_at(total);
        let (scales, ranks) = rest.split_at(levels);
        let (jacobian, rest) = self.stack.split_at(total * self.n);
        let (command, upper) = rest.split_at(total);
        [v, residuals, scales, ranks, jacobian, command, upper]
    }
}
