//! Cholesky factorisation `A = L L'` of a symmetric positive definite matrix, row-major.

use crate::error::{Error, Result, finite};
use crate::scalar::Real;
use nalgebra::{DMatrix, DVector};

/// An asymmetry up to this fraction of the largest entry counts as a rounding error.
const SYMMETRY: f64 = 1e-12;

/// Return the lower factor `L` of the matrix `a`, shape `(n, n)`, with zeros above the diagonal. The result is `None` if `a` is not
/// positive definite.
pub fn factor(n: usize, a: &[f64]) -> Option<Vec<f64>> {
    let mut l = vec![0.0; n * n];
    (factor_into(n, a, &mut l) == 1.0).then_some(l)
}

/// Write the lower factor to the lower triangle of `l`, and leave the other entries unchanged. Return one in lanes where `a` is positive
/// definite, otherwise zero.
pub fn factor_into<S: Real>(n: usize, a: &[S], l: &mut [S]) -> S {
    let (zero, infinity, mut definite) = (S::zero(), S::splat(f64::INFINITY), S::splat(1.0));
    for i in 0..n {
        for j in 0..=i {
            let mut sum = a[i * n + j];
            for k in 0..j {
                sum -= l[i * n + k] * l[j * n + k];
            }
            if i > j {
                l[i * n + j] = sum / l[j * n + j];
            } else {
                definite = S::select(zero.lt(sum), S::select(sum.lt(infinity), definite, zero), zero);
                l[i * n + i] = sum.sqrt();
            }
        }
    }
    definite
}

/// Solve `L y = b`. `x` contains `b`, and then `y`.
pub fn solve_lower<S: Real>(n: usize, l: &[S], x: &mut [S]) {
    for i in 0..n {
        for k in 0..i {
            x[i] -= l[i * n + k] * x[k];
        }
        x[i] = x[i] / l[i * n + i];
    }
}

/// Solve `L L' x = b`. `x` contains `b`, and then the solution.
pub fn solve<S: Real>(n: usize, l: &[S], x: &mut [S]) {
    solve_lower(n, l, x);
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= l[k * n + i] * x[k];
        }
        x[i] = x[i] / l[i * n + i];
    }
}

/// The factorisation `A = L L'` of a symmetric matrix.
pub struct Cholesky<S> {
    n: usize,
    l: Vec<S>,
    /// One in lanes where the matrix is positive definite, otherwise zero.
    pub definite: S,
}

impl<S: Real> Cholesky<S> {
    /// Factor the matrix `a`, shape `(n, n)`.
    pub fn of(a: &DMatrix<S>) -> Self {
        let n = a.nrows();
        let mut l = vec![S::zero(); n * n];
        let definite = factor_into(n, a.as_slice(), &mut l);
        Cholesky { n, l, definite }
    }

    /// Return `L^-1 B`.
    pub fn solve_lower(&self, b: &DMatrix<S>) -> DMatrix<S> {
        self.columns(b, solve_lower)
    }

    /// Return `A^-1 B`.
    pub fn solve(&self, b: &DMatrix<S>) -> DMatrix<S> {
        self.columns(b, solve)
    }

    /// Return `A^-1 b`.
    pub fn solve_vector(&self, b: &DVector<S>) -> DVector<S> {
        let mut x = b.clone();
        solve(self.n, &self.l, x.as_mut_slice());
        x
    }

    /// Return `L^-1 b`.
    pub fn solve_lower_vector(&self, b: &DVector<S>) -> DVector<S> {
        let mut x = b.clone();
        solve_lower(self.n, &self.l, x.as_mut_slice());
        x
    }

    fn columns(&self, b: &DMatrix<S>, solve: fn(usize, &[S], &mut [S])) -> DMatrix<S> {
        let mut x = b.clone();
        x.as_mut_slice().chunks_exact_mut(self.n).for_each(|column| solve(self.n, &self.l, column));
        x
    }
}

/// Refuse a matrix that is not finite, symmetric and positive definite. Errors: `Input`.
pub fn require_positive_definite(argument: &str, n: usize, a: &[f64]) -> Result<()> {
    finite(argument, a)?;
    let scale = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for i in 0..n {
        for j in 0..i {
            let (x, y) = (a[i * n + j], a[j * n + i]);
            if (x - y).abs() > SYMMETRY * scale {
                return Err(Error::input(argument, format!("is not symmetric: expected equal entries, got {y} and {x}")).at([j, i]));
            }
        }
    }
    match factor(n, a) {
        Some(_) => Ok(()),
        None => Err(Error::input(argument, "is not positive definite: expected all eigenvalues > 0")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_and_refuses() {
        let a = [4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0];
        let l = factor(3, &a).expect("positive definite");
        let mut x = [5.5, 3.8, 2.3];
        solve(3, &l, &mut x);
        for (i, want) in [5.5, 3.8, 2.3].into_iter().enumerate() {
            let got: f64 = (0..3).map(|j| a[3 * i + j] * x[j]).sum();
            assert!((got - want).abs() < 1e-14, "three products and a sum of numbers below 10");
        }
        assert!(require_positive_definite("k", 2, &[1.0, 2.0, 2.0, 1.0]).is_err());
        assert!(require_positive_definite("k", 2, &[1.0, 0.1, 0.0, 1.0]).is_err());
        assert!(require_positive_definite("k", 2, &[1.0, f64::NAN, 0.0, 1.0]).is_err());
        assert!(require_positive_definite("k", 2, &[0.0, 0.0, 0.0, 1.0]).is_err());
    }
}
