//! Scaled commands (`sns`, and every stack that keeps directions; Flacco, De Luca and Khatib 2015, `flacco2015saturation`). `P r` is the
//! command `r` of a level, projected on the range of its rows in the null space of the tasks above. The level minimises
//!
//! `|A x - s P r|`  over `x` and `0 <= s <= 1`,
//!
//! and then finds the largest `s` among the minimisers. Both are fixed for the lower levels.
//!
//! With a length `L`, `s P r = t q`, `q = P r / L`, `t = s L`. The length `t` is one more unknown, in the unit of `x`. So the first problem
//! has tasks `a x - q t = 0` and bounds `0 <= t <= L`. The second is a linear program, whose gradient is that of `-t`. `L` is the length of
//! the smallest step `d` of `A d = P r` in this null space, so that `q` is as long as the rows are. Near a singularity `d` is longer than the
//! bounds allow. Then `L` is the norm of the bounds, but not below `|P r| / |A|`, so that neither `t` nor `q` is too long.
//!
//! The coordinate of `t` in the frame is the last coordinate of the levels above, because no row needs it any more.

use super::projected_command::Scaling;
use super::{Goal, Inequalities, NOISE, Part, ZERO_FORCE};
use crate::error::Result;
use crate::linalg::dot;
use crate::priority::solution::LevelSolution;

/// A scale that is less than this number below 1 is 1.
const NEARLY_ONE: f64 = 1e-12;

/// The distance from the direction of the command, relative to the size of the level, from which a level counts as singular.
const OFF_DIRECTION: f64 = 1e-9;

impl Inequalities {
    /// Solve a level with a scaled command, and fix its directions. The result is `None` if the number of changes reached its limit.
    pub(super) fn solve_scaled_level(&mut self, level: usize) -> Result<Option<LevelSolution>> {
        let Inequalities { rows, scaling, .. } = self;
        let Some(scaling) = scaling else { return Ok(None) };
        let own = rows.levels[level].clone();
        let n = scaling.hierarchy.y.len();
        for (at, i) in own.clone().enumerate() {
            scaling.jacobian[at * n..(at + 1) * n].copy_from_slice(&rows.row(i)[1..]);
            scaling.command[at] = rows.lower[i];
        }
        let rank = scaling.use_rows(own.len())?;
        scaling.project_command(own.len(), rank, rows.frobenius[level]);
        let possible = scaling.hierarchy.projected.svd.s().len();
        self.start_length(level);
        let found = self.find_scale(level, rank);
        self.end_length(level);
        let Some((scale, follows)) = found? else { return Ok(None) };
        let outcome = LevelSolution::new(rank, possible);
        Ok(Some(LevelSolution { scale, singular: outcome.singular || !follows, ..outcome }))
    }

    /// Minimise the distance from the direction of the command, then find the largest scale. Return the scale, and whether the level follows
    /// the direction.
    fn find_scale(&mut self, level: usize, rank: usize) -> Result<Option<(f64, bool)>> {
        self.rule.norm = self.rows.frobenius[level];
        self.watch();
        if !self.minimise(level, Goal::Violation)? {
            return Ok(None);
        }
        let follows = self.follows(level, rank);
        self.fix(level, false)?;
        let length = self.length_bound();
        if length == 0.0 {
            return Ok(Some((1.0, follows)));
        }
        self.watch();
        if !self.minimise(2 * self.rows.levels.len() + level, Goal::Scale)? {
            return Ok(None);
        }
        let (t, slack) = (self.x[0], NOISE * self.reach);
        if self.warm && !(-slack..=length + slack).contains(&t) {
            return Ok(None);
        }
        self.release_idle();
        if !self.warm {
            self.keep_set();
        }
        self.fix_working(|_, multiplier| multiplier / length);
        let (direction, used) = (self.frame.basis(0), self.frame.used);
        if self.frame.norm2(direction, used).sqrt() > NOISE {
            self.frame.reflect(direction, used);
            self.frame.used += 1;
        }
        let whole = length - t <= slack.max(NEARLY_ONE * length);
        Ok(Some((if whole { 1.0 } else { (t / length).max(0.0) }, follows)))
    }

    /// The upper bound `L` of `t` in the present level. It is zero for a level without a feasible command, whose scale is 1.
    fn length_bound(&self) -> f64 {
        self.scaling.as_ref().map_or(0.0, |scaling| scaling.length)
    }

    /// The longest `t` or `x` of the present level.
    pub(super) fn longest(&self) -> f64 {
        self.length_bound().max(self.reach)
    }

    /// Return the factor of the projected gradient in a step that increases `t` to more than its upper bound, which then ends the step. It is
    /// zero if `t` cannot increase.
    pub(super) fn factor_of_ascent(&self, from: usize) -> f64 {
        let square = self.frame.norm2(self.frame.norm(), from);
        if square.sqrt() > ZERO_FORCE { (self.length_bound() - self.x[0] + self.longest()) / square } else { 0.0 }
    }

    /// Whether `A x = s P r` up to rounding, apart from the part of `A x` that the level cannot change.
    fn follows(&self, level: usize, rank: usize) -> bool {
        let Some(Scaling { hierarchy, .. }) = &self.scaling else { return true };
        let own = self.rows.levels[level].clone();
        let allowed = OFF_DIRECTION * self.rows.frobenius[level] * self.reach;
        (0..rank).all(|j| dot(hierarchy.projected.svd.u(j), &self.value[own.clone()]).abs() <= allowed)
    }

    /// Add `t` to the unknowns, and replace the tasks `a x = r` of the level by `a x - q t = 0`.
    fn start_length(&mut self, level: usize) {
        self.part[self.rows.levels[level].clone()].fill(Part::Own);
        let Inequalities { frame, rows, part, scaling, x, .. } = self;
        let Some(Scaling { image, length, .. }) = scaling.as_ref().filter(|scaling| scaling.length != 0.0) else { return };
        let (bound, at) = (rows.len() - 1, frame.used - 1);
        frame.free_last_used();
        for (i, q) in rows.levels[level].clone().zip(image) {
            rows.set_length_entry(i, -q);
            (rows.lower[i], rows.upper[i], frame[(at, i)]) = (0.0, 0.0, -q);
        }
        for column in [bound, frame.basis(0)] {
            frame.clear(column);
            frame[(at, column)] = 1.0;
        }
        (rows.lower[bound], rows.upper[bound], part[bound], x[0]) = (0.0, *length, Part::Kept, 0.0);
    }

    /// Remove `t` from the unknowns, and restore the tasks of the level.
    fn end_length(&mut self, level: usize) {
        let Inequalities { rows, part, side, multiplier, scaling, working, x, .. } = self;
        let (Some(Scaling { command, .. }), bound) = (scaling, rows.len() - 1) else { return };
        for (i, r) in rows.levels[level].clone().zip(command) {
            rows.set_length_entry(i, 0.0);
            (rows.lower[i], rows.upper[i]) = (*r, *r);
        }
        working.retain(|i| *i != bound);
        (part[bound], side[bound], multiplier[bound], x[0]) = (Part::Later, 0, 0.0, 0.0);
    }

    /// Remove the directions of the tasks and of the violated rows of a level with bounds from the null space of the tasks.
    pub(super) fn use_fixed_rows(&mut self, level: usize) -> Result<()> {
        let Inequalities { rows, part, scaling, .. } = self;
        let Some(scaling) = scaling.as_mut().filter(|_| level > 0) else { return Ok(()) };
        let n = scaling.hierarchy.y.len();
        let own = rows.levels[level].clone();
        for (at, i) in own.clone().enumerate() {
            let row = &mut scaling.jacobian[at * n..(at + 1) * n];
            if part[i] == Part::Fixed {
                row.copy_from_slice(&rows.row(i)[1..]);
            } else {
                row.fill(0.0);
            }
        }
        scaling.use_rows(own.len()).map(|_| ())
    }
}
