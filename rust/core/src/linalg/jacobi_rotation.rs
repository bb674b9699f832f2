//! Rotations of Jacobi's eigenvalue method without a branch on the data (Golub and Van Loan, Matrix Computations, 8.5).
//!
//! The tangent of the smaller angle is `t = 2 a_pq / (d + sign(d) sqrt(d^2 + 4 a_pq^2))` with `d = a_qq - a_pp`.

use crate::scalar::Real;

/// If two eigenvalues differ by less than this fraction of the matrix norm, they count as equal, and the axes are not rotated. The rounding
/// error of derivatives of the recorded rotation is 1e-16 divided by this number.
const SAME: f64 = 1e-7;

/// The rotation of two axes.
pub struct JacobiRotation<S: Real> {
    /// Whether the axes are rotated.
    pub there: S::Mask,
    /// The tangent of the angle. It is zero without a rotation.
    pub t: S,
    c: S,
    s: S,
}

/// Return the smallest `(a_qq - a_pp)^2 + 4 a_pq^2` for which the axes `p` and `q` are rotated, for a matrix with these entries.
pub fn least_to_turn<'a, S: Real>(entries: impl IntoIterator<Item = &'a S>) -> S {
    let size = entries.into_iter().fold(S::zero(), |sum, &x| x.mul_add(x, sum));
    size.mul_add(S::splat(SAME * SAME), S::splat(f64::MIN_POSITIVE))
}

impl<S: Real> JacobiRotation<S> {
    /// Return the rotation that makes the off-diagonal entry `a_pq` zero. `least`: the result of [`least_to_turn`].
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

    /// Return the rotated entries `x` and `y` of the two axes.
    pub fn turn(&self, x: S, y: S) -> (S, S) {
        (self.s.neg_mul_add(y, self.c * x), self.s.mul_add(x, self.c * y))
    }
}
