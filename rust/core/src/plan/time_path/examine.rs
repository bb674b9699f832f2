//! The samples of every segment, and what they say: see `check`.

use super::check::{Course, FINE, Found, INTERPOLATION, TOLERANCE, WINDOW, measure, state};
use super::lines::{FASTEST, Rows, largest, load, store};
use super::reach::Profile;
use crate::scalar::{Real, Task, run_lanes};

/// A block of rows at the samples of a segment.
type Fine<S> = [S; FINE + 1];

/// Squared path speed, path acceleration and path speed at a sample.
#[derive(Clone, Copy, Default)]
struct State {
    x: f64,
    u: f64,
    rate: f64,
}

struct Examine<'a, F> {
    course: &'a Course<'a>,
    rows: &'a Rows,
    x: &'a [f64],
    samples: &'a mut Samples,
    narrow: F,
}

impl<F: FnMut(usize, usize, f64, f64)> Examine<'_, F> {
    /// A block of rows of segment `i` from `k` on at all samples, by the window of points about it. The points are read once.
    #[inline(always)]
    fn sample<S: Real>(&self, i: usize, k: usize, (start, weights): (usize, &[[f64; WINDOW]]), states: &[State; FINE + 1]) -> Fine<S> {
        let Examine { course, rows, .. } = self;
        let w = rows.width;
        let mut values = [S::zero(); FINE + 1];
        if k < w {
            let c = &rows.coefficients[start * 3 * w..(start + WINDOW) * 3 * w];
            let mut points = [[S::zero(); 3]; WINDOW];
            for m in 0..WINDOW {
                for part in 0..3 {
                    points[m][part] = load(c, (3 * m + part) * w + k);
                }
            }
            for sub in 0..=FINE {
                let [mut a, mut b, mut g] = points[(i + sub / FINE - start).min(WINDOW - 1)];
                if (1..FINE).contains(&sub) {
                    (a, b, g) = (S::zero(), S::zero(), S::zero());
                    for m in 0..WINDOW {
                        let weight = S::splat(weights[sub - 1][m]);
                        (a, b, g) = (weight.mul_add(points[m][0], a), weight.mul_add(points[m][1], b), weight.mul_add(points[m][2], g));
                    }
                }
                values[sub] = S::splat(states[sub].u).mul_add(a, S::splat(states[sub].x).mul_add(b, g));
            }
        } else {
            let c = &course.slopes[start * course.stride..(start + WINDOW) * course.stride];
            let mut points = [S::zero(); WINDOW];
            for m in 0..WINDOW {
                points[m] = load(c, m * course.stride + k - w);
            }
            for sub in 0..=FINE {
                let mut slope = points[(i + sub / FINE - start).min(WINDOW - 1)];
                if (1..FINE).contains(&sub) {
                    slope = S::zero();
                    for m in 0..WINDOW {
                        slope = S::splat(weights[sub - 1][m]).mul_add(points[m], slope);
                    }
                }
                values[sub] = slope * S::splat(states[sub].rate);
            }
        }
        values
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

/// The second difference of a row at sample `sub`. A function, since a closure may be left a call, outside of the instruction set.
#[inline(always)]
fn bend<S: Real>(values: &Fine<S>, sub: usize) -> S {
    values[sub - 1] - (values[sub] + values[sub]) + values[sub + 1]
}

impl<F: FnMut(usize, usize, f64, f64)> Task for Examine<'_, F> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(mut self) {
        let limits = self.course.limits;
        let width = limits.lo.len();
        let torques = if self.course.kinds[0] { self.course.n } else { 0 };
        let (mut values, mut middle) = (vec![0.0; (FINE + 1) * width], vec![0.0; width]);
        let zero = S::zero();
        let (half, tiny) = (S::splat(0.5), S::splat(f64::MIN_POSITIVE));
        let list = std::mem::take(&mut self.samples.list);
        let mut order = 0;
        for &i in &list {
            let (first, last) = self.course.spans[self.samples.span[i]];
            let window = self.course.stencil.of(i, first, last).filter(|_| !self.samples.exact[i]);
            let mut states = [State::default(); FINE + 1];
            if window.is_some() {
                for sub in 0..=FINE {
                    let (x, u) = state(self.rows, self.x, i, sub as f64 / FINE as f64);
                    states[sub] = State { x, u, rate: x.sqrt() };
                }
            } else {
                self.copy(order, &mut values);
                order += 1;
            }
            let (mut margin, mut excess, mut of_torque, mut at) = (S::splat(FASTEST), f64::NEG_INFINITY, f64::NEG_INFINITY, 0);
            let mut k = 0;
            while k < width {
                let mut fine = [zero; FINE + 1];
                if let Some(window) = window {
                    fine = self.sample::<S>(i, k, window, &states);
                    if k < torques {
                        store(fine[FINE / 2], &mut middle, k);
                    }
                } else {
                    for sub in 0..=FINE {
                        fine[sub] = load(&values, sub * width + k);
                    }
                }
                let (mut top, mut bottom, mut high, mut low) = (fine[0], fine[0], fine[0], fine[0]);
                // At the ends, what the bends beside them lead to.
                let mut after = bend(&fine, 1);
                let mut before = after + after - bend(&fine, 2);
                for sub in 0..FINE {
                    let (f, g) = (fine[sub], fine[sub + 1]);
                    let d = before.abs().max(after.abs());
                    let rest = half.mul_add(d, -(g - f).abs());
                    (top, bottom) = (top.max(g), bottom.min(g));
                    (high, low) = (high.max(g), low.min(g));
                    if S::any(zero.lt(rest)) {
                        let rest = rest.max(zero);
                        let between = half * rest * rest * d.max(tiny).recip();
                        (high, low) = (high.max(f.max(g) + between), low.min(f.min(g) - between));
                    }
                    let next = if sub + 2 < FINE { bend(&fine, sub + 2) } else { after + after - before };
                    (before, after) = (after, next);
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
            self.samples.middles[i * torques..(i + 1) * torques].copy_from_slice(&middle[..torques]);
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
        measure(course, rows, x, &self.asked, FINE + 1, &mut self.values);
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
        measure(course, rows, &profile.x, &self.asked, 1, &mut self.values);
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
