//! The Moore-Penrose inverse `A# = V diag(1/s) U'`. The caller chooses the cut-off, in the unit of `A`.
//!
//! A default cut-off relative to `A` does not exist, because it would be wrong for a projected Jacobian (see `priority`).

use super::axpy;
use super::svd::Svd;
use crate::error::Result;

/// Return the pseudo-inverse, shape `(k, m)`, row-major, of a matrix `a`, shape `(m, k)`, row-major. Singular values up to `cut` count as
/// zero. Errors: as for [`Svd::decompose`].
pub fn pinv(a: &[f64], m: usize, k: usize, cut: f64) -> Result<Vec<f64>> {
    let mut svd = Svd::new(m, k);
    svd.decompose(a, m, k)?;
    let mut out = vec![0.0; k * m];
    for j in 0..svd.rank(cut.max(0.0)) {
        for (row, v) in out.chunks_exact_mut(m).zip(svd.v(j)) {
            axpy(v / svd.s()[j], svd.u(j), row);
        }
    }
    Ok(out)
}
