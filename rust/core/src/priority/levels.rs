//! The general recursion over levels with singular values. `X` is an orthonormal basis of the directions that are still free. The entries
//! of `scale`, with `0 < scale <= 1`, are the remaining fractions of these directions. For each level,
//!
//! `A_i = J_i X diag(scale) = U diag(s) V'`,  `v += X V g(s) U' (v_i - J_i v)`,  `X diag(scale) <- X diag(scale) V_k diag(d)`.
//!
//! Here `g(s)` replaces the reciprocal of the singular value `s`, depending on the method. `d` is the fraction of a direction that the
//! level leaves free. The prime is the transpose. For `exact`, `d` is 0 or 1 by the rank rule. For `clamp` and `damped`,
//! `d = 1 - min(1, (s/eps)^2)`. `V_k` has the columns of `V` with `d > 0`.
//!
//! An SVD brings the product on the right back to the form `X diag(scale)`. So the projector `X diag(scale) X'` is symmetric. For `clamp`
//! and `damped` it is also a continuous function of the Jacobians. Its range is then orthogonal to every direction with `s >= eps` of the
//! levels above.
//!
//! Rank rule: a singular value `s` counts if `s > rounding |J_i| c`. Here `c` is the product of `|J_l| / (smallest counted s of level l)`
//! over all levels `l` above. `rounding c` estimates the relative error of their null basis. For level 2, `c = cond(J1)`.

use super::workspace::Workspace;
use crate::error::Result;
use crate::linalg::svd::Svd;
use crate::linalg::{axpy, clamp_gain, clamp_remainder, dot};

impl Workspace {
    /// Start a recursion: all directions are free, and the velocity is zero.
    pub(super) fn begin(&mut self) {
        let n = self.n;
        self.basis.fill(0.0);
        for i in 0..n {
            self.basis[i * n + i] = 1.0;
        }
        self.identity = true;
        self.free = 0;
        self.scale.fill(1.0);
        self.y.fill(0.0);
    }

    /// Whether a later level uses the directions that level `i` leaves free.
    fn is_followed(&self, i: usize) -> bool {
        i + 1 < self.rows.len()
    }

    /// Compute `A = J_i X diag(scale)`, and decompose it in `svd`. Return its number of columns.
    pub(super) fn project(&mut self, i: usize) -> Result<usize> {
        let (n, free, level) = (self.n, self.free, self.level(i));
        let (m, k) = (level.len(), n - free);
        if self.identity {
            self.svd.decompose(&self.j[level.start * n..level.end * n], m, n)?;
            self.a[..m * n].copy_from_slice(&self.j[level.start * n..level.end * n]);
            return Ok(n);
        }
        for (r, row) in level.enumerate() {
            let j = &self.j[row * n..(row + 1) * n];
            for c in 0..k {
                self.a[r * k + c] = dot(j, &self.basis[(free + c) * n..(free + c + 1) * n]) * self.scale[free + c];
            }
        }
        self.svd.decompose(&self.a[..m * k], m, k)?;
        Ok(k)
    }

    /// Compute the remaining command `r = v_i - J_i y`.
    pub(super) fn rest(&mut self, i: usize) {
        let n = self.n;
        for (r, row) in self.level(i).enumerate() {
            self.r[r] = self.c[row] - dot(&self.j[row * n..(row + 1) * n], &self.y);
        }
    }

    /// Return the spectral norm of `J_i`, which is the scale of its rank decisions.
    pub(super) fn spectral_norm(&mut self, i: usize) -> Result<f64> {
        let (n, level) = (self.n, self.level(i));
        if self.free == 0 {
            return Ok(self.svd.s().first().copied().unwrap_or(0.0));
        }
        self.svd2.decompose(&self.j[level.start * n..level.end * n], level.len(), n)?;
        Ok(self.svd2.s().first().copied().unwrap_or(0.0))
    }

    /// Compute `y += X (gain v_j)` for right singular vector `j` of the present level.
    pub(super) fn move_along(&mut self, j: usize, gain: f64) {
        let n = self.n;
        if gain != 0.0 {
            for (c, v) in self.svd.v(j).iter().enumerate() {
                let at = (self.free + c) * n;
                axpy(gain * v, &self.basis[at..at + n], &mut self.y);
            }
        }
    }

    /// Solve all levels with the method `exact`.
    pub(super) fn solve_exact(&mut self) -> Result<()> {
        self.begin();
        let mut condition = 1.0;
        for i in 0..self.rows.len() {
            self.rest(i);
            let k = self.project(i)?;
            let rank = self.consume_exact_rank(i, &mut condition)?;
            for j in 0..rank.0 {
                let gain = dot(self.svd.u(j), &self.r[..self.rows[i]]) / self.svd.s()[j];
                self.move_along(j, gain);
            }
            self.ranks[i] = rank.0;
            self.lost[i] = rank.0 < self.rows[i].min(k);
            if self.is_followed(i) {
                self.consume(rank.1);
            }
        }
        Ok(())
    }

    /// Return `(counted, spent)` for level `i` after `project`. Of the first `spent` singular directions, which no lower level may use,
    /// this level commands the first `counted`. Update `condition`.
    ///
    /// A singular value between the rounding error and the cut-off of the rank rule is spent but not counted. Such a direction may be
    /// noise, so that this level must not command it. It may also be real, so that a lower level along it would disturb this level.
    pub(super) fn consume_exact_rank(&mut self, i: usize, condition: &mut f64) -> Result<(usize, usize)> {
        let norm = self.spectral_norm(i)?;
        let rank = self.svd.rank(self.rounding * norm * *condition);
        let spent = rank.max(self.svd.rank(self.rounding * norm));
        if rank > 0 {
            *condition *= norm / self.svd.s()[rank - 1];
        }
        Ok((rank, spent))
    }

    /// Rotate the free basis into the singular directions of the present level, and mark the first `spent` directions as used.
    pub(super) fn consume(&mut self, spent: usize) {
        if self.identity {
            for j in 0..self.n {
                self.t[j * self.n..(j + 1) * self.n].copy_from_slice(self.svd.v(j));
            }
            self.basis.copy_from_slice(&self.t[..self.n * self.n]);
            self.identity = false;
        } else {
            turn_basis(&mut self.basis, &mut self.t, &self.svd, self.n, self.free);
        }
        self.free += spent;
    }

    /// Solve all levels with the method `clamp` or `damped`.
    pub(super) fn solve_clamped(&mut self, damped: bool) -> Result<()> {
        self.begin();
        for i in 0..self.rows.len() {
            self.rest(i);
            let k = self.project(i)?;
            let (m, eps) = (self.rows[i], self.threshold[i]);
            let p = m.min(k);
            let manipulability: f64 = self.svd.s().iter().map(|s| if *s >= eps { 1.0 } else { s / eps }).product();
            let lambda = eps * (1.0 - manipulability);
            self.ranks[i] = self.svd.s().iter().filter(|s| **s >= eps && **s > 0.0).count();
            self.lost[i] = self.ranks[i] < p;
            for j in 0..p {
                let s = self.svd.s()[j];
                let gain = if damped { damped_gain(s, lambda) } else { clamp_gain(s, eps) };
                let along = gain * dot(self.svd.u(j), &self.r[..m]);
                self.move_along(j, along);
            }
            if self.is_followed(i) {
                self.leave(eps, k)?;
            }
        }
        Ok(())
    }

    /// Pass the free directions of a clamped level to the next level: bring `X diag(scale) V_k diag(d)` to the form `X diag(scale)`.
    fn leave(&mut self, eps: f64, k: usize) -> Result<()> {
        let n = self.n;
        // The singular values descend, so that directions with d = 0 are first.
        let spent = self.svd.s().iter().filter(|s| clamp_remainder(**s, eps) == 0.0).count();
        let plain = self.scale[self.free..].iter().all(|s| *s == 1.0);
        let partial = self.svd.s()[spent..].iter().any(|s| clamp_remainder(*s, eps) < 1.0);
        let remainder = |svd: &Svd, j: usize| svd.s().get(j).map_or(1.0, |s| clamp_remainder(*s, eps));
        if plain {
            self.consume(spent);
            if partial {
                for j in spent..k {
                    self.scale[self.free + j - spent] = remainder(&self.svd, j);
                }
            }
            return Ok(());
        }
        // The rows are the vectors d_j V_j' diag(scale) in the coordinates of X. Their right singular vectors are the new directions.
        let kept = k - spent;
        for j in spent..k {
            let d = remainder(&self.svd, j);
            for c in 0..k {
                self.a[(j - spent) * k + c] = d * self.svd.v(j)[c] * self.scale[self.free + c];
            }
        }
        self.svd2.decompose(&self.a[..kept * k], kept, k)?;
        // The directions that remain free are moved to the end, the largest scale first. This level uses the other directions completely.
        turn_basis(&mut self.basis, &mut self.t, &self.svd2, n, self.free);
        let alive = self.svd2.rank(0.0);
        self.basis[self.free * n..].rotate_left(alive * n);
        self.free = n - alive;
        for j in 0..alive {
            self.scale[self.free + j] = self.svd2.s()[j].min(1.0);
        }
        Ok(())
    }

    /// Solve all levels with the method `chiaverini`: `v = sum P_{i-1} J_i# v_i`. The inverse `J_i#` is clamped, and `P` projects on the
    /// null space of the levels above.
    pub(super) fn solve_chiaverini(&mut self) -> Result<()> {
        self.begin();
        let n = self.n;
        let mut condition = 1.0;
        for i in 0..self.rows.len() {
            let (level, eps) = (self.level(i), self.threshold[i]);
            let m = level.len();
            self.z[..n].fill(0.0);
            self.svd2.decompose(&self.j[level.start * n..level.end * n], m, n)?;
            let mut kinematic = false;
            for j in 0..m.min(n) {
                let s = self.svd2.s()[j];
                kinematic |= s < eps;
                axpy(clamp_gain(s, eps) * dot(self.svd2.u(j), &self.c[level.clone()]), self.svd2.v(j), &mut self.z[..n]);
            }
            for c in self.free..n {
                let x = &self.basis[c * n..(c + 1) * n];
                axpy(dot(x, &self.z[..n]), x, &mut self.y);
            }
            let k = self.project(i)?;
            let (rank, spent) = self.consume_exact_rank(i, &mut condition)?;
            self.ranks[i] = rank;
            // A level without free directions cannot lose a direction.
            self.lost[i] = kinematic && k > 0 || rank < m.min(k);
            if self.is_followed(i) {
                self.consume(spent);
            }
        }
        Ok(())
    }
}

fn damped_gain(s: f64, lambda: f64) -> f64 {
    if s <= 0.0 { 0.0 } else { 1.0 / (s + lambda * (lambda / s)) }
}

/// Replace the free rows of the basis by their combinations along the right singular vectors.
fn turn_basis(basis: &mut [f64], t: &mut [f64], svd: &Svd, n: usize, free: usize) {
    let k = n - free;
    let t = &mut t[..k * n];
    t.fill(0.0);
    for j in 0..k {
        for (c, v) in svd.v(j).iter().enumerate() {
            axpy(*v, &basis[(free + c) * n..(free + c + 1) * n], &mut t[j * n..(j + 1) * n]);
        }
    }
    basis[free * n..].copy_from_slice(t);
}
