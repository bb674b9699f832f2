//! The solution of a stack, and one prioritised solve.

use super::stack::level_ranges;
use super::{PriorityOptions, PrioritySolver};
use crate::error::{Error, Result};
use crate::status::Status;
use nalgebra::{DMatrix, DVector};
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
    ranges: Vec<Range<usize>>,
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
    /// The scale of the command. It is 1 except for `sns`.
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
        Solution { v: vec![f64::NAN; n], residuals, levels, status: Status::Diverged, ranges: level_ranges(rows).collect() }
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

/// Solve one prioritised problem. `jacobians`: shape `(rows_i, n)` each, row-major, the highest level first. `velocities`: task velocities,
/// shape `(rows_i,)` each. Errors: as for [`PrioritySolver::new`] and [`PrioritySolver::solve`].
///
/// ```
/// use armlet_core::priority::{PriorityOptions, solve_priority};
/// let (x, both) = ([1.0, 0.0], [1.0, 1.0]);
/// let solution = solve_priority(2, &[&x, &both], &[&[1.0], &[3.0]], &PriorityOptions::default()).unwrap();
/// assert_eq!(solution.ranks(), [1, 1]);
/// assert!((solution.v[0] - 1.0).abs() < 1e-15 && (solution.v[1] - 2.0).abs() < 1e-14);
/// ```
pub fn solve_priority(n: usize, jacobians: &[&[f64]], velocities: &[&[f64]], options: &PriorityOptions) -> Result<Solution> {
    let rows: Vec<usize> = velocities.iter().map(|v| v.len()).collect();
    PrioritySolver::new(n, &rows, options)?.solve(jacobians, velocities).cloned()
}

/// Solve `J_i v = v_i` with priorities, the highest level first. `levels`: pairs of `J_i`, shape `(rows_i, n)`, and `v_i`, shape
/// `(rows_i,)`.
///
/// Errors: `WrongShape` for shapes that do not fit. `Input` for an invalid option, no joint, or numbers that are not finite. `Solve` if the
/// result overflows. `Memory` if the memory does not suffice.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, solve_levels};
/// use nalgebra::{dmatrix, dvector};
///
/// let (first, second) = ((dmatrix![1.0, 0.0, 1.0], dvector![1.0]), (dmatrix![0.0, 1.0, 0.0; 1.0, 0.0, 0.0], dvector![2.0, 0.25]));
/// let solution = solve_levels(&[first, second], &PriorityOptions::new(PriorityMethod::Exact))?;
/// assert_eq!(solution.ranks(), [1, 2]);
/// assert!((solution.velocities() - dvector![0.25, 2.0, 0.75]).norm() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn solve_levels(levels: &[(DMatrix<f64>, DVector<f64>)], options: &PriorityOptions) -> Result<Solution> {
    let n = levels.first().map_or(0, |(jacobian, _)| jacobian.ncols());
    for (i, (jacobian, velocity)) in levels.iter().enumerate() {
        if jacobian.shape() != (velocity.len(), n) {
            let (rows, columns) = jacobian.shape();
            return Err(Error::wrong_shape("levels", &[velocity.len(), n], &[rows, columns]).at([i]));
        }
    }
    // nalgebra stores columns, but the solver reads rows.
    let jacobians: Vec<DMatrix<f64>> = levels.iter().map(|(jacobian, _)| jacobian.transpose()).collect();
    let jacobians: Vec<&[f64]> = jacobians.iter().map(|jacobian| jacobian.as_slice()).collect();
    let velocities: Vec<&[f64]> = levels.iter().map(|(_, velocity)| velocity.as_slice()).collect();
    solve_priority(n, &jacobians, &velocities, options)
}
