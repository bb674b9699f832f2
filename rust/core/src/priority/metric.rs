//! Weighted joint metric by a change of coordinates: `W = L L'`, `y = L' v`, so `v' W v = y' y` and `J v = (J L^-T) y`.
//!
//! The maps run unchanged on `J L^-T`; `v = L^-T y` at the end. Singular values then have the unit of `J` over the root of that of `W`.

use crate::error::{Error, Result, finite};
use crate::scalar::Real;

/// The Cholesky factor `L`, row-major, lower.
#[derive(Debug, Clone)]
pub struct Metric<S = f64> {
    n: usize,
    l: Vec<S>,
}

impl Metric {
    /// Factor the row-major `(n, n)` weight. Errors: `Input` unless it is finite, symmetric and positive definite.
    pub fn new(weight: &[f64], n: usize) -> Result<Self> {
        if weight.len() != n * n {
            return Err(Error::wrong("weight", "size", format!("({n}, {n})"), format!("{} entries", weight.len())));
        }
        finite("weight", weight)?;
        let biggest = weight.iter().fold(0.0f64, |b, x| b.max(x.abs()));
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                // Symmetric up to the rounding of whoever computed it.
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

    /// The metric on another number type.
    pub fn lift<S: Real>(&self) -> Metric<S> {
        Metric { n: self.n, l: self.l.iter().map(|&x| S::from_lanes(|_| x)).collect() }
    }

    /// `v -> y = L' v`, in place.
    pub fn coordinates(&self, v: &mut [f64]) {
        for i in 0..self.n {
            v[i] = (i..self.n).map(|k| self.l[k * self.n + i] * v[k]).sum();
        }
    }
}

impl<S: Real> Metric<S> {
    /// `x <- x L^-T` for a row of a Jacobian, that is `L x' = row'`.
    pub fn row(&self, x: &mut [S]) {
        for i in 0..self.n {
            let rest = (0..i).fold(x[i], |rest, k| self.l[i * self.n + k].neg_mul_add(x[k], rest));
            x[i] = rest / self.l[i * self.n + i];
        }
    }

    /// `y -> v = L^-T y`, in place.
    pub fn velocity(&self, y: &mut [S]) {
        for i in (0..self.n).rev() {
            let rest = (i + 1..self.n).fold(y[i], |rest, k| self.l[k * self.n + i].neg_mul_add(y[k], rest));
            y[i] = rest / self.l[i * self.n + i];
        }
    }
}
