//! The check of a profile (the squared path speed `x` at all grid points) against its limits between grid points. A *row* is one limited
//! quantity, for example the torque of one joint.
//!
//! Every segment is sampled at ten steps. Between samples `k` and `k + 1`, the largest value of a row with the samples `f_k` is estimated
//! as
//!
//! ```text
//! max(f_k, f_(k+1)) + (d/2 - |f_(k+1) - f_k|)^2 / (2 d)   if |f_(k+1) - f_k| < d/2,   d = max |second difference| there
//! ```
//!
//! If the condition is false, the estimate is `max(f_k, f_(k+1))`. For a parabola the estimate is exact. The second differences at the ends
//! of the segment are extrapolated from the two next to them.
//!
//! Where a row exceeds its limit, the limit is reduced on that segment by a multiple of the excess. The profile obeys the rows at three
//! points of a segment. So the excess between them is small on a fine grid. Samples are computed by the dynamics, or interpolated by
//! polynomials through the rows at six grid points. Before a profile is accepted, interpolated torques are compared with the dynamics in
//! the middle of every interpolated segment.

use super::lines::LimitRows;
use super::problem::PathProblem;
use super::rows::{Points, Request};
use super::tuning::CHECK_STEPS;
use crate::scalar::sign;

/// The result of the check of a profile.
#[derive(Clone, Copy, Debug)]
pub(super) struct LimitCheck {
    /// Smallest relative distance of a sample to a limit; negative if a sample exceeds its limit.
    pub margin: f64,
    /// Largest relative excess, including the estimate between samples.
    pub excess: f64,
    /// The segment and the row of the largest excess.
    pub at: (usize, usize),
}

/// Squared path speed and path acceleration at the fraction `z` of segment `i`.
#[inline(always)]
pub(super) fn state(rows: &LimitRows, x: &[f64], i: usize, z: f64) -> (f64, f64) {
    let (h, b) = (rows.s[i + 1] - rows.s[i], rows.u_slope[i]);
    let here = if z == 1.0 { x[i + 1] } else { x[i] + z * (x[i + 1] - x[i]) - z * (1.0 - z) * h * h * b };
    (here.max(0.0), 0.5 * (x[i + 1] - x[i]) / h + (z - 0.5) * h * b)
}

/// Compute `[tau, a, v]`, `(3 n,)`, and the frame's acceleration and velocity by the dynamics. A quantity whose limit varies is divided by
/// this limit.
///
/// Each listed segment has `per` places. One place is the middle of the segment. Several places are samples at equal time steps of a motion
/// with constant `u`. Equal steps in `s` would not suffice near rest, because viscous friction is proportional to `sqrt(x)`, which is not a
/// parabola in `s`.
pub(super) fn measure(problem: &PathProblem, x: &[f64], list: &[usize], per: usize, values: &mut Vec<f64>) {
    let PathProblem { n, mover, path, rows, along, pieces, .. } = problem;
    let (n, stride) = (*n, problem.measured());
    let count = list.len() * per;
    values.clear();
    values.resize(count * stride, 0.0);
    if count == 0 {
        return;
    }
    let s = &rows.s;
    let place = |k: usize| {
        let (i, t) = (list[k / per], (k % per) as f64 / CHECK_STEPS as f64);
        let (from, to) = (x[i].sqrt(), x[i + 1].sqrt());
        // If the speed is zero at both ends of the segment, no motion has constant `u`. Then the places have equal steps in `s`.
        let even = if from + to > 0.0 { t * (2.0 * from + t * (to - from)) / (from + to) } else { t };
        (i, if per == 1 { 0.5 } else { even.min(1.0) })
    };
    let at = |k: usize| {
        let (i, z) = place(k);
        (pieces[i], if z == 1.0 { s[i + 1] } else { s[i] + z * (s[i + 1] - s[i]) })
    };
    let rate = |k: usize| {
        let (i, z) = place(k);
        let (x, u) = state(rows, x, i, z);
        (x.sqrt(), u)
    };
    let (request, tip) = (Request::Motion { rate: &rate }, problem.tip.as_ref().map(|tip| (tip.frame, along)));
    Points { mover: *mover, path, at: &at, count, stride, out: values, request, tip }.run();
    if let Some(friction) = &problem.friction {
        for row in values.chunks_exact_mut(stride) {
            for j in 0..n {
                let v = row[2 * n + j];
                row[j] += friction.viscous[j] * v + friction.coulomb[j] * sign(v);
            }
        }
    }
    if along.any() {
        for (k, row) in values.chunks_exact_mut(stride).enumerate() {
            let (piece, s) = at(k);
            for kind in 0..3 {
                (0..n).for_each(|j| row[kind * n + j] /= along.limit(path, kind, j, piece, s));
            }
        }
    }
}
