//! The samples of every segment, and their distance to the limits (`check`).
//!
//! A register holds a block of rows, one row per lane. In an interpolated segment, the distance of each block to its limits is first
//! estimated from three samples. The block with the smallest estimate is sampled first. Another block is sampled only if its estimate is
//! below the smallest distance so far, or below `FAR_ENOUGH`.

use super::check::{Course, FINE, LimitCheck, TOLERANCE, WINDOW, measure};
use super::lines::{LimitRows, largest, load, store};
use super::magnitudes::FASTEST;
use super::reach::Profile;
use super::samples::{Samples, Segment};
use super::tip::length;
use crate::interrupt;
use crate::scalar::{GenericKernel, Real, run_lanes};

/// The values of a block of rows at the samples of a segment.
type Fine<S> = [S; FINE + 1];

/// Number of sample places of a segment, padded to whole registers.
const PLACES: usize = 16;
/// The sample places as fractions of the segment; one in the padding.
const AT: [f64; PLACES] = {
    let mut at = [1.0; PLACES];
    let mut sub = 0;
    while sub < FINE {
        at[sub] = sub as f64 / FINE as f64;
        sub += 1;
    }
    at
};

/// Squared path speed, path acceleration and path speed at the samples, as computed by [`state`](super::check::state).
#[derive(Clone, Copy, Default)]
struct States {
    x: [f64; PLACES],
    u: [f64; PLACES],
    rate: [f64; PLACES],
}

impl States {
    #[inline(always)]
    fn of<S: Real>(rows: &LimitRows, x: &[f64], i: usize) -> Self {
        let (h, from, to) = (rows.s[i + 1] - rows.s[i], x[i], x[i + 1]);
        let (rise, turn) = (to - from, h * rows.u_slope[i]);
        let mean = 0.5 * rise / h;
        let mut states = States::default();
        let mut k = 0;
        while k < PLACES {
            let z = load::<S>(&AT, k);
            let dip = (z - z * z) * S::splat(h * turn);
            let here = (z.mul_add(S::splat(rise), S::splat(from)) - dip).max(S::zero());
            store(here, &mut states.x, k);
            store(here.sqrt(), &mut states.rate, k);
            store((z - S::splat(0.5)).mul_add(S::splat(turn), S::splat(mean)), &mut states.u, k);
            k += S::LANES;
        }
        // The last sample is exactly the end of the segment.
        (states.x[FINE], states.rate[FINE]) = (to, to.sqrt());
        states
    }
}

/// The smallest relative distance to the limits, estimated from three samples, at which a block may be skipped.
const FAR_ENOUGH: f64 = 0.01;
/// Number of segments between two checks for an interrupt.
const CHECK_INTERVAL: usize = 64;

struct Examine<'a, F> {
    course: &'a Course<'a>,
    rows: &'a LimitRows,
    x: &'a [f64],
    samples: &'a mut Samples,
    narrow: F,
}

impl Samples {
    /// Examine the segments, and return the smallest margin and the largest excess. `narrow(segment, row, below, above)` is called for each
    /// exceeded row, with its excess over the lower and the upper limit, in the unit of the row. Unchanged segments within their limits are
    /// not examined again.
    pub fn examine(
        &mut self,
        course: &Course,
        rows: &LimitRows,
        profile: &mut Profile,
        narrow: impl FnMut(usize, usize, f64, f64),
    ) -> LimitCheck {
        let Profile { x, moved, .. } = profile;
        self.list.clear();
        self.evaluated.clear();
        for (i, segment) in self.segments.iter().enumerate() {
            if moved[i] || moved[i + 1] || !(segment.excess <= TOLERANCE) {
                self.list.push(i);
                if self.exact[i] {
                    self.evaluated.push(i);
                }
            }
        }
        moved.fill(false);
        measure(course, rows, x, &self.evaluated, FINE + 1, &mut self.values);
        run_lanes(Examine { course, rows, x, samples: self, narrow });
        let mut found = LimitCheck { margin: f64::INFINITY, excess: f64::NEG_INFINITY, at: (0, 0) };
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
}

impl<F: FnMut(usize, usize, f64, f64)> Examine<'_, F> {
    /// The values of a block of rows, from row `k` on, at all samples of segment `i`. They are interpolated from the `WINDOW` grid points
    /// from `start` on.
    #[inline(always)]
    fn sample<S: Real>(&self, i: usize, k: usize, (start, weights): (usize, &[[f64; WINDOW]]), states: &States) -> Fine<S> {
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
                values[sub] = S::splat(states.u[sub]).mul_add(a, S::splat(states.x[sub]).mul_add(b, g));
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
                values[sub] = slope * S::splat(states.rate[sub]);
            }
        }
        values
    }

    /// The values of a block of rows, from row `k` on, at both ends of segment `i` and in its middle.
    #[inline(always)]
    fn outline<S: Real>(&self, i: usize, k: usize, (start, weights): (usize, &[[f64; WINDOW]]), states: &States) -> [S; 3] {
        let Examine { course, rows, .. } = self;
        let w = rows.width;
        let weights = &weights[FINE / 2 - 1];
        let mut values = [S::zero(); 3];
        if k < w {
            let c = &rows.coefficients[start * 3 * w..(start + WINDOW) * 3 * w];
            let mut middle = [S::zero(); 3];
            for m in 0..WINDOW {
                for part in 0..3 {
                    middle[part] = S::splat(weights[m]).mul_add(load(c, (3 * m + part) * w + k), middle[part]);
                }
            }
            let first = 3 * (i - start) * w + k;
            let points = [
                [load(c, first), load(c, first + w), load(c, first + 2 * w)],
                middle,
                [load(c, first + 3 * w), load(c, first + 4 * w), load(c, first + 5 * w)],
            ];
            for at in 0..3 {
                let (sub, [a, b, g]) = (at * FINE / 2, points[at]);
                values[at] = S::splat(states.u[sub]).mul_add(a, S::splat(states.x[sub]).mul_add(b, g));
            }
        } else {
            let c = &course.slopes[start * course.stride..(start + WINDOW) * course.stride];
            let mut middle = S::zero();
            for m in 0..WINDOW {
                middle = S::splat(weights[m]).mul_add(load(c, m * course.stride + k - w), middle);
            }
            let first = (i - start) * course.stride + k - w;
            let points = [load(c, first), middle, load(c, first + course.stride)];
            for at in 0..3 {
                values[at] = points[at] * S::splat(states.rate[at * FINE / 2]);
            }
        }
        values
    }

    /// Copy the samples that the dynamics computed for one segment. `order` is the index of this segment in the list of such segments.
    #[inline(always)]
    fn copy(&self, order: usize, values: &mut [f64]) {
        let Examine { course, samples: Samples { values: measured, .. }, .. } = self;
        let (n, width, stride) = (course.n, course.limits.lo.len(), course.measured());
        for sub in 0..=FINE {
            let from = &measured[(order * (FINE + 1) + sub) * stride..][..stride];
            let to = &mut values[sub * width..(sub + 1) * width];
            let mut at = 0;
            for (kind, wanted) in course.kinds.into_iter().enumerate() {
                if wanted {
                    to[at..at + n].copy_from_slice(&from[kind * n..(kind + 1) * n]);
                    at += n;
                }
            }
            if let Some(first) = course.speeds {
                to[first..first + n].copy_from_slice(&from[2 * n..3 * n]);
            }
            if let Some(first) = course.norms {
                (to[first], to[first + 1]) = (length(&from[3 * n..]), length(&from[3 * n + 3..]));
            }
        }
    }
}

/// The second difference of a row at sample `sub`. If this were a closure, the compiler might not inline it, and not use the SIMD
/// instructions of `run`.
#[inline(always)]
fn second_difference<S: Real>(values: &Fine<S>, sub: usize) -> S {
    values[sub - 1] - (values[sub] + values[sub]) + values[sub + 1]
}

impl<F: FnMut(usize, usize, f64, f64)> GenericKernel for Examine<'_, F> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(mut self) {
        let limits = self.course.limits;
        let width = limits.lo.len();
        let torques = if self.course.kinds[0] { self.course.n } else { 0 };
        let (mut values, mut middles, mut most) = (vec![0.0; (FINE + 1) * width], vec![0.0; width], vec![0.0; width]);
        let zero = S::zero();
        let (half, tiny) = (S::splat(0.5), S::splat(f64::MIN_POSITIVE));
        let list = std::mem::take(&mut self.samples.list);
        let mut order = 0;
        for (k, &i) in list.iter().enumerate() {
            if k % CHECK_INTERVAL == 0 {
                interrupt::check();
            }
            let (first, last) = self.course.spans[self.samples.span[i]];
            let window = self.course.stencil.of(i, first, last).filter(|_| !self.samples.exact[i]);
            let mut states = States::default();
            if window.is_some() {
                states = States::of::<S>(self.rows, self.x, i);
            } else {
                self.copy(order, &mut values);
                order += 1;
            }
            // Estimate the relative excess of each block: the largest of three samples, plus a margin for the values between them.
            let mut nearest = 0;
            if let Some(window) = window {
                for block in 0..width / S::LANES {
                    let k = block * S::LANES;
                    let [first, middle, last] = self.outline::<S>(i, k, window, &states);
                    if k < torques {
                        store(middle, &mut middles, k);
                    }
                    let spare = (first - (middle + middle) + last).abs() + half * (last - first).abs();
                    let over = first.max(middle).max(last) + spare - load::<S>(&limits.hi, k);
                    let under = load::<S>(&limits.lo, k) - (first.min(middle).min(last) - spare);
                    most[block] = largest((over * load::<S>(&limits.by_hi, k)).max(under * load::<S>(&limits.by_lo, k)));
                    // The comparison is negated, so that a NaN replaces a number.
                    if !(most[block] <= most[nearest]) {
                        nearest = block;
                    }
                }
            }
            let (mut margin, mut excess, mut of_torque, mut at) = (S::splat(FASTEST), f64::NEG_INFINITY, f64::NEG_INFINITY, 0);
            for turn in 0..width / S::LANES {
                // The block nearest to its limits is first. Skip a block if its estimate exceeds both `FAR_ENOUGH` and the smallest margin.
                let block = if turn == 0 { nearest } else { turn - usize::from(turn <= nearest) };
                let k = block * S::LANES;
                if turn > 0 && window.is_some() && most[block] <= -FAR_ENOUGH && most[block] <= largest(-margin) {
                    if k < torques {
                        of_torque = of_torque.max(most[block]);
                    }
                    continue;
                }
                let mut fine = [zero; FINE + 1];
                if let Some(window) = window {
                    fine = self.sample::<S>(i, k, window, &states);
                } else {
                    for sub in 0..=FINE {
                        fine[sub] = load(&values, sub * width + k);
                    }
                }
                let (mut top, mut bottom, mut high, mut low) = (fine[0], fine[0], fine[0], fine[0]);
                // At the ends, extrapolate the second differences.
                let mut after = second_difference(&fine, 1);
                let mut before = after + after - second_difference(&fine, 2);
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
                    let next = if sub + 2 < FINE { second_difference(&fine, sub + 2) } else { after + after - before };
                    (before, after) = (after, next);
                }
                let (lo, hi) = (load::<S>(&limits.lo, k), load::<S>(&limits.hi, k));
                let (by_lo, by_hi) = (load::<S>(&limits.by_lo, k), load::<S>(&limits.by_hi, k));
                margin = margin.min((hi - top) * by_hi).min((bottom - lo) * by_lo);
                let (over, under) = (high - hi, lo - low);
                let past = (over * by_hi).max(under * by_lo);
                let worst = largest(past);
                // The comparison is negated, so that a NaN replaces a number.
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
            }
            self.samples.middles[i * torques..(i + 1) * torques].copy_from_slice(&middles[..torques]);
            self.samples.segments[i] = Segment { margin: -largest(-margin), excess, at, torque: of_torque, proven: false };
        }
        self.samples.list = list;
    }
}
