//! LQ and QR factorisations for the algorithm `regular` (Golub and Van Loan, Matrix Computations, 5.1 and 5.2).
//!
//! `Factor` is the factorisation `J_E = L Q` of the Jacobian rows of several levels, by Householder reflections of rows. `least_squares`
//! solves a level with more rows than free directions. `inverse_norm2` computes `|T^-1|_F^2` of a triangular block `T`.

use crate::scalar::Real;

/// An LQ factorisation: the factor `L`, the reflectors `w` and their factors `beta`, the reciprocal diagonal of `L`, and the coordinates
/// `y` of the solution.
#[derive(Debug, Clone)]
pub(super) struct Factor<S> {
    n: usize,
    /// The factor `L`, shape `(fit, n)`.
    pub l: Vec<S>,
    /// The reflectors, shape `(fit, n)`. Row `at` is zero before column `at`.
    w: Vec<S>,
    beta: Vec<S>,
    inverse: Vec<S>,
    products: Vec<S>,
    pub y: Vec<S>,
}

impl<S: Real> Factor<S> {
    /// Allocate a factorisation of `fit <= n` rows.
    pub fn new(n: usize, fit: usize) -> Self {
        let zeros = |k: usize| vec![S::zero(); k];
        let (l, w) = (zeros(fit * n), zeros(fit * n));
        Factor { n, l, w, beta: zeros(fit), inverse: zeros(fit), products: zeros(fit), y: zeros(n) }
    }

    fn fit(&self) -> usize {
        self.beta.len()
    }

    /// Reduce row `at` by a reflection, apply the reflection to the rows below, and compute coordinate `at` of the solution.
    pub fn eliminate(&mut self, at: usize, command: S) {
        let Factor { n, l, w, beta, inverse, products, y } = self;
        let n = *n;
        let (above, below) = l.split_at_mut((at + 1) * n);
        let row = &above[at * n..];
        let x0 = row[at];
        if at + 1 == n {
            inverse[at] = S::splat(1.0) / x0;
        } else {
            // The reflector is `w = x - alpha e1` with `alpha = -sign(x0) |x|`.
            let w = &mut w[at * n + at..(at + 1) * n];
            w.copy_from_slice(&row[at..]);
            // For each row `y` below, the product with the reflector is `w'y = x'y - alpha y1`. So `x'y` is computed here, before
            // `alpha` is known.
            for (product_of, row) in products.iter_mut().zip(below.chunks_exact(n)) {
                *product_of = product(w, &row[at..]);
            }
            let norm = product(w, w).sqrt();
            let reach = norm + x0.abs();
            let negative = x0.lt(S::zero());
            w[0] = S::select(negative, -reach, reach);
            let minus_alpha = S::select(negative, -norm, norm);
            // A row of zeros gives NaN. The caller then finds that this algorithm is not valid.
            beta[at] = S::splat(1.0) / (norm * reach);
            // `size` is `1/|alpha|`, computed without a second division.
            let size = beta[at] * reach;
            inverse[at] = S::select(negative, size, -size);
            for (&product_of, row) in products.iter().zip(below.chunks_exact_mut(n)) {
                add(-beta[at] * minus_alpha.mul_add(row[at], product_of), w, &mut row[at..]);
            }
        }
        y[at] = (command - product(&row[..at], &y[..at])) * inverse[at];
    }

    /// Compute `x <- x H_at` for a row or for coordinates. The last row of a square `L` has no reflection.
    fn reflect(&self, at: usize, x: &mut [S]) {
        if at + 1 < self.n {
            let w = &self.w[at * self.n + at..(at + 1) * self.n];
            add(-self.beta[at] * product(w, &x[at..]), w, &mut x[at..]);
        }
    }

    /// Transform a row that is not a row of `L` to the coordinates of `L`.
    pub fn transform(&self, row: &mut [S]) {
        (0..self.fit()).for_each(|at| self.reflect(at, row));
    }

    /// Compute `v = Q' y`.
    pub fn velocity(&self, v: &mut [S]) {
        self.velocity_of_first(self.n, v);
    }

    /// Compute `v = Q' y` from the first `used` coordinates of `y`. The other coordinates count as zero.
    pub fn velocity_of_first(&self, used: usize, v: &mut [S]) {
        let (first, others) = v.split_at_mut(used);
        first.copy_from_slice(&self.y[..used]);
        others.fill(S::zero());
        (0..self.fit().min(used)).rev().for_each(|at| self.reflect(at, v));
    }

    /// Return `|T^-1|_F^2` of the diagonal block `T` with `m` rows, from row `used` on.
    pub fn inverse_norm2(&self, used: usize, m: usize, z: &mut [S]) -> S {
        inverse_norm2(m, z, |i, j| if i == j { self.inverse[used + i] } else { self.l[(used + i) * self.n + used + j] })
    }
}

/// Solve a level with more rows than free directions: least squares by a QR factorisation of its columns from `used` on. Return
/// `|T^-1|_F^2` of the triangular factor `T`.
pub(super) fn least_squares<S: Real>(rows: &mut [S], command: &[S], used: usize, y: &mut [S], r: &mut [S], z: &mut [S]) -> S {
    let (n, m) = (y.len(), command.len());
    let zero = S::zero();
    for (i, row) in rows.chunks_exact(n).enumerate() {
        r[i] = (0..used).fold(command[i], |remaining, c| row[c].neg_mul_add(y[c], remaining));
    }
    for a in 0..n - used {
        let col = used + a;
        let x0 = rows[a * n + col];
        let norm = (a..m).fold(zero, |sum, i| rows[i * n + col].mul_add(rows[i * n + col], sum)).sqrt();
        let reach = norm + x0.abs();
        let negative = x0.lt(zero);
        let beta = S::splat(1.0) / (norm * reach);
        rows[a * n + col] = S::select(negative, -reach, reach);
        for c in col + 1..n {
            let s = -beta * (a..m).fold(zero, |sum, i| rows[i * n + col].mul_add(rows[i * n + c], sum));
            (a..m).for_each(|i| rows[i * n + c] = s.mul_add(rows[i * n + col], rows[i * n + c]));
        }
        let s = -beta * (a..m).fold(zero, |sum, i| rows[i * n + col].mul_add(r[i], sum));
        (a..m).for_each(|i| r[i] = s.mul_add(rows[i * n + col], r[i]));
        let inverse = beta * reach;
        rows[a * n + col] = S::select(negative, inverse, -inverse);
    }
    for a in (0..n - used).rev() {
        let remaining = (used + a + 1..n).fold(r[a], |remaining, c| rows[a * n + c].neg_mul_add(y[c], remaining));
        y[used + a] = remaining * rows[a * n + used + a];
    }
    // The inverses of a triangle and of its transpose have the same norm.
    inverse_norm2(n - used, z, |i, j| rows[j * n + used + i])
}

/// Return `|T^-1|_F^2` of a lower triangle `T`. `t(i, i)` is the reciprocal of a diagonal element.
fn inverse_norm2<S: Real>(m: usize, z: &mut [S], t: impl Fn(usize, usize) -> S) -> S {
    let mut sum = S::zero();
    for b in 0..m {
        z[b] = t(b, b);
        sum = z[b].mul_add(z[b], sum);
        for i in b + 1..m {
            z[i] = -(b..i).fold(S::zero(), |sum, l| t(i, l).mul_add(z[l], sum)) * t(i, i);
            sum = z[i].mul_add(z[i], sum);
        }
    }
    sum
}

/// Compute `y += s w`.
fn add<S: Real>(s: S, w: &[S], y: &mut [S]) {
    for (y, &w) in y.iter_mut().zip(w) {
        *y = s.mul_add(w, *y);
    }
}

/// Return the scalar product. Two independent sums shorten the chain of operations that depend on each other.
pub fn product<S: Real>(a: &[S], b: &[S]) -> S {
    let (mut even, mut odd) = (S::zero(), S::zero());
    for (i, (&a, &b)) in a.iter().zip(b).enumerate() {
        if i % 2 == 0 {
            even = a.mul_add(b, even);
        } else {
            odd = a.mul_add(b, odd);
        }
    }
    even + odd
}
