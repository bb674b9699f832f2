//! The clamped inverse `f(A) = max(A, c)^-1` of a symmetric positive semidefinite matrix `A`: its eigenvalues are raised to at least `c`,
//! then inverted.
//!
//! The code does not branch on the data. It makes a fixed number of sweeps of Jacobi's method (Golub and Van Loan, Matrix Computations,
//! 8.5).
//!
//! With `A = G G'` and `c = eps^2`, the matrix `G' f(A)` is the pseudo-inverse of `G` with the spectral clamp `sigma / max(sigma, eps)^2`.
//!
//! The sweeps make `B = V' A V` nearly diagonal. Then `f(A) = V F V'`, where `F_ii = f(B_ii)` and
//! `F_ij = B_ij (f(B_ii) - f(B_jj)) / (B_ii - B_jj)` (Daleckii and Krein). So the result includes the off-diagonal entries of `B` to first
//! order. To this order, the result and its derivative do not depend on the choice of `V`.

use super::jacobi_rotation::{JacobiRotation, least_to_turn};
use crate::scalar::Real;
use nalgebra::DMatrix;

/// For each number of rows, the number of sweeps after which off-diagonal entries are below 1e-7 of the largest eigenvalue. The error of
/// the result is proportional to the squares of these entries.
const SWEEPS: [usize; 7] = [0, 0, 1, 4, 5, 6, 7];

/// The clamped inverse of matrices of one size, with its memory.
#[derive(Clone, Debug)]
pub struct ClampedInverse<S> {
    m: usize,
    b: Vec<S>,
    v: Vec<S>,
    f: Vec<S>,
    row: Vec<S>,
}

impl<S: Real> ClampedInverse<S> {
    /// Create the memory for matrices of shape `(m, m)`. `m` is at most six, the number of rows of a frame's Jacobian.
    pub fn new(m: usize) -> Self {
        let zeros = |k: usize| vec![S::zero(); k];
        ClampedInverse { m, b: zeros(m * m), v: zeros(m * m), f: zeros(m * m), row: zeros(m) }
    }

    /// Raise the eigenvalues of `a`, shape `(m, m)`, to at least `floor`, and write the inverse to `out`. Return the smallest eigenvalue of
    /// `a`.
    pub fn compute(&mut self, a: &[S], floor: S, out: &mut [S]) -> S {
        let m = self.m;
        self.b.copy_from_slice(a);
        for (k, v) in self.v.iter_mut().enumerate() {
            *v = if k % (m + 1) == 0 { S::splat(1.0) } else { S::zero() };
        }
        let least = least_to_turn(a);
        for _ in 0..SWEEPS[m.min(SWEEPS.len() - 1)] {
            for p in 0..m {
                for q in p + 1..m {
                    self.turn(p, q, least);
                }
            }
        }
        self.raise(floor);
        for i in 0..m {
            for j in 0..m {
                self.row[j] = (0..m).fold(S::zero(), |sum, k| self.v[i * m + k].mul_add(self.f[k * m + j], sum));
            }
            for j in 0..=i {
                let entry = (0..m).fold(S::zero(), |sum, k| self.row[k].mul_add(self.v[j * m + k], sum));
                (out[i * m + j], out[j * m + i]) = (entry, entry);
            }
        }
        (1..m).fold(self.b[0], |least, i| least.min(self.b[i * m + i]))
    }

    /// Rotate the axes `p` and `q` so that their off-diagonal entry becomes zero. Axes with nearly equal eigenvalues are not rotated.
    /// `least`: see [`least_to_turn`].
    fn turn(&mut self, p: usize, q: usize, least: S) {
        let m = self.m;
        let (b, v) = (&mut self.b, &mut self.v);
        let between = b[p * m + q];
        let rotation = JacobiRotation::new(b[p * m + p], b[q * m + q], between, least);
        b[p * m + p] = rotation.t.neg_mul_add(between, b[p * m + p]);
        b[q * m + q] = rotation.t.mul_add(between, b[q * m + q]);
        let entry = S::select(rotation.there, S::zero(), between);
        (b[p * m + q], b[q * m + p]) = (entry, entry);
        for k in (0..m).filter(|&k| k != p && k != q) {
            let (x, y) = rotation.turn(b[k * m + p], b[k * m + q]);
            (b[k * m + p], b[p * m + k], b[k * m + q], b[q * m + k]) = (x, x, y, y);
        }
        for row in v.chunks_exact_mut(m) {
            (row[p], row[q]) = rotation.turn(row[p], row[q]);
        }
    }

    /// Compute `F` from `B`, with `l = B_ii` and `k = B_jj`: `F_ii = 1 / max(l, c)` and `F_ij = -share B_ij / (max(l, c) max(k, c))`.
    /// `share` is the fraction of the interval between `l` and `k` that is above `c`.
    fn raise(&mut self, floor: S) {
        let (m, zero, one) = (self.m, S::zero(), S::splat(1.0));
        for i in 0..m {
            let own = self.b[i * m + i];
            self.f[i * m + i] = one / own.max(floor);
            for j in 0..i {
                let other = self.b[j * m + j];
                let (low, high) = (own.min(other), own.max(other));
                let (some, both) = (low.lt(floor), high.lt(floor));
                // If both eigenvalues are on one side of the floor, `share` is 1 or 0, and `apart` has no effect.
                let apart = S::select(both, one, S::select(some, high - low, one));
                let share = S::select(both, zero, S::select(some, (high - floor) / apart, one));
                let entry = -(share * self.b[i * m + j] * self.f[i * m + i] * self.f[j * m + j]);
                (self.f[i * m + j], self.f[j * m + i]) = (entry, entry);
            }
        }
    }
}

/// Return the clamped inverse of `a`, shape `(m, m)`, and the smallest eigenvalue of `a`: see [`ClampedInverse::compute`].
pub fn clamped_inverse<S: Real>(a: &DMatrix<S>, floor: S) -> (DMatrix<S>, S) {
    let m = a.nrows();
    let mut inverse = DMatrix::from_element(m, m, S::zero());
    let least = ClampedInverse::new(m).compute(a.as_slice(), floor, inverse.as_mut_slice());
    (inverse, least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::symmetric_eigen;

    /// Return a positive semidefinite matrix with entries of random size and with rank up to `m`.
    fn matrix(m: usize, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let n = 7;
        let mut g: Vec<f64> = (0..m * n).map(|_| next()).collect();
        // Make two rows equal or almost equal.
        if seed.is_multiple_of(3) && m > 1 {
            let near = 10f64.powf(20.0 * next() - 10.0) * f64::from(u8::from(seed.is_multiple_of(2)));
            for k in 0..n {
                g[(m - 1) * n + k] = g[k] + near * next();
            }
        }
        (0..m * m).map(|at| (0..n).map(|k| g[at / m * n + k] * g[at % m * n + k]).sum()).collect()
    }

    #[test]
    fn it_is_the_function_of_the_eigenvalues() {
        for m in 1..=6 {
            for seed in 0..200 {
                let a = matrix(m, 7 * seed + m as u64);
                let floor = 1e-3;
                let (values, vectors) = symmetric_eigen(&a, m).expect("finite");
                let mut got = vec![0.0; m * m];
                let least = ClampedInverse::new(m).compute(&a, floor, &mut got);
                assert!((least - values[0]).abs() < 1e-14 * (1.0 + values[m - 1]), "{m} {seed}: {least} against {}", values[0]);
                for i in 0..m {
                    for j in 0..m {
                        let want: f64 = (0..m).map(|k| vectors[k * m + i] * vectors[k * m + j] / values[k].max(floor)).sum();
                        // The tolerance is the rounding error of the eigenvalues, multiplied with the bound 1/c^2 of the slope.
                        assert!((got[i * m + j] - want).abs() < 1e-8, "{m} {seed}: {} against {want}", got[i * m + j]);
                    }
                }
            }
        }
    }
}
