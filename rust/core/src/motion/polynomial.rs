//! Polynomials of degree five, and derivatives of a path that is followed in time.
//!
//! ```text
//! q(x) = sum_j c_j x^j
//! v = q' s',   a = q' s'' + q'' s'^2,   jerk = q' s''' + 3 q'' s' s'' + q''' s'^3                             (chain rule)
//! snap = q' s'''' + q'' (4 s' s''' + 3 s''^2) + 6 q''' s'^2 s'' + q'''' s'^4
//! ```
//!
//! In the chain rule, derivatives of `q` are with respect to `s`, and derivatives of `s` are with respect to time. An array `[S; K]` has a
//! value and its derivatives up to order `K - 1`.

use crate::scalar::Real;

/// Number of coefficients of a polynomial.
pub const TERMS: usize = 6;

/// Compute the polynomial with the coefficients `c` and its derivatives at `x`.
#[inline(always)]
pub fn polynomial<S: Real, const K: usize>(c: [S; TERMS], x: S) -> [S; K] {
    let [c0, c1, c2, c3, c4, c5] = c;
    let (k, mut values) = (S::splat, [S::zero(); K]);
    for (order, value) in values.iter_mut().enumerate() {
        *value = match order {
            0 => c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))),
            1 => c1 + x * (k(2.0) * c2 + x * (k(3.0) * c3 + x * (k(4.0) * c4 + x * (k(5.0) * c5)))),
            2 => k(2.0) * c2 + x * (k(6.0) * c3 + x * (k(12.0) * c4 + x * (k(20.0) * c5))),
            3 => k(6.0) * c3 + x * (k(24.0) * c4 + x * (k(60.0) * c5)),
            _ => k(24.0) * c4 + x * (k(120.0) * c5),
        };
    }
    values
}

/// Compute the coefficients of the polynomial in `x` from 0 to 1 with given ends. `start` and `end` have the position and its first two
/// derivatives with respect to `h x`.
#[inline(always)]
pub fn hermite<S: Real>(start: [S; 3], end: [S; 3], h: S) -> [S; TERMS] {
    let k = S::splat;
    let (c0, c1, c2) = (start[0], h * start[1], k(0.5) * h * h * start[2]);
    // A quadratic polynomial has the three values of the start. `dq`, `dv` and `da` are its errors at the end.
    let (dq, dv, da) = (end[0] - c0 - c1 - c2, h * end[1] - c1 - k(2.0) * c2, h * h * end[2] - k(2.0) * c2);
    let c3 = k(10.0) * dq - k(4.0) * dv + k(0.5) * da;
    let c4 = k(-15.0) * dq + k(7.0) * dv - da;
    let c5 = k(6.0) * dq - k(3.0) * dv + k(0.5) * da;
    [c0, c1, c2, c3, c4, c5]
}

/// Convert derivatives with respect to `x` to derivatives with respect to `x / rate`.
#[inline(always)]
pub fn scaled<S: Real, const K: usize>(mut values: [S; K], rate: S) -> [S; K] {
    for order in 1..K {
        for value in &mut values[order..] {
            *value *= rate;
        }
    }
    values
}

/// Compute the derivatives of `q(s(t))` with respect to time by the chain rule.
#[inline(always)]
pub fn chain<S: Real, const K: usize>(q: [S; K], s: [S; 5]) -> [S; K] {
    let [_, s1, s2, s3, s4] = s;
    let (k, mut values) = (S::splat, [S::zero(); K]);
    for (order, value) in values.iter_mut().enumerate() {
        *value = match order {
            0 => q[0],
            1 => q[1] * s1,
            2 => q[1] * s2 + q[2] * s1 * s1,
            3 => q[1] * s3 + k(3.0) * q[2] * s1 * s2 + q[3] * s1 * s1 * s1,
            _ => q[1] * s4 + q[2] * (k(4.0) * s1 * s3 + k(3.0) * s2 * s2) + k(6.0) * q[3] * s1 * s1 * s2 + q[4] * s1 * s1 * s1 * s1,
        };
    }
    values
}

/// A value that does not change with time.
#[inline(always)]
pub fn constant<S: Real, const K: usize>(value: S) -> [S; K] {
    let mut values = [S::zero(); K];
    values[0] = value;
    values
}
