//! Orthonormal null basis `A N = 0`, `N'N = I`: the right singular vectors beyond the rank.
//!
//! The formula `I - A'(A A')^-1 A` is not used, because it squares the condition number and thereby the error of the projector.

use super::svd::Svd;
use crate::error::Result;

/// Columns of `N` as the rows of a row-major `(k - rank, k)` array, for a row-major `m` by `k` matrix `a`.
///
/// `cut`: singular values at or below it count as zero, unit of `a`. Errors: entries that are not finite.
pub fn null_basis(a: &[f64], m: usize, k: usize, cut: f64) -> Result<Vec<f64>> {
    let mut svd = Svd::new(m, k);
    svd.decompose(a, m, k)?;
    let rank = svd.rank(cut);
    Ok((rank..k).flat_map(|j| svd.v(j).iter().copied()).collect())
}
