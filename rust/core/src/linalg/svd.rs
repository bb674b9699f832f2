//! Singular value decomposition `A = U diag(s) V'` by one-sided Jacobi rotations of the triangular factor of `A` (Drmac and Veselic 2008,
//! `drmac2008jacobi`).
//!
//! The triangular factor is `L` of `A = L Q` (wide) or `R` of `A = Q R` (tall). Rotations make its columns orthogonal. The same rotations
//! are applied to the rows of `V'`.
//!
//! `V` is a product of reflections and rotations. So `V` has the shape `(k, k)`, and is orthonormal even if singular values are zero. The
//! last rows of `V'` are the null basis. The number of sweeps is limited, and memory is reused.

use super::householder::{reflect, reflector};
use super::{axpy, dot, largest};
use crate::error::{Error, Result, finite};
use crate::status::Status;

/// The largest number of sweeps. The convergence is quadratic.
const MAX_SWEEPS: usize = 60;

/// The memory and the result of a decomposition. `new` allocates, and `decompose` does not.
#[derive(Debug, Clone)]
pub struct Svd {
    /// The sizes of the present matrix, and their minimum.
    m: usize,
    k: usize,
    p: usize,
    /// The Householder vectors of the triangular factorisation, with the factors `beta`.
    work: Vec<f64>,
    beta: Vec<f64>,
    /// The columns of the triangular factor as rows. Rotations make them orthogonal.
    g: Vec<f64>,
    /// The right and the left singular vectors as rows, and the singular values.
    vt: Vec<f64>,
    ut: Vec<f64>,
    s: Vec<f64>,
}

impl Svd {
    /// Allocate memory for matrices of up to `rows` by `columns`.
    pub fn new(rows: usize, columns: usize) -> Self {
        let p = rows.min(columns);
        Svd {
            m: 0,
            k: 0,
            p: 0,
            work: vec![0.0; rows * columns],
            g: vec![0.0; p * p],
            beta: vec![0.0; p],
            vt: vec![0.0; columns * columns],
            ut: vec![0.0; p * rows],
            s: vec![0.0; p],
        }
    }

    /// The `min(m, k)` singular values, in descending order.
    pub fn s(&self) -> &[f64] {
        &self.s[..self.p]
    }

    /// The left singular vector `j`, shape `(m,)`. It is zero if `s[j] = 0`.
    pub fn u(&self, j: usize) -> &[f64] {
        &self.ut[j * self.m..(j + 1) * self.m]
    }

    /// The right singular vector `j < k`, shape `(k,)`. The vectors from `min(m, k)` on complete the basis.
    pub fn v(&self, j: usize) -> &[f64] {
        &self.vt[j * self.k..(j + 1) * self.k]
    }

    /// Return the number of singular values above `cut`.
    pub fn rank(&self, cut: f64) -> usize {
        self.s().iter().filter(|&&s| s > cut).count()
    }

    /// Decompose the matrix `a`, shape `(m, k)`, row-major.
    ///
    /// Errors: `Input` for a wrong length, a size larger than in [`Svd::new`] or an entry that is not finite. `Solve` if the rotations do
    /// not converge.
    pub fn decompose(&mut self, a: &[f64], m: usize, k: usize) -> Result<()> {
        let p = m.min(k);
        if a.len() != m * k || self.work.len() < m * k || self.vt.len() < k * k || self.s.len() < p || self.ut.len() < p * m {
            return Err(Error::input("matrix", format!("is too large: expected at most the sizes of construction, got ({m}, {k})")));
        }
        let biggest = largest(a);
        if !biggest.is_finite() {
            finite("matrix", a)?;
        }
        (self.m, self.k, self.p) = (m, k, p);
        // Squares of entries must neither overflow nor underflow. The scale is a power of two, which changes no digit.
        let scale = if biggest == 0.0 || (1e-60..1e60).contains(&biggest) {
            1.0
        } else {
            2f64.powi(-(biggest.log2().floor() as i32).clamp(-1022, 1022))
        };
        self.identity();
        if m <= k {
            for (w, a) in self.work.iter_mut().zip(a) {
                *w = a * scale;
            }
            self.triangle(m, k);
            // Apply Q = H_m .. H_1 to the identity from the right. Only H_j with j <= r changes row r.
            for j in (0..m).rev() {
                let w = &self.work[j * k + j..(j + 1) * k];
                for r in j..k {
                    reflect(w, self.beta[j], &mut self.vt[r * k + j..(r + 1) * k]);
                }
            }
        } else {
            for i in 0..m {
                for j in 0..k {
                    self.work[j * m + i] = a[i * k + j] * scale;
                }
            }
            self.triangle(k, m);
        }
        // Copy the triangle to `g`, and clear its other half. For a wide matrix, row i of `work` is row i of `L`, and row j of `g` is
        // column j of `L`. For a tall matrix, row i of `work` is column i of `R`.
        let stride = if m <= k { k } else { m };
        for i in 0..p {
            for j in 0..i {
                let x = self.work[i * stride + j];
                if m <= k {
                    (self.g[j * p + i], self.g[i * p + j]) = (x, 0.0);
                } else {
                    (self.g[i * p + j], self.g[j * p + i]) = (x, 0.0);
                }
            }
            self.g[i * p + i] = self.s[i];
        }
        self.rotate()?;
        self.finish(scale);
        Ok(())
    }

    fn identity(&mut self) {
        let k = self.k;
        self.vt[..k * k].fill(0.0);
        for i in 0..k {
            self.vt[i * k + i] = 1.0;
        }
    }

    /// Reduce the `p` rows of length `len` of the work array to a triangle. The diagonal is written to `s`, and the reflectors replace the
    /// rows.
    fn triangle(&mut self, p: usize, len: usize) {
        for j in 0..p {
            let (head, below) = self.work[..p * len].split_at_mut((j + 1) * len);
            let w = &mut head[j * len + j..];
            (self.s[j], self.beta[j]) = reflector(w);
            if self.beta[j] != 0.0 {
                for row in below.chunks_exact_mut(len) {
                    reflect(w, self.beta[j], &mut row[j..]);
                }
            }
        }
    }

    /// Rotate pairs of rows of `g` in sweeps until all pairs are orthogonal, and apply the rotations to the rows of `vt`.
    fn rotate(&mut self) -> Result<()> {
        let (p, k) = (self.p, self.k);
        // The computed product of two vectors of length `p` has a rounding error of `p` units in the last place of the product of their
        // norms.
        let tol = f64::EPSILON * (p.max(4) as f64);
        for _ in 0..MAX_SWEEPS {
            let mut quiet = true;
            for i in 0..p {
                for j in i + 1..p {
                    let (gi, gj) = pair(&mut self.g, i, j, p);
                    let (a, b, c) = (dot(gi, gi), dot(gj, gj), dot(gi, gj));
                    if c * c <= tol * tol * a * b || a == 0.0 || b == 0.0 {
                        continue;
                    }
                    quiet = false;
                    let zeta = (b - a) / (2.0 * c);
                    let t = if zeta.abs() > 1e150 { 0.5 / zeta } else { 1.0f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt()) };
                    let cos = 1.0 / (1.0 + t * t).sqrt();
                    turn(gi, gj, cos, cos * t);
                    let (vi, vj) = pair(&mut self.vt, i, j, k);
                    turn(vi, vj, cos, cos * t);
                }
            }
            if quiet {
                return Ok(());
            }
        }
        Err(Error::Solve {
            status: Status::MaxSteps,
            t: MAX_SWEEPS as f64,
            problem: "the singular value decomposition did not converge".into(),
        })
    }

    /// Compute the norms, sort them in descending order, and compute the left singular vectors.
    fn finish(&mut self, scale: f64) {
        let (m, k, p) = (self.m, self.k, self.p);
        for j in 0..p {
            let g = &self.g[j * p..(j + 1) * p];
            self.s[j] = dot(g, g).sqrt();
        }
        for i in 0..p {
            let top = (i..p).fold(i, |b, j| if self.s[j] > self.s[b] { j } else { b });
            if top != i {
                self.s.swap(i, top);
                let (a, b) = pair(&mut self.g, i, top, p);
                a.swap_with_slice(b);
                let (a, b) = pair(&mut self.vt, i, top, k);
                a.swap_with_slice(b);
            }
            let u = &mut self.ut[i * m..(i + 1) * m];
            u.fill(0.0);
            if self.s[i] > 0.0 {
                axpy(1.0 / self.s[i], &self.g[i * p..(i + 1) * p], u);
            }
            if m > k {
                for j in (0..k).rev() {
                    reflect(&self.work[j * m + j..(j + 1) * m], self.beta[j], &mut u[j..]);
                }
            }
        }
        if scale != 1.0 {
            self.s[..p].iter_mut().for_each(|s| *s /= scale);
        }
    }
}

/// Return rows `i < j` of a row-major array with rows of length `len`.
#[inline]
fn pair(a: &mut [f64], i: usize, j: usize, len: usize) -> (&mut [f64], &mut [f64]) {
    let (head, tail) = a.split_at_mut(j * len);
    (&mut head[i * len..(i + 1) * len], &mut tail[..len])
}

/// Rotate two vectors: `(x, y) <- (c x - s y, s x + c y)`.
#[inline]
fn turn(x: &mut [f64], y: &mut [f64], c: f64, s: f64) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}
