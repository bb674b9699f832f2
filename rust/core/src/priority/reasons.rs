//! The reasons why a level is not reached. The conditions of Karush, Kuhn and Tucker of level `k` are `A_k' w_k = -sum lambda_i a_i`. They
//! divide the gradient of its violations among the active rows `a_i` of the higher levels. The share of a row is the part of its force
//! `lambda_i a_i` along the gradient. The shares add up to one.
//!
//! Tasks and violated rows may have every multiplier. A row at a bound has a multiplier of one sign (non-negative least squares, Lawson and
//! Hanson 1974, `lawson1974least`).

use crate::error::Result;
use crate::linalg::pinv;
use nalgebra::{DMatrix, DVector, DVectorView};

/// Singular values of unit rows up to this limit count as zero.
const CUT: f64 = 1e-10;

/// A violation up to this fraction of the largest term of its row is a rounding error.
const NOISE: f64 = 1e-12;

/// The rows `l <= a v <= u` of one level: `a`, shape `(rows, n)`, row-major, and the bounds, shape `(rows,)` each.
pub type BoundedRows<'a> = (&'a [f64], &'a [f64], &'a [f64]);

/// A row of a higher level that stops a level.
///
/// ```
/// use armlet_core::priority::{Reason, reasons};
///
/// // Level 1 keeps `v = 0`, and level 2 asks for `v = 2`.
/// let (first, second) = ((&[1.0][..], &[0.0][..], &[0.0][..]), (&[1.0][..], &[2.0][..], &[2.0][..]));
/// let found = reasons(1, &[(&[], &[], &[]), first, second], &[0.0], 2)?;
/// assert_eq!(found.reasons, [Reason { level: 1, row: 0, side: 0, share: 1.0 }]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reason {
    /// The level of the row. Level 0 has the bounds of the joint velocities.
    pub level: usize,
    /// The index of the row in its level.
    pub row: usize,
    /// 1 at an upper bound, -1 at a lower bound, 0 for a task.
    pub side: i8,
    /// The share in the gradient of the violations.
    pub share: f64,
}

/// Why a level is not reached.
///
/// ```
/// use armlet_core::priority::reasons;
///
/// // The task 3 of the second level needs twice the speed that the bound of the first joint allows.
/// let (limits, task) = ((&[1.0, 0.0, 0.0, 1.0][..], &[-1.0, -9.0][..], &[1.0, 9.0][..]), (&[2.0, 0.0][..], &[3.0][..], &[3.0][..]));
/// let found = reasons(2, &[limits, task], &[1.0, 0.0], 1)?;
/// assert_eq!(found.violations, [-1.0]);
/// assert_eq!((found.reasons[0].row, found.reasons[0].side), (0, 1));
/// assert!((found.reasons[0].share - 1.0).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Reasons {
    /// The violations `w_k` of the level, in the units of its rows. Rounding errors are zero.
    pub violations: Vec<f64>,
    /// The rows that stop the level, the largest share first.
    pub reasons: Vec<Reason>,
}

/// A row of a higher level with its unit normal, which points out of the bounds.
struct Active {
    reason: Reason,
    normal: DVector<f64>,
    free: bool,
}

/// Find the reasons why level `k` is not reached at the velocities `v`, shape `(n,)`. `levels`: the rows of each level, with level 0 first.
/// Level 0 may have no rows. Errors: `Solve` without convergence of a singular value decomposition.
pub fn reasons(n: usize, levels: &[BoundedRows], v: &[f64], k: usize) -> Result<Reasons> {
    let v = DVectorView::from_slice(v, n);
    let (a, ..) = levels[k];
    let violations: Vec<f64> = (0..levels[k].1.len()).map(|i| violation(n, levels[k], i, &v)).collect();
    let gradient = DMatrix::from_column_slice(n, violations.len(), a) * DVector::from_column_slice(&violations);
    let mut active = Vec::new();
    for (level, rows) in levels.iter().enumerate().take(k) {
        active.extend((0..rows.1.len()).filter_map(|i| active_row(n, *rows, level, i, &v)));
    }
    let mut reasons = if gradient.norm() > 0.0 { shares(&active, &gradient)? } else { Vec::new() };
    reasons.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(Reasons { violations, reasons })
}

/// Find the reasons why the scale of level `k` is not larger, at the velocities `v`, shape `(n,)`, of a stack with scaled commands. The
/// largest share is first. `levels` is as for [`reasons`], and level `k` has tasks. Errors: `Solve` without convergence of a singular value
/// decomposition.
///
/// `P r` is the command, projected on the range of the rows `A` in the null space of the higher tasks. The scale is `t / |d|` with the
/// smallest `d` of `A d = P r`. The gradient of `-t` along `A x = t P r / |d|` is divided among the active rows.
///
/// ```
/// use armlet_core::priority::scale_reasons;
///
/// // The command (1, 1) is scaled by 1/2, because the first joint is at its bound.
/// let (limits, task) = ((&[1.0, 0.0, 0.0, 1.0][..], &[-0.5, -9.0][..], &[0.5, 9.0][..]), (&[1.0, 0.0, 0.0, 1.0][..], &[1.0, 1.0][..]));
/// let found = scale_reasons(2, &[limits, (task.0, task.1, task.1)], &[0.5, 0.5], 1)?;
/// assert_eq!((found.len(), found[0].row, found[0].side), (1, 0, 1));
/// assert!((found[0].share - 1.0).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn scale_reasons(n: usize, levels: &[BoundedRows], v: &[f64], k: usize) -> Result<Vec<Reason>> {
    let v = DVectorView::from_slice(v, n);
    let (mut active, m) = (Vec::new(), levels[k].1.len());
    for (level, rows) in levels.iter().enumerate().take(k) {
        active.extend((0..rows.1.len()).filter_map(|i| active_row(n, *rows, level, i, &v)));
    }
    let a = DMatrix::from_column_slice(n, m, levels[k].0);
    let size = a.norm().max(f64::MIN_POSITIVE);
    let (a, r) = (a / size, DVector::from_column_slice(levels[k].1) / size);
    let above = columns(n, active.iter().filter(|row| row.free).map(|row| &row.normal));
    let b = &a - &above * (inverse(&above)? * &a);
    let d = inverse(&b)?.transpose() * r;
    // A level without a feasible command has the scale 1.
    if d.norm() == 0.0 {
        return Ok(Vec::new());
    }
    let mut own = a.insert_row(n, 0.0);
    own.row_mut(n).copy_from(&(-(&d / d.norm()).transpose() * b));
    let mut gradient = DVector::zeros(n + 1);
    gradient[n] = -1.0;
    let inverse = inverse(&own)?;
    let along = |x: DVector<f64>| &x - &own * (&inverse * &x);
    active.iter_mut().for_each(|row| row.normal = along(row.normal.clone().insert_row(n, 0.0)));
    let mut reasons = shares(&active, &along(gradient))?;
    reasons.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(reasons)
}

/// The row `i` of a level, shape `(n,)`.
fn row(n: usize, a: &[f64], i: usize) -> DVectorView<'_, f64> {
    DVectorView::from_slice(&a[i * n..(i + 1) * n], n)
}

/// The rounding error of the value of a row.
fn slack(a: &DVectorView<f64>, v: &DVectorView<f64>, bound: f64) -> f64 {
    NOISE * (a.norm() * v.norm()).max(if bound.is_finite() { bound.abs() } else { 0.0 })
}

fn violation(n: usize, (a, lower, upper): BoundedRows, i: usize, v: &DVectorView<f64>) -> f64 {
    let a = row(n, a, i);
    let value = a.dot(v);
    let nearest = value.max(lower[i]).min(upper[i]);
    if (value - nearest).abs() <= slack(&a, v, nearest) { 0.0 } else { value - nearest }
}

/// The normal of row `i`, if the row is a task, violated or at a bound.
fn active_row(n: usize, rows: BoundedRows, level: usize, i: usize, v: &DVectorView<f64>) -> Option<Active> {
    let (a, lower, upper) = (row(n, rows.0, i), rows.1[i], rows.2[i]);
    let (value, norm) = (a.dot(v), a.norm());
    let is_task = lower == upper;
    let side = if is_task {
        0
    } else if value >= upper - slack(&a, v, upper) {
        1
    } else {
        -i8::from(value <= lower + slack(&a, v, lower))
    };
    let free = is_task || violation(n, rows, i, v) != 0.0;
    let outward = if side < 0 { -1.0 } else { 1.0 };
    ((is_task || side != 0) && norm > 0.0).then(|| Active {
        reason: Reason { level, row: i, side, share: 0.0 },
        normal: a * (outward / norm),
        free,
    })
}

/// Divide the gradient among the active rows.
fn shares(active: &[Active], gradient: &DVector<f64>) -> Result<Vec<Reason>> {
    let (free, signed): (Vec<&Active>, Vec<&Active>) = active.iter().partition(|row| row.free);
    let free_rows = columns(gradient.len(), free.iter().map(|row| &row.normal));
    let inverse = inverse(&free_rows)?;
    // The free rows balance every force in their span, so that the signed rows are compared outside of it.
    let outside = |x: &DVector<f64>| x - &free_rows * (&inverse * x);
    let normals: Vec<DVector<f64>> = signed.iter().map(|row| outside(&row.normal)).collect();
    let lambda = nonnegative(&normals, &outside(gradient))?;
    let forces = signed.iter().zip(&lambda).fold(gradient.clone(), |sum, (row, lambda)| sum + &row.normal * *lambda);
    let others = -(inverse * forces);
    let all = signed.iter().zip(lambda).chain(free.iter().zip(others.iter().copied()));
    let share =
        |(row, lambda): (&&Active, f64)| Reason { share: -lambda * row.normal.dot(gradient) / gradient.norm_squared(), ..row.reason };
    Ok(all.filter(|(_, lambda)| *lambda != 0.0).map(share).collect())
}

/// Return `lambda >= 0` with the smallest `|g + sum lambda_i b_i|`.
fn nonnegative(b: &[DVector<f64>], g: &DVector<f64>) -> Result<Vec<f64>> {
    let (mut lambda, mut passive) = (vec![0.0; b.len()], Vec::<usize>::new());
    for _ in 0..10 * b.len() + 10 {
        let residual = passive.iter().fold(g.clone(), |sum, &i: &usize| sum + &b[i] * lambda[i]);
        let descent = |i: &usize| -b[*i].dot(&residual);
        let next = (0..b.len()).filter(|i| !passive.contains(i) && b[*i].norm() > CUT).max_by(|i, j| descent(i).total_cmp(&descent(j)));
        match next {
            Some(i) if descent(&i) > CUT * g.norm() => passive.push(i),
            _ => break,
        }
        loop {
            let trial = -(inverse(&columns(g.len(), passive.iter().map(|i| &b[*i])))? * g);
            // The step to the trial multipliers ends where the first of them becomes zero.
            let step = |(i, new): (&usize, &f64)| if *new > 0.0 { 1.0 } else { lambda[*i] / (lambda[*i] - new) };
            let t = passive.iter().zip(trial.iter()).map(step).fold(1.0, f64::min);
            passive.iter().zip(trial.iter()).for_each(|(i, new)| lambda[*i] += t * (new - lambda[*i]));
            if t == 1.0 {
                break;
            }
            passive.retain(|i| lambda[*i] > f64::EPSILON * g.norm());
            (0..b.len()).filter(|i| !passive.contains(i)).for_each(|i| lambda[i] = 0.0);
        }
    }
    Ok(lambda)
}

/// The matrix with these columns.
fn columns<'a>(n: usize, columns: impl Iterator<Item = &'a DVector<f64>>) -> DMatrix<f64> {
    let columns: Vec<f64> = columns.flat_map(|column| column.iter().copied()).collect();
    DMatrix::from_column_slice(n, columns.len() / n, &columns)
}

/// The pseudo-inverse of a matrix with columns of about unit length.
fn inverse(a: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    // nalgebra stores columns. So the data of `a` are the rows of its transpose, and the result has the rows of the transposed inverse.
    let (n, m) = a.shape();
    if m == 0 {
        return Ok(DMatrix::zeros(0, n));
    }
    Ok(DMatrix::from_column_slice(m, n, &pinv(a.as_slice(), m, n, CUT)?))
}
