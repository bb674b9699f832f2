//! The least-squares problem of a face: `min |M p - r|`, where the rows of `M` are rows of the frame, restricted to its free coordinates.
//! The solution has the smallest norm.
//!
//! Away from singularities, `M` is factored by reflections: `M = L Q` if it is wide, `M = Q R` if it is tall. The number `1/|L^-1|_F` is a
//! lower bound of the smallest singular value. If it does not prove that the rank is full, the singular values decide by the rank rule of
//! `hierarchy`. The rows of a wide `M` are divided by the norms of the unprojected rows for this bound, because their units do not change
//! the solution.

use super::frame::Frame;
use crate::error::Result;
use crate::linalg::householder::{reflect, reflector};
use crate::linalg::{Svd, axpy, dot};
use nalgebra::DVector;

/// Singular values above this limit, relative to the norm of the level, are regular without a decomposition.
const REGULAR: f64 = 1e-6;

/// The rank rule of a level: its Frobenius norm with the penalty rows, and the relative error of its entries. `condition` is the condition
/// number of the levels above.
#[derive(Debug, Clone, Copy)]
pub struct RankRule {
    pub norm: f64,
    pub rounding: f64,
    pub condition: f64,
}

impl RankRule {
    /// The largest singular value that may be the rounding error of a level, in the null space of the levels above.
    pub fn cut(&self) -> f64 {
        self.rounding * self.norm * self.condition
    }
}

/// The form of the last factorisation.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Wide,
    Tall,
    Singular,
}

/// The factorisation of a face, with its memory.
#[derive(Debug, Clone)]
pub struct Face {
    form: Form,
    /// The first free coordinate.
    from: usize,
    /// The number of directions with a counted singular value, and of those that lower levels may not use.
    pub rank: usize,
    pub taken: usize,
    /// The condition number of the rows, or an upper bound of it.
    pub condition: f64,
    /// The tall matrix column by column, then its right side. Also the row-major matrix of `svd`.
    matrix: Vec<f64>,
    beta: Vec<f64>,
    diagonal: Vec<f64>,
    pub svd: Svd,
    column: Vec<f64>,
}

impl Face {
    /// Allocate memory for `n` coordinates and at most `rows` rows.
    pub fn new(n: usize, rows: usize) -> Self {
        let (matrix, column) = (vec![0.0; (n + 1) * rows.max(1)], vec![0.0; n.max(rows)]);
        let [beta, diagonal] = [0; 2].map(|_| vec![0.0; n]);
        Face { form: Form::Wide, from: 0, rank: 0, taken: 0, condition: 1.0, matrix, beta, diagonal, svd: Svd::new(rows, n), column }
    }

    /// Factor the rows `rows` of the frame, with the norms `size`, in the coordinates from `from` on. Errors: `Solve` without convergence.
    pub fn factor(&mut self, frame: &mut Frame, rows: &[usize], size: &DVector<f64>, from: usize, rule: RankRule) -> Result<()> {
        let (m, k) = (rows.len(), frame.n() - from);
        self.from = from;
        (self.rank, self.taken, self.condition) = (m.min(k), m.min(k), 1.0);
        self.form = if m <= k { Form::Wide } else { Form::Tall };
        if self.rank == 0 {
            return Ok(());
        }
        let regular = if m <= k { self.factor_wide(frame, rows, size) } else { self.factor_tall(frame, rows) / rule.norm };
        // A row that may be a rounding error of the level has no direction.
        let shortest = rows.iter().map(|i| size[*i]).fold(rule.norm, f64::min) / rule.norm;
        if regular > REGULAR.max(rule.rounding * rule.condition) && (m > k || regular * shortest > rule.rounding) {
            self.condition = 1.0 / regular;
            return Ok(());
        }
        self.decompose(frame, rows, from)?;
        frame.turn(&self.svd, from, false);
        self.form = Form::Singular;
        self.rank = self.svd.rank(rule.cut());
        self.taken = self.rank.max(self.svd.rank(rule.rounding * rule.norm));
        self.condition = if self.rank > 0 { rule.norm / self.svd.s()[self.rank - 1] } else { 1.0 };
        Ok(())
    }

    /// Compute the singular values of the rows in the coordinates from `from` on.
    pub fn decompose(&mut self, frame: &Frame, rows: &[usize], from: usize) -> Result<()> {
        let (m, k) = (rows.len(), frame.n() - from);
        let matrix = &mut self.matrix[..m * k];
        for (to, i) in matrix.chunks_exact_mut(k.max(1)).zip(rows) {
            to.iter_mut().zip(frame.vector(*i, from)).for_each(|(to, x)| *to = x);
        }
        self.svd.decompose(matrix, m, k)
    }

    /// Reduce wide rows to the triangle `L`. Return a lower bound of its smallest singular value, divided by the norms of the rows.
    fn factor_wide(&mut self, frame: &mut Frame, rows: &[usize], size: &DVector<f64>) -> f64 {
        let from = self.from;
        rows.iter().enumerate().for_each(|(j, i)| frame.reflect(*i, from + j));
        self.triangle_bound(frame, rows, size, from)
    }

    /// Return a lower bound of the smallest singular value of rows that are a lower triangle from coordinate `from` on, divided by their
    /// norms.
    pub fn triangle_bound(&mut self, frame: &Frame, rows: &[usize], size: &DVector<f64>, from: usize) -> f64 {
        let (m, Face { matrix, column, .. }) = (rows.len(), self);
        for (r, i) in rows.iter().enumerate() {
            (0..=r).for_each(|j| matrix[r * m + j] = frame[(from + j, *i)] / size[*i]);
        }
        inverse_bound(m, column, |i, j| matrix[i * m + j])
    }

    /// Reduce tall rows to the triangle `R`, in a copy. Return a lower bound of the smallest singular value.
    fn factor_tall(&mut self, frame: &Frame, rows: &[usize]) -> f64 {
        let (m, k, from) = (rows.len(), frame.n() - self.from, self.from);
        for (r, i) in rows.iter().enumerate() {
            frame.vector(*i, from).enumerate().for_each(|(c, x)| self.matrix[c * m + r] = x);
        }
        for c in 0..k {
            let (head, tail) = self.matrix[..k * m].split_at_mut((c + 1) * m);
            let w = &mut head[c * m + c..];
            (self.diagonal[c], self.beta[c]) = reflector(w);
            if self.beta[c] != 0.0 {
                tail.chunks_exact_mut(m).for_each(|column| reflect(w, self.beta[c], &mut column[c..]));
            }
        }
        let Face { matrix, diagonal, column, .. } = self;
        // The transpose of `R` is lower triangular.
        inverse_bound(k, column, |i, j| if i == j { diagonal[i] } else { matrix[i * m + j] })
    }

    /// Write the solution for the right side `r` to `p`, in the coordinates of the frame. `r` is overwritten.
    pub fn solve(&mut self, frame: &Frame, rows: &[usize], r: &mut [f64], p: &mut [f64]) {
        let (from, m) = (self.from, rows.len());
        p.fill(0.0);
        match self.form {
            Form::Wide => {
                for (j, i) in rows.iter().enumerate() {
                    p[from + j] = (r[j] - frame.product(*i, from, &p[from..from + j])) / frame[(from + j, *i)];
                }
            }
            Form::Tall => {
                let k = p.len() - from;
                for c in 0..k {
                    reflect(&self.matrix[c * m + c..(c + 1) * m], self.beta[c], &mut r[c..m]);
                }
                for c in (0..k).rev() {
                    p[from + c] = r[c] / self.diagonal[c];
                    axpy(-p[from + c], &self.matrix[c * m..c * m + c], &mut r[..c]);
                }
            }
            Form::Singular => {
                (0..self.rank).for_each(|j| p[from + j] = dot(self.svd.u(j), r) / self.svd.s()[j]);
            }
        }
    }
}

/// Return `1/|T^-1|_F` for a lower triangular matrix `T`, shape `(k, k)`. It is zero if `T` is singular.
fn inverse_bound(k: usize, column: &mut [f64], t: impl Fn(usize, usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for c in 0..k {
        for i in c..k {
            let known: f64 = (c..i).map(|j| t(i, j) * column[j]).sum();
            column[i] = (if i == c { 1.0 } else { 0.0 } - known) / t(i, i);
            sum += column[i] * column[i];
        }
    }
    if sum.is_finite() { 1.0 / sum.sqrt() } else { 0.0 }
}
