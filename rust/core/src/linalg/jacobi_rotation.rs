//! The rotation of Jacobi's method without a branch on the data (Golub and Van Loan, Matrix Computations, 8.5).
//!
//! `t = tan` of the smaller angle, `t = 2 a_pq / (d + sign(d) sqrt(d^2 + 4 a_pq^2))`, `d = a_qq - a_pp`.

use crate::scalar::Real;

/// Eigenvalues that differ by less than this fraction of the matrix are treated as equal and not rotated. The rounding error of rates is
/// 1e-16 over this.
const SAME: f64 = 1e-7;

/// A rotation of two axes.
pub struct JacobiRotation<S: Real> {
    /// Whether the axes are rotated.
    pub there: S::Mask,
    /// The tangent; zero without a rotation.
    pub t: S,
    c: S,
    s: S,
}

/// The least `d^2 + 4 a_pq^2` of axes that are rotated, for a matrix with these entries.
pub fn least_to_turn<'a, S: Real>(entries: impl IntoIterator<Item = &'a S>) -> S {
    let size = entries.into_iter().fold(S::zero(), |sum, &x| x.mul_add(x, sum));
    size.mul_add(S::splat(SAME * SAME), S::splat(f64::MIN_POSITIVE))
}

impl<S: Real> JacobiRotation<S> {
    /// The rotation that makes the off-diagonal entry `a_pq` of two axes vanish; `least`: see [`least_to_turn`].
    pub fn new(a_pp: S, a_qq: S, a_pq: S, least: S) -> Self {
        let (zero, one) = (S::zero(), S::splat(1.0));
        let (twice, d) = (a_pq + a_pq, a_qq - a_pp);
        let square = d.mul_add(d, twice * twice);
        let there = least.lt(square);
        let root = S::select(there, square, one).sqrt();
        let t = S::select(there, twice / S::select(d.lt(zero), d - root, d + root), zero);
        let c = one / t.mul_add(t, one).sqrt();
        JacobiRotation { there, t, c, s: t * c }
    }

    /// The entries `x`, `y` of the two axes, rotated.
    pub fn turn(&self, x: S, y: S) -> (S, S) {
        (self.s.neg_mul_add(y, self.c * x), self.s.mul_add(x, self.c * y))
    }
}
