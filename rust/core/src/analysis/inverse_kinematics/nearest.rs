//! The nearest position to targets that cannot all be reached: level by level, the highest priority first,
//!
//! `min 1/2 |e_k(q)|^2` over `q` within the joint limits.
//!
//! Reached levels above level `k` stay at their targets, and the other levels above it stay at their minimum.
//!
//! The conditions of Karush, Kuhn and Tucker hold at the result (`NocedalWright2006`, section 12.3). With the gradient `g = -J_k' e_k` and
//! the constraints `A dq = 0` of the levels above, `r = g - A' lambda` is zero for each joint between its limits. At a lower limit it is not
//! negative, and at an upper limit not positive. The steps are Newton steps in the null space of `A`, with an active set of limits. The
//! Hessian is the central difference of `r` with constant `lambda`. A level above that is not reached adds the rows `P H P` to `A`. `H` is
//! its Hessian, and `P` the projector on the null space of the levels above it.

use super::active_limits::{Constraints, Matrix, Vector, inverse, newton_step, null_space, release, without};
use super::attempt::{StartResult, better, clip, misses_of};
use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::interrupt;
use crate::kinematics::{TaskFunction, TaskStack};
use crate::status::Status;
use std::ops::Range;

/// Half the distance of the two points of a central difference, rad or m. Its error is about `DIFFERENCE^2`, relative to the Hessian.
const DIFFERENCE: f64 = 1e-5;
/// A reduced gradient below this fraction of `|J_k| |e_k|` counts as zero. Some ten rounding errors.
const STATIONARY: f64 = 1e-14;
/// A multiplier above this fraction of `|J_k| |e_k|` belongs to an active limit.
const ACTIVE: f64 = 1e-9;
/// An error of a level above may grow by this fraction of its square.
const GROWTH: f64 = 1e-9;
/// Largest number of halvings of one step.
const HALVINGS: usize = 30;
/// Number of steps whose decrease of the squared error is below its rounding error, before a level ends.
const FLAT_STEPS: usize = 3;
/// Largest number of Newton steps of one level.
const MOST_STEPS: usize = 50;

/// The steps for one arm and its tasks.
#[derive(Clone)]
pub(super) struct Nearest {
    stack: TaskStack,
    tolerance: f64,
    step_max: f64,
    most: usize,
}

/// The errors and the Jacobian of all tasks at one position, and the error of each task as in [`misses_of`].
struct Rows {
    e: Vector,
    j: Matrix,
    misses: Vec<f64>,
}

/// The targets of a search, its joint limits, and the levels that it reached.
pub(super) struct Targets<'a> {
    /// `[x_d, 0, 0]` of each task.
    pub desired: &'a [Vec<f64>],
    /// Lower and upper limit of each joint, rad or m.
    pub bounds: &'a [(f64, f64)],
    reached: Vec<bool>,
}

impl<'a> Targets<'a> {
    pub fn new(desired: &'a [Vec<f64>], bounds: &'a [(f64, f64)], found: &StartResult) -> Self {
        Targets { desired, bounds, reached: found.misses.iter().map(|miss| *miss == 0.0).collect() }
    }
}

impl Nearest {
    /// `max_iterations`: the largest number of steps of a search, see [`super::IkOptions`].
    pub fn new(arm: &Arm, functions: &[TaskFunction], tolerance: f64, step_max: f64, max_iterations: usize) -> Self {
        Nearest { stack: TaskStack::new(arm, functions.to_vec()), tolerance, step_max, most: max_iterations.clamp(1, MOST_STEPS) }
    }

    /// Move the position of `found` to the nearest one, unless a higher level then has a larger error. Errors: `Solve` if the square of an
    /// error overflows.
    pub fn improve(&mut self, mut goal: Targets, found: &mut StartResult, iterations: &mut usize) -> Result<()> {
        if found.misses.contains(&f64::INFINITY) {
            return Err(Error::Solve { status: Status::Diverged, t: 0.0, problem: "the square of an error overflows".into() });
        }
        let mut q = Vector::from_column_slice(&found.q);
        let mut fixed = vec![false; q.len()];
        let mut settled = true;
        for level in 0..goal.desired.len() {
            if !goal.reached[level] {
                settled &= self.minimise(level, &goal, &mut q, &mut fixed, iterations)?;
                goal.reached[level] = self.rows_of(&goal, &q).misses[level] == 0.0;
            }
        }
        let misses = self.rows_of(&goal, &q).misses;
        if q.iter().all(|q| q.is_finite()) && !better(&found.misses, &misses) {
            found.q.copy_from_slice(q.as_slice());
            found.misses.copy_from_slice(&misses);
            found.resting |= settled;
        }
        Ok(())
    }

    /// Minimise the error of one level from `q`. Return whether the steps ended at a minimum. On return `fixed` also has the joints whose
    /// limits are active for this level, so that lower levels do not move them.
    fn minimise(&mut self, level: usize, goal: &Targets, q: &mut Vector, fixed: &mut [bool], iterations: &mut usize) -> Result<bool> {
        let start = self.rows_of(goal, q);
        let above: Vec<f64> = (0..level).map(|j| self.cost(j, &start)).collect();
        let mut flat = 0;
        for _ in 0..self.most {
            interrupt::check();
            let here = self.rows_of(goal, q);
            let (range, constraints) = (self.range(level), self.constraints(level, goal, (q, &here), fixed)?);
            let (e, j) = (here.e.rows_range(range.clone()), here.j.rows_range(range));
            let (g, scale) = (-(j.transpose() * e), e.norm() * j.norm());
            let mut held: Vec<bool> = (0..q.len()).map(|i| fixed[i] || q[i] <= goal.bounds[i].0 || q[i] >= goal.bounds[i].1).collect();
            let (lambda, r) = release(&constraints.a, &g, q, goal.bounds, fixed, ACTIVE * scale, &mut held)?;
            let reduced = (0..q.len()).filter(|&i| !held[i]).fold(0.0, |most: f64, i| most.max(r[i].abs()));
            let astray = constraints.c.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
            if (reduced <= STATIONARY * scale && astray <= self.tolerance) || flat >= FLAT_STEPS {
                (0..q.len()).for_each(|i| fixed[i] |= held[i] && r[i].abs() > ACTIVE * scale);
                return Ok(true);
            }
            let hessian = self.hessian(level, goal, q, &constraints, &lambda);
            let dq = newton_step(&hessian, &g, &constraints, q, goal.bounds, &mut held)?;
            *iterations += 1;
            let before = 0.5 * e.norm_squared();
            let Some((next, cost)) = self.line_search(level, goal, (q, before), &dq, &held, &above)? else {
                return Ok(reduced <= ACTIVE.sqrt() * scale);
            };
            flat = if cost < before * (1.0 - 1e-13) { 0 } else { flat + 1 };
            q.copy_from(&next);
        }
        Ok(false)
    }

    /// Shorten the step `dq` from `q` until the error of the level does not grow from `before`, and the levels above keep their errors.
    /// `None` if no step does.
    fn line_search(
        &mut self,
        level: usize,
        goal: &Targets,
        (q, before): (&Vector, f64),
        dq: &Vector,
        held: &[bool],
        above: &[f64],
    ) -> Result<Option<(Vector, f64)>> {
        let mut scale = (self.step_max / dq.amax()).min(1.0);
        for _ in 0..HALVINGS {
            let mut next = q + dq * scale;
            clip(next.as_mut_slice(), goal.bounds);
            self.restore(level, goal, &mut next, held)?;
            let there = self.rows_of(goal, &next);
            let cost = self.cost(level, &there);
            let higher_levels_hold = (0..level)
                .all(|j| if goal.reached[j] { there.misses[j] == 0.0 } else { self.cost(j, &there) <= above[j] * (1.0 + GROWTH) });
            if higher_levels_hold && cost <= before * (1.0 + f64::EPSILON) {
                return Ok(Some((next, cost)));
            }
            scale *= 0.5;
        }
        Ok(None)
    }

    /// Bring the reached levels above `level` back to their targets, by Newton steps of the joints that are not held.
    fn restore(&mut self, level: usize, goal: &Targets, q: &mut Vector, held: &[bool]) -> Result<()> {
        for _ in 0..4 {
            let here = self.rows_of(goal, q);
            let levels: Vec<usize> = (0..level).filter(|&j| goal.reached[j]).collect();
            if levels.iter().all(|&j| here.misses[j] == 0.0) {
                break;
            }
            let rows: Vec<usize> = levels.iter().flat_map(|&j| self.range(j)).collect();
            let a = without(here.j.select_rows(&rows), held);
            *q += inverse(&a)? * here.e.select_rows(&rows);
            clip(q.as_mut_slice(), goal.bounds);
        }
        Ok(())
    }

    /// The constraints of the levels above `level` at `q`, with the errors and Jacobians `here`. The columns of the joints `fixed` are zero.
    fn constraints(&mut self, level: usize, goal: &Targets, (q, here): (&Vector, &Rows), fixed: &[bool]) -> Result<Constraints> {
        let mut found = Constraints { a: Matrix::zeros(0, q.len()), c: Vector::zeros(0), jacobians: Vec::new() };
        for j in 0..level {
            let range = self.range(j);
            let (e, jacobian) = (here.e.rows_range(range.clone()).into_owned(), here.j.rows_range(range).into_owned());
            if goal.reached[j] {
                let (rows, factor) = found.append(without(jacobian, fixed), e);
                found.jacobians.push((rows, j, factor));
                continue;
            }
            let g = -(jacobian.transpose() * e);
            let lambda = inverse(&found.a.transpose())? * &g;
            let z = null_space(&found.a, fixed)?;
            let (projector, hessian) = (&z * z.transpose(), self.hessian(j, goal, q, &found, &lambda));
            found.append(&projector * hessian * &projector, -(&projector * g));
        }
        Ok(found)
    }

    /// The derivative of `g_k - A' lambda` by the joint positions, with the constant multipliers `lambda`, `(n, n)`. Only the rows of `A`
    /// that are Jacobians of levels vary with the position.
    fn hessian(&mut self, level: usize, goal: &Targets, q: &Vector, constraints: &Constraints, lambda: &Vector) -> Matrix {
        let n = q.len();
        let mut slope = |q: &Vector| {
            let here = self.rows_of(goal, q);
            let range = self.range(level);
            let mut g = -(here.j.rows_range(range.clone()).transpose() * here.e.rows_range(range));
            for (rows, j, factor) in &constraints.jacobians {
                g -= here.j.rows_range(self.range(*j)).transpose() * (lambda.rows_range(rows.clone()) * *factor);
            }
            g
        };
        let mut hessian = Matrix::zeros(n, n);
        for i in 0..n {
            let step = Vector::from_fn(n, |row, _| if row == i { DIFFERENCE } else { 0.0 });
            hessian.set_column(i, &((slope(&(q + &step)) - slope(&(q - &step))) / (2.0 * DIFFERENCE)));
        }
        0.5 * (&hessian + hessian.transpose())
    }

    fn rows_of(&mut self, goal: &Targets, q: &Vector) -> Rows {
        let rows: usize = self.stack.rows().iter().sum();
        let (mut e, mut w, mut j) = (Vector::zeros(rows), vec![0.0; rows], vec![0.0; rows * q.len()]);
        self.stack.place(q.as_slice());
        for (k, desired) in goal.desired.iter().enumerate() {
            let range = self.range(k);
            self.stack.error(k, desired, &mut e.as_mut_slice()[range.clone()], &mut w[range], None);
        }
        self.stack.jacobians(&mut j);
        let mut misses = vec![0.0; goal.desired.len()];
        misses_of(e.as_slice(), self.stack.rows(), self.tolerance, &mut misses);
        Rows { e, j: Matrix::from_row_slice(rows, q.len(), &j), misses }
    }

    /// Half the squared error of a level.
    fn cost(&self, level: usize, rows: &Rows) -> f64 {
        0.5 * rows.e.rows_range(self.range(level)).norm_squared()
    }

    fn range(&self, level: usize) -> Range<usize> {
        let first = self.stack.rows()[..level].iter().sum();
        first..first + self.stack.rows()[level]
    }
}
