//! Batches of stacks with equal sizes. A program (the recorded and compiled algorithm `regular`) solves one stack per lane. It reports the
//! stacks for which its result is not valid, and these are solved one by one. For small batches and large stacks there is no program, so
//! all stacks are solved one by one. Every row has the bits, ranks and status of a single solve, and does not depend on other rows.

use super::branch_free::{self, BranchFree, MOST_OPERATIONS, WithinBounds, regular_ranks};
use super::solution::{Bounded, Solution};
use super::solver::PrioritySolver;
use super::stack::{Stack, level_ranges};
use crate::error::Result;
use crate::interrupt;
use crate::status::Status;
use crate::trace::Sym;
use crate::trace::function::{Evaluation, record};
use crate::trace::rows::Rows;

/// Batches of fewer rows are solved one by one, with the same bits.
pub const FEWEST_ROWS: usize = 32;

impl PrioritySolver {
    /// Record the algorithm `regular` as a program for lanes. The program has `inputs` numbers as inputs. From the value of `set_up` and
    /// these numbers, the function `stack` computes `rounding`, the Jacobians, and the command. `rounding` is the relative error of the
    /// entries of the Jacobians.
    ///
    /// The results are a flag, then `v`. The flag is one if `v` is valid, otherwise zero. The return value is `None` if the program would be
    /// too long, if each stack requires a search, or if a level has bounds.
    pub fn recorded<T>(
        &self,
        inputs: usize,
        set_up: impl FnOnce() -> T,
        stack: impl FnOnce(T, &[Sym]) -> (Sym, Vec<Sym>, Vec<Sym>),
    ) -> Option<Evaluation> {
        let recordable = self.has_regular_stacks() && self.given.upper.is_empty();
        if !recordable || WithinBounds::<Sym>::operations(self.n(), self.rows()) > MOST_OPERATIONS {
            return None;
        }
        let set_up = || (WithinBounds::<Sym>::new(self.n(), self.rows(), &self.settings), set_up());
        record(true, inputs, set_up, |(mut regular, made), inputs| {
            let (rounding, jacobian, command) = stack(made, inputs);
            let valid = regular.solve(rounding, &jacobian, &command, &[]);
            [&[valid], regular.results()[0]].concat()
        })
    }
}

/// A batch of stacks, row-major. Each level has Jacobians, shape `(count, rows_i, n)`, and velocities, shape `(count, rows_i)`. One
/// Jacobian or velocity may apply to all stacks.
///
/// ```
/// use armlet_core::priority::StackRows;
///
/// // Two stacks with one level of one row. Both have the same Jacobian.
/// let given = StackRows { jacobians: &[&[1.0, 1.0]], velocities: &[&[2.0, 4.0]], uppers: &[] };
/// # use armlet_core::priority::{PriorityOptions, PrioritySolver, StackAnswers, StackBatch};
/// # let (mut v, mut r, mut ranks, mut scales, mut status) = ([0.0; 4], [0.0; 2], [0; 2], [0.0; 2], [0; 2]);
/// # let residuals = vec![&mut r[..]];
/// # let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status, bounded: None };
/// let mut batch = StackBatch::new(&PrioritySolver::new(2, &[1], &PriorityOptions::default())?, 2);
/// batch.solve(&given, 0, 2, &mut answers);
/// assert!(v.iter().zip([1.0, 1.0, 2.0, 2.0]).all(|(v, expected)| (v - expected).abs() < 1e-15));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy)]
pub struct StackRows<'a> {
    pub jacobians: &'a [&'a [f64]],
    pub velocities: &'a [&'a [f64]],
    /// The upper bounds of the levels, whose `velocities` are then lower bounds. Empty if no level has bounds.
    pub uppers: &'a [&'a [f64]],
}

/// The results of a batch: `v`, shape `(count, n)`, and for each level residuals, shape `(count, rows_i)`. `ranks` and `scales` have the
/// shape `(count, levels)`. `status` has the shape `(count,)`, with codes. A row that fails is NaN, with `Status::Diverged` and ranks of
/// zero.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackAnswers, StackBatch, StackRows};
/// use armlet_core::status::Status;
///
/// let (mut v, mut residual, mut ranks, mut scales, mut status) = ([0.0; 4], [0.0; 2], [0; 2], [0.0; 2], [0; 2]);
/// let residuals = vec![&mut residual[..]];
/// let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status, bounded: None };
/// # let solver = PrioritySolver::new(2, &[1], &PriorityOptions::new(PriorityMethod::Exact))?;
/// // The Jacobian of the second stack is zero.
/// let given = StackRows { jacobians: &[&[0.0, 2.0, 0.0, 0.0]], velocities: &[&[1.0, 1.0]], uppers: &[] };
/// StackBatch::new(&solver, 2).solve(&given, 0, 2, &mut answers);
/// assert_eq!((v, residual, ranks), ([0.0, 0.5, 0.0, 0.0], [0.0, 1.0], [1, 0]));
/// assert_eq!(status, [Status::Success as i32, Status::Degraded as i32]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct StackAnswers<'a> {
    pub v: &'a mut [f64],
    pub residuals: Vec<&'a mut [f64]>,
    pub ranks: &'a mut [i64],
    pub scales: &'a mut [f64],
    pub status: &'a mut [i32],
    /// The bounds of the solutions, if the solver has bounds.
    pub bounded: Option<BoundedAnswers<'a>>,
}

/// The bounds of the solutions of a batch. The first three have the shape `(count, limits + rows)`, with the numbers of
/// [`Bounded`](super::Bounded). `changes` and `certificate` have the shape `(count,)`.
///
/// ```
/// use armlet_core::priority::{BoundedAnswers, PriorityOptions, PrioritySolver, StackAnswers, StackBatch, StackRows};
///
/// let options = PriorityOptions { v_max: Some(vec![1.0, 1.0]), ..PriorityOptions::default() };
/// let (mut violations, mut sides, mut multipliers, mut changes, mut certificate) = ([0.0; 3], [0; 3], [0.0; 3], [0], [0.0]);
/// # let (mut v, mut r, mut ranks, mut scales, mut status) = ([0.0; 2], [0.0], [0], [0.0], [0]);
/// let bounded = BoundedAnswers {
///     violations: &mut violations, sides: &mut sides, multipliers: &mut multipliers, changes: &mut changes, certificate: &mut certificate,
/// };
/// # let residuals = vec![&mut r[..]];
/// # let bounded = Some(bounded);
/// # let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status, bounded };
/// // Both joints are at their upper bounds, and the task is one short.
/// let given = StackRows { jacobians: &[&[1.0, 1.0]], velocities: &[&[3.0]], uppers: &[] };
/// StackBatch::new(&PrioritySolver::new(2, &[1], &options)?, 1).solve(&given, 0, 1, &mut answers);
/// assert_eq!((sides, violations[2]), ([1, 1, 0], -1.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct BoundedAnswers<'a> {
    pub violations: &'a mut [f64],
    pub sides: &'a mut [i64],
    pub multipliers: &'a mut [f64],
    pub changes: &'a mut [i64],
    pub certificate: &'a mut [f64],
}

impl<'a> BoundedAnswers<'a> {
    /// Split off the results of the first `count` stacks.
    fn first(&mut self, count: usize) -> BoundedAnswers<'a> {
        let width = self.violations.len() / self.changes.len().max(1);
        BoundedAnswers {
            violations: cut(&mut self.violations, count * width),
            sides: cut(&mut self.sides, count * width),
            multipliers: cut(&mut self.multipliers, count * width),
            changes: cut(&mut self.changes, count),
            certificate: cut(&mut self.certificate, count),
        }
    }

    /// Write the bounds of stack `i`.
    fn set(&mut self, i: usize, bounded: &Bounded) {
        let width = bounded.violations.len();
        let rows = i * width..(i + 1) * width;
        self.violations[rows.clone()].copy_from_slice(&bounded.violations);
        self.multipliers[rows.clone()].copy_from_slice(&bounded.multipliers);
        self.sides[rows].iter_mut().zip(&bounded.sides).for_each(|(to, side)| *to = i64::from(*side));
        (self.changes[i], self.certificate[i]) = (bounded.changes as i64, bounded.certificate);
    }
}

impl<'a> StackAnswers<'a> {
    /// Split off the results of the first `count` stacks. `n`: number of joints. `rows`: number of rows of each level.
    pub fn first(&mut self, count: usize, n: usize, rows: &[usize]) -> StackAnswers<'a> {
        StackAnswers {
            v: cut(&mut self.v, count * n),
            residuals: self.residuals.iter_mut().zip(rows).map(|(r, m)| cut(r, count * m)).collect(),
            ranks: cut(&mut self.ranks, count * rows.len()),
            scales: cut(&mut self.scales, count * rows.len()),
            status: cut(&mut self.status, count),
            bounded: self.bounded.as_mut().map(|bounded| bounded.first(count)),
        }
    }

    /// Write the solution of stack `i`.
    fn set(&mut self, i: usize, solution: &Solution) {
        let (n, levels) = (solution.v.len(), solution.levels.len());
        self.v[i * n..(i + 1) * n].copy_from_slice(&solution.v);
        self.status[i] = solution.status.code();
        if let (Some(answers), Some(bounded)) = (&mut self.bounded, &solution.bounded) {
            answers.set(i, bounded);
        }
        for (k, level) in solution.levels.iter().enumerate() {
            let residual = solution.residual(k);
            self.residuals[k][i * residual.len()..(i + 1) * residual.len()].copy_from_slice(residual);
            (self.ranks[i * levels + k], self.scales[i * levels + k]) = (level.rank as i64, level.scale);
        }
    }
}

/// Split off the first `size` elements.
fn cut<'a, T>(all: &mut &'a mut [T], size: usize) -> &'a mut [T] {
    let (head, tail) = std::mem::take(all).split_at_mut(size);
    *all = tail;
    head
}

/// A solver for batches of stacks on the calling thread, with its memory.
///
/// ```
/// use armlet_core::priority::{PriorityOptions, PrioritySolver, StackAnswers, StackBatch, StackRows};
///
/// let solver = PrioritySolver::new(2, &[1, 1], &PriorityOptions::default())?;
/// let mut batch = StackBatch::new(&solver, 64);
/// # let (mut v, mut r1, mut r2, mut ranks, mut scales, mut status) = ([0.0; 128], [0.0; 64], [0.0; 64], [0; 128], [0.0; 128], [0; 64]);
/// # let residuals = vec![&mut r1[..], &mut r2[..]];
/// # let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status, bounded: None };
/// let commands: Vec<f64> = (0..64).map(f64::from).collect();
/// let given = StackRows { jacobians: &[&[1.0, 0.0], &[0.0, 2.0]], velocities: &[&commands, &[1.0]], uppers: &[] };
/// batch.solve(&given, 0, 64, &mut answers);
/// assert!((v[126] - 63.0).abs() < 1e-13 && (v[127] - 0.5).abs() < 1e-15);
/// assert_eq!(ranks, [1; 128]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct StackBatch {
    program: Option<Evaluation>,
    single: PrioritySolver,
    /// The solution of a row that fails.
    failed: Solution,
    /// The bounds of a row that no bound restricts.
    free: Option<Bounded>,
    ranks: Vec<i64>,
    declined: Vec<usize>,
}

impl StackBatch {
    /// Create a solver for batches of `rows` stacks, with the sizes and options of `solver`.
    pub fn new(solver: &PrioritySolver, rows: usize) -> Self {
        let (n, total) = (solver.n(), solver.rows().iter().sum::<usize>());
        let mut program = if rows < FEWEST_ROWS || !solver.has_regular_stacks() {
            None
        } else {
            branch_free::recorded::<WithinBounds<Sym>>(&solver.given, &solver.settings, true)
        };
        if let Some(program) = &mut program {
            program.inputs(total * (n + 1) + solver.given.upper.len(), 1).fill(solver.settings.rounding);
        }
        let ranks = regular_ranks(n, solver.rows(), &solver.given.intervals).map(|rank| rank as i64).collect();
        let failed = solver.failed();
        StackBatch { program, single: solver.clone(), free: failed.bounded.clone(), failed, ranks, declined: Vec::new() }
    }

    /// The solver of single stacks from which this solver was made.
    pub fn solver(&self) -> &PrioritySolver {
        &self.single
    }

    /// Whether the solver is fast for most stacks: a program exists, and there are no bounds.
    pub fn is_quick(&self) -> bool {
        self.program.is_some() && !self.single.is_bounded()
    }

    /// Solve the stacks `first..last` of the batch. Row 0 of `answers` belongs to the stack `first`.
    pub fn solve(&mut self, given: &StackRows, first: usize, last: usize, answers: &mut StackAnswers) {
        let count = last - first;
        self.declined.clear();
        if self.program.is_some() {
            self.run(given, first, last, answers);
        } else {
            self.declined.extend(0..count);
        }
        if self.declined.len() < count {
            answers.ranks.chunks_exact_mut(self.ranks.len()).for_each(|ranks| ranks.copy_from_slice(&self.ranks));
            answers.scales.fill(1.0);
            answers.status.fill(Status::Success.code());
            self.set_free(answers);
        }
        let StackBatch { program, single, failed, declined, .. } = self;
        for &i in declined.iter() {
            interrupt::check();
            answers.set(i, solve_one(single, given, first + i, program.is_some()).unwrap_or(failed));
        }
    }

    /// Write the bounds of all stacks, as of solutions that no bound restricts.
    fn set_free(&mut self, answers: &mut StackAnswers) {
        let (StackAnswers { v, residuals, bounded: Some(answers), .. }, Some(bounded)) = (answers, &mut self.free) else { return };
        let (n, mut residual) = (self.single.n(), Vec::with_capacity(bounded.violations.len()));
        for (i, v) in v.chunks_exact(n).enumerate() {
            residual.clear();
            residuals.iter().zip(self.single.rows()).for_each(|(all, &m)| residual.extend_from_slice(&all[i * m..(i + 1) * m]));
            let certificate = if self.single.settings.certifies() { answers.certificate[i] } else { f64::NAN };
            bounded.set_free(v, &residual, self.single.bounds(), certificate);
            answers.set(i, bounded);
        }
    }

    /// Solve the stacks `first..last` with the program. Write to `declined` the rows for which its result is not valid.
    fn run<'a>(&mut self, given: &StackRows<'a>, first: usize, last: usize, answers: &mut StackAnswers) {
        let StackBatch { program, single, declined, .. } = self;
        let Some(program) = program else { return };
        let (n, lanes, count) = (single.n(), program.lanes(), last - first);
        let with = |values: &'a [&'a [f64]], columns: usize| {
            values.iter().zip(single.rows()).map(move |(numbers, &m)| Rows { numbers, width: m * columns })
        };
        let inputs: Vec<Rows> = with(given.jacobians, n).chain(with(given.velocities, 1)).chain(with(given.uppers, 1)).collect();
        for at in (0..count).step_by(lanes) {
            let mut residual = 1 + n;
            program.read(&inputs, first + at);
            program.run();
            let end = (at + lanes).min(count);
            program.write(1, n, &mut answers.v[at * n..end * n]);
            for (answer, &m) in answers.residuals.iter_mut().zip(single.rows()) {
                program.write(residual, m, &mut answer[at * m..end * m]);
                residual += m;
            }
            if let Some(bounded) = answers.bounded.as_mut().filter(|_| single.settings.certifies()) {
                program.write(residual, 1, &mut bounded.certificate[at..end]);
            }
            declined.extend((at..end).zip(program.output(0)).filter(|(_, valid)| **valid != 1.0).map(|(row, _)| row));
        }
    }
}

/// Solve stack `i` of the batch alone. `declined`: whether the algorithm `regular` has already reported that it is not valid for this
/// stack.
fn solve_one<'a>(solver: &'a mut PrioritySolver, given: &StackRows, i: usize, declined: bool) -> Result<&'a Solution> {
    // A row does not depend on the active set of another row.
    solver.clear_active_set();
    let Stack { n, rows, jacobian, command, upper, .. } = &mut solver.given;
    for ((level, jacobians), velocities) in level_ranges(rows).zip(given.jacobians).zip(given.velocities) {
        jacobian[level.start * *n..level.end * *n].copy_from_slice(row(jacobians, level.len() * *n, i));
        command[level.clone()].copy_from_slice(row(velocities, level.len(), i));
    }
    for (level, uppers) in level_ranges(rows).zip(given.uppers) {
        upper[level.clone()].copy_from_slice(row(uppers, level.len(), i));
    }
    if declined { solver.run_declined() } else { solver.run() }
}

/// Return row `i` of values with `width` numbers per row. If the values have only one row, return this row.
fn row(values: &[f64], width: usize, i: usize) -> &[f64] {
    let i = if values.len() == width { 0 } else { i };
    &values[i * width..(i + 1) * width]
}
