//! The solution of a stack.

use super::stack::level_ranges;
use crate::status::Status;
use nalgebra::DVector;
use std::ops::Range;

/// The solution of a stack of levels `J_i v = v_i`.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, solve_priority};
/// use armlet_core::status::Status;
///
/// let options = PriorityOptions { v_max: Some(vec![1.0, 1.0]), ..PriorityOptions::new(PriorityMethod::Sns) };
/// // Together the joints reach 2 rad/s: the task is scaled by 2/5.
/// let solution = solve_priority(2, &[&[1.0, 1.0]], &[&[5.0]], &options)?;
/// assert_eq!((solution.v.as_slice(), solution.status), (&[1.0, 1.0][..], Status::Degraded));
/// assert!((solution.levels[0].scale - 0.4).abs() < 1e-15 && (solution.residual(0)[0] - 3.0).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Joint velocities, shape `(n,)`, rad/s or m/s.
    pub v: Vec<f64>,
    /// The residuals `v_i - J_i v` of all levels, stacked, in the units of the tasks.
    pub residuals: Vec<f64>,
    /// The outcome of each level.
    pub levels: Vec<LevelSolution>,
    /// `Success`, or `Degraded` if a level is singular or was scaled.
    pub status: Status,
    /// The bounds of the solve; `None` for a stack without bounds.
    pub bounded: Option<Bounded>,
    ranges: Vec<Range<usize>>,
}

/// The bounds of a solution. Each array has one entry per row: first the joint velocities if they have bounds, then the rows of all levels.
///
/// ```
/// use armlet_core::priority::{PriorityOptions, solve_priority};
///
/// let options = PriorityOptions { v_max: Some(vec![1.0, 1.0]), ..PriorityOptions::default() };
/// let solution = solve_priority(2, &[&[1.0, 1.0]], &[&[3.0]], &options)?;
/// let bounded = solution.bounded.expect("the joint velocities have bounds");
/// // Both joints are at their upper bounds, and the task is 1 rad/s short.
/// assert_eq!((bounded.limits, &bounded.sides[..]), (2, &[1, 1, 0][..]));
/// assert!((bounded.violations[2] + 1.0).abs() < 1e-15 && bounded.certificate < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Bounded {
    /// The number of rows of joint velocities.
    pub limits: usize,
    /// The violations `w = J v - clip(J v, l, u)`, in the units of the tasks.
    pub violations: Vec<f64>,
    /// The active bound of each row: 1 for the upper bound, -1 for the lower bound, 0 for none. It is 0 for tasks.
    pub sides: Vec<i8>,
    /// The multipliers of the level that a row limits first, >= 0 at an upper bound and <= 0 at a lower bound. For a violated row it is the
    /// violation.
    pub multipliers: Vec<f64>,
    /// The number of changes of the active set.
    pub changes: usize,
    /// The largest residual of the conditions of Karush, Kuhn and Tucker, divided by their largest term. Stacks of `sns` that
    /// meet no bound are solved without a search, and it is NaN unless [`PrioritySolver::certify`](super::PrioritySolver::certify) was called.
    pub certificate: f64,
}

impl Bounded {
    /// Allocate the bounds of a failed solve.
    pub(super) fn new(limits: usize, rows: usize) -> Self {
        let nan = || vec![f64::NAN; limits + rows];
        Bounded { limits, violations: nan(), sides: vec![0; limits + rows], multipliers: nan(), changes: 0, certificate: f64::NAN }
    }

    /// Write the bounds of a solution of tasks that no bound restricts. The residuals of levels with bounds are NaN.
    pub(super) fn set_free(&mut self, v: &[f64], residuals: &[f64], bounds: Option<&(Vec<f64>, Vec<f64>)>, certificate: f64) {
        let (own, tasks) = self.violations.split_at_mut(self.limits);
        own.fill(0.0);
        tasks.iter_mut().zip(residuals).for_each(|(to, residual)| *to = if residual.is_nan() { 0.0 } else { -residual });
        self.sides.fill(0);
        self.multipliers.fill(0.0);
        (self.changes, self.certificate) = (0, certificate);
        if let Some((lower, upper)) = bounds {
            for (side, (v, (l, u))) in self.sides.iter_mut().zip(v.iter().zip(lower.iter().zip(upper))) {
                *side = i8::from(v >= u) - i8::from(v <= l);
            }
        }
    }
}

/// The outcome of one level.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, solve_priority};
///
/// // Both levels command the same joint.
/// let options = PriorityOptions::new(PriorityMethod::Exact);
/// let solution = solve_priority(2, &[&[1.0, 0.0], &[1.0, 0.0]], &[&[1.0], &[3.0]], &options)?;
/// assert_eq!(solution.levels.iter().map(|level| (level.rank, level.singular)).collect::<Vec<_>>(), [(1, false), (0, true)]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelSolution {
    /// The number of realised directions. For `exact`, `chiaverini` and `sns`, the rank rule counts them. For `clamp` and `damped`, the
    /// directions with `s >= eps` count.
    pub rank: usize,
    /// Whether the level realises fewer directions than its rows and the null space of the levels above allow. For `chiaverini`, also
    /// whether a singular value of `J_i` is below `eps`.
    pub singular: bool,
    /// The scale of the command. It is 1 except for `sns`, and for `exact` with kept directions.
    pub scale: f64,
}

impl LevelSolution {
    /// The outcome of a level that realises `rank` of the `possible` directions.
    pub(super) fn new(rank: usize, possible: usize) -> Self {
        LevelSolution { rank, singular: rank < possible, scale: 1.0 }
    }
}

impl Solution {
    /// Allocate a solution for `n` joints and these numbers of rows. It is the solution of a failed solve: all numbers are NaN.
    pub(super) fn new(n: usize, rows: &[usize]) -> Self {
        let levels = vec![LevelSolution { rank: 0, singular: true, scale: f64::NAN }; rows.len()];
        let residuals = vec![f64::NAN; rows.iter().sum()];
        Solution { v: vec![f64::NAN; n], residuals, levels, status: Status::Diverged, bounded: None, ranges: level_ranges(rows).collect() }
    }

    /// Set the status from the outcomes of the levels.
    pub(super) fn conclude(&mut self) {
        let degraded = self.levels.iter().any(|level| level.singular || level.scale < 1.0);
        self.status = if degraded { Status::Degraded } else { Status::Success };
    }

    /// The residual `v_i - J_i v` of level `i`, shape `(rows_i,)`, in the unit of the task.
    pub fn residual(&self, i: usize) -> &[f64] {
        &self.residuals[self.ranges[i].clone()]
    }

    /// The joint velocities, shape `(n,)`, rad/s or m/s.
    pub fn velocities(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.v)
    }

    /// The number of realised directions of each level.
    pub fn ranks(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.rank).collect()
    }

    /// The scale of each level's command.
    pub fn scales(&self) -> Vec<f64> {
        self.levels.iter().map(|level| level.scale).collect()
    }
}
