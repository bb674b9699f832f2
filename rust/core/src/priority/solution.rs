//! One prioritised solve with row-major matrices, and its result.

use super::{PriorityOptions, PrioritySolver};
use crate::error::Result;
use crate::status::Status;

/// The result of `solve_priority`.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, solve_priority};
/// use armlet_core::status::Status;
///
/// let options = PriorityOptions { v_max: Some(vec![1.0, 1.0]), ..PriorityOptions::new(PriorityMethod::Sns) };
/// // Together the joints reach 2 rad/s: the task is scaled by 2/5.
/// let solution = solve_priority(2, &[&[1.0, 1.0]], &[&[5.0]], &options)?;
/// assert_eq!((solution.v.as_slice(), solution.status), (&[1.0, 1.0][..], Status::Degraded));
/// assert!((solution.scales[0] - 0.4).abs() < 1e-15 && (solution.residuals[0][0] - 3.0).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Joint velocities, shape `(n,)`, rad/s or m/s.
    pub v: Vec<f64>,
    /// Residuals `v_i - J_i v` of each level, shape `(rows_i,)`, in the unit of the task.
    pub residuals: Vec<Vec<f64>>,
    /// The number of realised directions of each level. For `exact`, `chiaverini` and `sns`, the rank rule counts them. For `clamp` and
    /// `damped`, the directions with `s >= eps` count.
    pub ranks: Vec<usize>,
    /// The scale of each level's command. It is 1 except for `sns`.
    pub scales: Vec<f64>,
    /// `Success`, or `Degraded` if a level lost a direction or was scaled.
    pub status: Status,
}

/// Solve one prioritised problem. `jacobians`: shape `(rows_i, n)` each, row-major, the highest level first. `velocities`: task velocities,
/// shape `(rows_i,)` each. Errors: as for [`PrioritySolver::new`] and [`PrioritySolver::solve`].
///
/// ```
/// use armlet_core::priority::{PriorityOptions, solve_priority};
/// let (x, both) = ([1.0, 0.0], [1.0, 1.0]);
/// let solution = solve_priority(2, &[&x, &both], &[&[1.0], &[3.0]], &PriorityOptions::default()).unwrap();
/// assert_eq!(solution.ranks, [1, 1]);
/// assert!((solution.v[0] - 1.0).abs() < 1e-15 && (solution.v[1] - 2.0).abs() < 1e-14);
/// ```
pub fn solve_priority(n: usize, jacobians: &[&[f64]], velocities: &[&[f64]], options: &PriorityOptions) -> Result<Solution> {
    let rows: Vec<usize> = velocities.iter().map(|v| v.len()).collect();
    let mut solver = PrioritySolver::new(n, &rows, options)?;
    let status = solver.solve(jacobians, velocities)?;
    Ok(Solution {
        v: solver.v().to_vec(),
        residuals: (0..rows.len()).map(|i| solver.residual(i).to_vec()).collect(),
        ranks: solver.ranks().to_vec(),
        scales: solver.scales().to_vec(),
        status,
    })
}
