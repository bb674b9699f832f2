//! The check of a profile between its grid points.
//!
//! Every segment is sampled at ten equal steps. Between two samples a row `f` is at most
//!
//! ```text
//! max(f_k, f_(k+1)) + (d/2 - |f_(k+1) - f_k|)^2 / (2 d)   if |f_(k+1) - f_k| < d/2,   d = max |second difference| there
//! ```
//!
//! What a row is past its limit by, its limit is narrowed by on that segment; the rows hold at three points of a segment, so that is
//! little and a few corrections suffice. Samples come from the dynamics themselves, or from polynomials through the rows of six
//! grid points, which are then compared with the dynamics in the middle of every segment.

use super::reach::{FASTEST, Profile, Rows, largest, load, store};
use super::rows::{Ask, Friction, Mover, Points};
use super::stencil::Stencil;
use crate::motion::Path;
use crate::scalar::{Real, Task, run_lanes};

/// Samples per segment, less one.
pub const FINE: usize = 10;
/// What no row may exceed its limit by, relative: half of the promised 1e-9.
pub(super) const TOLERANCE: f64 = 5e-10;
/// What interpolated torques may differ from the dynamics by, relative to the limit: a fifth of what is left.
const INTERPOLATION: f64 = 1e-10;
/// Points of an interpolation.
pub(super) const WINDOW: usize = 6;

/// Whole blocks of rows: torques and accelerations as in [`Rows`], then speeds where they are limited.
#[derive(Clone, Debug, Default)]
pub(super) struct Limits {
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    /// What a relative excess is relative to: the limit, or the other one where it is zero.
    pub scale_lo: Vec<f64>,
    pub scale_hi: Vec<f64>,
}

impl Limits {
    pub fn push(&mut self, lo: f64, hi: f64) {
        let (a, b) = (lo.abs(), hi.abs());
        self.lo.push(lo);
        self.hi.push(hi);
        self.scale_lo.push(if a > 0.0 { a } else { b });
        self.scale_hi.push(if b > 0.0 { b } else { a });
    }
}

/// What a check found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
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
    pub limits: &'a Limits,
    pub stencil: &'a Stencil<WINDOW>,
}

impl Course<'_> {
    /// Whether every piece has points enough to interpolate, and friction does not bend the rows.
    pub fn interpolates(&self) -> bool {
        self.friction.is_none() && self.spans.iter().all(|(first, last)| last - first + 1 >= WINDOW)
    }
}

/// Squared path speed and path acceleration at `z` in segment `i`.
#[inline(always)]
fn state(rows: &Rows, x: &[f64], i: usize, z: f64) -> (f64, f64) {
    let (h, b) = (rows.s[i + 1] - rows.s[i], rows.bend[i]);
    let here = if z == 1.0 { x[i + 1] } else { x[i] + z * (x[i + 1] - x[i]) - z * (1.0 - z) * h * h * b };
    (here.max(0.0), 0.5 * (x[i + 1] - x[i]) / h + (z - 0.5) * h * b)
}

/// `[tau, a, v]`, `(3 n,)`, by the dynamics at `per` places of every segment.
fn measure(course: &Course, rows: &Rows, x: &[f64], places: &[f64], values: &mut Vec<f64>) {
    let (n, per) = (course.n, places.len());
    let count = (rows.s.len() - 1) * per;
    values.clear();
    values.resize(count * 3 * n, 0.0);
    let s = &rows.s;
    let at = |k: usize| {
        let (i, z) = (k / per, places[k % per]);
        (course.pieces[i], if z == 1.0 { s[i + 1] } else { s[i] + z * (s[i + 1] - s[i]) })
    };
    let rate = |k: usize| {
        let (x, u) = state(rows, x, k / per, places[k % per]);
        (x.sqrt(), u)
    };
    let ask = Ask::Motion { rate: &rate };
    Points { mover: course.mover, path: course.path, at: &at, count, stride: 3 * n, out: values, ask }.run();
    if let Some(friction) = course.friction {
        for row in values.chunks_exact_mut(3 * n) {
            for j in 0..n {
                let v = row[2 * n + j];
                row[j] += friction.viscous[j] * v + friction.coulomb[j] * sign(v);
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

struct Examine<'a, F> {
    course: &'a Course<'a>,
    rows: &'a Rows,
    x: &'a [f64],
    /// Samples by the dynamics; empty where rows are interpolated.
    measured: &'a [f64],
    /// Interpolated torques in the middle of every segment, `(N, n)`, where wanted.
    middles: &'a mut [f64],
    narrow: F,
}

impl<F: FnMut(usize, usize, f64, f64)> Examine<'_, F> {
    /// The rows of segment `i` at all samples, `(FINE + 1, width)`.
    #[inline(always)]
    fn sample<S: Real>(&self, i: usize, window: (usize, &[[f64; WINDOW]]), values: &mut [f64]) {
        let Examine { course, rows, x, .. } = self;
        let (w, width) = (rows.width, course.limits.lo.len());
        for sub in 0..=FINE {
            let z = sub as f64 / FINE as f64;
            let (x, u) = state(rows, x, i, z);
            let (u, squared, rate) = (S::splat(u), S::splat(x), S::splat(x.sqrt()));
            let values = &mut values[sub * width..(sub + 1) * width];
            let inner = 1..FINE;
            let (start, weights) = if inner.contains(&sub) { (window.0, &window.1[sub - 1][..]) } else { (i + sub / FINE, &[1.0][..]) };
            let mut k = 0;
            while k < w {
                let mut sum = S::zero();
                for m in 0..weights.len() {
                    let c = &rows.coefficients[(start + m) * 3 * w..(start + m + 1) * 3 * w];
                    let f = u.mul_add(load::<S>(c, k), squared.mul_add(load::<S>(c, w + k), load::<S>(c, 2 * w + k)));
                    sum = S::splat(weights[m]).mul_add(f, sum);
                }
                store(sum, values, k);
                k += S::LANES;
            }
            while k < width {
                let mut sum = S::zero();
                for m in 0..weights.len() {
                    sum = S::splat(weights[m]).mul_add(load::<S>(course.slopes, (start + m) * course.stride + k - w), sum);
                }
                store(sum * rate, values, k);
                k += S::LANES;
            }
        }
    }

    /// The same from measured samples.
    #[inline(always)]
    fn copy(&self, i: usize, values: &mut [f64]) {
        let Examine { course, rows, measured, .. } = self;
        let (n, width) = (course.n, course.limits.lo.len());
        for sub in 0..=FINE {
            let from = &measured[(i * (FINE + 1) + sub) * 3 * n..][..3 * n];
            let to = &mut values[sub * width..(sub + 1) * width];
            let mut at = 0;
            for (kind, wanted) in course.kinds.into_iter().enumerate() {
                if wanted {
                    to[at..at + n].copy_from_slice(&from[kind * n..(kind + 1) * n]);
                    at += n;
                }
            }
            if width > rows.width {
                to[rows.width..rows.width + n].copy_from_slice(&from[2 * n..]);
            }
        }
    }
}

impl<F: FnMut(usize, usize, f64, f64)> Task for Examine<'_, F> {
    type Output = Found;
    #[inline(always)]
    fn run<S: Real>(mut self) -> Found {
        let limits = self.course.limits;
        let width = limits.lo.len();
        let mut found = Found { margin: f64::INFINITY, excess: f64::NEG_INFINITY, at: (0, 0) };
        let mut values = vec![0.0; (FINE + 1) * width];
        let mut margin = S::splat(FASTEST);
        let zero = S::zero();
        let (half, tiny) = (S::splat(0.5), S::splat(f64::MIN_POSITIVE));
        for &(first, last) in self.course.spans {
            for i in first..last {
                if self.measured.is_empty() {
                    // A piece with too few points is never asked for.
                    let Some(window) = self.course.stencil.of(i, first, last) else { continue };
                    self.sample::<S>(i, window, &mut values);
                    if !self.middles.is_empty() {
                        let n = self.course.n;
                        self.middles[i * n..(i + 1) * n].copy_from_slice(&values[FINE / 2 * width..][..n]);
                    }
                } else {
                    self.copy(i, &mut values);
                }
                let mut k = 0;
                while k < width {
                    let mut f = load::<S>(&values, k);
                    let mut g = load::<S>(&values, width + k);
                    let (mut top, mut bottom, mut high, mut low) = (f, f, f, f);
                    let mut before = zero;
                    for sub in 0..FINE {
                        // From f to g, with the bend at f and at g; the ends have their neighbour's.
                        let next = load::<S>(&values, (sub + 2).min(FINE) * width + k);
                        let after = if sub + 2 <= FINE { (f + next - (g + g)).abs() } else { before };
                        let d = if sub == 0 { after } else { before.max(after) };
                        let rest = (half * d - (g - f).abs()).max(zero);
                        let between = half * rest * rest * d.max(tiny).recip();
                        (top, bottom) = (top.max(g), bottom.min(g));
                        (high, low) = (high.max(f.max(g) + between), low.min(f.min(g) - between));
                        (before, f, g) = (after, g, next);
                    }
                    let (lo, hi) = (load::<S>(&limits.lo, k), load::<S>(&limits.hi, k));
                    let (by_lo, by_hi) = (load::<S>(&limits.scale_lo, k).recip(), load::<S>(&limits.scale_hi, k).recip());
                    margin = margin.min((hi - top) * by_hi).min((bottom - lo) * by_lo);
                    let (over, under) = (high - hi, lo - low);
                    let excess = (over * by_hi).max(under * by_lo);
                    if !S::all(excess.lt(S::splat(found.excess))) {
                        for lane in 0..S::LANES {
                            let e = excess.lane(lane);
                            if !(e <= found.excess) {
                                (found.excess, found.at) = (e, (i, k + lane));
                            }
                        }
                    }
                    if S::any(S::splat(TOLERANCE).lt(excess)) {
                        for lane in 0..S::LANES {
                            if excess.lane(lane) > TOLERANCE {
                                (self.narrow)(i, k + lane, under.lane(lane).max(0.0), over.lane(lane).max(0.0));
                            }
                        }
                    }
                    k += S::LANES;
                }
            }
        }
        found.margin = -largest(-margin);
        found
    }
}

/// Buffers of the checks.
#[derive(Default)]
pub(super) struct Samples {
    values: Vec<f64>,
    middles: Vec<f64>,
    /// Interpolation was found wanting on this grid.
    pub exact: bool,
}

impl Samples {
    /// Margins and excesses; `narrow(segment, row, below, above)` is told what each row is past its limits by, where it is.
    pub fn examine(&mut self, course: &Course, rows: &Rows, profile: &Profile, narrow: impl FnMut(usize, usize, f64, f64)) -> Found {
        let x = &profile.x;
        let interpolate = !self.exact && course.interpolates();
        if interpolate {
            self.values.clear();
            self.middles.resize((rows.s.len() - 1) * course.n, 0.0);
        } else {
            measure(course, rows, x, &places(), &mut self.values);
        }
        run_lanes(Examine { course, rows, x, measured: &self.values, middles: &mut self.middles, narrow })
    }

    /// Whether the last examination stands: what it interpolated is what the dynamics say.
    pub fn stands(&mut self, course: &Course, rows: &Rows, profile: &Profile) -> bool {
        if self.exact || !course.interpolates() || !course.kinds[0] {
            return true;
        }
        let n = course.n;
        measure(course, rows, &profile.x, &[0.5], &mut self.values);
        for (i, measured) in self.values.chunks_exact(3 * n).enumerate() {
            for j in 0..n {
                let scale = course.limits.scale_lo[j].min(course.limits.scale_hi[j]);
                if !((measured[j] - self.middles[i * n + j]).abs() <= INTERPOLATION * scale) {
                    self.exact = true;
                    return false;
                }
            }
        }
        true
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
