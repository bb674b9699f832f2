//! Equation (5) away from singularities: with the stack `J_E = [J1; J2; ..] = L Q` (LQ factorisation by Householder reflections),
//! the prioritised solution is `v = Q' y` with `L y = [v1; v2; ..]` by forward substitution, because the diagonal block
//! `T_i` of `L` is `J_i N_{i-1}` in an orthonormal basis of the null space of the levels above.
//!
//! The route is taken only where it is provably the same map as the recursion over singular values: `1/|T_i^-1|_F` bounds the
//! smallest singular value of `J_i N_{i-1}` from below, and must reach `eps_i` (`clamp`, `damped`) or pass the rank rule with
//! six digits to spare (`exact`). Otherwise it declines, having decided nothing, and `levels` takes over.

use super::method::DEFAULT_EPS;
use super::workspace::{TAME, Workspace};
use crate::linalg::householder::TAIL;

/// `exact` takes this route only for relative singular values above it, where forward substitution loses no digits that count.
const EXACT_FLOOR: f64 = 1e-6;

/// Joints beyond which the route is not compiled.
pub(super) const MOST_JOINTS: usize = 32;

impl Workspace {
    /// Solve into `v`, `residual` and `ranks`; false if some level is not provably regular or some number is not tame.
    pub(super) fn solve_regular(&mut self, exact: bool) -> bool {
        // Row lengths are constants, so that the loops over joints unroll; zero columns up to the next size change nothing.
        match self.n {
            1 | 2 => self.regular::<2>(exact),
            3 => self.regular::<3>(exact),
            4 => self.regular::<4>(exact),
            5 | 6 => self.regular::<6>(exact),
            7 => self.regular::<7>(exact),
            8 => self.regular::<8>(exact),
            9..=12 => self.regular::<12>(exact),
            13..=MOST_JOINTS => self.regular::<MOST_JOINTS>(exact),
            _ => false,
        }
    }

    #[inline(never)]
    fn regular<const N: usize>(&mut self, exact: bool) -> bool {
        let n = self.n;
        let total = self.command.len();
        // The levels that fit into the freedom left come first; their rows are rows of a square L.
        let (mut fit, mut levels) = (0, 0);
        while levels < self.rows.len() && fit + self.rows[levels] <= n {
            fit += self.rows[levels];
            levels += 1;
        }
        let mut f = Factor::<N> { l: [[0.0; N]; N], h: [[0.0; N]; N], beta: [0.0; N], inverse: [0.0; N], y: [0.0; N] };
        // Rows that do not fit stand behind.
        let (tail, _) = self.lq.as_chunks_mut::<N>();
        let mut given = self.jacobian.chunks_exact(n).enumerate();
        for (i, &m) in self.rows.iter().enumerate() {
            let (mut most, mut sum) = (0.0f64, 0.0);
            for (r, given) in given.by_ref().take(m) {
                let row = if r < fit { &mut f.l[r] } else { &mut tail[r - fit] };
                match <&[f64; N]>::try_from(given) {
                    Ok(given) => *row = *given,
                    Err(_) => {
                        row.fill(0.0);
                        row[..n].copy_from_slice(given);
                    }
                }
                if let Some(metric) = &self.metric {
                    metric.row(&mut row[..n]);
                }
                let row2 = product(row, row);
                most = if row2 > most { row2 } else { most };
                sum += row2;
            }
            (self.most2[i], self.norm2[i]) = (most, sum);
        }
        let command = &self.command[..fit];
        if N == 4 {
            // Written out, so that the indices are constants for the smallest redundant arms.
            f.eliminate(0, command);
            f.eliminate(1, command);
            f.eliminate(2, command);
            f.eliminate(3, command);
        } else {
            (0..fit).for_each(|at| f.eliminate(at, command));
        }
        for at in 0..fit {
            tail[..total - fit].iter_mut().for_each(|row| reflect(&f.h[at], f.beta[at], row));
        }
        let (mut used, mut condition) = (0, 1.0);
        for i in 0..self.rows.len() {
            let (m, p) = (self.rows[i], self.rows[i].min(n - used));
            self.ranks[i] = p;
            // A level without rows or freedom decides nothing, so that it cannot change the route of the levels above it.
            if p == 0 {
                continue;
            }
            if !TAME.contains(&self.norm2[i]) {
                return false;
            }
            let inverse2 = if i < levels {
                f.inverse_norm2(used, m, &mut self.z)
            } else {
                tall(&mut tail[..m], &self.command[fit..fit + m], fit, p, &mut f.y, &mut self.r, &mut self.z)
            };
            used += p;
            // NaN fails every comparison and declines.
            let regular = if exact {
                let relative2 = inverse2 * self.norm2[i];
                let floor = EXACT_FLOOR.max(self.rounding * condition);
                condition *= relative2.sqrt();
                relative2 * floor * floor < 1.0
            } else {
                let eps2 = self.eps.as_ref().map_or(DEFAULT_EPS * DEFAULT_EPS * self.most2[i], |eps| eps[i] * eps[i]);
                inverse2 * eps2 <= 1.0
            };
            if !regular {
                return false;
            }
        }
        if N == 4 {
            f.back(3);
            f.back(2);
            f.back(1);
            f.back(0);
        } else {
            (0..fit).rev().for_each(|at| f.back(at));
        }
        let mut y = f.y;
        if let Some(metric) = &self.metric {
            metric.velocity(&mut y[..n]);
        }
        match <&mut [f64; N]>::try_from(&mut self.v[..]) {
            Ok(v) => *v = y,
            Err(_) => self.v.copy_from_slice(&y[..n]),
        }
        let mut sound = 0.0;
        for ((r, given), c) in self.residual.iter_mut().zip(self.jacobian.chunks_exact(n)).zip(&self.command) {
            *r = c - match <&[f64; N]>::try_from(given) {
                Ok(given) => product(given, &y),
                Err(_) => crate::linalg::dot(given, &y[..n]),
            };
            sound += *r * 0.0;
        }
        sound == 0.0
    }
}

/// `L`, the reflectors, the reciprocals of the diagonal and the coordinates `y`.
struct Factor<const N: usize> {
    l: [[f64; N]; N],
    h: [[f64; N]; N],
    beta: [f64; N],
    inverse: [f64; N],
    y: [f64; N],
}

impl<const N: usize> Factor<N> {
    /// Reduce row `at` by a reflection, apply it to the rows below, and substitute forward.
    #[inline(always)]
    fn eliminate(&mut self, at: usize, command: &[f64]) {
        if at >= command.len() {
            return;
        }
        // A reflector of full length with leading zeros, and a row of L with trailing zeros.
        let mut row = self.l[at];
        let mut w = row;
        let x0 = row[at];
        for c in 0..N {
            w[c] = if c > at { w[c] } else { 0.0 };
            row[c] = if c < at { row[c] } else { 0.0 };
        }
        let rest = product(&w, &w);
        let mut alpha = x0;
        if rest > TAIL {
            let norm2 = x0 * x0 + rest;
            let norm = norm2.sqrt();
            alpha = -norm.copysign(x0);
            w[at] = x0 - alpha;
            let beta = 1.0 / (norm2 + norm * x0.abs());
            for r in at + 1..N {
                reflect(&w, beta, &mut self.l[r]);
            }
            self.beta[at] = beta;
            self.h[at] = w;
        }
        self.inverse[at] = 1.0 / alpha;
        self.y[at] = (command[at] - product(&row, &self.y)) * self.inverse[at];
    }

    /// Apply reflection `at` to the coordinates.
    #[inline(always)]
    fn back(&mut self, at: usize) {
        reflect(&self.h[at], self.beta[at], &mut self.y);
    }

    /// `|T^-1|_F^2` of the diagonal block of `m` rows from `used` on.
    #[inline(always)]
    fn inverse_norm2(&self, used: usize, m: usize, z: &mut [f64]) -> f64 {
        let d = |i: usize| self.inverse[used + i];
        let t = |i: usize, j: usize| self.l[used + i][used + j];
        match m {
            1 => d(0) * d(0),
            2 => {
                let x = t(1, 0) * d(0) * d(1);
                d(0) * d(0) + d(1) * d(1) + x * x
            }
            3 => {
                let (x, y) = (t(1, 0) * d(0) * d(1), t(2, 1) * d(1) * d(2));
                let z = (t(2, 0) * d(0) - t(2, 1) * x) * d(2);
                d(0) * d(0) + d(1) * d(1) + d(2) * d(2) + x * x + y * y + z * z
            }
            _ => inverse_norm2(m, z, |i, j| if i == j { d(i) } else { t(i, j) }),
        }
    }
}

/// `y <- (I - beta w w') y`.
#[inline(always)]
fn reflect<const N: usize>(w: &[f64; N], beta: f64, y: &mut [f64; N]) {
    let s = -beta * product(w, y);
    (0..N).for_each(|c| y[c] += s * w[c]);
}

/// A level with more rows than the `k` free directions: least squares by a QR factorisation of its free columns.
#[inline(always)]
fn tall<const N: usize>(
    rows: &mut [[f64; N]],
    command: &[f64],
    used: usize,
    k: usize,
    y: &mut [f64; N],
    r: &mut [f64],
    z: &mut [f64],
) -> f64 {
    let m = command.len();
    for i in 0..m {
        r[i] = command[i] - (0..used).map(|c| rows[i][c] * y[c]).sum::<f64>();
    }
    for a in 0..k {
        let col = used + a;
        let x0 = rows[a][col];
        let norm = rows[a..].iter().map(|row| row[col] * row[col]).sum::<f64>().sqrt();
        let alpha = -norm.copysign(x0);
        let beta = 1.0 / (norm * (norm + x0.abs()));
        rows[a][col] = x0 - alpha;
        for c in col + 1..used + k {
            let s = -beta * rows[a..].iter().map(|row| row[col] * row[c]).sum::<f64>();
            rows[a..].iter_mut().for_each(|row| row[c] += s * row[col]);
        }
        let s = -beta * rows[a..].iter().zip(&r[a..m]).map(|(row, r)| row[col] * r).sum::<f64>();
        rows[a..].iter().zip(&mut r[a..m]).for_each(|(row, r)| *r += s * row[col]);
        rows[a][col] = 1.0 / alpha;
    }
    for a in (0..k).rev() {
        let s: f64 = (a + 1..k).map(|b| rows[a][used + b] * y[used + b]).sum();
        y[used + a] = (r[a] - s) * rows[a][used + a];
    }
    // The norm of the inverse is that of the transposed triangle.
    inverse_norm2(k, z, |i, j| rows[j][used + i])
}

/// `|T^-1|_F^2` of a lower triangle whose diagonal is given by its reciprocals.
#[inline(always)]
fn inverse_norm2(m: usize, z: &mut [f64], t: impl Fn(usize, usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for b in 0..m {
        z[b] = t(b, b);
        sum += z[b] * z[b];
        for i in b + 1..m {
            z[i] = -(b..i).map(|l| t(i, l) * z[l]).sum::<f64>() * t(i, i);
            sum += z[i] * z[i];
        }
    }
    sum
}

/// Scalar product in two chains, which two-wide registers hold.
#[inline(always)]
fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let (mut even, mut odd) = (0.0, 0.0);
    for i in 0..N / 2 {
        even += a[2 * i] * b[2 * i];
        odd += a[2 * i + 1] * b[2 * i + 1];
    }
    if N % 2 == 1 {
        even += a[N - 1] * b[N - 1];
    }
    even + odd
}
