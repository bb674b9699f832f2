//! The primal active-set method of a level. A *face* is the set of `x` on which the working rows keep their bounds. Each iteration steps
//! towards the minimiser on the face. The step ends before a kept row leaves its bounds, and this row joins the working rows. At the
//! minimiser, the working row with the most negative multiplier is released. Equal candidates are resolved by the lowest index.
//!
//! The violations are piecewise linear along a step, and the goal is piecewise quadratic. The step ends at its minimum along the line, so
//! that every step decreases the goal. At a vertex with more active rows than working rows, `vertex` finds a descent direction or the
//! proof that there is none. So no face occurs twice.

use super::unbounded::Damping;
use super::{Goal, Inequalities, NOISE, Part, ZERO_FORCE};
use crate::error::Result;
use crate::linalg::{axpy, dot};

/// The step to a minimiser is repeated at most this number of times, if its relative residual is above this limit. The second step removes
/// rounding errors of the first.
const REFINEMENTS: usize = 3;
const REFINED: f64 = 1e-12;

/// A step counts as a movement if it is longer than this fraction of the largest norm of `x`.
const MOVEMENT: f64 = 1e-12;

impl Inequalities {
    /// The rounding error of the value of row `i`.
    pub(super) fn tolerance(&self, i: usize) -> f64 {
        NOISE * self.rows.size[i] * self.reach
    }

    /// Whether the rate of row `i` is more than a rounding error of a step of the length `length`.
    fn moves(&self, i: usize, length: f64) -> bool {
        self.rate[i].abs() > NOISE * self.rows.size[i] * length
    }

    /// The length of the step.
    fn length(&self) -> f64 {
        dot(&self.step, &self.step).sqrt()
    }

    /// The violation `w` of row `i`. For bounds, a violation up to rounding is zero.
    pub(super) fn violation(&self, i: usize) -> f64 {
        let (value, lower, upper) = (self.value[i], self.rows.lower[i], self.rows.upper[i]);
        if lower == upper {
            return value - lower;
        }
        let excess = value - value.max(lower).min(upper);
        if excess.abs() <= self.tolerance(i) { 0.0 } else { excess }
    }

    /// The number of coordinates that the higher levels and the working rows determine.
    pub(super) fn determined(&self) -> usize {
        self.frame.used + self.working.len()
    }

    /// The bound on the side of row `i` that is violated or held.
    pub(super) fn bound(&self, i: usize) -> f64 {
        if self.side[i] > 0 { self.rows.upper[i] } else { self.rows.lower[i] }
    }

    /// Release all working rows.
    pub(super) fn clear_working(&mut self) {
        for i in self.working.drain(..) {
            (self.part[i], self.multiplier[i]) = (Part::Kept, 0.0);
        }
    }

    /// Compute the values of all rows.
    pub(super) fn find_values(&mut self) {
        let Inequalities { rows, x, value, .. } = self;
        rows.columns.products(0, x, value);
        value[rows.len()..].fill(0.0);
    }

    /// Compute the values of all rows, and the gradient of the norm.
    pub(super) fn refresh(&mut self) {
        self.find_values();
        let Inequalities { frame, x, .. } = self;
        let (basis, norm) = (frame.basis(0), frame.norm());
        frame.clear(norm);
        if self.goal == Goal::Scale {
            (0..x.len()).for_each(|c| frame[(c, norm)] = -frame[(c, basis)]);
        }
        if self.goal == Goal::Norm {
            let damping = self.damping.as_ref();
            let preferred = damping.and_then(Damping::preferred);
            for j in 0..x.len() {
                let away = x[j] - preferred.map_or(0.0, |p| p[j]);
                for c in 0..x.len() {
                    let entry = frame[(c, basis + j)];
                    frame[(c, norm)] += away * entry * damping.map_or(1.0, |damping| damping.scale[c]);
                }
            }
        }
    }

    /// Search for the minimiser of the goal. Return false if the number of changes reached its limit; `x` is then the last feasible point.
    pub(super) fn search(&mut self) -> Result<bool> {
        let most = 100 + 10 * self.part.len();
        let (mut moved, mut refinements) = (true, 0);
        self.tied.clear();
        for _ in 0..most {
            self.pull();
            self.step_on_face()?;
            if self.is_feasible_step() {
                moved |= self.is_movement(1.0);
                self.advance(self.determined(), 1.0);
                self.find_multipliers();
                if refinements < REFINEMENTS && self.stationarity() > REFINED {
                    refinements += 1;
                    continue;
                }
                refinements = 0;
                let Some(worst) = self.worst_multiplier() else { return Ok(true) };
                if std::mem::take(&mut moved) {
                    self.release(worst);
                } else if !self.leave_vertex() {
                    return Ok(true);
                }
            } else {
                let (t, blocking) = self.line_search(self.determined(), false);
                let moves = self.is_movement(t);
                moved |= moves;
                self.advance(self.determined(), t);
                if moves || blocking.is_some() {
                    self.tied.clear();
                } else if !self.tie() {
                    return Ok(true);
                }
                if let Some((row, side)) = blocking {
                    self.hold(row, side);
                }
            }
            self.changes += 1;
        }
        Ok(false)
    }

    /// Tie the rows of the level that are at a bound, and that the step would violate. Return false if there is none.
    fn tie(&mut self) -> bool {
        let (known, length) = (self.tied.len(), self.length());
        for &i in self.watched.iter().filter(|i| self.part[**i] == Part::Own && !self.rows.is_task(**i) && self.side[**i] == 0) {
            let (rate, slack) = (self.rate[i], self.tolerance(i));
            let side = if rate > 0.0 { 1 } else { -1 };
            let bound = if rate > 0.0 { self.rows.upper[i] } else { self.rows.lower[i] };
            if (self.value[i] - bound).abs() <= slack && self.moves(i, length) {
                self.tied.push((i, side));
            }
        }
        self.tied.len() > known
    }

    pub(super) fn is_movement(&self, t: f64) -> bool {
        t * self.length() > MOVEMENT * self.reach
    }

    /// List the tasks, the violated and the tied rows of the level, and its penalty rows.
    pub(super) fn pull(&mut self) {
        self.pulled.clear();
        if self.goal != Goal::Violation {
            return;
        }
        for at in 0..self.watched.len() {
            let i = self.watched[at];
            if self.part[i] == Part::Own {
                let w = self.violation(i);
                let tied = self.tied.iter().find(|(row, _)| *row == i).map_or(0, |(_, side)| *side);
                self.side[i] = if self.rows.is_task(i) || w == 0.0 { tied } else { w.signum() as i8 };
                if self.side[i] != 0 || self.rows.is_task(i) {
                    self.pulled.push(i);
                    self.touched |= self.side[i] != 0;
                }
            }
        }
        self.pulled.extend((0..self.penalties).map(|j| self.rows.len() + j));
    }

    /// The distance of a pulled row from its bound or its command. A penalty row has the command zero.
    pub(super) fn distance(&self, i: usize) -> f64 {
        if i < self.rows.len() { self.value[i] - self.bound(i) } else { self.value[i] }
    }

    /// Compute the step to the minimiser on the face, and the rates of the rows along it.
    pub(super) fn step_on_face(&mut self) -> Result<()> {
        let from = self.determined();
        if self.goal != Goal::Violation {
            let factor = if self.goal == Goal::Norm { 1.0 } else { self.factor_of_ascent(from) };
            let Inequalities { frame, step, .. } = self;
            step[..from].fill(0.0);
            step[from..].iter_mut().zip(frame.vector(frame.norm(), from)).for_each(|(p, c)| *p = -c * factor);
        } else {
            for at in 0..self.pulled.len() {
                self.right_side[at] = -self.distance(self.pulled[at]);
            }
            let Inequalities { frame, face, pulled, rule, right_side, step, .. } = self;
            face.factor(frame, pulled, &self.rows.size, from, *rule)?;
            face.solve(frame, pulled, right_side, step);
        }
        self.rates(from);
        Ok(())
    }

    /// Compute the rates of all rows and of `x` along a step that is zero before the coordinate `from`.
    pub(super) fn rates(&mut self, from: usize) {
        self.frame.products(from, &self.step, &mut self.rate);
    }

    /// Whether the whole step keeps the kept rows within their bounds, and does not change which rows are violated.
    pub(super) fn is_feasible_step(&self) -> bool {
        let length = self.length();
        self.watched.iter().filter(|i| self.moves(**i, length)).all(|&i| {
            let (value, lower, upper) = (self.value[i] + self.rate[i], self.rows.lower[i], self.rows.upper[i]);
            let slack = self.tolerance(i);
            match self.part[i] {
                Part::Own if lower == upper => true,
                Part::Own if self.side[i] > 0 => value >= upper - slack,
                Part::Own if self.side[i] < 0 => value <= lower + slack,
                Part::Own | Part::Kept => value <= upper + slack && value >= lower - slack,
                Part::Working | Part::Later | Part::Fixed => true,
            }
        })
    }

    /// Move `x` by `t` times the step, which is zero before the coordinate `from`, and whose rates are known.
    pub(super) fn advance(&mut self, from: usize, t: f64) {
        let Inequalities { frame, x, value, step, rate, penalties, .. } = self;
        axpy(t, &rate[..self.rows.len() + *penalties], value);
        axpy(t, &rate[frame.basis(0)..], x);
        if self.goal == Goal::Norm {
            let norm = frame.norm();
            step.iter().enumerate().skip(from).for_each(|(c, p)| frame[(c, norm)] += t * p);
        }
        self.reach = self.reach.max(dot(&self.x, &self.x).sqrt());
    }

    /// Return the length `t <= 1` of the step with the smallest goal along it, and the row that limits it, with the side of its bound. With
    /// `leaving`, rows that are at a bound do not limit the step.
    pub(super) fn line_search(&self, from: usize, leaving: bool) -> (f64, Option<(usize, i8)>) {
        let length = self.length();
        let (mut most, mut blocking) = (1.0, None);
        for &i in self.watched.iter().filter(|i| self.part[**i] == Part::Kept && self.moves(**i, length)) {
            let (value, rate, slack) = (self.value[i], self.rate[i], self.tolerance(i));
            let (bound, side) = if rate > 0.0 { (self.rows.upper[i], 1) } else { (self.rows.lower[i], -1) };
            let distance = (bound - value) * f64::from(side);
            if distance + slack < rate.abs() && !(leaving && distance <= slack) {
                let t = distance.max(0.0) / rate.abs();
                if t < most {
                    (most, blocking) = (t, Some((i, side)));
                }
            }
        }
        let slope = |t: f64| self.slope(from, t);
        if slope(most) <= 0.0 {
            return (most, blocking);
        }
        // The slope is piecewise linear, and increases. Its zero is between two neighbouring kinks.
        let (mut low, mut high) = ((0.0, slope(0.0)), (most, slope(most)));
        for &i in self.watched.iter().filter(|i| self.part[**i] == Part::Own && !self.rows.is_task(**i)) {
            for bound in [self.rows.lower[i], self.rows.upper[i]] {
                let t = (bound - self.value[i]) / self.rate[i];
                if t > low.0 && t < high.0 {
                    let s = slope(t);
                    *(if s <= 0.0 { &mut low } else { &mut high }) = (t, s);
                }
            }
        }
        let t = if high.1 > low.1 { low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1) } else { low.0 };
        (t.clamp(low.0, high.0), None)
    }

    /// The derivative of the goal along the step.
    fn slope(&self, from: usize, t: f64) -> f64 {
        if self.goal == Goal::Norm {
            let p = &self.step[from..];
            return self.frame.product(self.frame.norm(), from, p) + t * dot(p, p);
        }
        if self.goal == Goal::Scale {
            return -1.0;
        }
        let own = self.watched.iter().copied().filter(|i| self.part[*i] == Part::Own).map(|i| {
            let value = self.value[i] + t * self.rate[i];
            (value - value.max(self.rows.lower[i]).min(self.rows.upper[i])) * self.rate[i]
        });
        let rows = self.rows.len();
        let penalty = (rows..rows + self.penalties).map(|i| (self.value[i] + t * self.rate[i]) * self.rate[i]);
        own.chain(penalty).sum()
    }

    /// Hold row `i` at a bound.
    pub(super) fn hold(&mut self, i: usize, side: i8) {
        let at = self.determined();
        self.frame.reflect(i, at);
        self.working.push(i);
        self.touched = true;
        (self.part[i], self.side[i]) = (Part::Working, side);
        self.value[i] = self.bound(i);
    }

    /// Release working row number `j`. The triangle of the other rows is restored by rotations.
    pub(super) fn release(&mut self, j: usize) {
        let i = self.working.remove(j);
        (self.part[i], self.multiplier[i]) = (Part::Kept, 0.0);
        for at in j..self.working.len() {
            self.frame.rotate(self.working[at], self.frame.used + at);
        }
    }

    /// The component of the gradient of the goal along coordinate `at`.
    pub(super) fn gradient(&self, at: usize) -> f64 {
        let column = self.frame.coordinate(at);
        let forces = self.pulled.iter().map(|&i| self.distance(i) * column[i]);
        forces.sum::<f64>() + column[self.frame.norm()]
    }

    /// Compute the multipliers of the working rows by back substitution.
    pub(super) fn find_multipliers(&mut self) {
        self.solve_multipliers();
        let zero = self.zero_force();
        for &i in &self.working {
            if self.multiplier[i].abs() * self.rows.size[i] <= zero {
                self.multiplier[i] = 0.0;
            }
        }
    }

    /// Compute the multipliers of the working rows, without a limit for rounding errors.
    pub(super) fn solve_multipliers(&mut self) {
        let used = self.frame.used;
        for j in (0..self.working.len()).rev() {
            let forces = self.working[j + 1..].iter().map(|&i| self.multiplier[i] * self.frame[(used + j, i)]);
            let force = self.gradient(used + j) + forces.sum::<f64>();
            let i = self.working[j];
            self.multiplier[i] = -force / self.frame[(used + j, i)];
        }
    }

    /// The largest force that counts as a rounding error.
    fn zero_force(&self) -> f64 {
        match self.goal {
            Goal::Norm => return ZERO_FORCE * self.reach,
            Goal::Scale => return ZERO_FORCE,
            Goal::Violation => {}
        }
        let own = self.pulled.iter().filter(|i| **i < self.rows.len());
        let force = |&i: &usize| self.rows.size[i] * (ZERO_FORCE * self.distance(i).abs() + 10.0 * self.tolerance(i));
        own.map(force).fold(0.0, f64::max)
    }

    /// Return the number of the working row whose multiplier has the wrong sign and the largest force, if there is one.
    pub(super) fn worst_multiplier(&self) -> Option<usize> {
        let mut worst = (self.zero_force(), None);
        for (j, &i) in self.working.iter().enumerate() {
            let force = -self.multiplier[i] * f64::from(self.side[i]) * self.rows.size[i];
            let earlier = force == worst.0 && worst.1.is_some_and(|other: usize| i < self.working[other]);
            if force > worst.0 || earlier {
                worst = (force, Some(j));
            }
        }
        worst.1
    }

    /// Return the largest component of the gradient with the forces of the multipliers, divided by the largest term of the level. The rank
    /// rule counts the part of the gradient along a direction without rank as a rounding error.
    pub(super) fn stationarity(&self) -> f64 {
        let own = self.pulled.iter().filter(|i| **i < self.rows.len());
        let term = own.clone().map(|i| self.distance(*i).abs()).fold(0.0, f64::max);
        let mut largest = match self.goal {
            Goal::Norm => self.reach,
            Goal::Scale => 1.0,
            // The norm of the rule includes the penalties, which multiply the velocity but not the violations.
            Goal::Violation => (self.rows.frobenius[self.number] * term).max(self.rule.norm.powi(2) * self.reach),
        };
        for &i in &self.working {
            largest = largest.max(self.multiplier[i].abs() * self.rows.size[i]);
        }
        let rest = |at: usize| {
            let forces = self.working.iter().map(|&i| self.multiplier[i] * self.frame[(at, i)]);
            (self.gradient(at) + forces.sum::<f64>()).abs()
        };
        let rest = (self.frame.used..self.frame.n()).map(rest).fold(0.0, f64::max) - self.rule.cut() * term * (own.count() as f64).sqrt();
        if rest <= 0.0 { 0.0 } else { rest / largest.max(rest) }
    }
}
