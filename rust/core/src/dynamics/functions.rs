//! The functions of an arm, for any number of threads. Each function is first evaluated directly. After a number of single calls
//! (`single`), or of rows announced with [`Functions::prepare`], it is recorded and compiled to a *program*. Functions whose program would
//! be too long are never compiled.
//!
//! A program and the direct evaluation have the same bits.

use super::Query;
use super::evaluate::{Evaluator, check};
use super::recorded::ArmFunction;
use super::single::Single;
use crate::arm::Arm;
use crate::error::Result;
use crate::trace::cache::free;
use std::sync::{Arc, Mutex};

/// Number of announced rows of a query after which its program is made.
const ROWS_BEFORE_PROGRAM: usize = 256;

/// Number of queries of one arm whose programs for rows are kept.
const KEPT_QUERIES: usize = 64;

/// Largest number of operations of a program for rows. It limits the time to make the program.
const LONGEST: f64 = 600_000.0;

/// Largest number of joints for which the buffers are made together with the arm. For more joints, they are made at the first call.
const FEW_JOINTS: usize = 1024;

/// A query, and its function for many rows.
struct Known {
    query: Query,
    /// Number of rows that [`Functions::prepare`] announced.
    rows: usize,
    function: Option<Arc<ArmFunction>>,
}

/// The quantities of an arm at one configuration ([`Functions::one`]) and at many ([`Functions::rows`]).
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::{Functions, Quantity};
/// use std::sync::Arc;
///
/// let arm = Functions::new(Arc::new(Arm::pendulum(1.0, 5.0)?));
/// let (q, mut g) = ([-0.3, 0.0, 0.3], [0.0; 3]);
/// assert!(arm.rows(&Quantity::Gravity.into(), &[&q], 3, &mut g)?);
/// assert_eq!((g[0], g[1]), (-g[2], 0.0));
/// // The same bits as for one configuration.
/// let mut one = [0.0];
/// assert!(arm.one(&Quantity::Gravity.into(), &[&[0.3]], &mut one)? && one[0] == g[2]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Functions {
    arm: Arc<Arm>,
    single: Mutex<Single>,
    /// The queries in the order of their last announcement, the most recent last.
    known: Mutex<Vec<Known>>,
}

impl Functions {
    /// Create the functions of an arm.
    pub fn new(arm: Arc<Arm>) -> Self {
        let evaluator = (arm.joints.len() <= FEW_JOINTS).then(|| Evaluator::new(&arm));
        Functions { single: Single::new(evaluator), known: Mutex::default(), arm }
    }

    /// The arm.
    pub fn arm(&self) -> &Arc<Arm> {
        &self.arm
    }

    /// Evaluate one configuration, as [`Evaluator::one`] does, with the same errors.
    pub fn one(&self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        match free(&self.single) {
            Some(mut single) => single.one(&self.arm, query, inputs, out),
            // Another thread uses the buffers, so this call creates new buffers.
            None => Evaluator::large(&self.arm)?.one(query, inputs, out),
        }
    }

    /// Whether [`Functions::prepare`] would make a program now, which can take a second.
    pub fn is_due(&self, query: &Query, count: usize) -> bool {
        let waiting = |known: &Known| if known.function.is_some() { usize::MAX } else { known.rows };
        let Some(known) = free(&self.known) else { return false };
        let rows = known.iter().find(|known| known.query == *query).map_or(0, waiting);
        rows < usize::MAX && rows + count >= ROWS_BEFORE_PROGRAM && query.operations(self.arm.size(), self.arm.pairs()) <= LONGEST
    }

    /// Announce `count` more rows of the query, and make its program if [`Functions::is_due`] is true. Errors: `Memory`.
    pub fn prepare(&self, query: &Query, count: usize) -> Result<()> {
        let due = self.is_due(query, count);
        let function = if due { Some(Arc::new(ArmFunction::new(&self.arm, query)?)) } else { None };
        let Some(mut all) = free(&self.known) else { return Ok(()) };
        let mut known = match all.iter().position(|known| known.query == *query) {
            Some(at) => all.remove(at),
            None => Known { query: *query, rows: 0, function: None },
        };
        known.rows = known.rows.saturating_add(count);
        known.function = known.function.or(function);
        all.push(known);
        if all.len() > KEPT_QUERIES {
            all.remove(0);
        }
        Ok(())
    }

    /// Evaluate `count` configurations, the rows of the inputs, and write the rows of `out`. Return whether every number is finite. The
    /// division of rows into calls does not change their bits. Errors: as for [`Evaluator::one`].
    pub fn rows(&self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> Result<bool> {
        let (n, length) = (self.arm.n(), query.length(self.arm.size()));
        check(query, inputs, count, self.arm.size(), self.arm.frames.len(), out.len())?;
        if out.is_empty() {
            return Ok(true);
        }
        let (mut evaluator, mut all_finite) = (None, true);
        let mut direct = |i: usize, out: &mut [f64]| {
            let mut row: [&[f64]; 4] = [&[]; 4];
            for (k, given) in inputs.iter().enumerate() {
                let width = query.input_length(k, n);
                row[k] = &given[i * width..][..width];
            }
            let evaluator: &mut Evaluator = evaluator.get_or_insert_with(|| Evaluator::sized(&self.arm, false));
            all_finite &= evaluator.one(query, &row[..inputs.len()], out)?;
            Ok(())
        };
        let function = free(&self.known).and_then(|known| known.iter().find(|known| known.query == *query)?.function.clone());
        match function {
            Some(function) => function.rows(inputs, out, direct)?,
            None => out.chunks_exact_mut(length).enumerate().try_for_each(|(i, out)| direct(i, out))?,
        }
        Ok(all_finite)
    }
}

impl Arm {
    /// Evaluate `count` configurations once, as [`Functions::rows`] does, with the same errors. No program is kept for later calls.
    pub fn evaluate(self: &Arc<Self>, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> Result<bool> {
        let single = Single::new(Some(Evaluator::sized(self, false)));
        let functions = Functions { arm: self.clone(), single, known: Mutex::default() };
        functions.prepare(query, count)?;
        functions.rows(query, inputs, count, out)
    }
}
