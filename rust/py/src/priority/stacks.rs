//! Batches of stacks for `armlet.solve_priority`.
//!
//! If the batch runs as a recorded program (machine code) and the method is not "sns", the caller's arrays are not copied. The batch is
//! then solved piece by piece, while the interpreter lock is held. Between two pieces other threads can get the lock and change an array.
//! So each piece looks up the arrays again.

use super::details::limits;
use super::solution::PrioritySolution;
use super::stack::Stack;
use crate::arrays::{adopted, out_of_shape, written_array};
use crate::errors::Failure;
use crate::interrupts::{Breaks, long, signalled};
use armlet_core::interrupt::interrupt;
use armlet_core::memory;
use armlet_core::priority::{BoundedAnswers, PriorityOptions, PrioritySolver, StackAnswers, StackBatch, StackRows};
use armlet_core::simulate::{default_threads, solve_stacks_by};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

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
    upper: Option<Stack<'a>>,
    options: &PriorityOptions,
    copied: impl FnOnce() -> Result<Stack<'a>, Failure>,
) -> Result<PrioritySolution, Failure> {
    let (count, levels, lead, stack_n) = (stack.count, stack.rows.len(), stack.lead.clone(), stack.n);
    let shape = |last: usize| -> Vec<usize> { lead.iter().copied().chain([last]).collect() };
    let new = |last: usize| written_array(py, &shape(last), |_| Ok(()));
    let (v, scales) = (new(stack.n)?, new(levels)?);
    let residuals = stack.rows.iter().map(|&m| new(m)).collect::<Result<Vec<_>, _>>()?;
    let mut ranks = memory::untouched::<i64>(count.saturating_mul(levels))?;
    let mut status = memory::untouched::<i32>(count)?;
    let width = stack.rows.iter().sum::<usize>() + options.velocity_bounds().map_or(0, |_| stack.n);
    let mut details = Details::new(solver.is_bounded(), &lead, width)?;
    let answers = StackAnswers {
        v: out_of_shape(&v, &shape(stack.n)).unwrap_or_default(),
        residuals: residuals.iter().zip(&stack.rows).map(|(r, &m)| out_of_shape(r, &shape(m)).unwrap_or_default()).collect(),
        ranks: &mut ranks,
        scales: out_of_shape(&scales, &shape(levels)).unwrap_or_default(),
        status: &mut status,
        bounded: details.answers(),
    };
    let batch = StackBatch::new(solver, count);
    if batch.is_quick() {
        in_pieces(py, function, &batch, &stack, answers)?;
    } else {
        let (stack, upper) = (copied()?.owned()?, upper.map(Stack::owned_velocities).transpose()?);
        let uppers: Vec<&[f64]> = upper.iter().flatten().map(|upper| &**upper).collect();
        let (jacobians, velocities): (Vec<&[f64]>, Vec<&[f64]>) = (0..levels).map(|i| stack.level(i)).unzip();
        long(py, || {
            let given = StackRows { jacobians: &jacobians, velocities: &velocities, uppers: &uppers };
            if solve_stacks_by(&batch, &given, answers, default_threads(), &mut signalled) {
                interrupt();
            }
            Ok(())
        })?;
    }
    let (ranks, status) = (adopted(py, &shape(levels), ranks)?, adopted(py, &lead, status)?);
    let residuals = PyList::new(py, residuals)?.into_any();
    let details = details.dict(py, limits(py, options, stack_n)?)?;
    Ok(PrioritySolution::new(py, v.unbind(), residuals.unbind(), ranks.unbind(), scales.unbind(), status.unbind(), details)?)
}

/// The arrays of the bounds of a batch. They are empty if the solver has no bounds.
struct Details {
    violations: Vec<f64>,
    sides: Vec<i64>,
    multipliers: Vec<f64>,
    changes: Vec<i64>,
    certificate: Vec<f64>,
    lead: Vec<usize>,
    width: usize,
    bounded: bool,
}

impl Details {
    fn new(bounded: bool, lead: &[usize], width: usize) -> Result<Self, Failure> {
        let count = if bounded { lead.iter().product::<usize>() } else { 0 };
        Ok(Details {
            violations: memory::zeros(count.saturating_mul(width))?,
            sides: memory::filled(count.saturating_mul(width), 0)?,
            multipliers: memory::zeros(count.saturating_mul(width))?,
            changes: memory::filled(count, 0)?,
            certificate: memory::zeros(count)?,
            lead: lead.to_vec(),
            width,
            bounded,
        })
    }

    fn answers(&mut self) -> Option<BoundedAnswers<'_>> {
        let Details { violations, sides, multipliers, changes, certificate, bounded, .. } = self;
        bounded.then_some(BoundedAnswers { violations, sides, multipliers, changes, certificate })
    }

    /// The dict of the module `details`; None without bounds.
    fn dict<'py>(self, py: Python<'py>, limits: Option<Bound<'py, PyTuple>>) -> Result<Option<Py<PyAny>>, Failure> {
        if !self.bounded {
            return Ok(None);
        }
        let wide: Vec<usize> = self.lead.iter().copied().chain([self.width]).collect();
        let details = PyDict::new(py);
        details.set_item("limits", limits)?;
        details.set_item("levels", py.None())?;
        details.set_item("violations", adopted(py, &wide, self.violations)?)?;
        details.set_item("sides", adopted(py, &wide, self.sides)?)?;
        details.set_item("multipliers", adopted(py, &wide, self.multipliers)?)?;
        details.set_item("changes", adopted(py, &self.lead, self.changes)?)?;
        details.set_item("certificate", adopted(py, &self.lead, self.certificate)?)?;
        Ok(Some(details.into_any().unbind()))
    }
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
        let given = StackRows { jacobians: &jacobians, velocities: &velocities, uppers: &[] };
        let part = answers.first(last - first, stack.n, &stack.rows);
        solve_stacks_by(batch, &given, part, default_threads(), &mut || false);
    }
    Ok(())
}
