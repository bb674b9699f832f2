//! Hierarchical least squares, level by level, with singular values. For each level, with the null space `N = X diag(scale)` of the levels
//! above,
//!
//! `A_i = J_i N = U diag(s) V'`,  `y += X V g(s) U' (v_i - J_i y)`,  `N <- N V_k diag(d)`.
//!
//! Here `y` is the velocity in metric coordinates. `g(s)` replaces the reciprocal of the singular value `s`, depending on the method. `d`
//! is the fraction of a direction that the level leaves to lower levels. The prime is the transpose. For `exact`, `d` is 0 or 1 by the rank
//! rule. For `clamp` and `damped`, `d = 1 - min(1, (s/eps)^2)`. `V_k` has the columns of `V` with `d > 0`.
//!
//! The projector `X diag(scale) X'` is symmetric. For `clamp` and `damped` it is also a continuous function of the Jacobians. Its range is
//! then orthogonal to every direction with `s >= eps` of the levels above.

mod conditions;
mod null_space;
mod projected_level;

use super::settings::Settings;
use super::solution::LevelSolution;
use super::stack::{Level, Stack};
use crate::error::Result;
use crate::linalg::{axpy, clamp_gain, dot};
pub(super) use conditions::Conditions;
use null_space::NullSpace;
use projected_level::{ProjectedLevel, RankRule};

/// The state of a solve between two levels, with its memory.
#[derive(Debug, Clone)]
pub(super) struct Hierarchy {
    pub null_space: NullSpace,
    /// The present level.
    pub projected: ProjectedLevel,
    pub rank_rule: RankRule,
    /// The velocity of the levels so far, in metric coordinates.
    pub y: Vec<f64>,
    /// The remaining command `v_i - J_i y` of the present level.
    pub residual: Vec<f64>,
    /// The velocity of the present level alone, for `chiaverini`.
    alone: Vec<f64>,
}

impl Hierarchy {
    /// Allocate memory for the levels of a stack.
    pub fn new(stack: &Stack) -> Self {
        let n = stack.n;
        let most = stack.rows.iter().copied().max().unwrap_or(0).max(n);
        Hierarchy {
            null_space: NullSpace::new(n),
            projected: ProjectedLevel::new(n, most),
            rank_rule: RankRule::new(0.0),
            y: vec![0.0; n],
            residual: vec![0.0; most],
            alone: vec![0.0; n],
        }
    }

    /// Start a solve: no level has used a direction, and the velocity is zero.
    pub fn start(&mut self, settings: &Settings) {
        self.null_space.reset();
        self.rank_rule = RankRule::new(settings.rounding);
        self.y.fill(0.0);
    }

    /// Project the Jacobian of a level on the null space of the levels above, and decompose it.
    pub fn project(&mut self, level: &Level) -> Result<()> {
        self.projected.decompose(level, &self.null_space)
    }

    /// Take the step of `exact`, with the pseudo-inverse of the counted singular values, and remove the used directions.
    pub fn exact_step(&mut self, level: &Level) -> Result<LevelSolution> {
        let (rank, used) = self.count_rank(level)?;
        let solution = LevelSolution::new(rank, self.projected.svd.s().len());
        self.step(level, rank, |s, along| along / s);
        self.remove(level, used);
        Ok(solution)
    }

    /// Take the step of `clamp`, with the gain `s / max(s, eps)^2`.
    pub fn clamped_step(&mut self, level: &Level) -> Result<LevelSolution> {
        self.partial_step(level, |s, along| clamp_gain(s, level.eps) * along)
    }

    /// Take the step of `damped`, with the gain `s / (s^2 + lambda^2)`, `lambda = eps (1 - manipulability)`.
    pub fn damped_step(&mut self, level: &Level) -> Result<LevelSolution> {
        let eps = level.eps;
        let manipulability: f64 = self.projected.svd.s().iter().map(|s| if *s >= eps { 1.0 } else { s / eps }).product();
        let lambda = eps * (1.0 - manipulability);
        self.partial_step(level, |s, along| damped_gain(s, lambda) * along)
    }

    /// Take a step with the gain `inverse`, and remove the part of the null space that a clamped level uses.
    fn partial_step(&mut self, level: &Level, inverse: impl Fn(f64, f64) -> f64) -> Result<LevelSolution> {
        let s = self.projected.svd.s();
        let (possible, rank) = (s.len(), s.iter().filter(|s| **s >= level.eps && **s > 0.0).count());
        self.step(level, possible, inverse);
        if !level.is_last {
            let ProjectedLevel { svd, alone, .. } = &mut self.projected;
            self.null_space.attenuate(svd, level.eps, alone)?;
        }
        Ok(LevelSolution::new(rank, possible))
    }

    /// Take the step of `chiaverini`: `P_{i-1} J_i# v_i`. The inverse `J_i#` is clamped, and `P` projects on the null space of the levels
    /// above.
    pub fn chiaverini_step(&mut self, level: &Level) -> Result<LevelSolution> {
        self.projected.alone.decompose(level.jacobian, level.rows(), level.n)?;
        let Hierarchy { null_space, projected, rank_rule, y, alone, .. } = self;
        let svd = &projected.alone;
        alone.fill(0.0);
        for (j, s) in svd.s().iter().enumerate() {
            axpy(clamp_gain(*s, level.eps) * dot(svd.u(j), level.command), svd.v(j), alone);
        }
        for x in null_space.directions() {
            axpy(dot(x, alone), x, y);
        }
        let (rank, used) = rank_rule.count(&projected.svd, projected.norm(null_space));
        let mut solution = LevelSolution::new(rank, projected.svd.s().len());
        // A level without directions cannot lose a direction.
        solution.singular |= null_space.dim() > 0 && svd.s().iter().any(|s| *s < level.eps);
        self.remove(level, used);
        Ok(solution)
    }

    /// Return `(rank, used)` for the projected level by the rank rule.
    pub fn count_rank(&mut self, level: &Level) -> Result<(usize, usize)> {
        if self.null_space.used > 0 {
            self.projected.alone.decompose(level.jacobian, level.rows(), level.n)?;
        }
        Ok(self.rank_rule.count(&self.projected.svd, self.projected.norm(&self.null_space)))
    }

    /// Compute `y += X V g(s) U' (v_i - J_i y)` along the first `count` singular directions. `inverse(s, x)` returns `g(s) x`.
    pub fn step(&mut self, level: &Level, count: usize, inverse: impl Fn(f64, f64) -> f64) {
        let Hierarchy { null_space, projected: ProjectedLevel { svd, .. }, y, residual, .. } = self;
        level.residual(y, residual);
        for j in 0..count {
            let gain = inverse(svd.s()[j], dot(svd.u(j), &residual[..level.rows()]));
            if gain != 0.0 {
                null_space.add(gain, svd.v(j), y);
            }
        }
    }

    /// Remove the first `used` singular directions from the null space, if a level follows.
    pub fn remove(&mut self, level: &Level, used: usize) {
        if !level.is_last {
            self.null_space.rotate(&self.projected.svd);
            self.null_space.remove(used);
        }
    }
}

fn damped_gain(s: f64, lambda: f64) -> f64 {
    if s <= 0.0 { 0.0 } else { 1.0 / (s + lambda * (lambda / s)) }
}
