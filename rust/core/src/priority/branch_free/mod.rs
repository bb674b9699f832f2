//! Algorithms whose code never branches on numbers: `regular` for stacks away from singularities, and `two_rows` for levels of at most two
//! rows. They can therefore be recorded and compiled as programs. Both check their result. If it is not valid, the algorithms with
//! singular values (`hierarchy`) solve the stack.

mod level_rows;
mod lq;
mod regular;
mod single_levels;
mod two_rows;
mod within_bounds;

pub use regular::{Regular, regular_ranks};
pub use two_rows::TwoRowLevels;
pub use within_bounds::WithinBounds;

use super::method::DEFAULT_EPS;
use super::metric::Metric;
use super::settings::Settings;
use super::stack::Stack;
use crate::scalar::Real;
use crate::trace::function::record;
use crate::trace::{Evaluation, Sym};

/// The largest size of a program. Larger stacks are solved one by one, without a program.
pub const MOST_OPERATIONS: usize = 12_000;

/// The number of direct solves after which a program is made.
const SOLVES_BEFORE_PROGRAM: u64 = 16;

/// An algorithm for stacks of one size.
pub(super) trait BranchFree<S> {
    /// Create the algorithm for `n` joints and levels of these sizes.
    fn new(n: usize, rows: &[usize], settings: &Settings) -> Self;

    /// The rough number of operations for stacks of this size.
    fn operations(n: usize, rows: &[usize]) -> usize;

    /// Solve the stack `jacobian`, shape `(sum rows, n)`, for the command `command`. `rounding` is the relative error of the entries of
    /// `jacobian`. If a level has bounds, `upper` are the upper bounds, as in [`Stack`], otherwise it is empty. Return one if the result is
    /// valid, otherwise zero.
    fn solve(&mut self, rounding: S, jacobian: &[S], command: &[S], upper: &[S]) -> S;

    /// The results of the last solve: joint velocities, stacked residuals, and for each level its rank and whether it is singular (one or
    /// zero). The ranks are empty if they are those of a regular stack. The last result is the certificate, or empty without one.
    fn results(&self) -> [&[S]; 5];

    /// The numbers of the settings that the algorithm uses.
    fn parameters(&mut self) -> &mut Parameters<S>;
}

/// The thresholds and the metric of an algorithm.
#[derive(Debug, Clone)]
pub struct Parameters<S> {
    /// The squares of the thresholds in the options.
    eps2: Option<Vec<S>>,
    pub metric: Option<Metric<S>>,
}

impl<S: Real> Parameters<S> {
    fn new(settings: &Settings) -> Self {
        let mut parameters = Parameters { eps2: None, metric: settings.metric.as_ref().map(Metric::lift) };
        settings.eps.iter().for_each(|eps| parameters.set_eps(eps));
        parameters
    }

    /// Set the thresholds of the levels, shape `(levels,)`. The existing memory is reused, because some searches set thresholds in every
    /// step.
    pub fn set_eps(&mut self, eps: &[f64]) {
        let eps2 = self.eps2.get_or_insert_with(|| vec![S::zero(); eps.len()]);
        eps2.iter_mut().zip(eps).for_each(|(to, eps)| *to = S::varying(eps * eps));
    }

    /// Set the squares of the thresholds of the levels.
    pub fn set_eps2(&mut self, eps2: Vec<S>) {
        self.eps2 = Some(eps2);
    }

    /// Return the square of the threshold of level `i`. `row_norm2` is the square of the level's largest row norm.
    fn threshold2(&self, i: usize, row_norm2: S) -> S {
        self.eps2.as_deref().map_or(S::splat(DEFAULT_EPS * DEFAULT_EPS) * row_norm2, |eps2| eps2[i])
    }
}

/// Record an algorithm as a program for the size of `stack`, for one stack or for lanes. The arguments are those of [`BranchFree::solve`],
/// with `rounding` at the end. The results are a flag of validity and the results of the algorithm. Return `None` if the program would be
/// too long.
pub(super) fn recorded<A: BranchFree<Sym>>(stack: &Stack, settings: &Settings, lanes: bool) -> Option<Evaluation> {
    let (n, rows, total, bounds) = (stack.n, &stack.rows, stack.command.len(), stack.upper.len());
    if A::operations(n, rows) > MOST_OPERATIONS {
        return None;
    }
    record(
        lanes,
        total * (n + 1) + bounds + 1,
        || A::new(n, rows, settings),
        |mut algorithm, inputs| {
            let (jacobian, others) = inputs.split_at(total * n);
            let (command, others) = others.split_at(total);
            let valid = algorithm.solve(others[bounds], jacobian, command, &others[..bounds]);
            [&[valid], &algorithm.results().concat()[..]].concat()
        },
    )
}

/// An algorithm for single stacks: direct, and after a number of solves as a program with the same bits.
#[derive(Debug, Clone)]
pub(super) struct Compiled<A> {
    direct: A,
    program: Option<Evaluation>,
    solves: u64,
}

impl<A: BranchFree<f64>> Compiled<A> {
    /// Create the algorithm for stacks of the size of `stack`.
    pub fn new(stack: &Stack, settings: &Settings) -> Self {
        Compiled { direct: A::new(stack.n, &stack.rows, settings), program: None, solves: 0 }
    }

    /// Return the algorithm for a change of its parameters. Discard the program, which contains the old parameters.
    pub fn change(&mut self) -> &mut A {
        self.program = None;
        &mut self.direct
    }

    /// Make a program after a number of solves, at most once. `R` is the algorithm with expressions.
    #[inline]
    pub fn compile<R: BranchFree<Sym>>(&mut self, stack: &Stack, settings: &Settings) {
        if self.solves == SOLVES_BEFORE_PROGRAM {
            self.solves += 1;
            self.program = recorded::<R>(stack, settings, false);
        }
    }

    /// Solve a stack. Return the results, as for [`BranchFree::results`], if they are valid.
    #[inline]
    pub fn solve(&mut self, rounding: f64, given: &Stack) -> Option<[&[f64]; 5]> {
        let Stack { jacobian, command, upper, .. } = given;
        let Some(program) = &mut self.program else {
            self.solves += u64::from(self.solves < SOLVES_BEFORE_PROGRAM);
            let valid = self.direct.solve(rounding, jacobian, command, upper);
            return (valid == 1.0).then(|| self.direct.results());
        };
        let (stacked, last) = program.inputs(0, jacobian.len() + command.len() + upper.len() + 1).split_at_mut(jacobian.len());
        stacked.copy_from_slice(jacobian);
        let (commands, last) = last.split_at_mut(command.len());
        commands.copy_from_slice(command);
        last[..upper.len()].copy_from_slice(upper);
        last[upper.len()] = rounding;
        program.run();
        let lengths = self.direct.results().map(<[f64]>::len);
        let (valid, mut outputs) = program.outputs(0, 1 + lengths.iter().sum::<usize>()).split_at(1);
        let results = lengths.map(|length| outputs.split_off(..length).unwrap_or_default());
        (valid == [1.0]).then_some(results)
    }
}
