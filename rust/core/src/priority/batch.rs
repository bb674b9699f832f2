//! Many stacks of the same sizes: (5) by the program of `regular`, one stack per lane. If that route declines a stack, it is solved
//! alone. So every row has the bits, ranks and status of a single solve, independent of the other rows.

use super::method::PriorityMethod;
use super::regular::regular_ranks;
use super::solver::PrioritySolver;
use crate::error::Result;
use crate::interrupt::look;
use crate::status::Status;
use crate::trace::Sym;
use crate::trace::function::{Evaluation, record};

/// The largest size of a program. The code of a larger one does not fit the caches, so its stacks are solved one by one.
pub(super) const MOST: usize = 12_000;

/// Before a program exists, fewer rows than this are solved one by one, with the same bits.
pub const FEW: usize = 32;

impl PrioritySolver {
    /// The regular route for one row or for lanes. `stack` makes its arguments, rounding, Jacobians and command, from `inputs` numbers. The
    /// results are one if the route is valid and zero if it declines, then `v` and, if requested, the residuals. `None` if the program
    /// would be too long.
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
    /// The regular route of plain stacks, for one or for lanes: from Jacobians, command and rounding to one if it is valid, `v` and
    /// residuals.
    pub(super) fn of_stacks(&self, lanes: bool) -> Option<Evaluation> {
        let (n, total) = (self.n(), self.rows().iter().sum::<usize>());
        let stack = |(), inputs: &[Sym]| {
            let (jacobian, rest) = inputs.split_at(total * n);
            (rest[total], jacobian.to_vec(), rest[..total].to_vec())
        };
        self.recorded(lanes, total * (n + 1) + 1, true, || (), stack)
    }
}

/// A batch of stacks from plain matrices: per level Jacobians `(count, rows_i, n)` and velocities `(count, rows_i)`, row-major, or one of
/// them for all rows.
#[derive(Clone, Copy)]
pub struct StackRows<'a> {
    pub jacobians: &'a [&'a [f64]],
    pub velocities: &'a [&'a [f64]],
}

/// The answers of some rows: `v` `(count, n)`, per level residuals `(count, rows_i)`, `ranks` and `scales` `(count, levels)`,
/// `status` `(count,)` by code. A row that fails is NaN with `Status::Diverged` and ranks of zero.
pub struct StackAnswers<'a> {
    pub v: &'a mut [f64],
    pub residuals: Vec<&'a mut [f64]>,
    pub ranks: &'a mut [i64],
    pub scales: &'a mut [f64],
    pub status: &'a mut [i32],
}

impl<'a> StackAnswers<'a> {
    /// Split off the results of the first `count` rows, for `n` joints and levels with these `rows`.
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

/// Split off the first `size` entries.
fn cut<'a, T>(all: &mut &'a mut [T], size: usize) -> &'a mut [T] {
    let (head, tail) = std::mem::take(all).split_at_mut(size);
    *all = tail;
    head
}

/// Solves batches of stacks on the calling thread, and keeps its buffers.
#[derive(Clone)]
pub struct StackBatch {
    program: Option<Evaluation>,
    single: PrioritySolver,
    ranks: Vec<i64>,
    declined: Vec<usize>,
}

impl StackBatch {
    /// Buffers for batches of `rows` stacks with the sizes and options of `solver`.
    pub fn new(solver: &PrioritySolver, rows: usize) -> Self {
        let (n, total) = (solver.n(), solver.rows().iter().sum::<usize>());
        let mut program = if rows < FEW { None } else { solver.of_stacks(true) };
        if let Some(program) = &mut program {
            program.inputs(total * (n + 1), 1).fill(solver.rounding());
        }
        let ranks = regular_ranks(n, solver.rows()).map(|rank| rank as i64).collect();
        StackBatch { program, single: solver.clone(), ranks, declined: Vec::new() }
    }

    /// The solver of single stacks that it was made with.
    pub fn solver(&self) -> &PrioritySolver {
        &self.single
    }

    /// Whether a row takes microseconds at most: by a program, or without iterations over bounds.
    pub fn is_quick(&self) -> bool {
        self.program.is_some() && self.single.method() != PriorityMethod::Sns
    }

    /// Solve rows `first..last` of the batch.
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
            look();
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

    /// Solve all rows by the program, and note those that it declines.
    fn run(&mut self, given: &StackRows, first: usize, last: usize, answers: &mut StackAnswers) {
        let StackBatch { program, single, declined, .. } = self;
        let Some(program) = program else { return };
        let (n, lanes, count) = (single.n(), program.lanes(), last - first);
        for at in (0..count).step_by(lanes) {
            let (mut to, mut residual) = (0, 1 + n);
            for (level, &m) in single.rows().iter().enumerate() {
                program.read(to, given.jacobians[level], m * n, first + at);
                to += m * n;
            }
            for (level, &m) in single.rows().iter().enumerate() {
                program.read(to, given.velocities[level], m, first + at);
                to += m;
            }
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

/// Solve row `i` of the batch alone. The regular route may have declined it already.
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

/// Row `i` of values with rows of this width, or the only one.
fn row(values: &[f64], width: usize, i: usize) -> &[f64] {
    let i = if values.len() == width { 0 } else { i };
    &values[i * width..(i + 1) * width]
}
