//! The check of a profile between its grid points.
//!
//! Every segment is sampled at ten equal steps. Between two samples a row `f` is at most
//!
//! ```text
//! max(f_k, f_(k+1)) + (d/2 - |f_(k+1) - f_k|)^2 / (2 d)   if |f_(k+1) - f_k| < d/2,   d = max |second difference| there
//! ```
//!
//! The second differences at the ends of the segment are extrapolated from the two beside them.
//!
//! The limit of a row is reduced on a segment by the excess of the row there. The rows hold at three points of a segment, so the excess is
//! small, and a few corrections are sufficient. Samples come from the dynamics, or from polynomials through the rows of six
//! grid points. These are compared with the dynamics in the middle of every segment.

use super::along::Along;
use super::lines::LimitRows;
use super::rows::{Friction, Mover, Points, Request};
use super::stencil::Stencil;
use super::tip::TIP;
use crate::motion::Path;
use crate::scalar::sign;

/// Samples per segment, less one.
pub const FINE: usize = 10;
/// The largest relative excess of a row over its limit: half of the documented 1e-9.
pub(super) const TOLERANCE: f64 = 5e-10;
/// The largest error of interpolated torques, relative to the limit: a fifth of the other half.
pub(super) const INTERPOLATION: f64 = 1e-10;
/// Points of an interpolation.
pub(super) const WINDOW: usize = 6;

/// Whole blocks of rows: torques and accelerations as in [`LimitRows`], then speeds where they are limited.
#[derive(Clone, Debug, Default)]
pub(super) struct Limits {
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    /// The scale of a relative excess: the limit, or the opposite limit if it is zero.
    pub scale_lo: Vec<f64>,
    pub scale_hi: Vec<f64>,
    /// The reciprocals of these.
    pub by_lo: Vec<f64>,
    pub by_hi: Vec<f64>,
}

impl Limits {
    pub fn push(&mut self, lo: f64, hi: f64) {
        let (a, b) = (lo.abs(), hi.abs());
        self.lo.push(lo);
        self.hi.push(hi);
        self.scale_lo.push(if a > 0.0 { a } else { b });
        self.scale_hi.push(if b > 0.0 { b } else { a });
        self.by_lo.push(1.0 / self.scale_lo[self.lo.len() - 1]);
        self.by_hi.push(1.0 / self.scale_hi[self.lo.len() - 1]);
    }
}

/// The result of a check.
#[derive(Clone, Copy, Debug)]
pub(super) struct LimitCheck {
    /// Smallest relative distance to a limit on the samples; negative beyond it.
    pub margin: f64,
    /// Largest relative excess, between the samples too.
    pub excess: f64,
    /// Its segment and row.
    pub at: (usize, usize),
}

/// The data of a problem for the check.
pub(super) struct Course<'a> {
    pub mover: Mover<'a>,
    pub path: &'a Path,
    pub n: usize,
    /// The piece of each segment, and the segments of each piece.
    pub pieces: &'a [usize],
    pub spans: &'a [(usize, usize)],
    /// Whether torques are rows, and accelerations.
    pub kinds: [bool; 2],
    /// `(N + 1, stride)`: `q'`.
    pub slopes: &'a [f64],
    pub stride: usize,
    pub friction: Option<&'a Friction>,
    /// Limits that vary along the path, and the frame whose origin is limited. Such rows are computed by the dynamics, not interpolated.
    pub along: &'a Along,
    pub tip: Option<usize>,
    /// The first of the rows of speeds, and of the norms of the frame's acceleration and speed.
    pub speeds: Option<usize>,
    pub norms: Option<usize>,
    pub limits: &'a Limits,
    pub stencil: &'a Stencil<WINDOW>,
}

impl Course<'_> {
    /// Numbers per measured sample.
    pub fn measured(&self) -> usize {
        3 * self.n + if self.tip.is_some() { TIP } else { 0 }
    }
}

/// Squared path speed and path acceleration at `z` in segment `i`.
#[inline(always)]
pub(super) fn state(rows: &LimitRows, x: &[f64], i: usize, z: f64) -> (f64, f64) {
    let (h, b) = (rows.s[i + 1] - rows.s[i], rows.u_slope[i]);
    let here = if z == 1.0 { x[i + 1] } else { x[i] + z * (x[i + 1] - x[i]) - z * (1.0 - z) * h * h * b };
    (here.max(0.0), 0.5 * (x[i + 1] - x[i]) / h + (z - 0.5) * h * b)
}

/// `[tau, a, v]`, `(3 n,)`, as fractions of limits that vary, and acceleration and velocity of the frame, by the dynamics. There are `per`
/// places in each listed segment: the middle, or samples evenly in time. Viscous friction is proportional to the root of `x`, which a
/// parabola in `s` does not approximate near rest.
pub(super) fn measure(course: &Course, rows: &LimitRows, x: &[f64], list: &[usize], per: usize, values: &mut Vec<f64>) {
    let (n, stride) = (course.n, course.measured());
    let count = list.len() * per;
    values.clear();
    values.resize(count * stride, 0.0);
    if count == 0 {
        return;
    }
    let s = &rows.s;
    let place = |k: usize| {
        let (i, t) = (list[k / per], (k % per) as f64 / FINE as f64);
        let (from, to) = (x[i].sqrt(), x[i + 1].sqrt());
        // At rest at both ends there is no time to divide evenly.
        let even = if from + to > 0.0 { t * (2.0 * from + t * (to - from)) / (from + to) } else { t };
        (i, if per == 1 { 0.5 } else { even.min(1.0) })
    };
    let at = |k: usize| {
        let (i, z) = place(k);
        (course.pieces[i], if z == 1.0 { s[i + 1] } else { s[i] + z * (s[i + 1] - s[i]) })
    };
    let rate = |k: usize| {
        let (i, z) = place(k);
        let (x, u) = state(rows, x, i, z);
        (x.sqrt(), u)
    };
    let request = Request::Motion { rate: &rate };
    Points {
        mover: course.mover,
        path: course.path,
        at: &at,
        count,
        stride,
        out: values,
        request,
        tip: course.tip.map(|frame| (frame, course.along)),
    }
    .run();
    if let Some(friction) = course.friction {
        for row in values.chunks_exact_mut(stride) {
            for j in 0..n {
                let v = row[2 * n + j];
                row[j] += friction.viscous[j] * v + friction.coulomb[j] * sign(v);
            }
        }
    }
    if course.along.any() {
        for (k, row) in values.chunks_exact_mut(stride).enumerate() {
            let (piece, s) = at(k);
            for kind in 0..3 {
                (0..n).for_each(|j| row[kind * n + j] /= course.along.limit(course.path, kind, j, piece, s));
            }
        }
    }
}

fn places() -> [f64; FINE + 1] {
    std::array::from_fn(|k| k as f64 / FINE as f64)
}

/// The places where the stencils of a check interpolate.
pub(super) fn inner_places() -> Vec<f64> {
    places()[1..FINE].to_vec()
}
