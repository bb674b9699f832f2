//! The numbers of a single solve.

use armlet_core::priority::{Bounded, PriorityOptions};
use armlet_core::status::Status;
use std::sync::Arc;

/// The memory of the last two solutions. It is used again when their Python objects no longer exist. In a loop, the solution of a call
/// exists until the next one replaces it, so that two are sufficient, and a call allocates none.
#[derive(Default)]
pub struct Memory([Arc<Vec<f64>>; 2]);

impl Memory {
    /// Write numbers to the memory of the solution before the last, or to new memory.
    pub fn fill(&mut self, write: impl FnOnce(&mut Vec<f64>)) -> Arc<Vec<f64>> {
        let Memory(memory) = self;
        memory.swap(0, 1);
        if Arc::get_mut(&mut memory[0]).is_none() {
            memory[0] = Arc::default();
        }
        if let Some(numbers) = Arc::get_mut(&mut memory[0]) {
            numbers.clear();
            write(numbers);
        }
        memory[0].clone()
    }
}

/// The result of a single solve.
pub struct SingleSolution {
    pub n: usize,
    pub rows: Arc<[usize]>,
    /// The numbers of [`SingleSolution::parts`].
    pub numbers: Arc<Vec<f64>>,
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
        let (scales, rest) = rest.split_at(levels);
        let (ranks, rest) = rest.split_at(levels);
        let (jacobian, rest) = rest.split_at(total * self.n);
        let (command, upper) = rest.split_at(total);
        [v, residuals, scales, ranks, jacobian, command, upper]
    }
}
