//! Rows of results: the position of all joints, and each of its derivatives with respect to time. Functions compute rows 0 to `K - 1`, and
//! write rows `FROM` to `K - 1`, as `(K - FROM, n)`.

use super::polynomial::constant;
use crate::scalar::Real;

/// Write the values of joint `i` of `n` joints, one to each row of `out`.
#[inline(always)]
pub fn put<S: Real, const K: usize, const FROM: usize>(n: usize, out: &mut [S], i: usize, values: [S; K]) {
    for k in FROM..K {
        out[(k - FROM) * n + i] = values[k];
    }
}

/// Write a constant position.
#[inline(always)]
pub fn hold<S: Real, const K: usize, const FROM: usize>(q: &[f64], out: &mut [S]) {
    for i in 0..q.len() {
        put::<_, K, FROM>(q.len(), out, i, constant(S::splat(q[i])));
    }
}
