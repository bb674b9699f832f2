//! A vertex at which a released row is blocked at once, because more rows are active than linearly independent. The gradient `g` of the
//! goal and the outward normals `b_i` of all active rows decide (Lawson and Hanson 1974, `lawson1974least`: non-negative least squares):
//!
//! `min |g + sum lambda_i b_i|`,  `lambda >= 0`
//!
//! If the minimum is zero, the vertex is optimal. Otherwise the negative residual is a direction that decreases the goal, and along which no
//! active row leaves its bounds. The rows with a positive multiplier are the working rows, whose triangle solves the least squares.

use super::{Goal, Inequalities, Part};
use crate::linalg::dot;

/// A residual below this fraction of the largest force counts as zero. The same holds for the cosine of two directions.
const ZERO: f64 = 1e-11;

impl Inequalities {
    /// Leave a vertex. Return whether `x` moved; the vertex is optimal if not.
    pub(super) fn leave_vertex(&mut self) -> bool {
        self.clear_working();
        let free = (self.frame.used..self.frame.n()).map(|at| self.gradient(at).powi(2));
        let largest = free.sum::<f64>().sqrt();
        // Every pass of non-negative least squares decreases the residual, so that no set of rows occurs twice.
        for _ in 0..10 * self.part.len() {
            let residual = self.free_gradient();
            if residual <= ZERO * largest {
                break;
            }
            let Some((i, side)) = self.steepest(residual) else { break };
            self.hold(i, side);
            self.nonnegative_multipliers();
        }
        let decreases = dot(&self.step, &self.step).sqrt() > ZERO * largest;
        // The gradient of a scale has no unit.
        let size = if self.goal == Goal::Scale { self.longest() } else { 1.0 };
        self.step.iter_mut().for_each(|p| *p *= -size);
        let from = self.determined();
        self.rates(from);
        let (t, blocking) = self.line_search(from, true);
        if !decreases || !self.is_movement(t) {
            self.find_multipliers();
            return false;
        }
        self.advance(from, t);
        if let Some((row, side)) = blocking {
            self.hold(row, side);
        }
        true
    }

    /// Write the gradient along the free coordinates to the step. Return its norm.
    fn free_gradient(&mut self) -> f64 {
        let from = self.determined();
        self.step[..from].fill(0.0);
        for at in from..self.frame.n() {
            self.step[at] = self.gradient(at);
        }
        dot(&self.step, &self.step).sqrt()
    }

    /// Return the active row that the direction of the steepest descent violates most, and the side of its bound.
    fn steepest(&self, residual: f64) -> Option<(usize, i8)> {
        let from = self.determined();
        let (mut steepest, mut found) = (ZERO, None);
        for &i in self.watched.iter().filter(|i| self.part[**i] == Part::Kept) {
            let (value, slack) = (self.value[i], self.tolerance(i));
            let sides = [(self.rows.upper[i] - value, 1), (value - self.rows.lower[i], -1)];
            for (_, side) in sides.into_iter().filter(|(distance, _)| *distance <= slack) {
                let outward = self.frame.product(i, from, &self.step[from..]) * f64::from(side);
                let cosine = -outward / (residual * self.rows.size[i]);
                if cosine > steepest {
                    (steepest, found) = (cosine, Some((i, side)));
                }
            }
        }
        found
    }

    /// Move the multipliers to the least-squares solution of the working rows. Release the rows whose multiplier becomes zero first.
    fn nonnegative_multipliers(&mut self) {
        while !self.working.is_empty() {
            for at in 0..self.working.len() {
                let i = self.working[at];
                self.right_side[at] = self.multiplier[i] * f64::from(self.side[i]);
            }
            self.solve_multipliers();
            let (mut most, mut first) = (f64::INFINITY, None);
            for (at, &i) in self.working.iter().enumerate() {
                let (old, new) = (self.right_side[at], self.multiplier[i] * f64::from(self.side[i]));
                if new <= 0.0 && old / (old - new) < most {
                    (most, first) = (if old > 0.0 { old / (old - new) } else { 0.0 }, Some(at));
                }
            }
            let Some(first) = first else { return };
            for (at, &i) in self.working.iter().enumerate() {
                let (old, side) = (self.right_side[at], f64::from(self.side[i]));
                self.multiplier[i] = side * (old + most * (self.multiplier[i] * side - old)).max(0.0);
            }
            self.release(first);
        }
    }
}
