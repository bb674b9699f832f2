//! The check of a profile between its grid points, and what it narrows the limits by.
//!
//! Every segment is sampled at ten equal steps. With `f` a row along the segment and `chord` the line between its ends,
//!
//! ```text
//! overshoot = max (f - chord) + max |second difference| / 8,   value = max f + max |second difference| / 8
//! ```
//!
//! where the second difference stands for what happens between samples. A limit narrowed by the overshoot at both ends of the
//! segment is kept inside it; the overshoot hardly changes when the profile does, so one or two corrections suffice.

use super::reach::Rows;
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
    /// Largest relative overshoot among rows that are within it of their limit.
    pub coarse: f64,
}

/// The samples of all segments.
#[derive(Default)]
pub(super) struct Samples {
    values: Vec<f64>,
}

impl Samples {
    /// `[tau, a, v]` at the samples of every segment, friction included.
    pub fn take(&mut self, mover: Mover, path: &Path, pieces: &[usize], s: &[f64], x: &[f64], friction: Option<&Friction>) {
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
            let here = if sub == FINE { x[i + 1] } else { x[i] + z * (x[i + 1] - x[i]) };
            (here.sqrt(), 0.5 * (x[i + 1] - x[i]) / (s[i + 1] - s[i]))
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

    /// Margins, excesses, and the overshoot by which `narrow(segment, row, below, above)` may narrow each limit.
    pub fn examine(&self, limits: &Limits, segments: usize, mut narrow: impl FnMut(usize, usize, [f64; 2], [f64; 2])) -> Found {
        let width = 3 * limits.n;
        let mut found = Found { margin: f64::INFINITY, excess: f64::NEG_INFINITY, at: (0, 0), coarse: 0.0 };
        for i in 0..segments {
            let values = &self.values[i * (FINE + 1) * width..(i + 1) * (FINE + 1) * width];
            for row in 0..width {
                let (lo, hi) = (limits.lo[row], limits.hi[row]);
                if lo == f64::NEG_INFINITY && hi == f64::INFINITY {
                    continue;
                }
                let at = |k: usize| values[k * width + row];
                let (first, last) = (at(0), at(FINE));
                let (mut top, mut bottom, mut above, mut below, mut bend) = (first, first, 0.0_f64, 0.0_f64, 0.0_f64);
                for k in 1..=FINE {
                    let f = at(k);
                    let chord = first + (last - first) * (k as f64 / FINE as f64);
                    (top, bottom) = (top.max(f), bottom.min(f));
                    (above, below) = (above.max(f - chord), below.min(f - chord));
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
                let shoot = [between - below, above + between];
                if over + shoot[1] > 0.0 {
                    found.coarse = found.coarse.max(shoot[1] / scale_hi);
                }
                if under + shoot[0] > 0.0 {
                    found.coarse = found.coarse.max(shoot[0] / scale_lo);
                }
                narrow(i, row, shoot, [under.max(0.0), over.max(0.0)]);
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

/// Widths of the rows in [`Rows`]: torques, then accelerations where they are limited.
pub(super) fn narrow(rows: &mut Rows, i: usize, row: usize, shoot: [f64; 2], past: [f64; 2], keep: bool) {
    let at = i * rows.width + row;
    let put = |old: &mut f64, shoot: f64, past: f64| {
        let new = shoot * (1.0 + 1e-3);
        *old = if keep { old.max(new) + 2.0 * past } else { new };
    };
    put(&mut rows.tight_lo[at], shoot[0], past[0]);
    put(&mut rows.tight_hi[at], shoot[1], past[1]);
}
