//! LU decomposition `P A = L U` with partial pivoting (Golub and Van Loan, Matrix Computations, section 3.4), row-major, in place.
//!
//! The entries of `L` are below the diagonal, and the entries of `U` above it. The diagonal of `L` is all ones and not stored. The stored
//! diagonal is the reciprocal of the diagonal of `U`.
//!
//! The code also solves complex systems with entries `(re, im)`. Such systems occur in the transformed Newton iteration of implicit
//! Runge-Kutta methods.

use crate::scalar::Real;

/// A number type of a decomposition: real or complex.
pub trait Entry: Copy {
    type Real: Real;
    /// Return the real number `x` in this type.
    fn real(x: Self::Real) -> Self;
    fn magnitude(self) -> f64;
    fn inverse(self) -> Self;
    fn times(self, b: Self) -> Self;
    /// Return `self - a b`.
    fn less(self, a: Self, b: Self) -> Self;
}

/// Real entries.
impl<S: Real> Entry for S {
    type Real = S;
    #[inline]
    fn real(x: S) -> S {
        x
    }
    #[inline]
    fn magnitude(self) -> f64 {
        self.lane(0).abs()
    }
    #[inline]
    fn inverse(self) -> Self {
        S::splat(1.0) / self
    }
    #[inline]
    fn times(self, b: Self) -> Self {
        self * b
    }
    #[inline]
    fn less(self, a: Self, b: Self) -> Self {
        a.neg_mul_add(b, self)
    }
}

/// A complex number: real part, imaginary part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex<S>(pub S, pub S);

impl<S: Real> Entry for Complex<S> {
    type Real = S;
    #[inline]
    fn real(x: S) -> Self {
        Complex(x, S::zero())
    }
    #[inline]
    fn magnitude(self) -> f64 {
        self.0.lane(0).abs() + self.1.lane(0).abs()
    }
    #[inline]
    fn inverse(self) -> Self {
        // Smith's division computes no square that could overflow.
        if self.0.lane(0).abs() >= self.1.lane(0).abs() {
            let r = self.1 / self.0;
            let d = S::splat(1.0) / r.mul_add(self.1, self.0);
            Complex(d, -(r * d))
        } else {
            let r = self.0 / self.1;
            let d = S::splat(1.0) / r.mul_add(self.0, self.1);
            Complex(r * d, -d)
        }
    }
    #[inline]
    fn times(self, b: Self) -> Self {
        Complex(self.1.neg_mul_add(b.1, self.0 * b.0), self.1.mul_add(b.0, self.0 * b.1))
    }
    #[inline]
    fn less(self, a: Self, b: Self) -> Self {
        Complex(a.1.mul_add(b.1, a.0.neg_mul_add(b.0, self.0)), a.1.neg_mul_add(b.0, a.0.neg_mul_add(b.1, self.1)))
    }
}

/// The number of rows from which a decomposition calls `stopped`, because it takes milliseconds or longer.
const LONG: usize = 200;

/// Decompose `a`, shape `(n, n)`, in place. `pivots[k]` is the index of the row that is exchanged with row `k`.
///
/// The result is `false` if `a` is not finite, if a pivot is zero, or if `stopped` returned true. A long decomposition calls `stopped` once
/// per column. After `false`, the content of `a` is undefined.
#[inline(always)]
pub fn decompose<E: Entry>(n: usize, a: &mut [E], pivots: &mut [usize], mut stopped: impl FnMut() -> bool) -> bool {
    let (a, pivots) = (&mut a[..n * n], &mut pivots[..n]);
    for k in 0..n {
        if n >= LONG && stopped() {
            return false;
        }
        let mut pivot = k;
        let mut most = a[k * n + k].magnitude();
        for i in k + 1..n {
            let size = a[i * n + k].magnitude();
            if size > most {
                (most, pivot) = (size, i);
            }
        }
        // The comparisons are false for NaN, so that NaN is refused too.
        if !(most > 0.0 && most < f64::INFINITY) {
            return false;
        }
        pivots[k] = pivot;
        if pivot != k {
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
            }
        }
        let inverse = a[k * n + k].inverse();
        a[k * n + k] = inverse;
        let (head, tail) = a.split_at_mut((k + 1) * n);
        let row = &head[k * n + k + 1..];
        for other in tail.chunks_exact_mut(n) {
            let factor = other[k].times(inverse);
            other[k] = factor;
            for (x, &r) in other[k + 1..].iter_mut().zip(row) {
                *x = x.less(factor, r);
            }
        }
    }
    true
}

/// Solve `A x = b` with the decomposition of `a`. `b` is replaced by the solution.
#[inline(always)]
pub fn solve<E: Entry>(n: usize, a: &[E], pivots: &[usize], b: &mut [E]) {
    let (a, pivots, b) = (&a[..n * n], &pivots[..n], &mut b[..n]);
    for k in 0..n {
        b.swap(k, pivots[k]);
    }
    for i in 1..n {
        let mut sum = b[i];
        for j in 0..i {
            sum = sum.less(a[i * n + j], b[j]);
        }
        b[i] = sum;
    }
    for i in (0..n).rev() {
        let mut sum = b[i];
        for j in i + 1..n {
            sum = sum.less(a[i * n + j], b[j]);
        }
        b[i] = sum.times(a[i * n + i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Return `n` reproducible numbers in [-1, 1).
    fn numbers(n: usize, mut state: u64) -> Vec<f64> {
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        (0..n).map(|_| next()).collect()
    }

    /// The residual of a solve is a small multiple of eps |A| |x|, because n <= 9 and the entries of random matrices grow by a factor below
    /// 10.
    #[test]
    fn real_and_complex_solutions_satisfy_their_equations() {
        for n in 1..10 {
            for seed in 0..20 {
                let a: Vec<Complex<f64>> =
                    numbers(n * n, seed).into_iter().zip(numbers(n * n, seed + 100)).map(|(x, y)| Complex(x, y)).collect();
                let b: Vec<Complex<f64>> =
                    numbers(n, seed + 200).into_iter().zip(numbers(n, seed + 300)).map(|(x, y)| Complex(x, y)).collect();
                let (mut lu, mut pivots, mut x) = (a.clone(), vec![0; n], b.clone());
                assert!(decompose(n, &mut lu, &mut pivots, || false));
                solve(n, &lu, &pivots, &mut x);
                let size: f64 = x.iter().map(|x| x.magnitude()).sum();
                for i in 0..n {
                    let residual = (0..n).fold(b[i], |sum, j| sum.less(a[i * n + j], x[j]));
                    assert!(residual.magnitude() < 1e-14 * size * n as f64, "{n} {seed} {residual:?}");
                }
                let (mut lu, mut x): (Vec<f64>, Vec<f64>) = (a.iter().map(|a| a.0).collect(), b.iter().map(|b| b.0).collect());
                assert!(decompose(n, &mut lu, &mut pivots, || false));
                solve(n, &lu, &pivots, &mut x);
                let size: f64 = x.iter().map(|x| x.abs()).sum();
                for i in 0..n {
                    let residual = (0..n).fold(b[i].0, |sum, j| sum - a[i * n + j].0 * x[j]);
                    assert!(residual.abs() < 1e-14 * size * n as f64, "{n} {seed} {residual}");
                }
            }
        }
    }

    #[test]
    fn zero_pivots_are_exchanged_and_singular_matrices_refused() {
        let mut pivots = [0; 2];
        let mut a = [0.0, 1.0, 1.0, 0.0];
        assert!(decompose(2, &mut a, &mut pivots, || false));
        let mut b = [3.0, 5.0];
        solve(2, &a, &pivots, &mut b);
        assert_eq!(b, [5.0, 3.0]);
        assert!(!decompose(2, &mut [1.0, 2.0, 2.0, 4.0], &mut pivots, || false));
        assert!(!decompose(2, &mut [f64::NAN, 2.0, 2.0, 4.0], &mut pivots, || false));
        assert!(!decompose(2, &mut [f64::INFINITY, 2.0, 2.0, 4.0], &mut pivots, || false));
        assert!(decompose::<f64>(0, &mut [], &mut [], || false));
    }
}
