//! The arithmetic of `regular` on rows of a compiled length: Householder reflections of a row (`J_E = L Q`), the least squares of a level with
//! more rows than freedom, and `|T^-1|_F` (Golub and Van Loan, Matrix Computations, 5.1 and 5.2).

use super::regular::Given;
use crate::scalar::Real;

/// `L`, the reflectors, the reciprocals of the diagonal and the coordinates `y`.
pub(super) struct Factor<S, const N: usize> {
    pub l: [[S; N]; N],
    pub h: [[S; N]; N],
    pub beta: [S; N],
    inverse: [S; N],
    pub y: [S; N],
}

impl<S: Real, const N: usize> Factor<S, N> {
    #[inline(always)]
    pub fn new() -> Self {
        let zero = S::zero();
        Factor { l: [[zero; N]; N], h: [[zero; N]; N], beta: [zero; N], inverse: [zero; N], y: [zero; N] }
    }

    /// Reduce row `at` by a reflection, apply it to the rows below, and substitute forward.
    #[inline(always)]
    pub fn eliminate(&mut self, at: usize, fit: usize, given: &impl Given<S>) {
        if at >= fit {
            return;
        }
        let x0 = self.l[at][at];
        if at + 1 == N {
            self.inverse[at] = S::splat(1.0) / x0;
        } else {
            // A reflector of full length with leading zeros: `w = x - alpha e1`, `alpha = -sign(x0) |x|`.
            let mut w = self.l[at];
            w[..at].fill(S::zero());
            let last = if N == 4 { N } else { fit };
            // w'y = x'y - alpha y1: the products do not wait for the norm.
            let mut products = [S::zero(); N];
            for r in at + 1..last {
                products[r] = product(at, N, &w, &self.l[r]);
            }
            let norm2 = product(at, N, &w, &w);
            let norm = norm2.sqrt();
            let reach = norm + x0.abs();
            let negative = x0.lt(S::zero());
            w[at] = S::select(negative, -reach, reach);
            let minus_alpha = S::select(negative, -norm, norm);
            // A row of zeros gives NaN, which declines in the end.
            let beta = S::splat(1.0) / (norm * reach);
            // 1/alpha without a second division.
            let inverse = beta * reach;
            self.inverse[at] = S::select(negative, inverse, -inverse);
            for r in at + 1..last {
                let s = -beta * minus_alpha.mul_add(self.l[r][at], products[r]);
                add(at, s, &w, &mut self.l[r]);
            }
            self.beta[at] = beta;
            self.h[at] = w;
        }
        let mut row = self.l[at];
        row[at..].fill(S::zero());
        self.y[at] = (given.command(at) - product(0, at, &row, &self.y)) * self.inverse[at];
    }

    /// Apply reflection `at` to the coordinates; the last row of a square `L` has none.
    #[inline(always)]
    pub fn back(&mut self, at: usize, fit: usize) {
        if at < fit && at + 1 < N {
            reflect(at, &self.h[at], self.beta[at], &mut self.y);
        }
    }

    /// `|T^-1|_F^2` of the diagonal block of `m` rows from `used` on.
    #[inline(always)]
    pub fn inverse_norm2(&self, used: usize, m: usize, z: &mut [S]) -> S {
        let d = |i: usize| self.inverse[used + i];
        let t = |i: usize, j: usize| self.l[used + i][used + j];
        match m {
            1 => d(0) * d(0),
            2 => {
                let x = t(1, 0) * d(0) * d(1);
                x.mul_add(x, d(1).mul_add(d(1), d(0) * d(0)))
            }
            3 => {
                let (x, y) = (t(1, 0) * d(0) * d(1), t(2, 1) * d(1) * d(2));
                let z = t(2, 1).neg_mul_add(x, t(2, 0) * d(0)) * d(2);
                let diagonal = d(2).mul_add(d(2), d(1).mul_add(d(1), d(0) * d(0)));
                z.mul_add(z, y.mul_add(y, x.mul_add(x, diagonal)))
            }
            _ => inverse_norm2(m, z, |i, j| if i == j { d(i) } else { t(i, j) }),
        }
    }
}

/// `y <- (I - beta w w') y`, where `w` is zero before `at`.
#[inline(always)]
pub(super) fn reflect<S: Real, const N: usize>(at: usize, w: &[S; N], beta: S, y: &mut [S; N]) {
    add(at, -beta * product(at, N, w, y), w, y);
}

/// `y += s w`, where `w` is zero before `at`.
#[inline(always)]
fn add<S: Real, const N: usize>(at: usize, s: S, w: &[S; N], y: &mut [S; N]) {
    for c in if S::LANES > 1 { at } else { 0 }..N {
        y[c] = s.mul_add(w[c], y[c]);
    }
}

/// A level with more rows than the `k` free directions: least squares by a QR factorisation of its free columns.
#[inline(always)]
pub(super) fn tall<S: Real, const N: usize>(
    rows: &mut [[S; N]],
    given: &impl Given<S>,
    used: usize,
    k: usize,
    y: &mut [S; N],
    r: &mut [S],
    z: &mut [S],
) -> S {
    let m = rows.len();
    let zero = S::zero();
    for i in 0..m {
        r[i] = (0..used).fold(given.command(used + i), |rest, c| rows[i][c].neg_mul_add(y[c], rest));
    }
    for a in 0..k {
        let col = used + a;
        let x0 = rows[a][col];
        let norm = rows[a..].iter().fold(zero, |sum, row| row[col].mul_add(row[col], sum)).sqrt();
        let reach = norm + x0.abs();
        let negative = x0.lt(zero);
        let beta = S::splat(1.0) / (norm * reach);
        rows[a][col] = S::select(negative, -reach, reach);
        for c in col + 1..used + k {
            let s = -beta * rows[a..].iter().fold(zero, |sum, row| row[col].mul_add(row[c], sum));
            rows[a..].iter_mut().for_each(|row| row[c] = s.mul_add(row[col], row[c]));
        }
        let s = -beta * rows[a..].iter().zip(&r[a..m]).fold(zero, |sum, (row, r)| row[col].mul_add(*r, sum));
        rows[a..].iter().zip(&mut r[a..m]).for_each(|(row, r)| *r = s.mul_add(row[col], *r));
        let inverse = beta * reach;
        rows[a][col] = S::select(negative, inverse, -inverse);
    }
    for a in (0..k).rev() {
        let rest = (a + 1..k).fold(r[a], |rest, b| rows[a][used + b].neg_mul_add(y[used + b], rest));
        y[used + a] = rest * rows[a][used + a];
    }
    // The norm of the inverse is that of the transposed triangle.
    inverse_norm2(k, z, |i, j| rows[j][used + i])
}

/// `|T^-1|_F^2` of a lower triangle whose diagonal is given by its reciprocals.
#[inline(always)]
fn inverse_norm2<S: Real>(m: usize, z: &mut [S], t: impl Fn(usize, usize) -> S) -> S {
    let mut sum = S::zero();
    for b in 0..m {
        z[b] = t(b, b);
        sum = z[b].mul_add(z[b], sum);
        for i in b + 1..m {
            z[i] = -(b..i).fold(S::zero(), |rest, l| t(i, l).mul_add(z[l], rest)) * t(i, i);
            sum = z[i].mul_add(z[i], sum);
        }
    }
    sum
}

/// Scalar product of what is not zero, from `from` to `to`, in two chains, which two-wide registers hold. A single number takes the zeros
/// along, because full rows fit registers.
#[inline(always)]
pub(super) fn product<S: Real, const N: usize>(from: usize, to: usize, a: &[S; N], b: &[S; N]) -> S {
    let (mut even, mut odd) = (S::zero(), S::zero());
    if S::LANES == 1 {
        for i in 0..N / 2 {
            even = a[2 * i].mul_add(b[2 * i], even);
            odd = a[2 * i + 1].mul_add(b[2 * i + 1], odd);
        }
        if N % 2 == 1 {
            even = a[N - 1].mul_add(b[N - 1], even);
        }
    } else {
        for i in from..to {
            if i % 2 == 0 {
                even = a[i].mul_add(b[i], even);
            } else {
                odd = a[i].mul_add(b[i], odd);
            }
        }
    }
    even + odd
}
