//! The result of the search from one start, and functions that `damped` and `newton` share.

use crate::linalg::dot;

/// A step aims to move each joint by at most this fraction of its distance to the middle of its range. Errors below 1 (m or rad) reduce the
/// fraction, so that the last steps are Newton steps.
pub(super) const CENTRING: f64 = 0.2;

#[derive(Clone, Debug, Default)]
pub(super) struct StartResult {
    /// Joint positions, `(n,)`, rad or m.
    pub q: Vec<f64>,
    /// Norm of the error of each task, m or rad; zero where the task is reached.
    pub misses: Vec<f64>,
    /// Whether the search ended at the goal or without progress. It is false after the largest number of steps.
    pub resting: bool,
}

impl StartResult {
    /// Whether every task is reached.
    pub fn reached(&self) -> bool {
        self.misses.iter().all(|miss| *miss == 0.0)
    }
}

/// Whether the task errors `a` are smaller than `b` at the first task in which they differ.
pub(super) fn better(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).find(|(a, b)| a != b).is_some_and(|(a, b)| a < b)
}

/// The norm of the error of each task, zero where every entry is within the tolerance. An error that is not a number is infinite.
pub(super) fn misses_of(e: &[f64], rows: &[usize], tolerance: f64, misses: &mut [f64]) {
    let mut at = 0;
    for (miss, &m) in misses.iter_mut().zip(rows) {
        let e = &e[at..at + m];
        let size = dot(e, e).sqrt();
        *miss = if largest(e) <= tolerance && !size.is_nan() { 0.0 } else { size.min(f64::INFINITY) };
        at += m;
    }
}

/// Compute the motion `z` towards the middle of the ranges, for joints that have a range. `far` is the largest error.
pub(super) fn aim_at_middle(q: &[f64], bounds: &[(f64, f64)], far: f64, z: &mut [f64]) {
    let centring = CENTRING * far.min(1.0);
    for ((z, q), (lower, upper)) in z.iter_mut().zip(q).zip(bounds) {
        *z = if (upper - lower).is_finite() { centring * (0.5 * (lower + upper) - q) } else { 0.0 };
    }
}

/// Hold the joints at a limit that the motion `v` would cross. Return whether another joint is now held.
pub(super) fn blocked(q: &[f64], v: &[f64], bounds: &[(f64, f64)], held: &mut [bool]) -> bool {
    let mut more = false;
    for (i, (lower, upper)) in bounds.iter().enumerate() {
        if !held[i] && ((q[i] <= *lower && v[i] < 0.0) || (q[i] >= *upper && v[i] > 0.0)) {
            (held[i], more) = (true, true);
        }
    }
    more
}

/// Move `q` by `v`, no joint by more than `step_max`, and none beyond its limits. Return the largest motion of a joint.
pub(super) fn advance(q: &mut [f64], v: &[f64], bounds: &[(f64, f64)], step_max: f64) -> f64 {
    let most = v.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let scale = if most > step_max { step_max / most } else { 1.0 };
    let mut moved = 0.0f64;
    for ((q, v), (lower, upper)) in q.iter_mut().zip(v).zip(bounds) {
        let next = (*q + scale * v).max(*lower).min(*upper);
        moved = moved.max((next - *q).abs());
        *q = next;
    }
    moved
}

/// The largest absolute value of an entry.
pub(super) fn largest(e: &[f64]) -> f64 {
    e.iter().fold(0.0, |most, e| most.max(e.abs()))
}

pub(super) fn clip(q: &mut [f64], bounds: &[(f64, f64)]) {
    for (q, (lower, upper)) in q.iter_mut().zip(bounds) {
        *q = q.max(*lower).min(*upper);
    }
}
