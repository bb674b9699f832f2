//! Equation (5) away from singularities: with the stack `J_E = [J1; J2; ..] = L Q` (LQ factorisation by Householder reflections),
//! the prioritised solution is `v = Q' y` with `L y = [v1; v2; ..]` by forward substitution, because the diagonal block
//! `T_i` of `L` is `J_i N_{i-1}` in an orthonormal basis of the null space of the levels above.
//!
//! The route is taken only where it is provably the same map as the recursion over singular values: `1/|T_i^-1|_F` bounds the
//! smallest singular value of `J_i N_{i-1}` from below, and must reach `eps_i` (`clamp`, `damped`) or pass the rank rule with
//! six digits to spare (`exact`). Otherwise it declines and `levels` decides.

use super::workspace::Workspace;
use crate::linalg::dot;
use crate::linalg::householder::TAIL;

/// `exact` takes this route only for relative singular values above it, where forward substitution loses no digits that count.
const EXACT_FLOOR: f64 = 1e-6;

impl Workspace {
    /// Solve into `y` (metric coordinates) and `ranks`; false if some level is not provably regular.
    pub(super) fn solve_regular(&mut self, exact: bool) -> bool {
        // The sizes of common arms as constants, so that their row loops unroll.
        match self.n {
            2 => self.regular(2, exact),
            3 => self.regular(3, exact),
            4 => self.regular(4, exact),
            5 => self.regular(5, exact),
            6 => self.regular(6, exact),
            7 => self.regular(7, exact),
            8 => self.regular(8, exact),
            n => self.regular(n, exact),
        }
    }

    #[inline(always)]
    fn regular(&mut self, n: usize, exact: bool) -> bool {
        let total = self.c.len();
        self.lq[..total * n].copy_from_slice(&self.j[..total * n]);
        self.y[..n].fill(0.0);
        let mut used = 0;
        let mut condition = 1.0;
        for i in 0..self.rows.len() {
            let (first, m, k) = (self.start[i], self.rows[i], n - used);
            let p = m.min(k);
            self.ranks[i] = p;
            if p == 0 {
                continue;
            }
            let inverse2 = if m <= k { self.wide(n, first, m, used) } else { self.tall(n, first, m, used) };
            // NaN fails every comparison below and declines.
            let fine = if exact {
                let relative2 = inverse2 * self.norm2[i];
                let floor = EXACT_FLOOR.max(self.rounding * condition);
                condition *= relative2.sqrt();
                relative2 * floor * floor < 1.0
            } else {
                inverse2 * self.eps2[i] <= 1.0
            };
            if !fine {
                return false;
            }
            used += p;
        }
        for a in (0..used).rev() {
            if self.beta[a] != 0.0 {
                let h = &self.h[a * n..(a + 1) * n];
                let s = -self.beta[a] * sum4(h, &self.y[..n]);
                for (y, h) in self.y[..n].iter_mut().zip(h) {
                    *y += s * h;
                }
            }
        }
        true
    }

    /// A level with at most as many rows as free directions: its rows of `L`, its part of `y`; returns `|T^-1|_F^2`.
    #[inline(always)]
    fn wide(&mut self, n: usize, first: usize, m: usize, used: usize) -> f64 {
        for a in 0..m {
            let at = used + a;
            let (head, below) = self.lq.split_at_mut((first + a + 1) * n);
            let row = &mut head[(first + a) * n..];
            let h = &mut self.h[at * n..(at + 1) * n];
            // A reflector of full length with leading zeros: the loops below have a constant length.
            for c in 0..n {
                h[c] = if c < at { 0.0 } else { row[c] };
            }
            let x0 = h[at];
            h[at] = 0.0;
            let tail = sum4(h, h);
            let mut alpha = x0;
            self.beta[at] = 0.0;
            if tail > TAIL {
                let norm = (x0 * x0 + tail).sqrt();
                alpha = -norm.copysign(x0);
                h[at] = x0 - alpha;
                let beta = 1.0 / (norm * (norm + x0.abs()));
                self.beta[at] = beta;
                for row in below.chunks_exact_mut(n) {
                    let s = -beta * sum4(h, row);
                    for (x, h) in row.iter_mut().zip(&*h) {
                        *x += s * h;
                    }
                }
            }
            // y beyond `at` is still zero and the row beyond `at` is spent, so the full product is the partial sum.
            row[at..].fill(0.0);
            let known = sum4(row, &self.y[..n]);
            row[at] = 1.0 / alpha;
            self.y[at] = (self.c[first + a] - known) * row[at];
        }
        let t = |i: usize, j: usize| self.lq[(first + i) * n + used + j];
        match m {
            1 => t(0, 0) * t(0, 0),
            2 => {
                let x = t(1, 0) * t(0, 0) * t(1, 1);
                t(0, 0) * t(0, 0) + t(1, 1) * t(1, 1) + x * x
            }
            3 => {
                let (x, y) = (t(1, 0) * t(0, 0) * t(1, 1), t(2, 1) * t(1, 1) * t(2, 2));
                let z = (t(2, 0) * t(0, 0) - t(2, 1) * x) * t(2, 2);
                t(0, 0) * t(0, 0) + t(1, 1) * t(1, 1) + t(2, 2) * t(2, 2) + x * x + y * y + z * z
            }
            _ => {
                let mut sum = 0.0;
                for b in 0..m {
                    self.z[b] = t(b, b);
                    sum += self.z[b] * self.z[b];
                    for i in b + 1..m {
                        let row = &self.lq[(first + i) * n + used + b..(first + i) * n + used + i];
                        self.z[i] = -dot(row, &self.z[b..i]) * self.lq[(first + i) * n + used + i];
                        sum += self.z[i] * self.z[i];
                    }
                }
                sum
            }
        }
    }

    /// A level with more rows than free directions: least squares by a QR factorisation of its `k` free columns.
    #[inline(always)]
    fn tall(&mut self, n: usize, first: usize, m: usize, used: usize) -> f64 {
        let k = n - used;
        let block = &mut self.lq[first * n..(first + m) * n];
        for (r, row) in self.r[..m].iter_mut().zip(block.chunks_exact(n)) {
            *r = -dot(&row[..used], &self.y[..used]);
        }
        for (r, c) in self.r[..m].iter_mut().zip(&self.c[first..first + m]) {
            *r += c;
        }
        for a in 0..k {
            let col = used + a;
            let norm2: f64 = (a..m).map(|i| block[i * n + col] * block[i * n + col]).sum();
            let x0 = block[a * n + col];
            let norm = norm2.sqrt();
            let alpha = -norm.copysign(x0);
            let beta = 1.0 / (norm * (norm + x0.abs()));
            block[a * n + col] = x0 - alpha;
            for c in col + 1..n {
                let s: f64 = (a..m).map(|i| block[i * n + col] * block[i * n + c]).sum::<f64>() * beta;
                (a..m).for_each(|i| block[i * n + c] -= s * block[i * n + col]);
            }
            let s: f64 = (a..m).map(|i| block[i * n + col] * self.r[i]).sum::<f64>() * beta;
            (a..m).for_each(|i| self.r[i] -= s * block[i * n + col]);
            block[a * n + col] = 1.0 / alpha;
            self.beta[used + a] = 0.0;
        }
        for a in (0..k).rev() {
            let s: f64 = (a + 1..k).map(|b| block[a * n + used + b] * self.y[used + b]).sum();
            self.y[used + a] = (self.r[a] - s) * block[a * n + used + a];
        }
        let mut sum = 0.0;
        for b in 0..k {
            self.z[b] = block[b * n + used + b];
            sum += self.z[b] * self.z[b];
            for i in (0..b).rev() {
                let s: f64 = (i + 1..=b).map(|l| block[i * n + used + l] * self.z[l]).sum();
                self.z[i] = -s * block[i * n + used + i];
                sum += self.z[i] * self.z[i];
            }
        }
        sum
    }
}

/// Scalar product in two chains, which two-wide registers hold.
#[inline(always)]
fn sum4(a: &[f64], b: &[f64]) -> f64 {
    let (mut even, mut odd) = (0.0, 0.0);
    for i in (0..a.len() & !1).step_by(2) {
        even += a[i] * b[i];
        odd += a[i + 1] * b[i + 1];
    }
    if a.len() & 1 == 1 {
        even += a[a.len() - 1] * b[a.len() - 1];
    }
    even + odd
}
