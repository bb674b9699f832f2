//! Orthonormal null bases, `A N = 0` with `N'N = I`, from the right singular vectors beyond the rank. The prime is the transpose.
//!
//! The formula `I - A'(A A')^-1 A` is not used. It squares the condition number, and so increases the error of the projector.

use super::svd::Svd;
use crate::error::Result;

/// Return an orthonormal basis of the null space of `a`, shape `(m, k)`, row-major. The basis vectors are the rows of an array, shape
/// `(k - rank, k)`, row-major.
///
/// `cut`: singular values up to this number count as zero, in the unit of `a`. Errors: as for
/// [`Svd::decompose`].
pub fn null_basis(a: &[f64], m: usize, k: usize, cut: f64) -> Result<Vec<f64>> {
    let mut svd = Svd::new(m, k);
    svd.decompose(a, m, k)?;
    let rank = svd.rank(cut);
    Ok((rank..k).flat_map(|j| svd.v(j).iter().copied()).collect())
}
