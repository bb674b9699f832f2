//! Reachability analysis (Pham and Pham 2018, TOPP-RA) on a grid of path positions `s_i`, with `x = (ds/dt)^2` and `u = d^2 s/dt^2`. `u` is
//! constant between grid points at distance `h`, so that `x_(i+1) = x_i + 2 h u_i`:
//!
//! ```text
//! K_N = {x_end},   K_i = {x : some u obeys all rows of segment i, and x + 2 h u is in K_(i+1)}           (backward)
//! u_i = largest u that obeys all rows at x_i,   x_(i+1) = x_i + 2 h u_i                                (forward)
//! ```
//!
//! `K_i` is the controllable set of grid point `i`, an interval. Each segment has rows (limited quantities) at both ends and in the middle
//! (`lines`). Repeated passes compute only the segments whose rows or sets have changed.
//!
//! If a limit changes along a segment, a constant `u` loses time in proportion to `h`. So when the active limits of a profile are known,
//! `u` gets their slope `b`: `u_i + b (s - s_i - h/2)`. This only adds constants to the rows. For smooth limits the loss is then of order
//! `h^2`.

use super::lines::{LimitRows, Lines, largest, load};
use super::tip::Ball;
use super::tuning::{ACTIVE_LEVEL, ACTIVE_MEAN, ACTIVE_RISE, FAR, LARGEST_RISE, NONE, STATIC_EXCESS};
use crate::interrupt;
use crate::scalar::{GenericKernel, Real, run_lanes};
use nalgebra::Vector3;

/// Number of segments between two checks for an interrupt.
const CHECK_INTERVAL: usize = 1 << 12;

/// The reason why no profile is feasible on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Infeasible {
    /// The controllable set at the start of this segment is empty.
    EmptySet(usize),
    /// The start speed is not controllable. The fields are the smallest and the largest controllable `x` at the start.
    StartSpeed(f64, f64),
    /// The end speed is above its cap. The field is that cap, a bound of `x`.
    EndSpeed(f64),
}

/// The controllable sets `K_i`, from `low` to `high`, and the profile `x`, `(N + 1,)` each.
#[derive(Clone, Debug, Default)]
pub(super) struct Profile {
    pub low: Vec<f64>,
    pub high: Vec<f64>,
    pub x: Vec<f64>,
    /// A copy of the profile that exceeded its limits least.
    pub least_exceeding: Vec<f64>,
    /// `(N + 1,)`: points whose `x` changed since these flags were last cleared.
    pub x_changed: Vec<bool>,
    /// `(N,)`: segments whose rows changed since their lines were built.
    pub rows_changed: Vec<bool>,
    lines: Lines,
    /// `(N + 1,)`: points whose set `K_i` changed in the last backward pass.
    set_changed: Vec<bool>,
    /// `(N + 1,)`: the caps of `x` in the last backward pass.
    cap: Vec<f64>,
    /// Whether the next passes must compute all segments.
    pub recompute_all: bool,
}

impl Profile {
    /// Copy `x` to `least_exceeding`, for the case that later passes find no profile.
    pub fn store_least_exceeding(&mut self) {
        self.least_exceeding.clone_from(&self.x);
    }

    /// Adapt the sizes to the grid if all segments must be computed.
    fn begin(&mut self, rows: &LimitRows) {
        let count = rows.s.len() - 1;
        if !self.recompute_all && self.rows_changed.len() == count {
            return;
        }
        self.recompute_all = true;
        for values in [&mut self.low, &mut self.high, &mut self.x, &mut self.cap] {
            values.resize(count + 1, 0.0);
        }
        for (flags, length) in [(&mut self.x_changed, count + 1), (&mut self.set_changed, count + 1), (&mut self.rows_changed, count)] {
            flags.clear();
            flags.resize(length, true);
        }
        self.lines.resize(count, rows.width, rows.ball.is_some());
    }

    /// The backward pass: the controllable sets, from the end of the path to its start.
    #[inline(always)]
    fn backward_pass<S: Real>(&mut self, rows: &LimitRows, all: bool) -> Result<(), Infeasible> {
        let Profile { low, high, lines, rows_changed, set_changed, cap, .. } = self;
        let count = rows.s.len() - 1;
        if !(rows.x_end <= rows.cap[count]) {
            return Err(Infeasible::EndSpeed(rows.cap[count]));
        }
        (low[count], high[count], set_changed[count]) = (rows.x_end, rows.x_end, all);
        for i in (0..count).rev() {
            if i % CHECK_INTERVAL == 0 {
                interrupt::check();
            }
            if rows_changed[i] {
                lines.build::<S>(rows, i, i, 0.0);
            }
            if !(rows_changed[i] || set_changed[i + 1] || rows.cap[i] != cap[i]) {
                set_changed[i] = false;
                continue;
            }
            let target = target(rows, i, low[i + 1], high[i + 1]);
            let Some((from, to)) = lines.controllable::<S>(i, rows.cap[i], target) else { return Err(Infeasible::EmptySet(i)) };
            set_changed[i] = all || (from, to) != (low[i], high[i]);
            (low[i], high[i]) = (from, to);
        }
        if !(rows.x_start >= low[0] * (1.0 - STATIC_EXCESS) && rows.x_start <= high[0] * (1.0 + STATIC_EXCESS)) {
            return Err(Infeasible::StartSpeed(low[0], high[0]));
        }
        Ok(())
    }

    /// The forward pass: on each segment, the largest `u` within the limits that leads to the next controllable set.
    #[inline(always)]
    fn forward_pass<S: Real>(&mut self, rows: &LimitRows, all: bool) {
        let Profile { low, high, x, x_changed, lines, rows_changed, set_changed, .. } = self;
        let mut new = all;
        x[0] = rows.x_start;
        for i in 0..rows.s.len() - 1 {
            if !(rows_changed[i] || new || set_changed[i + 1]) {
                continue;
            }
            let step = 2.0 * (rows.s[i + 1] - rows.s[i]);
            let next = (x[i] + step * lines.upper::<S>(i, x[i])).max(low[i + 1]).min(high[i + 1]);
            new = next != x[i + 1];
            x_changed[i + 1] |= new;
            x[i + 1] = next;
        }
    }
}

/// Three numbers of the condition that the next `x` is in `K_(i+1)`: `1 / (2 h)`, and the two ends of the set `K_(i+1)`.
#[inline(always)]
fn target(rows: &LimitRows, i: usize, low: f64, high: f64) -> [f64; 3] {
    [0.5 / (rows.s[i + 1] - rows.s[i]), low, high]
}

/// The fastest profile on the grid, by the backward and the forward pass.
pub(super) struct Passes<'a>(pub &'a LimitRows, pub &'a mut Profile);

impl GenericKernel for Passes<'_> {
    type Output = Result<(), Infeasible>;
    #[inline(always)]
    fn run<S: Real>(self) -> Result<(), Infeasible> {
        let Passes(rows, profile) = self;
        profile.begin(rows);
        // After an error, `recompute_all` stays true, because the passes ended early.
        let all = std::mem::replace(&mut profile.recompute_all, true);
        profile.backward_pass::<S>(rows, all)?;
        profile.forward_pass::<S>(rows, all);
        profile.rows_changed.fill(false);
        profile.cap.copy_from_slice(&rows.cap);
        profile.recompute_all = false;
        Ok(())
    }
}

/// The upper and the lower bound of `u` at grid point `i` for `x = at`, from the rows at this point alone.
#[inline(always)]
fn acceleration_bounds<S: Real>(rows: &LimitRows, i: usize, at: f64) -> [f64; 2] {
    let w = rows.width;
    let c = &rows.coefficients[i * 3 * w..(i + 1) * 3 * w];
    let x = S::splat(at);
    let (mut upper, mut lower) = (S::splat(FAR), S::splat(-FAR));
    let mut k = 0;
    while k < w {
        let (alpha, constant) = (load::<S>(c, k), x.mul_add(load::<S>(c, w + k), load::<S>(c, 2 * w + k)));
        let idle = alpha.abs().lt(S::splat(NONE));
        let inverse = S::select(idle, S::splat(1.0), alpha).recip();
        let (a, b) = ((load::<S>(&rows.limits.hi, k) - constant) * inverse, (load::<S>(&rows.limits.lo, k) - constant) * inverse);
        upper = upper.min(S::select(idle, S::splat(FAR), a.max(b)));
        lower = lower.max(S::select(idle, S::splat(-FAR), a.min(b)));
        k += S::LANES;
    }
    let (upper, lower) = (-largest(-upper), largest(lower));
    let Some((k, radius)) = rows.ball else { return [upper, lower] };
    let row = |at: usize| Vector3::new(c[at], c[at + 1], c[at + 2]);
    let [most, least] = Ball::new([row(k), row(w + k), Vector3::zeros()], radius).tangents(at);
    [upper.min(most.value), lower.max(least.value)]
}

/// The slope of `u` on each segment where `u` follows a limit: the slope of that limit. The third field, `(N,)`, has the slopes along speed
/// limits.
pub(super) struct SetSlopes<'a>(pub &'a mut LimitRows, pub &'a mut Profile, pub &'a [f64]);

impl GenericKernel for SetSlopes<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let SetSlopes(rows, profile, caps) = self;
        let mut before = acceleration_bounds::<S>(rows, 0, profile.x[0]);
        for i in 0..rows.u_slope.len() {
            let after = acceleration_bounds::<S>(rows, i + 1, profile.x[i + 1]);
            let h = rows.s[i + 1] - rows.s[i];
            let (x0, x1) = (profile.x[i], profile.x[i + 1]);
            let u = 0.5 * (x1 - x0) / h;
            let distance = (before[0] - before[1]).min(after[0] - after[1]);
            let mut u_slope = 0.0;
            for side in 0..2 {
                let (from, to) = (before[side], after[side]);
                let (mean, rise) = (0.5 * (from + to), to - from);
                let least = if side == 0 { from.min(to) } else { from.max(to) };
                let near = ACTIVE_RISE * rise.abs() + ACTIVE_LEVEL * u.abs();
                let follows = (u - least).abs() <= near || (u - mean).abs() <= near + ACTIVE_MEAN * rise.abs();
                // If this condition is true, `x` is positive within the segment.
                let sound = x0.min(x1) + h * u.abs() >= 2.0 * h * rise.abs();
                if follows && sound && rise.abs() <= LARGEST_RISE * distance {
                    u_slope = rise / h;
                }
            }
            // Where `x` follows a cap, `u` may have the slope of the cap. The conditions are that `u` is then within its bounds at both
            // ends of the segment, and that `x` is positive within the segment.
            let half = 0.5 * h * caps[i];
            let inside = |at: f64, [most, least]: [f64; 2]| least <= at && at <= most;
            if inside(u - half, before) && inside(u + half, after) && x0.min(x1) + h * u.abs() >= 4.0 * h * half.abs() {
                u_slope = caps[i];
            }
            if rows.u_slope[i] != u_slope {
                rows.u_slope[i] = u_slope;
                profile.rows_changed[i] = true;
            }
            before = after;
        }
    }
}

/// Estimate the largest loss of time of each segment, as a fraction of the duration, and write it to `to`, `(N,)`.
///
/// In this profile the active limit changes at a grid point, where `u` jumps. In the optimum the limit changes within a segment. The loss
/// is the duration of the profile minus the duration of the optimum.
pub(super) fn time_losses(rows: &LimitRows, profile: &Profile, to: &mut Vec<f64>) {
    let count = rows.u_slope.len();
    let x = &profile.x;
    let step = |i: usize| rows.s[i + 1] - rows.s[i];
    let mean = |i: usize| 0.5 * (x[i + 1] - x[i]) / step(i);
    let time = |i: usize| 2.0 * step(i) / (x[i].sqrt() + x[i + 1].sqrt());
    to.clear();
    to.resize(count, 0.0);
    let mut total = time(0);
    for i in 1..count {
        total += time(i);
        let jump = (mean(i - 1) + 0.5 * step(i - 1) * rows.u_slope[i - 1] - (mean(i) - 0.5 * step(i) * rows.u_slope[i])).abs();
        for k in [i - 1, i] {
            to[k] = (jump * step(k) / (x[k] + x[k + 1])).min(1.0).max(to[k]);
        }
    }
    (0..count).for_each(|i| to[i] *= 0.25 * time(i) / total);
}

struct Widened<'a>(&'a LimitRows, usize, f64, [f64; 2]);

impl GenericKernel for Widened<'_> {
    type Output = Option<(f64, f64)>;
    #[inline(always)]
    fn run<S: Real>(self) -> Option<(f64, f64)> {
        let Widened(rows, i, widen, [low, high]) = self;
        let mut lines = Lines::default();
        lines.resize(1, rows.width, rows.ball.is_some());
        lines.build::<S>(rows, i, 0, widen);
        lines.controllable::<S>(0, rows.cap[i], target(rows, i, low, high))
    }
}

/// Compute the controllable set `K_i` for limits that are wider by `widen` times their scales. `next` is the set `K_(i+1)`.
pub(super) fn widened(rows: &LimitRows, i: usize, widen: f64, next: [f64; 2]) -> Option<(f64, f64)> {
    run_lanes(Widened(rows, i, widen, next))
}
