//! The decomposition of a level in the null space of the levels above, and the rank rule.

use super::null_space::NullSpace;
use crate::error::Result;
use crate::linalg::Svd;
use crate::priority::stack::Level;

/// The projected Jacobian `A_i = J_i N = U diag(s) V'` of the present level, with its memory.
#[derive(Debug, Clone)]
pub struct ProjectedLevel {
    /// `A_i`, shape `(m, dim)`, row-major, with `dim` directions in the null space.
    a: Vec<f64>,
    /// The decomposition of `A_i`.
    pub svd: Svd,
    /// The decomposition of `J_i` without projection.
    pub alone: Svd,
}

impl ProjectedLevel {
    /// Allocate memory for `n` joints and at most `most` rows.
    pub fn new(n: usize, most: usize) -> Self {
        ProjectedLevel { a: vec![0.0; most * n], svd: Svd::new(most, n), alone: Svd::new(most, n) }
    }

    /// Project and decompose the level. Errors: as for [`Svd::decompose`].
    pub fn decompose(&mut self, level: &Level, null_space: &NullSpace) -> Result<()> {
        let (m, k) = (level.rows(), null_space.dim());
        null_space.project(level, &mut self.a[..m * k]);
        self.svd.decompose(&self.a[..m * k], m, k)
    }

    /// The spectral norm of `J_i`, which is the scale of its rank decisions. If the levels above use a direction, it requires
    /// the decomposition `alone`.
    pub fn norm(&self, null_space: &NullSpace) -> f64 {
        let svd = if null_space.used == 0 { &self.svd } else { &self.alone };
        svd.s().first().copied().unwrap_or(0.0)
    }
}

/// The rank rule: a singular value `s` of `A_i` counts if `s > rounding |J_i| c`. Here `|J_i|` is the spectral norm, and `c` the product
/// of `|J_l| / (smallest counted s of level l)` over all levels `l` above. `rounding c` estimates the relative error of their null basis.
/// For level 2, `c = cond(J1)`.
#[derive(Debug, Clone)]
pub struct RankRule {
    rounding: f64,
    /// The number `c`.
    pub condition: f64,
}

impl RankRule {
    /// Start with the first level. `rounding`: relative error of the entries of the Jacobians.
    pub fn new(rounding: f64) -> Self {
        RankRule { rounding, condition: 1.0 }
    }

    /// Return `(rank, used)` for a level with the spectral norm `norm`. Of the first `used` singular directions, which no lower level may
    /// use, the level commands the first `rank`. Update `c` for the next level.
    ///
    /// A singular value between the rounding error and the cut-off is used but not counted. Such a direction may be noise, so that the
    /// level must not command it. It may also be real, so that a lower level along it would disturb this level.
    pub fn count(&mut self, svd: &Svd, norm: f64) -> (usize, usize) {
        let rank = svd.rank(self.rounding * norm * self.condition);
        let used = rank.max(svd.rank(self.rounding * norm));
        if rank > 0 {
            self.condition *= norm / svd.s()[rank - 1];
        }
        (rank, used)
    }
}
