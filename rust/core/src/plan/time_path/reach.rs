//! Reachability analysis (Pham and Pham 2018, TOPP-RA) on a grid, with `x = (ds/dt)^2` and `u = d^2 s/dt^2` constant between
//! grid points, so that `x_(i+1) = x_i + 2 h u_i`:
//!
//! ```text
//! K_N = {x_end},   K_i = {x : some u obeys all rows of segment i and x + 2 h u lies in K_(i+1)}          (backward)
//! u_i = largest u that obeys them at x_i,   x_(i+1) = x_i + 2 h u_i                                    (forward)
//! ```
//!
//! A row `lo <= alpha u + beta x + gamma <= hi` is imposed at both ends of the segment and half way between them. At one `x` the rows leave `u` between
//! the largest of lines `L(x)` and the smallest of lines `U(x)`; `U - L` is concave, so Newton's method on its active pair of
//! lines finds an end of `K_i` in a few steps, from outside. The lanes run over the rows.
//!
//! A constant `u` under a limit that changes along the segment loses time in proportion to `h`. So once the limits that a profile
//! follows are known, `u` is given their slope, `u_i + b (s - s_i - h/2)`: that adds constants to the rows, changes nothing else
//! above, and what is lost goes with `h^2`.

use crate::scalar::{Real, Task, run_lanes};

/// Above every squared path speed.
pub(super) const FASTEST: f64 = 1e60;
/// A coefficient of `u` below this is none.
const NONE: f64 = 1e-140;
const FAR: f64 = 1e200;
/// How far above its middle a row is held in a segment, as a share of its rise above the chord there: a parabola that obeys
/// its limit at both ends and so in the middle is past it by at most 0.14 of that rise.
const SHARE: f64 = 0.25;
/// Slack of `L <= U` against rounding, relative.
const ROUNDING: f64 = 1e-13;
/// What a static torque that stands on its limit is given, relative to the limit.
pub(super) const STANDING: f64 = 3e-10;
/// Lane counts divide this.
pub(super) const BLOCK: usize = 8;

/// The rows of a problem on a grid; widths are padded to whole blocks, with limits that never bind.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub width: usize,
    /// `(N + 1, 3 width)`: `A, B, g` at the grid points, and `(N, 3 width)` half way between them.
    pub coefficients: Vec<f64>,
    pub middles: Vec<f64>,
    /// `(width,)`: limits, and what `STANDING` and tolerances are relative to.
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    pub scale_lo: Vec<f64>,
    pub scale_hi: Vec<f64>,
    /// `(N, width)`: what the limits are narrowed by, segment by segment.
    pub tight_lo: Vec<f64>,
    pub tight_hi: Vec<f64>,
    /// `(N,)`: the slope `du/ds` that the path acceleration is given in each segment, about its mean.
    pub bend: Vec<f64>,
    /// `(N + 1,)`: bounds of `x`.
    pub cap: Vec<f64>,
    /// `(N + 1,)`: path positions.
    pub s: Vec<f64>,
    pub x_start: f64,
    pub x_end: f64,
}

/// Where no speed is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stuck {
    /// No path speed at the start of this segment obeys the limits and reaches the next one.
    Empty(usize),
    /// The start speed is outside of what the path allows: the bounds of `x` there.
    Start(f64, f64),
    /// The end speed is above its bound.
    End(f64),
}

/// `K_i` and the profile.
#[derive(Clone, Debug, Default)]
pub(super) struct Profile {
    pub low: Vec<f64>,
    pub high: Vec<f64>,
    pub x: Vec<f64>,
}

/// The lines of one segment, `3 width` of each: `L`, `U` at `x = 0`, and the slope of both.
struct Lines {
    upper: Vec<f64>,
    lower: Vec<f64>,
    slope: Vec<f64>,
    /// Bounds of `x` from rows without `u`.
    low: f64,
    high: f64,
}

/// The active lines: `U` and `L` at `x`, their values at zero and their slopes.
struct Gap {
    upper: f64,
    upper_rest: f64,
    upper_slope: f64,
    lower: f64,
    lower_rest: f64,
    lower_slope: f64,
}

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

/// The middle row, raised by a share of its rise above the chord.
#[inline(always)]
fn raise<S: Real>(m: S, x: S, y: S) -> S {
    S::splat(SHARE).mul_add(S::splat(0.5).neg_mul_add(x + y, m), m)
}

#[inline(always)]
pub(super) fn largest<S: Real>(x: S) -> f64 {
    let mut best = x.lane(0);
    for lane in 1..S::LANES {
        if x.lane(lane) > best {
            best = x.lane(lane);
        }
    }
    best
}

impl Lines {
    fn new(width: usize) -> Self {
        let zeros = || vec![0.0; 3 * width];
        Lines { upper: zeros(), lower: zeros(), slope: zeros(), low: 0.0, high: FASTEST }
    }

    /// The rows of segment `i`: at its start, and at its end with `x + 2 h u` for `x`; limits widened by `widen` of their scale.
    #[inline(always)]
    fn build<S: Real>(&mut self, rows: &Rows, i: usize, widen: f64) {
        let w = rows.width;
        let step = rows.s[i + 1] - rows.s[i];
        let (h, turn, dip) = (S::splat(step), S::splat(0.5 * step * rows.bend[i]), S::splat(0.25 * step * step * rows.bend[i]));
        let (zero, none, far) = (S::zero(), S::splat(NONE), S::splat(FAR));
        let (standing, widen) = (S::splat(STANDING), S::splat(widen));
        let (mut low, mut high) = (zero, S::splat(FASTEST));
        let (first, last) = (&rows.coefficients[i * 3 * w..(i + 1) * 3 * w], &rows.coefficients[(i + 1) * 3 * w..(i + 2) * 3 * w]);
        let middle = &rows.middles[i * 3 * w..(i + 1) * 3 * w];
        let mut k = 0;
        while k < w {
            let (scale_hi, scale_lo) = (load::<S>(&rows.scale_hi, k), load::<S>(&rows.scale_lo, k));
            let limit_hi = widen.mul_add(scale_hi, load::<S>(&rows.hi, k));
            let limit_lo = widen.neg_mul_add(scale_lo, load::<S>(&rows.lo, k));
            let (tight_hi, tight_lo) = (load::<S>(&rows.tight_hi, i * w + k), load::<S>(&rows.tight_lo, i * w + k));
            let (b0, b2, bm) = (load::<S>(first, w + k), load::<S>(last, w + k), load::<S>(middle, w + k));
            let (g0, g2, gm) = (load::<S>(first, 2 * w + k), load::<S>(last, 2 * w + k), load::<S>(middle, 2 * w + k));
            // With x + 2 u (s - s_i) for the squared speed.
            let a0 = load::<S>(first, k);
            let a2 = (h + h).mul_add(b2, load::<S>(last, k));
            let am = h.mul_add(bm, load::<S>(middle, k));
            // What the bend of u adds: it leaves the mean of u, and so x at the end, as they are.
            let g0 = turn.neg_mul_add(a0, g0);
            let g2 = turn.mul_add(load::<S>(last, k), g2);
            let gm = dip.neg_mul_add(bm, gm);
            let points = [(a0, b0, g0), (a2, b2, g2), (raise(am, a0, a2), raise(bm, b0, b2), raise(gm, g0, g2))];
            for which in 0..3 {
                let (alpha, beta, gamma) = points[which];
                // A torque that stands on its limit, up to rounding, may stay there.
                let room_hi = (limit_hi - tight_hi - gamma).max((limit_hi - gamma).min(zero) + standing * scale_hi);
                let room_lo = (limit_lo + tight_lo - gamma).min((limit_lo - gamma).max(zero) - standing * scale_lo);
                let idle = alpha.abs().lt(none);
                let inverse = S::select(idle, S::splat(1.0), alpha).recip();
                let (a, b) = (room_hi * inverse, room_lo * inverse);
                let slope = -(beta * inverse);
                let at = which * w + k;
                store(S::select(idle, far, a.max(b)), &mut self.upper, at);
                store(S::select(idle, -far, a.min(b)), &mut self.lower, at);
                store(S::select(idle, zero, slope), &mut self.slope, at);
                if S::any(idle) {
                    // beta x between the rooms; without beta they must hold zero.
                    let still = beta.abs().lt(none);
                    let inverse = S::select(still, S::splat(1.0), beta).recip();
                    let (a, b) = (room_hi * inverse, room_lo * inverse);
                    let blocked_hi = S::select(room_hi.lt(zero), -far, far);
                    let blocked = S::select(zero.lt(room_lo), -far, blocked_hi);
                    high = high.min(S::select(idle, S::select(still, blocked, a.max(b)), far));
                    low = low.max(S::select(idle, S::select(still, -far, a.min(b)), -far));
                }
            }
            k += S::LANES;
        }
        self.low = largest(low).max(0.0);
        self.high = -largest(-high);
    }

    /// `U` and `L` at `x`, together with the way into `K_(i+1)`.
    #[inline(always)]
    fn gap<S: Real>(&self, x: f64, target: [f64; 3]) -> Gap {
        let at = S::splat(x);
        let zero = S::zero();
        let (mut upper, mut upper_rest, mut upper_slope) = (S::splat(FAR), zero, zero);
        let (mut lower, mut lower_rest, mut lower_slope) = (S::splat(-FAR), zero, zero);
        let mut k = 0;
        while k < self.slope.len() {
            let slope = load::<S>(&self.slope, k);
            let (u_rest, l_rest) = (load::<S>(&self.upper, k), load::<S>(&self.lower, k));
            let (u, l) = (slope.mul_add(at, u_rest), slope.mul_add(at, l_rest));
            let (less, more) = (u.lt(upper), lower.lt(l));
            upper = S::select(less, u, upper);
            upper_rest = S::select(less, u_rest, upper_rest);
            upper_slope = S::select(less, slope, upper_slope);
            lower = S::select(more, l, lower);
            lower_rest = S::select(more, l_rest, lower_rest);
            lower_slope = S::select(more, slope, lower_slope);
            k += S::LANES;
        }
        let [inverse, low, high] = target;
        let (upper_target, lower_target) = ((high - x) * inverse, (low - x) * inverse);
        let mut gap = Gap {
            upper: upper_target,
            upper_rest: high * inverse,
            upper_slope: -inverse,
            lower: lower_target,
            lower_rest: low * inverse,
            lower_slope: -inverse,
        };
        for lane in 0..S::LANES {
            if upper.lane(lane) < gap.upper {
                (gap.upper, gap.upper_rest, gap.upper_slope) = (upper.lane(lane), upper_rest.lane(lane), upper_slope.lane(lane));
            }
            if lower.lane(lane) > gap.lower {
                (gap.lower, gap.lower_rest, gap.lower_slope) = (lower.lane(lane), lower_rest.lane(lane), lower_slope.lane(lane));
            }
        }
        gap
    }

    /// The end of `K_i` seen from `from`, which is on the side of `away`; never beyond `limit`.
    #[inline(always)]
    fn end<S: Real>(&self, from: f64, limit: f64, target: [f64; 3]) -> Option<f64> {
        let away = if from >= limit { 1.0 } else { -1.0 };
        let mut x = from;
        for _ in 0..100 {
            let gap = self.gap::<S>(x, target);
            if gap.open() {
                return Some(x);
            }
            let slope = gap.upper_slope - gap.lower_slope;
            // The gap must widen on the way in, and the way must not be over.
            if !(slope * away < 0.0) || x == limit {
                return None;
            }
            // From their values at zero: a step from a far x would drown in it.
            let next = (gap.lower_rest - gap.upper_rest) / slope;
            // No further in, up to the rounding of the crossing: this is the end.
            if !((x - next) * away > ROUNDING * x.abs()) {
                return Some(x);
            }
            x = if (next - limit) * away > 0.0 { next } else { limit };
        }
        None
    }

    /// `K_i`.
    #[inline(always)]
    fn controllable<S: Real>(&self, cap: f64, target: [f64; 3]) -> Option<(f64, f64)> {
        let (low, high) = (self.low, self.high.min(cap));
        if !(low <= high) {
            return None;
        }
        let high = self.end::<S>(high, low, target)?;
        let low = self.end::<S>(low, high, target).unwrap_or(high);
        Some((low, high))
    }
}

#[inline(always)]
fn target(rows: &Rows, i: usize, low: f64, high: f64) -> [f64; 3] {
    [0.5 / (rows.s[i + 1] - rows.s[i]), low, high]
}

struct Solve<'a>(&'a Rows, &'a mut Profile);

impl Task for Solve<'_> {
    type Output = Result<(), Stuck>;
    #[inline(always)]
    fn run<S: Real>(self) -> Result<(), Stuck> {
        let Solve(rows, profile) = self;
        let count = rows.s.len() - 1;
        for values in [&mut profile.low, &mut profile.high, &mut profile.x] {
            values.resize(count + 1, 0.0);
        }
        let mut lines = Lines::new(rows.width);
        if !(rows.x_end <= rows.cap[count]) {
            return Err(Stuck::End(rows.cap[count]));
        }
        (profile.low[count], profile.high[count]) = (rows.x_end, rows.x_end);
        for i in (0..count).rev() {
            lines.build::<S>(rows, i, 0.0);
            let target = target(rows, i, profile.low[i + 1], profile.high[i + 1]);
            let Some((low, high)) = lines.controllable::<S>(rows.cap[i], target) else { return Err(Stuck::Empty(i)) };
            (profile.low[i], profile.high[i]) = (low, high);
        }
        let (low, high) = (profile.low[0], profile.high[0]);
        if !(rows.x_start >= low * (1.0 - STANDING) && rows.x_start <= high * (1.0 + STANDING)) {
            return Err(Stuck::Start(low, high));
        }
        profile.x[0] = rows.x_start;
        for i in 0..count {
            lines.build::<S>(rows, i, 0.0);
            let (low, high) = (profile.low[i + 1], profile.high[i + 1]);
            let gap = lines.gap::<S>(profile.x[i], target(rows, i, low, high));
            let next = profile.x[i] + 2.0 * (rows.s[i + 1] - rows.s[i]) * gap.upper;
            profile.x[i + 1] = next.max(low).min(high);
        }
        Ok(())
    }
}

/// The fastest profile on the grid.
pub(super) fn solve(rows: &Rows, profile: &mut Profile) -> Result<(), Stuck> {
    run_lanes(Solve(rows, profile))
}

/// The limits of `u` at point `i` alone.
#[inline(always)]
fn alone<S: Real>(rows: &Rows, i: usize, x: f64) -> [f64; 2] {
    let w = rows.width;
    let c = &rows.coefficients[i * 3 * w..(i + 1) * 3 * w];
    let x = S::splat(x);
    let (mut upper, mut lower) = (S::splat(FAR), S::splat(-FAR));
    let mut k = 0;
    while k < w {
        let (alpha, rest) = (load::<S>(c, k), x.mul_add(load::<S>(c, w + k), load::<S>(c, 2 * w + k)));
        let idle = alpha.abs().lt(S::splat(NONE));
        let inverse = S::select(idle, S::splat(1.0), alpha).recip();
        let (a, b) = ((load::<S>(&rows.hi, k) - rest) * inverse, (load::<S>(&rows.lo, k) - rest) * inverse);
        upper = upper.min(S::select(idle, S::splat(FAR), a.max(b)));
        lower = lower.max(S::select(idle, S::splat(-FAR), a.min(b)));
        k += S::LANES;
    }
    [-largest(-upper), largest(lower)]
}

struct Bends<'a>(&'a mut Rows, &'a Profile);

impl Task for Bends<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let Bends(rows, profile) = self;
        let mut before = alone::<S>(rows, 0, profile.x[0]);
        for i in 0..rows.bend.len() {
            let after = alone::<S>(rows, i + 1, profile.x[i + 1]);
            let h = rows.s[i + 1] - rows.s[i];
            let (x0, x1) = (profile.x[i], profile.x[i + 1]);
            let u = 0.5 * (x1 - x0) / h;
            let room = (before[0] - before[1]).min(after[0] - after[1]);
            rows.bend[i] = 0.0;
            for side in 0..2 {
                let (from, to) = (before[side], after[side]);
                let (mean, rise) = (0.5 * (from + to), to - from);
                let least = if side == 0 { from.min(to) } else { from.max(to) };
                let near = 1e-3 * rise.abs() + 1e-5 * u.abs();
                let follows = (u - least).abs() <= near || (u - mean).abs() <= near + 0.1 * rise.abs();
                // x stays well above zero within the segment.
                let sound = x0.min(x1) + h * u.abs() >= 2.0 * h * rise.abs();
                if follows && sound && rise.abs() <= 0.2 * room {
                    rows.bend[i] = rise / h;
                }
            }
            before = after;
        }
    }
}

/// Give `u` the slope of the limit that it follows, where it follows one.
pub(super) fn bend(rows: &mut Rows, profile: &Profile) {
    run_lanes(Bends(rows, profile));
}

struct Widened<'a>(&'a Rows, usize, f64, [f64; 2]);

impl Task for Widened<'_> {
    type Output = Option<(f64, f64)>;
    #[inline(always)]
    fn run<S: Real>(self) -> Option<(f64, f64)> {
        let Widened(rows, i, widen, [low, high]) = self;
        let mut lines = Lines::new(rows.width);
        lines.build::<S>(rows, i, widen);
        lines.controllable::<S>(rows.cap[i], target(rows, i, low, high))
    }
}

/// `K_i` where limits are wider by `widen` of their scale, from `K_(i+1)`.
pub(super) fn widened(rows: &Rows, i: usize, widen: f64, next: [f64; 2]) -> Option<(f64, f64)> {
    run_lanes(Widened(rows, i, widen, next))
}
