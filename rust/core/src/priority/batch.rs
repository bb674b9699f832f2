//! Batches of stacks with equal sizes. A program (the recorded and compiled algorithm `regular`) solves one stack per lane. It reports the
//! stacks for which its result is not valid, and these are solved one by one. For small batches and large stacks there is no program, so
//! all stacks are solved one by one. Every row has the bits, ranks and status of a single solve, and does not depend on other rows.

use super::method::PriorityMethod;
use super::regular::regular_ranks;
use super::solver::PrioritySolver;
use crate::error::Result;
use crate::interrupt;
use crate::scalar::Real;
use crate::status::Status;
use crate::trace::Sym;
use crate::trace::function::{Evaluation, record};
use crate::trace::rows::Rows;

/// The largest size of a program, as a rough number of operations. Larger stacks are solved one by one instead.
const MOST: usize = 12_000;

/// Batches of fewer rows are solved one by one, with the same bits.
pub const FEW: usize = 32;

impl PrioritySolver {
    /// Record the algorithm `regular` as a program, for one row or for lanes. The program has `inputs` numbers as inputs. From the value of
    /// `set_up` and these numbers, the function `stack` computes `rounding`, the Jacobians, and the command. `rounding` is the relative
    /// error of the entries of the Jacobians.
    ///
    /// The results are a flag, then `v` and, if requested, the residuals. The flag is one if the results are valid, otherwise zero. The
    /// return value is `None` if the program would be too long.
    pub fn recorded<T>(
        &self,
        lanes: bool,
        inputs: usize,
        residuals: bool,
        set_up: impl FnOnce() -> T,
        stack: impl FnOnce(T, &[Sym]) -> (Sym, Vec<Sym>, Vec<Sym>),
    ) -> Option<Evaluation> {
        let size = self.n() * self.n() * self.rows().iter().sum::<usize>();
        if size > MOST {
            return None;
        }
        let set_up = || (self.regular::<Sym>(), set_up());
        record(lanes, inputs, set_up, |(mut route, made), inputs| {
            let (rounding, jacobian, command) = stack(made, inputs);
            let stands = route.solve(rounding, &jacobian, &command);
            let rest = if residuals { &route.residual[..] } else { &[] };
            [&[stands], &route.v[..], rest].concat()
        })
    }
}

impl PrioritySolver {
    /// Record the closed-form algorithm (`pairs.rs`) as a program for single stacks. The arguments are Jacobians and command. The results
    /// are a flag of validity, `v`, residuals, ranks and, for each level, whether a direction is lost. Return `None` if the program would
    /// be too long.
    pub(super) fn of_pairs(&self) -> Option<Evaluation> {
        let (n, total, levels) = (self.n(), self.rows().iter().sum::<usize>(), self.rows().len());
        if n * total * (total + levels) > MOST {
            return None;
        }
        let set_up = || self.pairs::<Sym>();
        record(false, total * (n + 1), set_up, |route, inputs| {
            let Some(mut route) = route else { return vec![Sym::zero(); 1 + n + total + 2 * levels] };
            let (jacobian, command) = inputs.split_at(total * n);
            let stands = route.solve(jacobian, command);
            [&[stands], &route.v[..], &route.residual, &route.ranks, &route.lost].concat()
        })
    }
}

impl PrioritySolver {
    /// Record the algorithm `regular` for stacks of plain matrices. The arguments are Jacobians, command, and the relative error `rounding`
    /// of the entries of the Jacobians. The results are the flag of validity, `v` and the residuals. Return `None` if the program would be
    /// too long.
    pub(super) fn of_stacks(&self, lanes: bool) -> Option<Evaluation> {
        let (n, total) = (self.n(), self.rows().iter().sum::<usize>());
        let stack = |(), inputs: &[Sym]| {
            let (jacobian, rest) = inputs.split_at(total * n);
            (rest[total], jacobian.to_vec(), rest[..total].to_vec())
        };
        self.recorded(lanes, total * (n + 1) + 1, true, || (), stack)
    }
}

/// A batch of stacks, row-major. Each level has Jacobians, shape `(count, rows_i, n)`, and velocities, shape `(count, rows_i)`. One
/// Jacobian or velocity may apply to all stacks.
///
/// ```
/// use armlet_core::priority::StackRows;
///
/// // Two stacks with one level of one row. Both have the same Jacobian.
/// let given = StackRows { jacobians: &[&[1.0, 1.0]], velocities: &[&[2.0, 4.0]] };
/// # use armlet_core::priority::{PriorityOptions, PrioritySolver, StackAnswers, StackBatch};
/// # let (mut v, mut r, mut ranks, mut scales, mut status) = ([0.0; 4], [0.0; 2], [0; 2], [0.0; 2], [0; 2]);
/// # let residuals = vec![&mut r[..]];
/// # let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status };
/// let mut batch = StackBatch::new(&PrioritySolver::new(2, &[1], &PriorityOptions::default())?, 2);
/// batch.solve(&given, 0, 2, &mut answers);
/// assert!(v.iter().zip([1.0, 1.0, 2.0, 2.0]).all(|(v, expected)| (v - expected).abs() < 1e-15));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy)]
pub struct StackRows<'a> {
    pub jacobians: &'a [&'a [f64]],
    pub velocities: &'a [&'a [f64]],
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
/// let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status };
/// # let solver = PrioritySolver::new(2, &[1], &PriorityOptions::new(PriorityMethod::Exact))?;
/// // The Jacobian of the second stack is zero.
/// let given = StackRows { jacobians: &[&[0.0, 2.0, 0.0, 0.0]], velocities: &[&[1.0, 1.0]] };
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
/// # let mut answers = StackAnswers { v: &mut v, residuals, ranks: &mut ranks, scales: &mut scales, status: &mut status };
/// let commands: Vec<f64> = (0..64).map(f64::from).collect();
/// let given = StackRows { jacobians: &[&[1.0, 0.0], &[0.0, 2.0]], velocities: &[&commands, &[1.0]] };
/// batch.solve(&given, 0, 64, &mut answers);
/// assert!((v[126] - 63.0).abs() < 1e-13 && (v[127] - 0.5).abs() < 1e-15);
/// assert_eq!(ranks, [1; 128]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct StackBatch {
    program: Option<Evaluation>,
    single: PrioritySolver,
    ranks: Vec<i64>,
    declined: Vec<usize>,
}

impl StackBatch {
    /// Create a solver for batches of `rows` stacks, with the sizes and options of `solver`.
    pub fn new(solver: &PrioritySolver, rows: usize) -> Self {
        let (n, total) = (solver.n(), solver.rows().iter().sum::<usize>());
        let mut program = if rows < FEW { None } else { solver.of_stacks(true) };
        if let Some(program) = &mut program {
            program.inputs(total * (n + 1), 1).fill(solver.rounding());
        }
        let ranks = regular_ranks(n, solver.rows()).map(|rank| rank as i64).collect();
        StackBatch { program, single: solver.clone(), ranks, declined: Vec::new() }
    }

    /// The solver of single stacks from which this solver was made.
    pub fn solver(&self) -> &PrioritySolver {
        &self.single
    }

    /// Whether the solver is fast for most stacks: a program exists, and the method does not search over bounds.
    pub fn is_quick(&self) -> bool {
        self.program.is_some() && self.single.method() != PriorityMethod::Sns
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
        }
        let StackBatch { program, single, declined, .. } = self;
        let (n, levels) = (single.n(), single.rows().len());
        for &i in declined.iter() {
            interrupt::check();
            let ended = solve_one(single, given, first + i, program.is_some());
            let sound = ended.is_ok();
            let or_nan = |x: f64| if sound { x } else { f64::NAN };
            answers.status[i] = ended.unwrap_or(Status::Diverged).code();
            answers.v[i * n..(i + 1) * n].iter_mut().zip(single.v()).for_each(|(to, x)| *to = or_nan(*x));
            for (level, residual) in answers.residuals.iter_mut().enumerate() {
                let m = single.rows()[level];
                residual[i * m..(i + 1) * m].iter_mut().zip(single.residual(level)).for_each(|(to, x)| *to = or_nan(*x));
                answers.ranks[i * levels + level] = if sound { single.ranks()[level] as i64 } else { 0 };
                answers.scales[i * levels + level] = or_nan(single.scales()[level]);
            }
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
        let inputs: Vec<Rows> = with(given.jacobians, n).chain(with(given.velocities, 1)).collect();
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
            declined.extend((at..end).zip(program.output(0)).filter(|(_, stands)| **stands != 1.0).map(|(row, _)| row));
        }
    }
}

/// Solve stack `i` of the batch alone. `declined`: whether the algorithm `regular` has already reported that it is not valid for this
/// stack.
fn solve_one(solver: &mut PrioritySolver, given: &StackRows, i: usize, declined: bool) -> Result<Status> {
    let (n, levels) = (solver.n(), solver.rows().len());
    let (mut at, mut to) = (0, 0);
    for level in 0..levels {
        let m = solver.rows()[level];
        let (jacobian, command) = solver.inputs();
        jacobian[at..at + m * n].copy_from_slice(row(given.jacobians[level], m * n, i));
        command[to..to + m].copy_from_slice(row(given.velocities[level], m, i));
        at += m * n;
        to += m;
    }
    if declined { solver.run_declined() } else { solver.run() }
}

/// Return row `i` of values with `width` numbers per row. If the values have only one row, return this row.
fn row(values: &[f64], width: usize, i: usize) -> &[f64] {
    let i = if values.len() == width { 0 } else { i };
    &values[i * width..(i + 1) * width]
}
