//! Steps for all tasks together, damped by the size of the error (`sugihara2011solvability`):
//!
//! `dq = z + J' (J J' + (0.3 |e|^2 + floor) 1)^-1 (e - J z)`,  with the motion `z` towards the middle of the ranges.
//!
//! `1` is the identity matrix. `J` and `e` have the rows of all tasks. Each row is divided by the largest norm of its Jacobian row at
//! sampled positions. So `e` has the unit of joint positions. Far from the goal, the damping shortens steps along directions with small
//! singular values. Near the goal, the damping decreases faster than the error, so a step approaches a Newton step. No singular values are
//! computed. With more rows than joints, the same step is computed from `J' J`.

use super::super::uniform::{mirror, within};
use super::attempt::{StartResult, advance, aim_at_middle, better, blocked, clip, largest, misses_of};
use crate::arm::Arm;
use crate::interrupt;
use crate::kinematics::{TaskFunction, TaskStack};
use crate::linalg::dot;

/// The damping divided by the squared error. Half of this value requires more random starts. Three times this value requires more steps.
const DAMPING: f64 = 0.3;
/// The smallest damping, divided by the largest diagonal entry of `J J'` or `J' J`. It prevents a singular matrix for linearly dependent
/// rows.
const FLOOR: f64 = 1e-12;
/// If the square of the error decreases by less than this fraction in `PROGRESS_STEPS` steps, a start ends.
const PROGRESS: f64 = 0.02;
const PROGRESS_STEPS: usize = 8;
/// Number of pairs of positions at which the norms of Jacobian rows are computed. The positions of a pair are mirror images, so that a
/// mirrored arm has the same norms.
const SAMPLES: usize = 4;

/// Damped steps of one arm and its tasks.
#[derive(Clone)]
pub(super) struct Damped {
    stack: TaskStack,
    /// For each row of the Jacobian, the reciprocal of its largest norm at the sampled positions, `(rows,)`.
    weights: Vec<f64>,
    e: Vec<f64>,
    w: Vec<f64>,
    /// Weighted Jacobian, `(rows, n)`. The columns of held joints are zero.
    j: Vec<f64>,
    /// The matrix of the step, `(k, k)`, and later its Cholesky factor. `k` is the smaller one of the numbers of rows and joints.
    gram: Vec<f64>,
    y: Vec<f64>,
    /// The error without the part that the centring motion `z` changes, `e - J z`, `(rows,)`.
    remaining_error: Vec<f64>,
    z: Vec<f64>,
    dq: Vec<f64>,
    held: Vec<bool>,
    misses: Vec<f64>,
}

/// The limits of the search from one start: positions, tolerance of errors, length of a step, and number of steps.
pub(super) struct Reach<'a> {
    /// Lower and upper limit of each joint, rad or m.
    pub bounds: &'a [(f64, f64)],
    pub tolerance: f64,
    pub step_max: f64,
    pub max_iterations: usize,
}

impl Damped {
    /// Create the steps for these tasks. The norms of Jacobian rows are computed at positions within `bounds`.
    pub fn new(arm: &Arm, functions: &[TaskFunction], bounds: &[(f64, f64)], angles: &[bool]) -> Self {
        let (n, rows) = (arm.n(), functions.iter().map(TaskFunction::rows).sum());
        let k = n.min(rows);
        let mut damped = Damped {
            stack: TaskStack::new(arm, functions.to_vec()),
            weights: vec![0.0; rows],
            e: vec![0.0; rows],
            w: vec![0.0; rows],
            j: vec![0.0; rows * n],
            gram: vec![0.0; k * k],
            y: vec![0.0; k],
            remaining_error: vec![0.0; rows],
            z: vec![0.0; n],
            dq: vec![0.0; n],
            held: vec![false; n],
            misses: vec![0.0; functions.len()],
        };
        let (mut state, mut q, zeros) = (0, vec![0.0; n], vec![0.0; n]);
        for k in 0..2 * SAMPLES {
            interrupt::check();
            match k % 2 {
                0 => within(bounds, angles, &zeros, &mut state, &mut q),
                _ => mirror(bounds, angles, &zeros, &mut q),
            }
            damped.stack.place(&q);
            damped.stack.jacobians(&mut damped.j);
            for (weight, row) in damped.weights.iter_mut().zip(damped.j.chunks_exact(n)) {
                *weight = weight.max(dot(row, row).sqrt());
            }
        }
        damped.weights.iter_mut().for_each(|size| *size = if *size > 0.0 && size.is_finite() { 1.0 / *size } else { 1.0 });
        damped
    }

    /// Take steps from `q`, within the limits, until all tasks are reached, progress ends, or the largest number of steps is taken. The
    /// best result is written to `found`. Return false after the largest number of steps.
    pub fn descend(&mut self, q: &mut [f64], desired: &[Vec<f64>], reach: &Reach, found: &mut StartResult, iterations: &mut usize) -> bool {
        let (mut mark, mut since) = (f64::INFINITY, 0);
        clip(q, reach.bounds);
        for _ in 0..reach.max_iterations.max(1) {
            interrupt::check();
            self.look_at(q, desired, reach.tolerance, found);
            if self.misses.iter().all(|miss| *miss == 0.0) {
                return true;
            }
            let far = largest(&self.e);
            self.e.iter_mut().zip(&self.weights).for_each(|(e, weight)| *e *= weight);
            let size = dot(&self.e, &self.e);
            if size < (1.0 - PROGRESS) * mark {
                (mark, since) = (size, 0);
            } else {
                since += 1;
            }
            let moved = self.step(q, reach, far, size);
            *iterations += 1;
            if moved <= 1e-3 * reach.tolerance || since >= PROGRESS_STEPS {
                return true;
            }
        }
        // The loop does not compute the errors after its last step.
        self.look_at(q, desired, reach.tolerance, found);
        false
    }

    /// Compute the errors at `q` and the largest error of each task, and keep the best result in `found`.
    fn look_at(&mut self, q: &[f64], desired: &[Vec<f64>], tolerance: f64, found: &mut StartResult) {
        self.stack.place(q);
        let mut at = 0;
        for (k, desired) in desired.iter().enumerate() {
            let m = self.stack.rows()[k];
            self.stack.error(k, desired, &mut self.e[at..at + m], &mut self.w[at..at + m], None);
            at += m;
        }
        misses_of(&self.e, self.stack.rows(), tolerance, &mut self.misses);
        if better(&self.misses, &found.misses) {
            found.q.copy_from_slice(q);
            found.misses.copy_from_slice(&self.misses);
        }
    }

    /// Take one step from `q`, where `look_at` has placed the bodies. `far` is the largest error, and `size` the squared norm of the
    /// weighted error. Return the largest motion of a joint.
    fn step(&mut self, q: &mut [f64], reach: &Reach, far: f64, size: f64) -> f64 {
        let n = q.len();
        self.stack.jacobians(&mut self.j);
        for (row, weight) in self.j.chunks_exact_mut(n).zip(&self.weights) {
            row.iter_mut().for_each(|entry| *entry *= weight);
        }
        aim_at_middle(q, reach.bounds, far, &mut self.z);
        self.held.fill(false);
        // Every pass holds at least one more joint, so at most n + 1 passes are necessary.
        loop {
            self.solve(size);
            if !blocked(q, &self.dq, reach.bounds, &mut self.held) {
                break;
            }
            for (i, _) in self.held.iter().enumerate().filter(|(_, held)| **held) {
                self.z[i] = 0.0;
                self.j.chunks_exact_mut(n).for_each(|row| row[i] = 0.0);
            }
        }
        advance(q, &self.dq, reach.bounds, reach.step_max)
    }

    /// Compute the step `dq` from the weighted Jacobian, the weighted error and the centring motion `z`.
    fn solve(&mut self, size: f64) {
        let Damped { j, gram, y, remaining_error, z, dq, e, .. } = self;
        let n = dq.len();
        for ((remaining, row), e) in remaining_error.iter_mut().zip(j.chunks_exact(n)).zip(&*e) {
            *remaining = e - dot(row, z);
        }
        dq.copy_from_slice(z);
        if e.len() <= n {
            let k = e.len();
            for r in 0..k {
                for c in 0..=r {
                    gram[r * k + c] = dot(&j[r * n..(r + 1) * n], &j[c * n..(c + 1) * n]);
                }
            }
            y.copy_from_slice(remaining_error);
            solve_damped(gram, y, size);
            for (y, row) in y.iter().zip(j.chunks_exact(n)) {
                dq.iter_mut().zip(row).for_each(|(dq, entry)| *dq += y * entry);
            }
        } else {
            gram.fill(0.0);
            y.fill(0.0);
            for (row, remaining) in j.chunks_exact(n).zip(&*remaining_error) {
                for r in 0..n {
                    y[r] += row[r] * remaining;
                    for c in 0..=r {
                        gram[r * n + c] += row[r] * row[c];
                    }
                }
            }
            solve_damped(gram, y, size);
            dq.iter_mut().zip(&*y).for_each(|(dq, y)| *dq += y);
        }
    }
}

/// Compute `y <- (A + d 1)^-1 y` by Cholesky's method. `a` has the lower half of the symmetric `A`. The damping `d` follows from the
/// squared error `size`.
fn solve_damped(a: &mut [f64], y: &mut [f64], size: f64) {
    let k = y.len();
    let most = (0..k).fold(0.0, |most: f64, r| most.max(a[r * k + r]));
    let damping = DAMPING * size + FLOOR * most;
    for r in 0..k {
        let (above, own) = a.split_at_mut(r * k);
        for c in 0..r {
            let row = &above[c * k..(c + 1) * k];
            own[c] = (own[c] - dot(&own[..c], &row[..c])) / row[c];
        }
        // For finite numbers, the damping keeps this pivot positive. `max` replaces NaN, so that a start with NaN ends without progress.
        own[r] = (own[r] + damping - dot(&own[..r], &own[..r])).max(f64::MIN_POSITIVE).sqrt();
        y[r] = (y[r] - dot(&own[..r], &y[..r])) / own[r];
    }
    for r in (0..k).rev() {
        y[r] /= a[r * k + r];
        let known = y[r];
        y[..r].iter_mut().zip(&a[r * k..]).for_each(|(y, entry)| *y -= entry * known);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compare with the equation itself: random matrices, a singular matrix, and a matrix of zeros.
    #[test]
    fn the_damped_equation_is_solved() {
        let mut state = 7;
        for (k, rank) in [(1, 1), (3, 3), (6, 6), (6, 2), (4, 0)] {
            let mut rows = vec![0.0; k * rank];
            rows.iter_mut().for_each(|x| *x = super::super::super::uniform::uniform(&mut state) - 0.5);
            let full: Vec<f64> = (0..k * k).map(|i| (0..rank).map(|c| rows[i / k * rank + c] * rows[i % k * rank + c]).sum()).collect();
            let right: Vec<f64> = (0..k).map(|i| 1.0 + i as f64).collect();
            let (mut a, mut y) = (full.clone(), right.clone());
            solve_damped(&mut a, &mut y, 0.1);
            for r in 0..k {
                let left = dot(&full[r * k..(r + 1) * k], &y) + 0.03 * y[r];
                // The tolerance covers rounding errors divided by the damping, 0.03, and the floor of 1e-12.
                assert!((left - right[r]).abs() < 1e-9, "{k} {rank}: {left} {}", right[r]);
            }
        }
    }

    /// The matrices `J J'` and `J' J` give the same step. The test has two and four rows for three joints, and then three and six rows.
    #[test]
    fn both_matrices_have_the_same_step() {
        let arm = Arm::planar(&[0.5, 0.4, 0.3], None, None, None, [0.0, -9.81]).unwrap();
        let bounds = [(-3.0, 3.0); 3];
        let step = |functions: &[TaskFunction], desired: &[Vec<f64>]| {
            let mut damped = Damped::new(&arm, functions, &bounds, &[true; 3]);
            let mut q = vec![0.3, 0.4, 0.5];
            let reach = Reach { bounds: &bounds, tolerance: 1e-9, step_max: 10.0, max_iterations: 1 };
            let mut found = StartResult { q: q.clone(), misses: vec![f64::INFINITY; functions.len()], resting: false };
            damped.descend(&mut q, desired, &reach, &mut found, &mut 0);
            q
        };
        for (axes, aim) in [("xy", vec![0.6, 0.5, 0.0, 0.0, 0.0, 0.0]), ("xy rz", vec![0.6, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])] {
            let tip = TaskFunction::frame(&arm, "link3", axes).unwrap();
            let plain = step(std::slice::from_ref(&tip), std::slice::from_ref(&aim));
            // Two equal tasks double J'J and the squared error.
            let twice = step(&[tip.clone(), tip], &[aim.clone(), aim]);
            let gap = plain.iter().zip(&twice).fold(0.0, |gap: f64, (a, b)| gap.max((a - b).abs()));
            // The damping doubles like J'J, so the steps differ only by the floor.
            assert!(gap < 1e-9, "{axes}: {plain:?} {twice:?}");
        }
    }
}
