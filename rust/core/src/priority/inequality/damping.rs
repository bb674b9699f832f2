//! Penalties of the methods `clamp` and `damped`. Let `B` be the rows of a level in the free coordinates, with singular values `s_i` and
//! right singular vectors `v_i`. The step `y` of the level is the smallest-norm minimiser of
//!
//! `|B y - r|^2 + sum rho_i (v_i' y)^2`,  `rho_i = max(0, eps^2 - s_i^2)` (clamp)  or  `lambda^2` (damped).
//!
//! So a penalty is a row `sqrt(rho_i) v_i'` with the command zero. `B` has the tasks and the rows that are violated at the start of the
//! level. Of a direction with the singular value `s`, the fraction `1 - min(1, (s/eps)^2)` remains for the lower levels.
//!
//! So the directions that remain are `P = X diag(d) X'`, as in `hierarchy`. The tasks of a lower level have the rows `P a`, and a step
//! moves `x` by `X y`. Rows with bounds keep the rows `a`, because bounds hold for `x` itself.
//!
//! If no bound is active, the steps are those of the method without bounds. Otherwise `x` is moved along the remaining directions as close
//! as possible to the solution without bounds, before every level and after the last.

use super::unbounded::Damping;
use super::{Goal, Inequalities};
use crate::error::Result;
use crate::linalg::clamp_remainder;

impl Inequalities {
    /// Add the penalty rows of a level. `everywhere`: all directions are damped, as for the method `damped`.
    pub(super) fn add_penalties(&mut self, level: usize, everywhere: bool) -> Result<()> {
        (self.penalties, self.goal) = (0, Goal::Violation);
        self.refresh();
        self.pull();
        self.start_units();
        if let Some(Damping { scale, .. }) = &self.damping {
            for &i in self.pulled.iter().filter(|i| self.rows.is_task(**i)) {
                scale.iter().enumerate().for_each(|(j, d)| self.frame[(j, i)] *= d);
            }
        }
        let (from, eps) = (self.frame.used, self.rows.eps[level]);
        let Inequalities { frame, face, pulled, .. } = self;
        face.decompose(frame, pulled, from)?;
        let s = face.svd.s();
        self.last[level].damps = s.iter().any(|s| *s < eps);
        // Rows of zeros have no step.
        if s.iter().all(|s| *s >= eps) || self.rows.frobenius[level] == 0.0 {
            return Ok(());
        }
        frame.turn(&face.svd, from, false);
        let damping = eps * (1.0 - s.iter().map(|s| (s / eps).min(1.0)).product::<f64>());
        for at in from..frame.n() {
            let root = match s.get(at - from) {
                _ if everywhere => damping,
                Some(s) => ((eps - s).max(0.0) * (eps + s)).sqrt(),
                None => 0.0,
            };
            if root > 0.0 {
                let column = frame.penalty(self.penalties);
                frame.clear(column);
                frame[(at, column)] = root;
                self.rows.size[column] = root;
                self.penalties += 1;
                self.rule.norm = self.rule.norm.hypot(root);
            }
        }
        Ok(())
    }

    /// Start the unit vectors of the coordinates, if a direction remains in part.
    pub(super) fn start_units(&mut self) {
        let Inequalities { frame, damping, .. } = self;
        if damping.as_ref().is_none_or(|damping| damping.scale.iter().all(|d| *d == 1.0)) {
            return;
        }
        for j in 0..frame.n() {
            let unit = frame.unit(j);
            frame.clear(unit);
            frame[(j, unit)] = 1.0;
        }
    }

    /// Remove the part of the directions that the pulled rows of a damped level use: `P <- (P R^2 P)^1/2` with
    /// `R = V diag(1 - min(1, (s/eps)^2)) V'`. Return the number of singular values from `eps` on.
    pub(super) fn attenuate(&mut self, level: usize) -> Result<usize> {
        let eps = self.rows.eps[level];
        let Inequalities { frame, face, pulled, damping, .. } = self;
        let Some(Damping { scale, product, svd, .. }) = damping else { return Ok(0) };
        let (from, k) = (frame.used, frame.n() - frame.used);
        face.decompose(frame, pulled, from)?;
        let remainder = |j: usize| face.svd.s().get(j).map_or(1.0, |s| clamp_remainder(*s, eps));
        if scale.iter().all(|d| *d == 1.0) {
            frame.turn(&face.svd, from, false);
            (0..k).for_each(|j| scale[from + j] = remainder(j));
        } else {
            // The rows of `R P` along the right singular vectors, with `P = sum d u u'` over the unit vectors `u`.
            let product = &mut product[..k * k];
            product.fill(0.0);
            for (j, row) in product.chunks_exact_mut(k.max(1)).enumerate() {
                for (at, d) in scale.iter().enumerate() {
                    let unit = frame.unit(at);
                    let part = remainder(j) * d * frame.product(unit, from, face.svd.v(j));
                    row.iter_mut().zip(frame.vector(unit, from)).for_each(|(to, x)| *to += part * x);
                }
            }
            svd.decompose(product, k, k)?;
            frame.turn(svd, from, true);
            (0..k).for_each(|j| scale[from + j] = svd.s()[k - 1 - j].min(1.0));
        }
        frame.used += scale[from..].iter().filter(|d| **d == 0.0).count();
        scale[..frame.used].fill(1.0);
        Ok(face.svd.s().iter().filter(|s| **s >= eps && **s > 0.0).count())
    }
}
