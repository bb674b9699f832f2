//! The check of a profile between its grid points.
//!
//! Every segment is sampled at ten equal steps. Between two samples a row `f` is at most
//!
//! ```text
//! max(f_k, f_(k+1)) + (d/2 - |f_(k+1) - f_k|)^2 / (2 d)   if |f_(k+1) - f_k| < d/2,   d = max |second difference| there
//! ```
//!
//! with second differences at the ends of the segment extrapolated from the two beside them.
//!
//! What a row is past its limit by, its limit is narrowed by on that segment; the rows hold at three points of a segment, so that is
//! little and a few corrections suffice. Samples come from the dynamics themselves, or from polynomials through the rows of six
//! grid points, which are then compared with the dynamics in the middle of every segment.

use super::along::Along;
use super::lines::LimitRows;
use super::rows::{Ask, Friction, Mover, Points};
use super::stencil::Stencil;
use super::tip::TIP;
use crate::motion::Path;
use crate::scalar::sign;

/// Samples per segment, less one.
pub const FINE: usize = 10;
/// What no row may exceed its limit by, relative: half of the promised 1e-9.
pub(super) const TOLERANCE: f64 = 5e-10;
/// What interpolated torques may differ from the dynamics by, relative to the limit: a fifth of what is left.
pub(super) const INTERPOLATION: f64 = 1e-10;
/// Points of an interpolation.
pub(super) const WINDOW: usize = 6;

/// Whole blocks of rows: torques and accelerations as in [`LimitRows`], then speeds where they are limited.
#[derive(Clone, Debug, Default)]
pub(super) struct Limits {
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    /// What a relative excess is relative to: the limit, or the other one where it is zero.
    pub scale_lo: Vec<f64>,
    pub scale_hi: Vec<f64>,
    /// One over these.
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

/// What a check found.
#[derive(Clone, Copy, Debug)]
pub(super) struct LimitCheck {
    /// Smallest relative distance to a limit on the samples; negative beyond it.
    pub margin: f64,
    /// Largest relative excess, between the samples too.
    pub excess: f64,
    /// Where: segment, row.
    pub at: (usize, usize),
}

/// A problem as the check sees it.
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
    /// Limits that vary along the path, and the frame whose origin is limited: such rows are asked of the dynamics, not interpolated.
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

/// `[tau, a, v]`, `(3 n,)`, in parts of limits that vary, and acceleration and velocity of the frame, by the dynamics at `per` places of the segments listed: the middle, or samples that are even in time. Viscous
/// friction goes with the root of `x`, which near rest no parabola follows in `s`.
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
    let ask = Ask::Motion { rate: &rate };
    Points {
        mover: course.mover,
        path: course.path,
        at: &at,
        count,
        stride,
        out: values,
        ask,
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
