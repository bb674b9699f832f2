//! The samples of every segment, and their distance to the limits (`check`).
//!
//! A register holds a block of rows, one row per lane. In an interpolated segment, the distance of each block to its limits is first
//! estimated from three samples. The block with the smallest estimate is sampled first. Another block is sampled only if its estimate is
//! below the smallest distance so far, or below `FAR_ENOUGH`.

use super::check::{LimitCheck, measure};
use super::lines::{LimitRows, largest, load, store};
use super::passes::Profile;
use super::problem::PathProblem;
use super::samples::{Excess, Samples, Segment};
use super::tip::length;
use super::tuning::{CHECK_NODES, CHECK_STEPS, FAR_ENOUGH, FASTEST, TOLERANCE};
use crate::interrupt;
use crate::scalar::{GenericKernel, Real, run_lanes};

/// The values of a block of rows at the samples of a segment.
type RowSamples<S> = [S; CHECK_STEPS + 1];

/// Number of sample places of a segment, padded to whole registers.
const PLACES: usize = 16;
/// The sample places as fractions of the segment; one in the padding.
const AT: [f64; PLACES] = {
    let mut at = [1.0; PLACES];
    let mut sub = 0;
    while sub < CHECK_STEPS {
        at[sub] = sub as f64 / CHECK_STEPS as f64;
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
        (states.x[CHECK_STEPS], states.rate[CHECK_STEPS]) = (to, to.sqrt());
        states
    }
}

/// Number of segments between two checks for an interrupt.
const CHECK_INTERVAL: usize = 64;

struct Examine<'a> {
    problem: &'a PathProblem<'a>,
    x: &'a [f64],
    samples: &'a mut Samples,
}

impl Samples {
    /// Examine the segments, and return the smallest margin and the largest excess. Store the rows that exceed a limit in `exceeded`.
    /// Segments whose `x` did not change and that are within their limits keep their results.
    pub fn examine(&mut self, problem: &PathProblem, profile: &mut Profile) -> LimitCheck {
        let Profile { x, x_changed, .. } = profile;
        self.exceeded.clear();
        self.list.clear();
        self.evaluated.clear();
        for (i, segment) in self.segments.iter().enumerate() {
            if x_changed[i] || x_changed[i + 1] || !(segment.excess <= TOLERANCE) {
                self.list.push(i);
                if self.exact[i] {
                    self.evaluated.push(i);
                }
            }
        }
        x_changed.fill(false);
        measure(problem, x, &self.evaluated, CHECK_STEPS + 1, &mut self.values);
        run_lanes(Examine { problem, x, samples: self });
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

impl Examine<'_> {
    /// The values of a block of rows, from row `k` on, at all samples of segment `i`. They are interpolated from the `CHECK_NODES` grid points
    /// from `start` on.
    #[inline(always)]
    fn sample<S: Real>(&self, i: usize, k: usize, (start, weights): (usize, &[[f64; CHECK_NODES]]), states: &States) -> RowSamples<S> {
        let PathProblem { rows, slopes, stride, .. } = self.problem;
        let w = rows.width;
        let mut values = [S::zero(); CHECK_STEPS + 1];
        if k < w {
            let c = &rows.coefficients[start * 3 * w..(start + CHECK_NODES) * 3 * w];
            let mut points = [[S::zero(); 3]; CHECK_NODES];
            for m in 0..CHECK_NODES {
                for part in 0..3 {
                    points[m][part] = load(c, (3 * m + part) * w + k);
                }
            }
            for sub in 0..=CHECK_STEPS {
                let [mut a, mut b, mut g] = points[(i + sub / CHECK_STEPS - start).min(CHECK_NODES - 1)];
                if (1..CHECK_STEPS).contains(&sub) {
                    (a, b, g) = (S::zero(), S::zero(), S::zero());
                    for m in 0..CHECK_NODES {
                        let weight = S::splat(weights[sub - 1][m]);
                        (a, b, g) = (weight.mul_add(points[m][0], a), weight.mul_add(points[m][1], b), weight.mul_add(points[m][2], g));
                    }
                }
                values[sub] = S::splat(states.u[sub]).mul_add(a, S::splat(states.x[sub]).mul_add(b, g));
            }
        } else {
            let c = &slopes[start * stride..(start + CHECK_NODES) * stride];
            let mut points = [S::zero(); CHECK_NODES];
            for m in 0..CHECK_NODES {
                points[m] = load(c, m * stride + k - w);
            }
            for sub in 0..=CHECK_STEPS {
                let mut slope = points[(i + sub / CHECK_STEPS - start).min(CHECK_NODES - 1)];
                if (1..CHECK_STEPS).contains(&sub) {
                    slope = S::zero();
                    for m in 0..CHECK_NODES {
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
    fn outline<S: Real>(&self, i: usize, k: usize, (start, weights): (usize, &[[f64; CHECK_NODES]]), states: &States) -> [S; 3] {
        let PathProblem { rows, slopes, stride, .. } = self.problem;
        let w = rows.width;
        let weights = &weights[CHECK_STEPS / 2 - 1];
        let mut values = [S::zero(); 3];
        if k < w {
            let c = &rows.coefficients[start * 3 * w..(start + CHECK_NODES) * 3 * w];
            let mut middle = [S::zero(); 3];
            for m in 0..CHECK_NODES {
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
                let (sub, [a, b, g]) = (at * CHECK_STEPS / 2, points[at]);
                values[at] = S::splat(states.u[sub]).mul_add(a, S::splat(states.x[sub]).mul_add(b, g));
            }
        } else {
            let c = &slopes[start * stride..(start + CHECK_NODES) * stride];
            let mut middle = S::zero();
            for m in 0..CHECK_NODES {
                middle = S::splat(weights[m]).mul_add(load(c, m * stride + k - w), middle);
            }
            let first = (i - start) * stride + k - w;
            let points = [load(c, first), middle, load(c, first + stride)];
            for at in 0..3 {
                values[at] = points[at] * S::splat(states.rate[at * CHECK_STEPS / 2]);
            }
        }
        values
    }

    /// Estimate the largest relative excess of a block of rows: the largest of three samples, plus a margin for the values between them.
    #[inline(always)]
    fn estimate<S: Real>(&self, k: usize, [first, middle, last]: [S; 3]) -> f64 {
        let limits = &self.problem.rows.limits;
        let between = (first - (middle + middle) + last).abs() + S::splat(0.5) * (last - first).abs();
        let over = first.max(middle).max(last) + between - load::<S>(&limits.hi, k);
        let under = load::<S>(&limits.lo, k) - (first.min(middle).min(last) - between);
        largest((over * load::<S>(&limits.by_hi, k)).max(under * load::<S>(&limits.by_lo, k)))
    }

    /// Copy the samples that the dynamics computed for one segment. `order` is the index of this segment in the list of such segments.
    #[inline(always)]
    fn copy(&self, order: usize, values: &mut [f64]) {
        let Examine { problem, samples: Samples { values: measured, .. }, .. } = self;
        let (n, width, stride) = (problem.n, problem.rows.limits.lo.len(), problem.measured());
        for sub in 0..=CHECK_STEPS {
            let from = &measured[(order * (CHECK_STEPS + 1) + sub) * stride..][..stride];
            let to = &mut values[sub * width..(sub + 1) * width];
            let mut at = 0;
            for (kind, wanted) in problem.kinds.into_iter().enumerate() {
                if wanted {
                    to[at..at + n].copy_from_slice(&from[kind * n..(kind + 1) * n]);
                    at += n;
                }
            }
            if let Some(first) = problem.speeds {
                to[first..first + n].copy_from_slice(&from[2 * n..3 * n]);
            }
            if let Some(first) = problem.norms {
                (to[first], to[first + 1]) = (length(&from[3 * n..]), length(&from[3 * n + 3..]));
            }
        }
    }
}

/// A block of rows, from row `k` on, of all samples in `values`, `(CHECK_STEPS + 1, width)`.
#[inline(always)]
fn columns<S: Real>(values: &[f64], width: usize, k: usize) -> RowSamples<S> {
    let mut samples = [S::zero(); CHECK_STEPS + 1];
    for sub in 0..=CHECK_STEPS {
        samples[sub] = load(values, sub * width + k);
    }
    samples
}

/// The second difference of a row at sample `sub`. If this were a closure, the compiler might not inline it, and not use the SIMD
/// instructions of `run`.
#[inline(always)]
fn second_difference<S: Real>(values: &RowSamples<S>, sub: usize) -> S {
    values[sub - 1] - (values[sub] + values[sub]) + values[sub + 1]
}

/// Extrema of a block of rows over a segment: the largest and the smallest sample, then the estimates between samples (`check`).
#[inline(always)]
fn extrema<S: Real>(samples: &RowSamples<S>) -> [S; 4] {
    let (zero, half, tiny) = (S::zero(), S::splat(0.5), S::splat(f64::MIN_POSITIVE));
    let (mut top, mut bottom, mut high, mut low) = (samples[0], samples[0], samples[0], samples[0]);
    // At the ends, extrapolate the second differences.
    let mut after = second_difference(samples, 1);
    let mut before = after + after - second_difference(samples, 2);
    for sub in 0..CHECK_STEPS {
        let (f, g) = (samples[sub], samples[sub + 1]);
        let d = before.abs().max(after.abs());
        let inside = half.mul_add(d, -(g - f).abs());
        (top, bottom) = (top.max(g), bottom.min(g));
        (high, low) = (high.max(g), low.min(g));
        if S::any(zero.lt(inside)) {
            let inside = inside.max(zero);
            let between = half * inside * inside * d.max(tiny).recip();
            (high, low) = (high.max(f.max(g) + between), low.min(f.min(g) - between));
        }
        let next = if sub + 2 < CHECK_STEPS { second_difference(samples, sub + 2) } else { after + after - before };
        (before, after) = (after, next);
    }
    [top, bottom, high, low]
}

impl GenericKernel for Examine<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let limits = &self.problem.rows.limits;
        let width = limits.lo.len();
        let torques = if self.problem.kinds[0] { self.problem.n } else { 0 };
        let (mut values, mut middles, mut most) = (vec![0.0; (CHECK_STEPS + 1) * width], vec![0.0; width], vec![0.0; width]);
        let list = std::mem::take(&mut self.samples.list);
        let mut order = 0;
        for (k, &i) in list.iter().enumerate() {
            if k % CHECK_INTERVAL == 0 {
                interrupt::check();
            }
            let (first, last) = self.problem.spans[self.samples.span[i]];
            let stencil = self.problem.stencils.1.of(i, first, last).filter(|_| !self.samples.exact[i]);
            let mut states = States::default();
            if stencil.is_some() {
                states = States::of::<S>(&self.problem.rows, self.x, i);
            } else {
                self.copy(order, &mut values);
                order += 1;
            }
            let mut nearest = 0;
            if let Some(stencil) = stencil {
                for block in 0..width / S::LANES {
                    let k = block * S::LANES;
                    let outline = self.outline::<S>(i, k, stencil, &states);
                    if k < torques {
                        store(outline[1], &mut middles, k);
                    }
                    most[block] = self.estimate(k, outline);
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
                if turn > 0 && stencil.is_some() && most[block] <= -FAR_ENOUGH && most[block] <= largest(-margin) {
                    if k < torques {
                        of_torque = of_torque.max(most[block]);
                    }
                    continue;
                }
                let samples = match stencil {
                    Some(stencil) => self.sample::<S>(i, k, stencil, &states),
                    None => columns::<S>(&values, width, k),
                };
                let [top, bottom, high, low] = extrema(&samples);
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
                            let (below, above) = (under.lane(lane).max(0.0), over.lane(lane).max(0.0));
                            self.samples.exceeded.push(Excess { segment: i, row: k + lane, below, above });
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
