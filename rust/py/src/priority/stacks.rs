//! Batches of stacks for `armlet.solve_priority`.
//!
//! If the batch runs as a recorded program (machine code) and the method is not "sns", the caller's arrays are not copied. The batch is
//! then solved piece by piece, while the interpreter lock is held. Between two pieces other threads can get the lock and change an array.
//! So each piece looks up the arrays again.

use super::solution::PrioritySolution;
use super::stack::Stack;
use crate::arrays::{adopted, out_of_shape, written_array};
use crate::errors::Failure;
use crate::interrupts::{Breaks, long, signalled};
use armlet_core::interrupt::interrupt;
use armlet_core::memory;
use armlet_core::priority::{PrioritySolver, StackAnswers, StackBatch, StackRows};
use armlet_core::simulate::{default_threads, solve_stacks_by};
use pyo3::prelude::*;
use pyo3::types::PyList;

/// The approximate count of numbers in a piece. The number of its rows is rounded up to a multiple of [`ROWS`].
const PIECE: usize = 1 << 20;

/// The number of rows of a piece is a multiple of this number.
const ROWS: usize = 1024;

/// Solve a batch of stacks. `copied` reads the stack again with copies of the arrays, for long work.
pub fn solve<'a>(
    py: Python<'_>,
    function: &str,
    solver: &PrioritySolver,
    stack: Stack<'a>,
    copied: impl FnOnce() -> Result<Stack<'a>, Failure>,
) -> Result<PrioritySolution, Failure> {
    let (count, levels, lead) = (stack.count, stack.rows.len(), stack.lead.clone());
    let shape = |last: usize| -> Vec<usize> { lead.iter().copied().chain([last]).collect() };
    let new = |last: usize| written_array(py, &shape(last), |_| Ok(()));
    let (v, scales) = (new(stack.n)?, new(levels)?);
    let residuals = stack.rows.iter().map(|&m| new(m)).collect::<Result<Vec<_>, _>>()?;
    let mut ranks = memory::untouched::<i64>(count.saturating_mul(levels))?;
    let mut status = memory::untouched::<i32>(count)?;
    let answers = StackAnswers {
        v: out_of_shape(&v, &shape(stack.n)).unwrap_or_default(),
        residuals: residuals.iter().zip(&stack.rows).map(|(r, &m)| out_of_shape(r, &shape(m)).unwrap_or_default()).collect(),
        ranks: &mut ranks,
        scales: out_of_shape(&scales, &shape(levels)).unwrap_or_default(),
        status: &mut status,
    };
    let batch = StackBatch::new(solver, count);
    if batch.is_quick() {
        in_pieces(py, function, &batch, &stack, answers)?;
    } else {
        let stack = copied()?.owned()?;
        let (jacobians, velocities): (Vec<&[f64]>, Vec<&[f64]>) = (0..levels).map(|i| stack.level(i)).unzip();
        long(py, || {
            let given = StackRows { jacobians: &jacobians, velocities: &velocities };
            if solve_stacks_by(&batch, &given, answers, default_threads(), &mut signalled) {
                interrupt();
            }
            Ok(())
        })?;
    }
    let (ranks, status) = (adopted(py, &shape(levels), ranks)?, adopted(py, &lead, status)?);
    let residuals = PyList::new(py, residuals)?.into_any();
    Ok(PrioritySolution::new(py, v.unbind(), residuals.unbind(), ranks.unbind(), scales.unbind(), status.unbind())?)
}

fn in_pieces(py: Python<'_>, function: &str, batch: &StackBatch, stack: &Stack, mut answers: StackAnswers) -> Result<(), Failure> {
    let rows = (PIECE / stack.width().max(1)).max(1).next_multiple_of(ROWS);
    let mut breaks = Breaks::new();
    for first in (0..stack.count).step_by(rows) {
        if first > 0 {
            breaks.pause(py)?;
        }
        let last = (first + rows).min(stack.count);
        let [jacobians, velocities] = stack.piece(py, function, first, last)?;
        let given = StackRows { jacobians: &jacobians, velocities: &velocities };
        let part = answers.first(last - first, stack.n, &stack.rows);
        solve_stacks_by(batch, &given, part, default_threads(), &mut || false);
    }
    Ok(())
}
