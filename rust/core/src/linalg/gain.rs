//! Gains: scalar, diagonal or full symmetric positive definite matrices (also stiffness and inertia), and their products with vectors.

use crate::error::{Error, Result, finite};
use crate::linalg::cholesky::require_positive_definite;
use crate::scalar::Real;
use nalgebra::{DMatrix, DVector};
use std::ops::Mul;

/// A gain of size `n`. It is symmetric positive definite, except for gains of [`Gain::not_negative`] and results of computations with
/// gains.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    n: usize,
    /// The `n` diagonal entries, or all `n^2` entries, row-major.
    values: Vec<f64>,
}

impl Gain {
    /// Return the gain `k I` of size `n`. Errors: `Input` if `k` is not positive and finite.
    pub fn scalar(argument: &str, n: usize, k: f64) -> Result<Self> {
        crate::error::positive(argument, k)?;
        Ok(Gain { n, values: vec![k; n] })
    }

    /// Return the gain `diag(values)`. Errors: `Input` if a number is not positive and finite.
    pub fn diagonal(argument: &str, values: Vec<f64>) -> Result<Self> {
        finite(argument, &values)?;
        if let Some(i) = values.iter().position(|&k| k <= 0.0) {
            return Err(Error::input(argument, format!("is not positive definite: expected > 0, got {}", values[i])).at([i]));
        }
        Ok(Gain { n: values.len(), values })
    }

    /// Return the gain `values`, shape `(n, n)`, row-major. A diagonal matrix is stored as its diagonal. Errors: `Input` if the matrix is
    /// not finite, symmetric and positive definite.
    pub fn full(argument: &str, n: usize, values: Vec<f64>) -> Result<Self> {
        require_positive_definite(argument, n, &values)?;
        let off_diagonal = (0..n * n).any(|k| k / n != k % n && values[k] != 0.0);
        if !off_diagonal && n > 1 {
            return Ok(Gain { n, values: (0..n).map(|i| values[i * n + i]).collect() });
        }
        Ok(Gain { n, values })
    }

    /// Return the gain of a symmetric positive definite matrix, shape `(n, n)`. Errors: `Input` for any other matrix.
    ///
    /// ```
    /// use armlet_core::law::Gain;
    /// use nalgebra::{dmatrix, dvector};
    ///
    /// let gain = Gain::from_matrix("kp", &dmatrix![4.0, 1.0; 1.0, 3.0])?;
    /// assert_eq!(gain.to_matrix() * dvector![1.0, 1.0], dvector![5.0, 4.0]);
    /// assert_eq!(Gain::scalar("kd", 2, 5.0)?.to_matrix(), dmatrix![5.0, 0.0; 0.0, 5.0]);
    /// let error = Gain::from_matrix("kp", &dmatrix![1.0, 2.0; 2.0, 1.0]).unwrap_err();
    /// assert!(error.to_string().starts_with("kp is not positive definite"));
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn from_matrix(argument: &str, matrix: &DMatrix<f64>) -> Result<Self> {
        if !matrix.is_square() {
            let (rows, columns) = matrix.shape();
            return Err(Error::input(argument, format!("is not square: expected (n, n), got ({rows}, {columns})")));
        }
        Gain::full(argument, matrix.nrows(), matrix.transpose().as_slice().to_vec())
    }

    /// The gain as a matrix, shape `(n, n)`.
    pub fn to_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.n, self.n, &self.matrix())
    }

    /// Return a diagonal gain that may have zeros, for a task with only feedforward. Errors: `Input` for a number that is negative or not
    /// finite.
    pub fn not_negative(argument: &str, values: Vec<f64>) -> Result<Self> {
        finite(argument, &values)?;
        if let Some(i) = values.iter().position(|&k| k < 0.0) {
            return Err(Error::input(argument, format!("is negative: expected >= 0, got {}", values[i])).at([i]));
        }
        Ok(Gain { n: values.len(), values })
    }

    /// Return the square root of a symmetric gain. Negative eigenvalues of a full gain count as zero.
    pub fn square_root(&self) -> Gain {
        if self.is_diagonal() {
            return Gain::unchecked(self.n, self.values.iter().map(|k| k.sqrt()).collect());
        }
        let n = self.n;
        let Ok((values, vectors)) = crate::linalg::symmetric_eigen(&self.values, n) else {
            return Gain::unchecked(n, vec![f64::NAN; n * n]);
        };
        let entry = |i: usize, j: usize| (0..n).map(|k| vectors[k * n + i] * values[k].max(0.0).sqrt() * vectors[k * n + j]).sum();
        Gain::unchecked(n, (0..n * n).map(|k| entry(k / n, k % n)).collect())
    }

    /// Return a gain from a matrix without checks. The matrix may be unsymmetric, for example `Kd^-1 Kp`.
    pub(crate) fn unchecked(n: usize, values: Vec<f64>) -> Self {
        Gain { n, values }
    }

    pub fn n(&self) -> usize {
        self.n
    }

    pub fn is_diagonal(&self) -> bool {
        self.values.len() == self.n
    }

    /// The entry `(i, j)`.
    #[inline]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        if !self.is_diagonal() {
            self.values[i * self.n + j]
        } else if i == j {
            self.values[i]
        } else {
            0.0
        }
    }

    /// All entries, shape `(n, n)`, row-major.
    pub fn matrix(&self) -> Vec<f64> {
        (0..self.n * self.n).map(|k| self.at(k / self.n, k % self.n)).collect()
    }

    /// Return `self x`.
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        (0..self.n).map(|i| (0..self.n).map(|j| self.at(i, j) * x[j]).sum()).collect()
    }

    /// Return `k self`.
    pub fn scaled(&self, k: f64) -> Gain {
        Gain::unchecked(self.n, self.values.iter().map(|x| k * x).collect())
    }

    /// Return `x' self x`.
    pub fn form(&self, x: &[f64]) -> f64 {
        self.times(x).iter().zip(x).map(|(y, x)| y * x).sum()
    }

    /// Return `self^-1` for a symmetric positive definite `self`.
    pub fn inverse(&self) -> Gain {
        self.solve(&Gain::unchecked(self.n, vec![1.0; self.n]))
    }

    /// Return `self other`. The result is diagonal if both gains are.
    pub fn product(&self, other: &Gain) -> Gain {
        let n = self.n;
        if self.is_diagonal() && other.is_diagonal() {
            return Gain::unchecked(n, (0..n).map(|i| self.values[i] * other.values[i]).collect());
        }
        let entry = |k: usize| (0..n).map(|j| self.at(k / n, j) * other.at(j, k % n)).sum();
        Gain::unchecked(n, (0..n * n).map(entry).collect())
    }

    /// Return `self^-1 other` for a symmetric positive definite `self`. The result is diagonal if both gains are.
    pub fn solve(&self, other: &Gain) -> Gain {
        let n = self.n;
        if self.is_diagonal() && other.is_diagonal() {
            return Gain::unchecked(n, (0..n).map(|i| other.values[i] / self.values[i]).collect());
        }
        let l = crate::linalg::cholesky::factor(n, &self.matrix()).unwrap_or_else(|| vec![f64::NAN; n * n]);
        let mut out = vec![0.0; n * n];
        let mut column = vec![0.0; n];
        for j in 0..n {
            for i in 0..n {
                column[i] = other.at(i, j);
            }
            crate::linalg::cholesky::solve(n, &l, &mut column);
            for i in 0..n {
                out[i * n + j] = column[i];
            }
        }
        Gain::unchecked(n, out)
    }
}

/// A gain `K` in a control loop. The prime is the transpose.
#[derive(Clone, Debug)]
pub enum AnyGain<S> {
    /// The diagonal of a diagonal gain.
    Diagonal(Vec<S>),
    /// All entries of another gain, row-major.
    Full(Vec<S>),
}

impl<S: Real> AnyGain<S> {
    /// Return the gain as numbers of the loop. Listings of recordings (`trace`) show them with the label `name`.
    pub fn labelled(name: &'static str, gain: &Gain) -> Self {
        S::labelled(name, 1, || Self::new(gain))
    }

    /// Return the gain as numbers of the loop.
    pub fn new(gain: &Gain) -> Self {
        let n = gain.n();
        if gain.is_diagonal() {
            AnyGain::Diagonal((0..n).map(|k| S::varying(gain.at(k, k))).collect())
        } else {
            AnyGain::Full((0..n * n).map(|k| S::varying(gain.at(k / n, k % n))).collect())
        }
    }

    /// Return the entries of the gain of size `n`, `(n, n)`.
    pub fn matrix(&self, n: usize) -> Vec<S> {
        match self {
            AnyGain::Diagonal(k) => (0..n * n).map(|at| if at % (n + 1) == 0 { k[at / n] } else { S::zero() }).collect(),
            AnyGain::Full(k) => k.clone(),
        }
    }

    /// Return `x' K x`.
    pub fn quadratic(&self, x: &[S]) -> S {
        let mut sum = S::zero();
        match self {
            AnyGain::Diagonal(k) => {
                for i in 0..k.len() {
                    sum = (k[i] * x[i]).mul_add(x[i], sum);
                }
            }
            AnyGain::Full(k) => {
                for (row, &x_i) in k.chunks_exact(x.len()).zip(x) {
                    sum = row_times(row, x).mul_add(x_i, sum);
                }
            }
        }
        sum
    }

    /// Write `y = K x`.
    pub fn multiply(&self, x: &[S], y: &mut [S]) {
        match self {
            AnyGain::Diagonal(k) => {
                for i in 0..k.len() {
                    y[i] = k[i] * x[i];
                }
            }
            AnyGain::Full(k) => {
                for (row, y) in k.chunks_exact(x.len()).zip(y) {
                    *y = row_times(row, x);
                }
            }
        }
    }

    /// Write `y += K x`.
    pub fn add_to(&self, x: &[S], y: &mut [S]) {
        match self {
            AnyGain::Diagonal(k) => {
                for i in 0..k.len() {
                    y[i] = k[i].mul_add(x[i], y[i]);
                }
            }
            AnyGain::Full(k) => {
                for (row, y) in k.chunks_exact(x.len()).zip(y) {
                    *y = row.iter().zip(x).fold(*y, |sum, (&k, &x)| k.mul_add(x, sum));
                }
            }
        }
    }
}

impl<S: Real> Mul<&DVector<S>> for &AnyGain<S> {
    type Output = DVector<S>;

    fn mul(self, x: &DVector<S>) -> DVector<S> {
        let mut y = vec![S::zero(); x.len()];
        self.multiply(x.as_slice(), &mut y);
        DVector::from_vec(y)
    }
}

/// Return the product of a row of a gain and a vector.
fn row_times<S: Real>(row: &[S], x: &[S]) -> S {
    row[1..].iter().zip(&x[1..]).fold(row[0] * x[0], |sum, (&k, &x)| k.mul_add(x, sum))
}
