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

use super::lines::{FASTEST, Rows, largest, load, store};
use super::reach::Profile;
use super::rows::{Ask, Friction, Mover, Points};
use super::stencil::Stencil;
use crate::motion::Path;
use crate::scalar::{Real, Task, run_lanes, sign};

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
    /// One over these.
    by_lo: Vec<f64>,
    by_hi: Vec<f64>,
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

/// Squared path speed and path acceleration at `z` in segment `i`.
#[inline(always)]
fn state(rows: &Rows, x: &[f64], i: usize, z: f64) -> (f64, f64) {
    let (h, b) = (rows.s[i + 1] - rows.s[i], rows.bend[i]);
    let here = if z == 1.0 { x[i + 1] } else { x[i] + z * (x[i + 1] - x[i]) - z * (1.0 - z) * h * h * b };
    (here.max(0.0), 0.5 * (x[i + 1] - x[i]) / h + (z - 0.5) * h * b)
}

/// `[tau, a, v]`, `(3 n,)`, by the dynamics at `places` of the segments listed.
fn measure(course: &Course, rows: &Rows, x: &[f64], list: &[usize], places: &[f64], values: &mut Vec<f64>) {
    let (n, per) = (course.n, places.len());
    let count = list.len() * per;
    values.clear();
    values.resize(count * 3 * n, 0.0);
    let s = &rows.s;
    let at = |k: usize| {
        let (i, z) = (list[k / per], places[k % per]);
        (course.pieces[i], if z == 1.0 { s[i + 1] } else { s[i] + z * (s[i + 1] - s[i]) })
    };
    let rate = |k: usize| {
        let (x, u) = state(rows, x, list[k / per], places[k % per]);
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
    samples: &'a mut Samples,
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

    /// The same from measured samples, those of the segment that is number `order` of them.
    #[inline(always)]
    fn copy(&self, order: usize, values: &mut [f64]) {
        let Examine { course, rows, samples: Samples { values: measured, .. }, .. } = self;
        let (n, width) = (course.n, course.limits.lo.len());
        for sub in 0..=FINE {
            let from = &measured[(order * (FINE + 1) + sub) * 3 * n..][..3 * n];
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
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(mut self) {
        let limits = self.course.limits;
        let width = limits.lo.len();
        let torques = if self.course.kinds[0] { self.course.n } else { 0 };
        let mut values = vec![0.0; (FINE + 1) * width];
        let zero = S::zero();
        let (half, tiny) = (S::splat(0.5), S::splat(f64::MIN_POSITIVE));
        let list = std::mem::take(&mut self.samples.list);
        let mut order = 0;
        for &i in &list {
            let (first, last) = self.course.spans[self.samples.span[i]];
            match self.course.stencil.of(i, first, last) {
                Some(window) if !self.samples.exact[i] => {
                    self.sample::<S>(i, window, &mut values);
                    self.samples.middles[i * torques..(i + 1) * torques].copy_from_slice(&values[FINE / 2 * width..][..torques]);
                }
                _ => {
                    self.copy(order, &mut values);
                    order += 1;
                }
            }
            let (mut margin, mut excess, mut of_torque, mut at) = (S::splat(FASTEST), f64::NEG_INFINITY, f64::NEG_INFINITY, 0);
            let mut k = 0;
            while k < width {
                let mut f = load::<S>(&values, k);
                let mut g = load::<S>(&values, width + k);
                let (mut top, mut bottom, mut high, mut low) = (f.max(g), f.min(g), f, f);
                let (mut earlier, mut before) = (zero, zero);
                for sub in 0..FINE {
                    // From f to g, with the bend at f and at g; at the ends that of the neighbours goes on changing.
                    let next = load::<S>(&values, (sub + 2).min(FINE) * width + k);
                    let after = if sub + 2 <= FINE { f + next - (g + g) } else { before + (before - earlier) };
                    let here = if sub > 0 {
                        before
                    } else {
                        let then = g + load::<S>(&values, 3 * width + k) - (next + next);
                        after + (after - then)
                    };
                    let d = here.abs().max(after.abs());
                    let rest = (half * d - (g - f).abs()).max(zero);
                    let between = half * rest * rest * d.max(tiny).recip();
                    (top, bottom) = (top.max(g), bottom.min(g));
                    (high, low) = (high.max(f.max(g) + between), low.min(f.min(g) - between));
                    (earlier, before, f, g) = (before, after, g, next);
                }
                let (lo, hi) = (load::<S>(&limits.lo, k), load::<S>(&limits.hi, k));
                let (by_lo, by_hi) = (load::<S>(&limits.by_lo, k), load::<S>(&limits.by_hi, k));
                margin = margin.min((hi - top) * by_hi).min((bottom - lo) * by_lo);
                let (over, under) = (high - hi, lo - low);
                let past = (over * by_hi).max(under * by_lo);
                let worst = largest(past);
                // Not the other way round: NaN is an excess.
                if !(worst <= excess) {
                    (excess, at) = (worst, k + (0..S::LANES).find(|&lane| !(past.lane(lane) < worst)).unwrap_or(0));
                }
                if k < torques {
                    of_torque = of_torque.max(worst);
                }
                if worst > TOLERANCE {
                    for lane in 0..S::LANES {
                        if past.lane(lane) > TOLERANCE {
                            (self.narrow)(i, k + lane, under.lane(lane).max(0.0), over.lane(lane).max(0.0));
                        }
                    }
                }
                k += S::LANES;
            }
            self.samples.segments[i] = Segment { margin: -largest(-margin), excess, at, torque: of_torque, proven: false };
        }
        self.samples.list = list;
    }
}

/// What the last examination of a segment found.
#[derive(Clone, Copy, Debug)]
struct Segment {
    margin: f64,
    /// The largest excess, its row, and the largest excess of a torque.
    excess: f64,
    at: usize,
    torque: f64,
    /// What was interpolated is what the dynamics say.
    proven: bool,
}

/// The samples and what they said, segment by segment.
#[derive(Default)]
pub(super) struct Samples {
    segments: Vec<Segment>,
    /// The excesses before limits were narrowed.
    pub first: Vec<f64>,
    /// The span of each segment.
    span: Vec<usize>,
    /// Segments that are sampled by the dynamics themselves.
    exact: Vec<bool>,
    /// Segments to be examined.
    list: Vec<usize>,
    /// Segments to be measured, and what was measured.
    asked: Vec<usize>,
    values: Vec<f64>,
    /// Interpolated torques in the middle of every segment, `(N, n)`.
    middles: Vec<f64>,
}

impl Samples {
    /// A new problem or a new grid: nothing is known.
    pub fn begin(&mut self, course: &Course) {
        let count = course.pieces.len();
        let unknown = Segment { margin: f64::NAN, excess: f64::INFINITY, at: 0, torque: f64::INFINITY, proven: false };
        self.segments.clear();
        self.first.clear();
        self.first.resize(count, 0.0);
        self.segments.resize(count, unknown);
        self.span.clear();
        self.exact.clear();
        for (k, &(first, last)) in course.spans.iter().enumerate() {
            self.span.resize(last, k);
            // Friction bends the rows; few points can't be interpolated.
            self.exact.resize(last, course.friction.is_some() || last - first + 1 < WINDOW);
        }
        self.middles.clear();
        self.middles.resize(count * course.n, 0.0);
    }

    /// Margins and excesses; `narrow(segment, row, below, above)` is told what each row is past its limits by, where it is. Segments
    /// that held their limits and did not move are not looked at again.
    pub fn examine(&mut self, course: &Course, rows: &Rows, profile: &mut Profile, narrow: impl FnMut(usize, usize, f64, f64)) -> Found {
        let Profile { x, moved, .. } = profile;
        self.list.clear();
        self.asked.clear();
        for (i, segment) in self.segments.iter().enumerate() {
            if moved[i] || moved[i + 1] || !(segment.excess <= TOLERANCE) {
                self.list.push(i);
                if self.exact[i] {
                    self.asked.push(i);
                }
            }
        }
        moved.fill(false);
        measure(course, rows, x, &self.asked, &places(), &mut self.values);
        run_lanes(Examine { course, rows, x, samples: self, narrow });
        let mut found = Found { margin: f64::INFINITY, excess: f64::NEG_INFINITY, at: (0, 0) };
        for (i, segment) in self.segments.iter().enumerate() {
            if segment.margin < found.margin {
                found.margin = segment.margin;
            }
            if !(segment.excess <= found.excess) {
                (found.excess, found.at) = (segment.excess, (i, segment.at));
            }
        }
        found
    }

    /// Keep the excesses of this examination: those of limits that were not narrowed yet.
    pub fn remember(&mut self) {
        self.first.clear();
        self.first.extend(self.segments.iter().map(|segment| segment.excess));
    }

    /// Whether the last examination stands: what it interpolated is what the dynamics say. Where it is not, they are asked next time.
    pub fn stands(&mut self, course: &Course, rows: &Rows, profile: &Profile) -> bool {
        if !course.kinds[0] {
            return true;
        }
        let n = course.n;
        self.asked.clear();
        self.asked.extend((0..self.segments.len()).filter(|&i| !self.exact[i] && !self.segments[i].proven));
        measure(course, rows, &profile.x, &self.asked, &[0.5], &mut self.values);
        let mut stands = true;
        for (&i, measured) in self.asked.iter().zip(self.values.chunks_exact(3 * n)) {
            // Far from the limits an error does no harm.
            let segment = &mut self.segments[i];
            let least = INTERPOLATION.max(-0.1 * segment.torque);
            segment.proven = (0..n).all(|j| {
                let scale = course.limits.scale_lo[j].min(course.limits.scale_hi[j]);
                (measured[j] - self.middles[i * n + j]).abs() <= least * scale
            });
            if !segment.proven {
                self.exact[i] = true;
                segment.excess = f64::INFINITY;
                stands = false;
            }
        }
        stands
    }
}
