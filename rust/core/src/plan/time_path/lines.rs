//! The bounds of the path acceleration `u` on one segment, as lines in the plane of `x = (ds/dt)^2` and `u`.
//!
//! A segment has rows `lo <= alpha u + beta x + gamma <= hi` at its start, in its middle and at its end. `alpha`, `beta` and `gamma` are
//! the coefficients of one row. Row `k` bounds `u` by an upper line `U_k` and a lower line `L_k`. So `u` is between `L(x)`, the largest
//! lower line, and `U(x)`, the smallest upper line.
//!
//! ```text
//! U_k(x) = max(margin_hi/alpha, margin_lo/alpha) - (beta/alpha) x,   L_k(x) = min(..) - (beta/alpha) x,   margin = limit - gamma
//! ```
//!
//! `U - L` is a concave function of `x`. So Newton's method on the two active lines, started outside, finds an end of `{x : L(x) <= U(x)}`.
//! A *lane* is one entry of a SIMD register; here each lane has one row. The lines are stored, and a later pass builds only the lines of
//! segments whose rows changed. `K_i` is the controllable set at the start of segment `i` (`passes`).

use super::limits::Limits;
use super::tip::{Ball, Tangent};
use super::tuning::{FAR, FASTEST, MIDDLE_MARGIN, NEWTON_STEPS, NONE, ROUNDED_COEFFICIENT, ROUNDING, STATIC_EXCESS};
use crate::scalar::Real;
use nalgebra::Vector3;

/// The number of rows is padded to a multiple of this number, which every lane count divides.
pub(super) const BLOCK: usize = 8;

/// The rows of a problem on a grid of `N` segments. Rows that are always within their limits are added, so that `width` is a multiple of
/// `BLOCK`.
#[derive(Clone, Debug, Default)]
pub(super) struct LimitRows {
    pub width: usize,
    /// `(N + 1, 3 width)`: the coefficients `A, B, g` of the rows `A u + B x + g` at the grid points.
    pub coefficients: Vec<f64>,
    /// `(N, 3 width)`: the coefficients `A, B, g` of the rows `A u + B x + g` at the midpoints of segments.
    pub middles: Vec<f64>,
    /// The part of `g` from tangents of viscous friction. It is not part of a static torque. The shapes are `(N + 1, width)` at grid
    /// points, `(N, width)` at midpoints; empty without viscous friction.
    pub moving: [Vec<f64>; 2],
    /// The limits of the rows; then the limits of speeds, which are not rows but caps.
    pub limits: Limits,
    /// `(N, width)`: how much the lower limit of each row is raised on each segment, and how much the upper limit is lowered.
    pub tight_lo: Vec<f64>,
    pub tight_hi: Vec<f64>,
    /// `(N,)`: the slope `du/ds` within each segment. The slope does not change the mean of `u` over the segment.
    pub u_slope: Vec<f64>,
    /// `(N + 1,)`: the caps, upper bounds of `x`.
    pub cap: Vec<f64>,
    /// `(N + 1,)`: path positions.
    pub s: Vec<f64>,
    /// The prescribed squared path speeds `(ds/dt)^2` at the start and at the end.
    pub x_start: f64,
    pub x_end: f64,
    /// The index of the first of three rows with the frame's acceleration, and the limit of the norm of the acceleration; `None` without
    /// this limit.
    pub ball: Option<(usize, f64)>,
}

impl LimitRows {
    /// Set `A` to zero where `A` is only a rounding error. This happens where the path turns back. A division by this error would make `u`
    /// depend on the last digit of `B x`.
    pub fn drop_rounding(&mut self) {
        let width = self.width;
        let mut least = vec![0.0_f64; width];
        for c in self.coefficients.chunks_exact(3 * width) {
            least.iter_mut().zip(c).for_each(|(least, a)| *least = least.max(ROUNDED_COEFFICIENT * a.abs()));
        }
        for c in self.coefficients.chunks_exact_mut(3 * width) {
            c.iter_mut().zip(&least).filter(|(a, least)| a.abs() < **least).for_each(|(a, _)| *a = 0.0);
        }
    }
}

/// The lines of all segments.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    /// `(N, 3 width)`: the value of each upper line at `x = 0`.
    upper: Vec<f64>,
    /// `(N, 3 width)`: the value of each lower line at `x = 0`.
    lower: Vec<f64>,
    /// `(N, 3 width)`: the slope `du/dx` of the upper and of the lower line.
    slope: Vec<f64>,
    /// `(N,)`: the lower and the upper bound of `x` from rows without `u`, and from the limit of the frame's acceleration.
    low: Vec<f64>,
    high: Vec<f64>,
    /// The number of upper lines of one segment, three times the number of rows.
    width: usize,
    /// `(N,)`: the limit of the frame's acceleration at the start, end and middle of each segment; empty without this limit.
    balls: Vec<[Ball; 3]>,
}

/// The smallest upper line `U` and the largest lower line `L` at one `x`, and their indices in the lists. The index `NEXT_INTERVAL` is the
/// condition that the next `x` is in `K_(i+1)`. The index `BALL` is the limit of the frame's acceleration.
struct Gap {
    upper: f64,
    upper_at: usize,
    lower: f64,
    lower_at: usize,
    /// The tangent of the limit of the frame's acceleration where this limit is the upper bound of `u`: the value at `x = 0`, and the
    /// slope. `lower_tangent` is the corresponding tangent of the lower bound.
    upper_tangent: (f64, f64),
    lower_tangent: (f64, f64),
}

const NEXT_INTERVAL: usize = usize::MAX;
const BALL: usize = usize::MAX - 1;

impl Gap {
    #[inline(always)]
    fn open(&self) -> bool {
        self.upper - self.lower >= -ROUNDING * (self.upper.abs() + self.lower.abs())
    }
}

#[inline(always)]
pub(super) fn load<S: Real>(from: &[f64], at: usize) -> S {
    S::load(&from[at..])
}

#[inline(always)]
pub(super) fn store<S: Real>(x: S, to: &mut [f64], at: usize) {
    x.store(&mut to[at..]);
}

/// The middle value `m` of a row, raised by `MIDDLE_MARGIN` of its rise above the chord from `x` to `y`.
#[inline(always)]
fn raise<S: Real>(m: S, x: S, y: S) -> S {
    S::splat(MIDDLE_MARGIN).mul_add(S::splat(0.5).neg_mul_add(x + y, m), m)
}

/// The largest entry of a register: each pass compares the two halves of the remaining entries.
#[inline(always)]
pub(super) fn largest<S: Real>(x: S) -> f64 {
    const { assert!(S::LANES <= BLOCK) };
    let mut part = [f64::NEG_INFINITY; BLOCK];
    x.store(&mut part);
    for half in [4, 2, 1] {
        for lane in 0..half {
            part[lane] = if part[lane + half] > part[lane] { part[lane + half] } else { part[lane] };
        }
    }
    part[0]
}

impl Lines {
    /// Allocate memory for `segments` segments of `width` rows.
    pub fn resize(&mut self, segments: usize, width: usize, balls: bool) {
        self.width = 3 * width;
        self.balls.resize(if balls { segments } else { 0 }, Default::default());
        for values in [&mut self.upper, &mut self.lower, &mut self.slope] {
            values.resize(segments * self.width, 0.0);
        }
        for values in [&mut self.low, &mut self.high] {
            values.resize(segments, 0.0);
        }
    }

    /// Write the lines of segment `i` into the lists at index `place`. Rows at the end of the segment have `x + 2 h u` in place of `x`.
    /// Limits are wider by `widen` times their scale.
    #[inline(always)]
    pub fn build<S: Real>(&mut self, rows: &LimitRows, i: usize, place: usize, widen: f64) {
        let w = rows.width;
        let step = rows.s[i + 1] - rows.s[i];
        let (h, turn, dip) = (S::splat(step), S::splat(0.5 * step * rows.u_slope[i]), S::splat(0.25 * step * step * rows.u_slope[i]));
        let (zero, none, far) = (S::zero(), S::splat(NONE), S::splat(FAR));
        let (static_excess, widen) = (S::splat(STATIC_EXCESS), S::splat(widen));
        let (mut low, mut high) = (zero, S::splat(FASTEST));
        let (first, last) = (&rows.coefficients[i * 3 * w..(i + 1) * 3 * w], &rows.coefficients[(i + 1) * 3 * w..(i + 2) * 3 * w]);
        let middle = &rows.middles[i * 3 * w..(i + 1) * 3 * w];
        let rubs = !rows.moving[0].is_empty();
        let mut k = 0;
        while k < w {
            let (scale_hi, scale_lo) = (load::<S>(&rows.limits.scale_hi, k), load::<S>(&rows.limits.scale_lo, k));
            let limit_hi = widen.mul_add(scale_hi, load::<S>(&rows.limits.hi, k));
            let limit_lo = widen.neg_mul_add(scale_lo, load::<S>(&rows.limits.lo, k));
            let (tight_hi, tight_lo) = (load::<S>(&rows.tight_hi, i * w + k), load::<S>(&rows.tight_lo, i * w + k));
            let (b0, b2, bm) = (load::<S>(first, w + k), load::<S>(last, w + k), load::<S>(middle, w + k));
            let (g0, g2, gm) = (load::<S>(first, 2 * w + k), load::<S>(last, 2 * w + k), load::<S>(middle, 2 * w + k));
            // The coefficients of `u` after `x + 2 u (s - s_i)` is inserted for the squared speed at `s`.
            let a0 = load::<S>(first, k);
            let a2 = (h + h).mul_add(b2, load::<S>(last, k));
            let am = h.mul_add(bm, load::<S>(middle, k));
            // The slope of `u` adds these constants to the rows. It changes neither the mean of `u` nor `x` at the end. A static torque
            // does not contain these constants.
            let (p0, p2, pm) = (-(turn * a0), turn * load::<S>(last, k), -(dip * bm));
            let (p0, p2, pm) = if rubs {
                let [points, middles] = &rows.moving;
                (p0 + load(points, i * w + k), p2 + load(points, (i + 1) * w + k), pm + load(middles, i * w + k))
            } else {
                (p0, p2, pm)
            };
            let points = [(a0, b0, g0, p0), (a2, b2, g2, p2), (raise(am, a0, a2), raise(bm, b0, b2), raise(gm, g0, g2), raise(pm, p0, p2))];
            for which in 0..3 {
                let (alpha, beta, still, moving) = points[which];
                // A torque at rest may equal its limit up to rounding: the tolerance is `STATIC_EXCESS`.
                let (over, under) = (limit_hi - still, limit_lo - still);
                let margin_hi = (over - tight_hi).max(over.min(zero) + static_excess * scale_hi) - moving;
                let margin_lo = (under + tight_lo).min(under.max(zero) - static_excess * scale_lo) - moving;
                let idle = alpha.abs().lt(none);
                let inverse = S::select(idle, S::splat(1.0), alpha).recip();
                let (a, b) = (margin_hi * inverse, margin_lo * inverse);
                let slope = -(beta * inverse);
                let at = (3 * place + which) * w + k;
                store(S::select(idle, far, a.max(b)), &mut self.upper, at);
                store(S::select(idle, -far, a.min(b)), &mut self.lower, at);
                store(S::select(idle, zero, slope), &mut self.slope, at);
                if S::any(idle) {
                    // Rows without `u` bound `x`: `beta x` is between `margin_lo` and `margin_hi`. If `beta` is zero too, zero must be
                    // between them.
                    let still = beta.abs().lt(none);
                    let inverse = S::select(still, S::splat(1.0), beta).recip();
                    let (a, b) = (margin_hi * inverse, margin_lo * inverse);
                    let blocked_hi = S::select(margin_hi.lt(zero), -far, far);
                    let blocked = S::select(zero.lt(margin_lo), -far, blocked_hi);
                    high = high.min(S::select(idle, S::select(still, blocked, a.max(b)), far));
                    low = low.max(S::select(idle, S::select(still, -far, a.min(b)), -far));
                }
            }
            k += S::LANES;
        }
        self.low[place] = largest(low).max(0.0);
        self.high[place] = -largest(-high);
        if let Some((k, radius)) = rows.ball {
            self.build_balls(rows, i, place, k, radius * (1.0 + widen.lane(0)));
        }
    }

    /// Store the limit `radius` of the frame's acceleration at the three points of segment `i`. Its components are the rows `k` to
    /// `k + 2`.
    fn build_balls(&mut self, rows: &LimitRows, i: usize, place: usize, k: usize, radius: f64) {
        let w = rows.width;
        let h = rows.s[i + 1] - rows.s[i];
        let (turn, dip) = (0.5 * h * rows.u_slope[i], 0.25 * h * h * rows.u_slope[i]);
        let row = |from: &[f64], at: usize| Vector3::new(from[at], from[at + 1], from[at + 2]);
        let (first, last) = (&rows.coefficients[i * 3 * w..], &rows.coefficients[(i + 1) * 3 * w..]);
        let middle = &rows.middles[i * 3 * w..];
        let (b0, b2, bm) = (row(first, w + k), row(last, w + k), row(middle, w + k));
        let (p0, p2, pm) = (row(first, k), row(last, k), row(middle, k));
        let start = [p0, b0, -turn * p0];
        let end = [p2 + 2.0 * h * b2, b2, turn * p2];
        let between = [pm + h * bm, bm, -dip * bm];
        let raised = std::array::from_fn(|at| between[at] + MIDDLE_MARGIN * (between[at] - 0.5 * (start[at] + end[at])));
        let radius = radius - rows.tight_hi[i * w + k];
        self.balls[place] = [start, end, raised].map(|vectors| Ball::new(vectors, radius));
        for (near, far) in self.balls[place].map(|ball| ball.range()) {
            (self.low[place], self.high[place]) = (self.low[place].max(near), self.high[place].min(far));
        }
    }

    /// The bounds of `u` from the frame's acceleration at `x`: the tangents of the smallest upper bound and of the largest lower bound.
    #[inline(always)]
    fn ball_tangents(&self, i: usize, x: f64) -> Option<[Tangent; 2]> {
        let [a, b, c] = self.balls.get(i)?.each_ref().map(|ball| ball.tangents(x));
        let lower = |a: Tangent, b: Tangent| if b.value < a.value { b } else { a };
        let higher = |a: Tangent, b: Tangent| if b.value > a.value { b } else { a };
        Some([lower(lower(a[0], b[0]), c[0]), higher(higher(a[1], b[1]), c[1])])
    }

    /// `U(x)` of segment `i`, the largest `u` that its rows allow.
    #[inline(always)]
    pub fn upper<S: Real>(&self, i: usize, x: f64) -> f64 {
        let all = i * self.width..(i + 1) * self.width;
        let (upper, slope) = (&self.upper[all.clone()], &self.slope[all]);
        let mut least = S::splat(FAR);
        let mut k = 0;
        while k < slope.len() {
            least = least.min(load::<S>(slope, k).mul_add(S::splat(x), load::<S>(upper, k)));
            k += S::LANES;
        }
        let least = -largest(-least);
        self.ball_tangents(i, x).map_or(least, |[upper, _]| least.min(upper.value))
    }

    /// The bounds `U` and `L` of `u` on segment `i` at `x`. They include the condition that the next `x` is between `low` and `high`.
    /// `inverse` is `1 / (2 h)`.
    #[inline(always)]
    fn gap<S: Real>(&self, i: usize, x: f64, [inverse, low, high]: [f64; 3]) -> Gap {
        let first = i * self.width;
        let all = first..first + self.width;
        let (upper, lower, slope) = (&self.upper[all.clone()], &self.lower[all.clone()], &self.slope[all]);
        let at = S::splat(x);
        let (mut least, mut least_at) = (S::splat(FAR), S::zero());
        let (mut most, mut most_at) = (S::splat(-FAR), S::zero());
        let mut k = 0;
        while k < slope.len() {
            let m = load::<S>(slope, k);
            let (u, l) = (m.mul_add(at, load::<S>(upper, k)), m.mul_add(at, load::<S>(lower, k)));
            let (less, more) = (u.lt(least), most.lt(l));
            let here = S::splat(k as f64);
            (least, least_at) = (S::select(less, u, least), S::select(less, here, least_at));
            (most, most_at) = (S::select(more, l, most), S::select(more, here, most_at));
            k += S::LANES;
        }
        let (mut up, mut down) = ((high - x) * inverse, (low - x) * inverse);
        let (mut up_lane, mut down_lane) = (NEXT_INTERVAL, NEXT_INTERVAL);
        for lane in 0..S::LANES {
            let (u, l) = (least.lane(lane), most.lane(lane));
            (up, up_lane) = if u < up { (u, lane) } else { (up, up_lane) };
            (down, down_lane) = if l > down { (l, lane) } else { (down, down_lane) };
        }
        let place = |lane: usize, block: S| if lane == NEXT_INTERVAL { NEXT_INTERVAL } else { first + block.lane(lane) as usize + lane };
        let (mut upper_at, mut lower_at) = (place(up_lane, least_at), place(down_lane, most_at));
        let (mut upper_tangent, mut lower_tangent) = ((0.0, 0.0), (0.0, 0.0));
        if let Some([least, most]) = self.ball_tangents(i, x) {
            if least.value < up {
                (up, upper_at, upper_tangent) = (least.value, BALL, (least.intercept, least.slope));
            }
            if most.value > down {
                (down, lower_at, lower_tangent) = (most.value, BALL, (most.intercept, most.slope));
            }
        }
        Gap { upper: up, upper_at, lower: down, lower_at, upper_tangent, lower_tangent }
    }

    /// Search one end of the controllable set `K_i`, starting at `from`, never beyond `limit`. `away` = 1 searches the upper end, `away` = -1 the
    /// lower end.
    #[inline(always)]
    fn end<S: Real>(&self, i: usize, from: f64, limit: f64, away: f64, target: [f64; 3]) -> Option<f64> {
        let [inverse, low, high] = target;
        let mut x = from;
        for _ in 0..NEWTON_STEPS {
            let gap = self.gap::<S>(i, x, target);
            if gap.open() {
                return Some(x);
            }
            let line = |list: &[f64], at: usize, way: f64, tangent: (f64, f64)| match at {
                NEXT_INTERVAL => (way * inverse, -inverse),
                BALL => tangent,
                at => (list[at], self.slope[at]),
            };
            let (upper_intercept, upper_slope) = line(&self.upper, gap.upper_at, high, gap.upper_tangent);
            let (lower_intercept, lower_slope) = line(&self.lower, gap.lower_at, low, gap.lower_tangent);
            let slope = upper_slope - lower_slope;
            // No `x` is feasible if the gap `U - L` does not widen inwards, or if the search is already at its limit.
            if !(slope * away < 0.0) || x == limit {
                return None;
            }
            // Compute the crossing from the values at `x = 0`: a step from a distant `x` would lose all digits.
            let next = (lower_intercept - upper_intercept) / slope;
            // If the crossing is not further inside, up to rounding, then `x` is the end.
            if !((x - next) * away > ROUNDING * x.abs()) {
                return Some(x);
            }
            x = if (next - limit) * away > 0.0 { next } else { limit };
        }
        None
    }

    /// Compute the controllable set `K_i`: the `x` at the start of segment `i`, at most `cap`, from which the motion can continue. The result is
    /// `None` if the interval is empty.
    #[inline(always)]
    pub fn controllable<S: Real>(&self, i: usize, cap: f64, target: [f64; 3]) -> Option<(f64, f64)> {
        let (low, high) = (self.low[i], self.high[i].min(cap));
        if !(low <= high) {
            return None;
        }
        let high = self.end::<S>(i, high, low, 1.0, target)?;
        let low = if low == high { low } else { self.end::<S>(i, low, high, -1.0, target).unwrap_or(high) };
        Some((low, high))
    }
}
