//! The check of a profile between its grid points, and what it narrows the limits by.
//!
//! Every segment is sampled at ten equal steps. With `f` a row along the segment and `chord` the line between its ends,
//!
//! ```text
//! value = max f + max |second difference| / 8
//! ```
//!
//! where the second difference stands for what happens between samples. What a row is past its limit by, its limit is narrowed
//! by on that segment; the rows hold at three points of a segment, so that is little and one or two corrections suffice.

use super::rows::{Ask, Friction, Mover, Points};
use crate::motion::Path;

/// Samples per segment, less one.
pub const FINE: usize = 10;
/// What no row may exceed its limit by, relative: half of the promised 1e-9.
pub(super) const TOLERANCE: f64 = 5e-10;

/// The limits as the check sees them: torques `(n,)`, then accelerations `(n,)`, then speeds `(n,)`; infinite where there is none.
#[derive(Clone, Debug)]
pub(super) struct Limits {
    pub n: usize,
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
}

/// `1e-9 relative` to what: the limit, or the other one where it is zero.
pub(super) fn scales(lo: f64, hi: f64) -> (f64, f64) {
    let (a, b) = (lo.abs(), hi.abs());
    (if a > 0.0 { a } else { b }, if b > 0.0 { b } else { a })
}

/// What a check found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    /// Smallest relative distance to a limit on the samples; negative beyond it.
    pub margin: f64,
    /// Largest relative excess, estimated between the samples too.
    pub excess: f64,
    /// Where: segment, row.
    pub at: (usize, usize),
}

/// The samples of all segments.
#[derive(Default)]
pub(super) struct Samples {
    values: Vec<f64>,
}

impl Samples {
    /// `[tau, a, v]` at the samples of every segment, friction included.
    pub fn take(&mut self, mover: Mover, path: &Path, pieces: &[usize], s: &[f64], x: &[f64], bend: &[f64], friction: Option<&Friction>) {
        let (n, per) = (path.dof(), FINE + 1);
        let count = (s.len() - 1) * per;
        self.values.resize(count * 3 * n, 0.0);
        let at = |k: usize| {
            let (i, sub) = (k / per, k % per);
            let z = sub as f64 / FINE as f64;
            (pieces[i], if sub == FINE { s[i + 1] } else { s[i] + z * (s[i + 1] - s[i]) })
        };
        let rate = |k: usize| {
            let (i, sub) = (k / per, k % per);
            let z = sub as f64 / FINE as f64;
            let h = s[i + 1] - s[i];
            let here = if sub == FINE { x[i + 1] } else { x[i] + z * (x[i + 1] - x[i]) - z * (1.0 - z) * h * h * bend[i] };
            (here.max(0.0).sqrt(), 0.5 * (x[i + 1] - x[i]) / h + (z - 0.5) * h * bend[i])
        };
        let ask = Ask::Motion { rate: &rate };
        Points { mover, path, at: &at, count, stride: 3 * n, out: &mut self.values, ask }.run();
        if let Some(friction) = friction {
            for row in self.values.chunks_exact_mut(3 * n) {
                for j in 0..n {
                    let v = row[2 * n + j];
                    row[j] += friction.viscous[j] * v + friction.coulomb[j] * sign(v);
                }
            }
        }
    }

    /// Margins and excesses; `narrow(segment, row, below, above)` is told what each row is past its limits by, where it is.
    pub fn examine(&self, limits: &Limits, segments: usize, mut narrow: impl FnMut(usize, usize, f64, f64)) -> Found {
        let width = 3 * limits.n;
        let mut found = Found { margin: f64::INFINITY, excess: f64::NEG_INFINITY, at: (0, 0) };
        for i in 0..segments {
            let values = &self.values[i * (FINE + 1) * width..(i + 1) * (FINE + 1) * width];
            for row in 0..width {
                let (lo, hi) = (limits.lo[row], limits.hi[row]);
                if lo == f64::NEG_INFINITY && hi == f64::INFINITY {
                    continue;
                }
                let at = |k: usize| values[k * width + row];
                let (mut top, mut bottom, mut bend) = (at(0), at(0), 0.0_f64);
                for k in 1..=FINE {
                    let f = at(k);
                    (top, bottom) = (top.max(f), bottom.min(f));
                    if k < FINE {
                        bend = bend.max((at(k - 1) - 2.0 * f + at(k + 1)).abs());
                    }
                }
                let (scale_lo, scale_hi) = scales(lo, hi);
                found.margin = found.margin.min((hi - top) / scale_hi).min((bottom - lo) / scale_lo);
                let between = bend / 8.0;
                let (over, under) = (top + between - hi, lo - bottom + between);
                let excess = (over / scale_hi).max(under / scale_lo);
                if !(excess <= found.excess) {
                    (found.excess, found.at) = (excess, (i, row));
                }
                if excess > TOLERANCE {
                    narrow(i, row, under.max(0.0), over.max(0.0));
                }
            }
        }
        found
    }
}

pub(super) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}
