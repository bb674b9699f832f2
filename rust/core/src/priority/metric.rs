//! The joint metric `v' W v` by a change of coordinates: with `W = L L'` and `y = L' v`, `v' W v = y' y` and `J v = (J L^-T) y`.
//!
//! The methods use `J L^-T` instead of `J`, and `v = L^-T y` at the end. Singular values have the unit of `J` divided by the square root of
//! the unit of `W`. The prime is the transpose.

use crate::error::{Error, Result, finite};
use crate::scalar::Real;

/// The Cholesky factor `L` of the metric, lower triangle, row-major.
#[derive(Debug, Clone)]
pub struct Metric<S = f64> {
    n: usize,
    l: Vec<S>,
}

impl Metric {
    /// Factor `weight`, shape `(n, n)`, row-major. Errors: `WrongShape` for a wrong size, `Input` if it is not finite, symmetric and
    /// positive definite.
    pub fn new(weight: &[f64], n: usize) -> Result<Self> {
        if weight.len() != n * n {
            return Err(Error::wrong("weight", "size", format!("({n}, {n})"), format!("{} entries", weight.len())));
        }
        finite("weight", weight)?;
        let biggest = weight.iter().fold(0.0f64, |b, x| b.max(x.abs()));
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                // The matrix must be symmetric up to rounding errors of its computation.
                if (weight[i * n + j] - weight[j * n + i]).abs() > 1e-12 * biggest {
                    return Err(Error::input(
                        "weight",
                        format!("is not symmetric: expected W[i, j] = W[j, i], got {} and {}", weight[i * n + j], weight[j * n + i]),
                    )
                    .at([i, j]));
                }
                let s = weight[i * n + j] - (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum::<f64>();
                if i > j {
                    l[i * n + j] = s / l[j * n + j];
                } else if s > f64::EPSILON * weight[i * n + i] && weight[i * n + i] > 0.0 {
                    l[i * n + i] = s.sqrt();
                } else {
                    return Err(Error::input("weight", format!("is not positive definite: expected positive pivots, got {s}")).at([i]));
                }
            }
        }
        Ok(Metric { n, l })
    }

    /// Return the metric with another number type.
    pub fn lift<S: Real>(&self) -> Metric<S> {
        Metric { n: self.n, l: self.l.iter().map(|&x| S::varying(x)).collect() }
    }

    /// Replace `v` by its coordinates `y = L' v`.
    pub fn coordinates(&self, v: &mut [f64]) {
        for i in 0..self.n {
            v[i] = (i..self.n).map(|k| self.l[k * self.n + i] * v[k]).sum();
        }
    }
}

impl<S: Real> Metric<S> {
    /// The Cholesky factor, shape `(n, n)`, row-major.
    pub fn factor(&self) -> &[S] {
        &self.l
    }

    /// Replace the Cholesky factor.
    pub fn set_factor(&mut self, factor: &[S]) {
        self.l.copy_from_slice(factor);
    }

    /// Replace the row `x` of a Jacobian by `x L^-T`, the solution of `L x' = row'`.
    pub fn row(&self, x: &mut [S]) {
        for i in 0..self.n {
            let remaining = (0..i).fold(x[i], |sum, k| self.l[i * self.n + k].neg_mul_add(x[k], sum));
            x[i] = remaining / self.l[i * self.n + i];
        }
    }

    /// Replace the coordinates `y` by the velocity `v = L^-T y`.
    pub fn velocity(&self, y: &mut [S]) {
        for i in (0..self.n).rev() {
            let remaining = (i + 1..self.n).fold(y[i], |sum, k| self.l[k * self.n + i].neg_mul_add(y[k], sum));
            y[i] = remaining / self.l[i * self.n + i];
        }
    }
}
