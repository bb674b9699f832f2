//! Steps within joint limits and under linear constraints `A dq = c` (`NocedalWright2006`, chapters 16 and 18). There are functions for the
//! multipliers of the constraints, for the active limits, and for the Newton step in the null space of `A`.

use super::attempt::blocked;
use crate::error::Result;
use crate::linalg::null_basis::null_basis;
use crate::linalg::pinv::pinv;
use crate::linalg::symmetric_eigen::symmetric_eigen;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

pub(super) type Matrix = DMatrix<f64>;
pub(super) type Vector = DVector<f64>;

/// Singular values below this fraction of a level's largest one count as zero. Rounding errors of a difference are some 1e-10.
const CUT: f64 = 1e-7;

/// The constraints `A dq = c` of the levels above one level.
pub(super) struct Constraints {
    pub a: Matrix,
    pub c: Vector,
    /// The rows of `A` that are the Jacobian of a level, this level, and the factor of the rows.
    pub jacobians: Vec<(Range<usize>, usize, f64)>,
}

impl Constraints {
    /// Append rows, divided by their norm, so that the rank does not depend on units. Return their range and factor.
    pub fn append(&mut self, a: Matrix, c: Vector) -> (Range<usize>, f64) {
        let (first, size) = (self.a.nrows(), a.norm());
        let factor = if size > 0.0 { 1.0 / size } else { 1.0 };
        let rows = first..first + a.nrows();
        self.a = self.a.clone().insert_rows(first, a.nrows(), 0.0);
        self.c = self.c.clone().insert_rows(first, a.nrows(), 0.0);
        self.a.rows_range_mut(rows.clone()).copy_from(&(a * factor));
        self.c.rows_range_mut(rows.clone()).copy_from(&(c * factor));
        (rows, factor)
    }
}

/// Release the joints at their limits, one after another, while the gradient moves one of them away from its limit. Return the multipliers
/// `lambda` of the constraints `a` and the gradient `r = g - a' lambda`.
pub(super) fn release(
    a: &Matrix,
    g: &Vector,
    q: &Vector,
    bounds: &[(f64, f64)],
    fixed: &[bool],
    least: f64,
    held: &mut [bool],
) -> Result<(Vector, Vector)> {
    loop {
        let lambda = inverse(&without(a.clone(), held).transpose())? * g;
        let r = g - a.transpose() * &lambda;
        let pull = |i: usize| if q[i] <= bounds[i].0 { -r[i] } else { r[i] };
        let free = (0..q.len()).filter(|&i| held[i] && !fixed[i] && bounds[i].0 < bounds[i].1 && pull(i) > least);
        match free.max_by(|&i, &k| pull(i).total_cmp(&pull(k))) {
            Some(i) => held[i] = false,
            None => return Ok((lambda, r)),
        }
    }
}

/// The Newton step in the null space of the constraints, plus the step that satisfies the constraints. Joints that would cross a limit are
/// held. Negative curvature counts with its absolute value, so that the step decreases the error.
pub(super) fn newton_step(
    hessian: &Matrix,
    g: &Vector,
    constraints: &Constraints,
    q: &Vector,
    bounds: &[(f64, f64)],
    held: &mut [bool],
) -> Result<Vector> {
    // Every pass holds at least one more joint, so at most n + 1 passes are necessary.
    loop {
        let z = null_space(&constraints.a, held)?;
        let mut dq = inverse(&without(constraints.a.clone(), held))? * &constraints.c;
        let (values, vectors) = symmetric_eigen((z.transpose() * hessian * &z).as_slice(), z.ncols())?;
        let floor = f64::EPSILON * values.iter().fold(f64::MIN_POSITIVE, |most: f64, value| most.max(value.abs()));
        for (value, vector) in values.iter().zip(vectors.chunks_exact(z.ncols().max(1))) {
            let direction = &z * DVector::from_column_slice(vector);
            dq -= &direction * (direction.dot(g) / value.abs().max(floor));
        }
        if !blocked(q.as_slice(), dq.as_slice(), bounds, held) {
            return Ok(dq);
        }
    }
}

/// `a` with zeros in the columns of the joints `held`.
pub(super) fn without(mut a: Matrix, held: &[bool]) -> Matrix {
    for (mut column, _) in a.column_iter_mut().zip(held).filter(|(_, held)| **held) {
        column.fill(0.0);
    }
    a
}

/// The Moore-Penrose inverse, with singular values below `CUT |a|` as zero.
pub(super) fn inverse(a: &Matrix) -> Result<Matrix> {
    let (m, n) = a.shape();
    if m * n == 0 {
        return Ok(Matrix::zeros(n, m));
    }
    Ok(Matrix::from_row_slice(n, m, &pinv(a.transpose().as_slice(), m, n, CUT * a.norm())?))
}

/// An orthonormal basis of the motions that satisfy `a dq = 0` and do not move the joints `held`, as columns.
pub(super) fn null_space(a: &Matrix, held: &[bool]) -> Result<Matrix> {
    let (n, still) = (held.len(), held.iter().filter(|held| **held).count());
    let mut rows = without(a.clone(), held).insert_rows(a.nrows(), still, 0.0);
    // A row of a held joint is as large as the largest possible row of `a`.
    held.iter().enumerate().filter(|(_, held)| **held).enumerate().for_each(|(row, (i, _))| rows[(a.nrows() + row, i)] = 1.0);
    if rows.nrows() == 0 {
        return Ok(Matrix::identity(n, n));
    }
    let basis = null_basis(rows.transpose().as_slice(), rows.nrows(), n, CUT)?;
    Ok(Matrix::from_column_slice(n, basis.len() / n, &basis))
}
