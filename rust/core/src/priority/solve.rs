//! One prioritised solve.

use super::method::PriorityOptions;
use super::solution::Solution;
use super::solver::PrioritySolver;
use crate::error::{Error, Result};
use nalgebra::{DMatrix, DVector};

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
