//! Moore-Penrose inverse `A# = V diag(1/s) U'` with a cut-off from the caller, in the unit of `A`.
//!
//! There is no default cut-off relative to `A`, because for a projected Jacobian that scale is wrong (see `priority`).

use super::axpy;
use super::svd::Svd;
use crate::error::Result;

/// Row-major `(k, m)` pseudo-inverse of the row-major `m` by `k` matrix `a`; singular values at or below `cut` count as zero.
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
