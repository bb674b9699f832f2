//! The conditions of Karush, Kuhn and Tucker of velocities that no bound restricts. The gradient of level `k` is `g_k = A_k' w_k` with
//! `w_k = A_k v - v_k`. The last level is the smallest norm, with `g = v`. The rows `a_i` of the levels above must balance the gradient,
//! `g_k + sum lambda_i a_i = 0`, with multipliers of any sign. The certificate is the largest residual, divided by the largest term of its
//! level.
//!
//! The rows are divided by their norms and made orthogonal, level by level, the longest remaining row first. A remaining row counts by the
//! rank rule of the module. So near a singularity the multipliers are large, and the residual is compared with them.

use crate::error::Result;
use crate::linalg::{axpy, dot, largest};
use crate::priority::settings::Settings;
use crate::priority::stack::{Level, ScaledStack, Stack};
use nalgebra::{DMatrix, DVector};

/// The conditions of a stack, with their memory.
#[derive(Debug, Clone)]
pub struct Conditions {
    scaled: ScaledStack,
    /// The velocities in the coordinates of the metric.
    v: Vec<f64>,
    above: Above,
}

/// The rows of the levels so far, as orthonormal directions.
#[derive(Debug, Clone)]
struct Above {
    /// The directions as columns, of which the first `used` exist.
    directions: DMatrix<f64>,
    used: usize,
    /// Column `j` has the components of a row along the directions up to `j`.
    triangle: DMatrix<f64>,
    /// The rows of a level, divided by their norms, without the parts along the directions. Column `j` of `parts` has these parts.
    remaining: DMatrix<f64>,
    parts: DMatrix<f64>,
    gradient: DVector<f64>,
    forces: DVector<f64>,
    /// The condition number of the rows.
    condition: f64,
}

impl Conditions {
    /// Allocate memory for stacks of the size of `stack`.
    pub fn new(stack: &Stack) -> Self {
        Conditions { scaled: ScaledStack::new(stack), v: vec![0.0; stack.n], above: Above::new(stack) }
    }

    /// Return the certificate of `v`, shape `(n,)`. It is NaN if `v` is not finite. Errors: `Input` for numbers that are not finite.
    pub fn certificate(&mut self, stack: &Stack, settings: &Settings, v: &[f64]) -> Result<f64> {
        let Conditions { scaled, v: coordinates, above } = self;
        if !largest(v).is_finite() {
            return Ok(f64::NAN);
        }
        coordinates.copy_from_slice(v);
        settings.metric.iter().for_each(|metric| metric.coordinates(coordinates));
        scaled.load(stack, settings)?;
        (above.used, above.condition) = (0, 1.0);
        let (size, mut worst) = (dot(coordinates, coordinates).sqrt(), 0.0f64);
        for level in scaled.levels() {
            let (mut most, norm) = (0.0f64, dot(level.jacobian, level.jacobian).sqrt());
            above.gradient.fill(0.0);
            for (row, command) in level.jacobian_rows().zip(level.command) {
                let w = dot(row, coordinates) - command;
                axpy(w, row, above.gradient.as_mut_slice());
                most = most.max(w.abs());
            }
            // The rank rule counts a part of the gradient as a rounding error.
            let error = settings.rounding * above.condition * norm * most * (level.rows() as f64).sqrt();
            worst = worst.max(above.residual(norm * most.max(norm * size), error));
            above.add(&level, settings.rounding);
        }
        above.gradient.copy_from_slice(coordinates);
        Ok(worst.max(above.residual(size, 0.0)))
    }
}

impl Above {
    /// Allocate memory for the levels of a stack.
    fn new(stack: &Stack) -> Self {
        let (n, most) = (stack.n, stack.rows.iter().copied().max().unwrap_or(0));
        let [directions, triangle] = [0; 2].map(|_| DMatrix::zeros(n, n));
        let [remaining, parts] = [0; 2].map(|_| DMatrix::zeros(n, most));
        let [gradient, forces] = [0; 2].map(|_| DVector::zeros(n));
        Above { directions, used: 0, triangle, remaining, parts, gradient, forces, condition: 1.0 }
    }

    /// Balance the gradient by the rows. Return the largest component of the remaining gradient beyond `error`,
    /// divided by `term` or the largest force.
    fn residual(&mut self, term: f64, error: f64) -> f64 {
        let Above { directions, used, triangle, gradient, forces, .. } = self;
        forces.fill(0.0);
        remove(directions, *used, gradient.as_mut_slice(), forces.as_mut_slice());
        for i in (0..*used).rev() {
            let later: f64 = (i + 1..*used).map(|j| forces[j] * triangle[(i, j)]).sum();
            forces[i] = -(forces[i] + later) / triangle[(i, i)];
        }
        let remaining = largest(gradient.as_slice()) - error;
        if remaining <= 0.0 { 0.0 } else { remaining / largest(&forces.as_slice()[..*used]).max(term).max(remaining) }
    }

    /// Add the rows of a level to the directions.
    fn add(&mut self, level: &Level, rounding: f64) {
        let Above { directions, used, triangle, remaining, parts, condition, .. } = self;
        let (n, m, cut, mut shortest) = (level.n, level.rows(), rounding * *condition, 1.0f64);
        parts.fill(0.0);
        for (j, row) in level.jacobian_rows().enumerate() {
            let norm = dot(row, row).sqrt();
            remaining.column_mut(j).iter_mut().zip(row).for_each(|(to, x)| *to = if norm > 0.0 { x / norm } else { 0.0 });
            remove(directions, *used, column(remaining, j), column(parts, j));
        }
        while *used < n {
            let lengths = (0..m).map(|j| (remaining.column(j).norm(), j));
            let (length, j) = lengths.fold((0.0, 0), |longest, other| if other.0 > longest.0 { other } else { longest });
            if length <= cut {
                break;
            }
            triangle.column_mut(*used).copy_from(&parts.column(j));
            triangle[(*used, *used)] = length;
            directions.column_mut(*used).copy_from(&(remaining.column(j) / length));
            remaining.column_mut(j).fill(0.0);
            *used += 1;
            shortest = shortest.min(length);
            for j in 0..m {
                remove(directions, *used, column(remaining, j), column(parts, j));
            }
        }
        *condition /= shortest;
    }
}

/// Column `j` of a matrix.
fn column(all: &mut DMatrix<f64>, j: usize) -> &mut [f64] {
    let n = all.nrows();
    &mut all.as_mut_slice()[j * n..(j + 1) * n]
}

/// Remove the parts of `x` along the first `used` directions, and add them to `parts`. The second pass removes the rounding errors of the
/// first.
fn remove(directions: &DMatrix<f64>, used: usize, x: &mut [f64], parts: &mut [f64]) {
    for _ in 0..2 {
        for (q, sum) in directions.as_slice().chunks_exact(x.len()).take(used).zip(&mut *parts) {
            let part = dot(q, x);
            axpy(-part, q, x);
            *sum += part;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::priority::method::{PriorityMethod, PriorityOptions};

    /// The certificate of `v` for levels of one row of two joints.
    fn certificate(jacobian: &[f64], command: &[f64], v: &[f64]) -> f64 {
        let rows = vec![1; command.len()];
        let settings = Settings::new(2, rows.len(), &PriorityOptions::new(PriorityMethod::Exact)).unwrap();
        let mut stack = Stack::new(2, &rows);
        stack.jacobian.copy_from_slice(jacobian);
        stack.command.copy_from_slice(command);
        Conditions::new(&stack).certificate(&stack, &settings, v).unwrap()
    }

    #[test]
    fn a_missed_task_is_balanced_only_by_tasks_above() {
        // The first task is met, and the second one is the same row with another command.
        assert!(certificate(&[1.0, 1.0, 2.0, 2.0], &[2.0, 9.0], &[1.0, 1.0]) < 1e-15);
        // The second task is met instead of the first one.
        assert!(certificate(&[1.0, 1.0, 2.0, 2.0], &[2.0, 9.0], &[2.25, 2.25]) > 0.1);
        // A shorter solution exists. The rows differ by 1e-12, and both tasks are met with a large velocity.
        assert!(certificate(&[1.0, 1.0], &[2.0], &[2.0, 0.0]) > 0.1);
        assert!(certificate(&[1.0, 1.0, 1.0, 1.0 + 1e-12], &[2.0, 3.0], &[2.0 - 1e12, 1e12]) < 1e-4);
        assert!(certificate(&[1.0, 1.0], &[2.0], &[f64::NAN, 0.0]).is_nan());
    }
}
