//! The active set of the last solve. It makes the stack an equality hierarchy, without iterations. Each level has the tasks and the rows that
//! were violated. They act in the null space of the rows that had a positive multiplier. The result is accepted if its certificate holds: the signs
//! of all multipliers, and the bounds of all rows.

use super::{Goal, Inequalities, Part};
use crate::error::Result;

/// A row of the last set is held only if its part that is independent of the other rows is longer, relative to its norm.
const INDEPENDENT: f64 = 1e-9;

impl Inequalities {
    /// Store the working rows and the violated rows of a problem.
    pub(super) fn keep_set(&mut self) {
        let Inequalities { goal, number, last, working, side, part, pulled, rows, touched, .. } = self;
        let set = &mut last[*number];
        set.touched = *touched;
        set.held.clear();
        set.held.extend(working.iter().map(|i| (*i, side[*i])));
        set.violated.clear();
        if *goal == Goal::Violation {
            let own = pulled.iter().filter(|i| **i < part.len() && !rows.is_task(**i));
            set.violated.extend(own.map(|i| (*i, side[*i])));
        }
    }

    /// Solve a problem with the active set of the last solve. Return false if a multiplier has the wrong sign.
    pub(super) fn try_last(&mut self) -> Result<bool> {
        self.hold_last();
        self.pull_last();
        self.step_on_face()?;
        if self.goal == Goal::Scale && self.step.iter().any(|p| *p != 0.0) {
            return Ok(false);
        }
        self.advance(self.determined(), 1.0);
        self.find_multipliers();
        self.touched |= self.last[self.number].touched;
        Ok(self.worst_multiplier().is_none())
    }

    /// Hold the rows of the last solve, and move to their bounds.
    fn hold_last(&mut self) {
        let used = self.frame.used;
        self.step.fill(0.0);
        for at in 0..self.last[self.number].held.len() {
            let (i, side) = self.last[self.number].held[at];
            let free = self.frame.norm2(i, self.determined());
            let bound = if side > 0 { self.rows.upper[i] } else { self.rows.lower[i] };
            if self.part[i] != Part::Kept || free.sqrt() <= INDEPENDENT * self.rows.size[i] || !bound.is_finite() {
                continue;
            }
            let (at, value) = (self.determined(), self.value[i]);
            self.hold(i, side);
            self.value[i] = value;
            let known = self.frame.product(i, used, &self.step[used..at]);
            self.step[at] = (bound - value - known) / self.frame[(at, i)];
        }
        if !self.working.is_empty() {
            self.rates(used);
            self.advance(used, 1.0);
        }
    }

    /// Pull the tasks of the level and the rows that were violated in the last solve.
    fn pull_last(&mut self) {
        self.pulled.clear();
        if self.goal != Goal::Violation {
            return;
        }
        let Inequalities { number, last, side, part, pulled, watched, rows, penalties, .. } = self;
        let own = || watched.iter().copied().filter(|i| part[*i] == Part::Own);
        own().for_each(|i| side[i] = 0);
        last[*number].violated.iter().for_each(|(i, s)| side[*i] = *s);
        pulled.extend(own().filter(|i| side[*i] != 0 || rows.is_task(*i)));
        pulled.extend(rows.len()..rows.len() + *penalties);
    }

    /// Whether all rows of the levels so far are within their bounds, or beyond the bound at which they were violated.
    pub(super) fn is_consistent(&mut self) -> bool {
        self.find_values();
        (0..self.part.len()).all(|i| {
            let (value, slack) = (self.value[i], self.tolerance(i));
            match self.part[i] {
                Part::Later => true,
                _ if self.rows.is_task(i) => true,
                Part::Fixed if self.violated[i] => (value - self.bound(i)) * f64::from(self.side[i]) > slack,
                _ => value <= self.rows.upper[i] + slack && value >= self.rows.lower[i] - slack,
            }
        })
    }
}
