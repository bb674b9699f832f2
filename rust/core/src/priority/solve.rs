//! One prioritised solve.

use super::hierarchy::Conditions;
use super::method::{PriorityMethod, PriorityOptions};
use super::solution::Solution;
use super::solver::PrioritySolver;
use crate::error::{Error, Result};
use crate::linalg::dot;
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

/// Return the certificate of joint velocities `v` that were computed without bounds. It is the largest residual of the conditions of Karush,
/// Kuhn and Tucker, divided by their largest term. `rows`: number of rows of each level. `jacobian` and `command`: stacked, row-major.
///
/// If no direction is damped, the conditions are evaluated at `v`. The objective of a damped level depends on the step of the level, so that
/// such a stack is solved again by the active-set method. The certificate is then that of this solution, and at least its relative distance
/// from `v`. It is NaN for `chiaverini`, which minimises no objective. For `sns` no bound may restrict `v`. Errors: as for
/// [`PrioritySolver::new`].
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, certificate};
/// let options = PriorityOptions::new(PriorityMethod::Exact);
/// let of = |v| certificate(&[1], &options, &[1.0, 1.0], &[2.0], v);
/// assert!(of(&[1.0, 1.0])? < 1e-15 && of(&[2.0, 0.0])? > 0.1);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn certificate(rows: &[usize], options: &PriorityOptions, jacobian: &[f64], command: &[f64], v: &[f64]) -> Result<f64> {
    if options.method == PriorityMethod::Chiaverini {
        return Ok(f64::NAN);
    }
    let damped = options.method.damps();
    let mut options = options.clone();
    if damped {
        options.intervals = vec![true; rows.len()];
    }
    let mut solver = PrioritySolver::new(v.len(), rows, &options)?;
    if damped {
        solver.upper().copy_from_slice(command);
    }
    let (own_jacobian, own_command) = solver.inputs();
    own_jacobian.copy_from_slice(jacobian);
    own_command.copy_from_slice(command);
    if damped {
        solver.run()?;
        if solver.damps_a_direction() {
            let solution = solver.solution();
            let bounded = solution.bounded.as_ref().map_or(f64::NAN, |bounded| bounded.certificate);
            let apart = solution.v.iter().zip(v).map(|(x, v)| (x - v).powi(2)).sum::<f64>().sqrt();
            let norm = dot(v, v).max(dot(&solution.v, &solution.v)).sqrt();
            return Ok(bounded.max(if norm > 0.0 { apart / norm } else { 0.0 }));
        }
    }
    Conditions::new(&solver.given).certificate(&solver.given, &solver.settings, v)
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
