//! The null space of the levels above, as a basis `N = X diag(scale)`. `X` has orthonormal columns. The entries of `scale`, with
//! `0 < scale <= 1`, are the remaining fractions of these directions.

use crate::error::Result;
use crate::linalg::{Svd, axpy, clamp_remainder, dot};
use crate::priority::stack::Level;
use nalgebra::DMatrix;

/// The basis of the null space, with its memory.
#[derive(Debug, Clone)]
pub struct NullSpace {
    /// An orthonormal basis of joint space. The levels above use the directions of the first `used` columns. The others are `X`.
    basis: DMatrix<f64>,
    pub used: usize,
    /// The remaining fraction of each column.
    scale: Vec<f64>,
    /// Whether the basis is still the identity, because no level has rotated it.
    is_identity: bool,
    /// Memory for a product with the basis.
    product: Vec<f64>,
}

impl NullSpace {
    /// Create the null space of no level, for `n` joints.
    pub fn new(n: usize) -> Self {
        NullSpace { basis: DMatrix::identity(n, n), used: 0, scale: vec![1.0; n], is_identity: true, product: vec![0.0; n * n] }
    }

    /// Start with the null space of no level: all directions.
    pub fn reset(&mut self) {
        self.basis.fill(0.0);
        self.basis.fill_diagonal(1.0);
        self.used = 0;
        self.scale.fill(1.0);
        self.is_identity = true;
    }

    fn n(&self) -> usize {
        self.basis.nrows()
    }

    /// The number of directions.
    pub fn dim(&self) -> usize {
        self.n() - self.used
    }

    /// The directions: the columns of `X`, shape `(n,)` each.
    pub fn directions(&self) -> impl Iterator<Item = &[f64]> {
        self.basis.as_slice()[self.used * self.n()..].chunks_exact(self.n())
    }

    /// Write `A = J_i N`, shape `(m, dim)`, row-major.
    pub fn project(&self, level: &Level, a: &mut [f64]) {
        if self.is_identity {
            return a.copy_from_slice(level.jacobian);
        }
        for (a, row) in a.chunks_exact_mut(self.dim().max(1)).zip(level.jacobian_rows()) {
            for ((a, x), scale) in a.iter_mut().zip(self.directions()).zip(&self.scale[self.used..]) {
                *a = dot(row, x) * scale;
            }
        }
    }

    /// Compute `y += gain X v`.
    pub fn add(&self, gain: f64, v: &[f64], y: &mut [f64]) {
        for (x, v) in self.directions().zip(v) {
            axpy(gain * v, x, y);
        }
    }

    /// Rotate the directions to the right singular vectors of a decomposition with `dim` columns: `X <- X V`.
    pub fn rotate(&mut self, svd: &Svd) {
        let (n, k) = (self.n(), self.dim());
        let NullSpace { basis, used, is_identity, product, .. } = self;
        let x = &mut basis.as_mut_slice()[*used * n..];
        if std::mem::take(is_identity) {
            return x.chunks_exact_mut(n).enumerate().for_each(|(j, x)| x.copy_from_slice(svd.v(j)));
        }
        let product = &mut product[..k * n];
        product.fill(0.0);
        for (j, to) in product.chunks_exact_mut(n).enumerate() {
            for (x, v) in x.chunks_exact(n).zip(svd.v(j)) {
                axpy(*v, x, to);
            }
        }
        x.copy_from_slice(product);
    }

    /// Remove the first `count` directions, which a level uses completely.
    pub fn remove(&mut self, count: usize) {
        self.used += count;
    }

    /// Remove the part that a clamped level with the decomposition `svd` uses: `N <- N V diag(d)` with `d = 1 - min(1, (s/eps)^2)`. An SVD
    /// brings the product back to the form `X diag(scale)`. `work` is memory for this SVD.
    pub fn attenuate(&mut self, svd: &Svd, eps: f64, work: &mut Svd) -> Result<()> {
        let k = self.dim();
        let remainder = |j: usize| svd.s().get(j).map_or(1.0, |s| clamp_remainder(*s, eps));
        // The singular values descend, so that directions with d = 0 are first.
        let complete = svd.s().iter().filter(|s| clamp_remainder(**s, eps) == 0.0).count();
        if self.scale[self.used..].iter().all(|s| *s == 1.0) {
            self.rotate(svd);
            self.remove(complete);
            self.scale[self.used..].iter_mut().enumerate().for_each(|(j, scale)| *scale = remainder(complete + j));
            return Ok(());
        }
        // The rows are the vectors d_j V_j' diag(scale) in the coordinates of X. Their right singular vectors are the new directions.
        let rows = &mut self.product[..(k - complete) * k];
        for (j, row) in rows.chunks_exact_mut(k.max(1)).enumerate() {
            let d = remainder(complete + j);
            for ((to, v), scale) in row.iter_mut().zip(svd.v(complete + j)).zip(&self.scale[self.used..]) {
                *to = d * v * scale;
            }
        }
        work.decompose(rows, k - complete, k)?;
        self.rotate(work);
        // The remaining directions are moved to the end, the largest scale first. This level uses the other directions completely.
        let (n, remaining) = (self.n(), work.rank(0.0));
        self.basis.as_mut_slice()[self.used * n..].rotate_left(remaining * n);
        self.used = n - remaining;
        self.scale[self.used..].iter_mut().zip(work.s()).for_each(|(scale, s)| *scale = s.min(1.0));
        Ok(())
    }
}
