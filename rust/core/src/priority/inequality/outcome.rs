//! The outcome of a solve in the units of the caller: velocities, violations, active rows, and the certificate of the bounds.

use super::{Inequalities, Part};
use crate::priority::settings::Settings;
use crate::priority::solution::Solution;

impl Inequalities {
    /// Whether a row of bounds is violated.
    pub(super) fn is_limited(&self) -> bool {
        self.rows.levels.iter().flat_map(|level| level.clone()).any(|i| !self.rows.is_task(i) && self.violation(i) != 0.0)
    }

    /// Add the excess over bounds of rows that are not violated to the certificate.
    pub(super) fn check_bounds(&mut self) {
        self.find_values();
        for i in 0..self.part.len() {
            let value = self.value[i];
            if self.part[i] != Part::Later && !self.violated[i] {
                let excess = (value - self.rows.upper[i]).max(self.rows.lower[i] - value);
                if !self.rows.is_task(i) && excess > 0.0 {
                    self.certificate = self.certificate.max(excess / (self.rows.size[i] * self.reach));
                }
            }
        }
    }

    /// Write the solution in the units of the caller.
    pub(super) fn write(&mut self, settings: &Settings, solution: &mut Solution) {
        let Inequalities { rows, x, .. } = self;
        solution.v.copy_from_slice(&x[rows.offset..]);
        settings.metric.iter().for_each(|metric| metric.velocity(&mut solution.v));
        let limits = rows.levels[0].clone();
        if !limits.is_empty() {
            let bounds = rows.lower.iter().zip(&rows.upper);
            solution.v.iter_mut().zip(bounds).for_each(|(v, (l, u))| *v = v.max(*l).min(*u));
            // A held velocity is at its bound up to rounding.
            for i in limits.clone().filter(|i| self.side[*i] != 0 && matches!(self.part[*i], Part::Working | Part::Fixed)) {
                solution.v[i] = self.bound(i);
            }
        }
        let Some(bounded) = &mut solution.bounded else { return };
        (bounded.changes, bounded.certificate) = (self.changes, self.certificate);
        for (level, own) in self.rows.levels.iter().enumerate() {
            for i in own.clone() {
                let (w, side) = (self.rows.unscaled(level, self.violation(i), 1), self.active_side(i));
                let multiplier = if w == 0.0 { self.rows.unscaled(level, self.multiplier[i], -1) } else { w };
                (bounded.violations[i], bounded.sides[i]) = (w, side);
                bounded.multipliers[i] = if side == 0 { 0.0 } else { multiplier };
            }
        }
    }

    /// The bound at which or beyond which row `i` is: 1 for the upper, -1 for the lower, 0 for none.
    pub(super) fn active_side(&self, i: usize) -> i8 {
        let (value, slack) = (self.value[i], self.tolerance(i));
        if self.rows.is_task(i) {
            0
        } else if value >= self.rows.upper[i] - slack {
            1
        } else {
            -i8::from(value <= self.rows.lower[i] + slack)
        }
    }
}
