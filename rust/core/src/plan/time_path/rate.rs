//! A timing whose torques change no faster than a limit: `|d tau_j/dt| <= R_j`.
//!
//! In the fastest timing `u` jumps, and so do the torques. The average of the timing over a time window `W` has a continuous `u`. In a
//! motion slower by a large factor `k`, only the gravity torque remains:
//!
//! ```text
//! r_W(t) = (s(t) - s(t - W)) / W,   u_W(t) = (r(t) - r(t - W)) / W,   duration k (T + W)
//! tau(k t) = g + d q' r_W / k + I / k^2,   q' = dq/ds,   d: viscous friction,   I = M a + C v at time t for k = 1
//! ```
//!
//! `T` is the duration of the fastest timing, `r = ds/dt` and `u = dr/dt`. `I` are the inertia torques, with the mass matrix `M` and the
//! Coriolis matrix `C`. `g` is the gravity torque.
//!
//! The search varies the window `W`, and finds the least factor `k` for each by bisection. The result satisfies the limits, but it is not
//! the fastest timing under them. `u` is linear in time between nodes, so `s(t)` is a C2 cubic spline. Torque rates are difference
//! quotients of samples, plus the largest change from one quotient to the next.

use super::given::TimePathOptions;
use super::problem::PathProblem;
use super::reason::{LimitKind, PathReason, Shortfall};
use super::rows::{Points, Request};
use super::timing::TimePath;
use super::tip::length;
use super::tuning::{
    FACTOR_ACCURACY, NODES, NODES_PER_PIECE, NODES_PER_WINDOW, SLOWEST_FACTOR, STEPS_OF_CHECK, STEPS_OF_SEARCH, TOLERANCE, WINDOW_ACCURACY,
    WINDOW_EXPONENTS, WINDOW_FACTORS,
};
use crate::error::Result;
use crate::interrupt;
use crate::motion::TimedPath;

/// Number of node intervals between two checks for an interrupt.
const CHECK_INTERVAL: usize = 64;

/// Nodes of a timing: times, s, and the path position `s`, path speed `r` and path acceleration `u` at these times.
struct Nodes {
    t: Vec<f64>,
    s: Vec<f64>,
    r: Vec<f64>,
    u: Vec<f64>,
}

/// The largest relative excess over a limit, with this limit, its joint and the path position.
#[derive(Clone, Copy, Debug)]
struct Beyond {
    excess: f64,
    joint: Option<usize>,
    limit: LimitKind,
    s: f64,
}

/// `K` samples of a timing, with `per` steps of `step` seconds from one node to the next.
struct RateSamples<'a> {
    problem: &'a PathProblem<'a>,
    rates: &'a [f64],
    per: usize,
    step: f64,
    s: Vec<f64>,
    /// `(K, n)`: static torques.
    static_torque: Vec<f64>,
    /// `(K, n)`: viscous friction torques.
    viscous_torque: Vec<f64>,
    /// `(K, stride)`: inertia torques, joint accelerations and speeds; then acceleration and velocity of the frame's origin.
    all: Vec<f64>,
    stride: usize,
    /// `(K, 3 n)`: limits of torque, acceleration and speed that vary along the path; one where they are constant.
    along: Vec<f64>,
}

/// The average of `fast` over a time window that ends at each node.
fn averaged(fast: &TimedPath, window: f64, pieces: usize) -> Nodes {
    let total = fast.duration() + window;
    let count = ((NODES_PER_WINDOW * total / window) as usize).max(NODES_PER_PIECE * pieces).clamp(NODES.0, NODES.1);
    let step = total / count as f64;
    let speed = |t: f64| fast.phase(t).map_or(0.0, |(_, [_, r, ..])| r);
    let t: Vec<f64> = (0..=count).map(|k| step * k as f64).collect();
    let mut u: Vec<f64> = t.iter().map(|&t| (speed(t) - speed(t - window)) / window).collect();
    (u[0], u[count]) = (0.0, 0.0);
    // The motion must end exactly at rest. So the error of the trapezoidal rule is distributed over all nodes.
    let left: f64 = step * u.iter().sum::<f64>();
    for k in 0..=count {
        let z = k as f64 / count as f64;
        u[k] -= 6.0 * z * (1.0 - z) * left / total * (count * count) as f64 / ((count * count) as f64 - 1.0);
    }
    let (mut s, mut r) = (vec![0.0; count + 1], vec![0.0; count + 1]);
    for k in 0..count {
        r[k + 1] = (r[k] + 0.5 * step * (u[k] + u[k + 1])).max(0.0);
        s[k + 1] = s[k] + step * (r[k] + step * (u[k] / 3.0 + u[k + 1] / 6.0));
    }
    r[count] = 0.0;
    let (first, last) = (fast.grid()[0], fast.grid()[fast.grid().len() - 1]);
    let scale = (last - first) / s[count];
    for k in 0..=count {
        (s[k], r[k], u[k]) = (first + s[k] * scale, r[k] * scale, u[k] * scale);
    }
    s[count] = last;
    Nodes { t, s, r, u }
}

impl<'a> RateSamples<'a> {
    fn new(problem: &'a PathProblem<'a>, rates: &'a [f64], viscous: &[f64], nodes: &Nodes, per: usize) -> Self {
        let (n, segments) = (problem.n, nodes.s.len() - 1);
        let count = segments * per + 1;
        let step = nodes.t[1] / per as f64;
        let end = nodes.s[segments];
        let state = |k: usize| {
            let (i, d) = ((k / per).min(segments - 1), k - (k / per).min(segments - 1) * per);
            let (d, jolt) = (d as f64 * step, (nodes.u[i + 1] - nodes.u[i]) / nodes.t[1]);
            let s = nodes.s[i] + d * (nodes.r[i] + d * (nodes.u[i] / 2.0 + d * jolt / 6.0));
            ([s.clamp(nodes.s[0], end), (nodes.r[i] + d * (nodes.u[i] + d * jolt / 2.0)).max(0.0), nodes.u[i] + d * jolt], i)
        };
        let states: Vec<[f64; 3]> = (0..count).map(|k| state(k).0).collect();
        let at = |k: usize| (problem.path.piece(states[k][0]), states[k][0]);
        let (tip, stride) = (problem.tip.as_ref().map(|tip| (tip.frame, &problem.along)), problem.measured());
        let request = |rate: &dyn Fn(usize) -> (f64, f64)| {
            let mut out = vec![0.0; count * stride];
            let (mover, path) = (problem.mover, &*problem.path);
            Points { mover, path, at: &at, count, stride, out: &mut out, request: Request::Motion { rate }, tip }.run();
            out
        };
        let static_torque = request(&|_| (0.0, 0.0));
        let mut all = request(&|k| (states[k][1], states[k][2]));
        let static_torque: Vec<f64> = static_torque.chunks_exact(stride).flat_map(|row| row[..n].to_vec()).collect();
        let mut viscous_torque = vec![0.0; count * n];
        for k in 0..count {
            for j in 0..n {
                all[stride * k + j] -= static_torque[n * k + j];
                viscous_torque[n * k + j] = viscous[j] * all[stride * k + 2 * n + j];
            }
        }
        let limit = |k: usize, at_row: usize| problem.along.limit(&problem.path, at_row / n, at_row % n, at(k).0, states[k][0]);
        let along = (0..count * 3 * n).map(|i| limit(i / (3 * n), i % (3 * n))).collect();
        RateSamples {
            problem,
            rates,
            per,
            step,
            s: states.iter().map(|state| state[0]).collect(),
            static_torque,
            viscous_torque,
            all,
            stride,
            along,
        }
    }

    /// The largest relative excess over a limit, in a motion slower by the factor `k`. With `any`, the search ends at the first excess.
    fn worst(&self, k: f64, any: bool) -> Beyond {
        let RateSamples { problem, rates, per, step, s, static_torque, viscous_torque, all, stride, along } = self;
        let (n, per) = (problem.n, *per);
        let (lo, hi) = (&problem.lo, &problem.hi);
        let (by, by2, by_step) = (1.0 / k, 1.0 / (k * k), 1.0 / (k * step));
        let mut worst = Beyond { excess: f64::NEG_INFINITY, joint: None, limit: LimitKind::TorqueRate, s: s[0] };
        for i in 0..(s.len() - 1) / per {
            if i % CHECK_INTERVAL == 0 {
                interrupt::check();
            }
            for j in 0..n {
                let torque = |m: usize| static_torque[n * m + j] + viscous_torque[n * m + j] * by + all[stride * m + j] * by2;
                let [_, _, turned, rate] = span(i * per..=(i + 1) * per, torque);
                let [top, bottom, curvature, _] = span(i * per..=(i + 1) * per, |m| torque(m) / along[3 * n * m + j]);
                let [high, low, more, _] = span(i * per..=(i + 1) * per, |m| all[stride * m + n + j] * by2 / along[3 * n * m + n + j]);
                let steep = high.max(-low) + more;
                let [high, low, more, _] =
                    span(i * per..=(i + 1) * per, |m| all[stride * m + 2 * n + j] * by / along[3 * n * m + 2 * n + j]);
                let fast = high.max(-low) + more;
                let sides = [
                    ((top + curvature - hi[j]) / size(hi[j], lo[j]), LimitKind::TorqueMax),
                    ((lo[j] - bottom + curvature) / size(lo[j], hi[j]), LimitKind::TorqueMin),
                    ((rate + 2.0 * turned) * by_step / rates[j] - 1.0, LimitKind::TorqueRate),
                    (steep / hi[n + j] - 1.0, LimitKind::Acceleration),
                    (fast / hi[2 * n + j] - 1.0, LimitKind::Velocity),
                ];
                for (excess, limit) in sides {
                    if excess > worst.excess || excess.is_nan() && hi[j].is_finite() {
                        worst = Beyond { excess, joint: Some(j), limit, s: s[i * per] };
                    }
                }
                if any && !(worst.excess <= TOLERANCE) {
                    return worst;
                }
            }
            self.check_tip(i, [by2, by], &mut worst);
            if any && !(worst.excess <= TOLERANCE) {
                return worst;
            }
        }
        worst
    }

    /// Compare acceleration and speed of the frame's origin between nodes `i` and `i + 1` with their limits, and update `worst`.
    fn check_tip(&self, i: usize, by: [f64; 2], worst: &mut Beyond) {
        let Some(tip) = &self.problem.tip else { return };
        let first = 3 * self.problem.n;
        for (part, most, limit) in [(0, tip.acceleration, LimitKind::TipAcceleration), (1, tip.speed, LimitKind::TipSpeed)] {
            let Some(most) = most else { continue };
            let norm = |m: usize| length(&self.all[self.stride * m + first + 3 * part..]) * by[part];
            let [high, _, more, _] = span(i * self.per..=(i + 1) * self.per, norm);
            let excess = (high + more) / most - 1.0;
            if excess > worst.excess || excess.is_nan() {
                *worst = Beyond { excess, joint: None, limit, s: self.s[i * self.per] };
            }
        }
    }

    /// The least factor `k` that satisfies all limits, by bisection to the relative accuracy `share`. Bisection assumes that all larger
    /// factors satisfy them too. `None` beyond `SLOWEST_FACTOR`.
    fn slowing(&self, share: f64) -> Option<f64> {
        let fits = |k: f64| self.worst(k, true).excess <= TOLERANCE;
        let mut high = 1.0;
        while !fits(high) {
            high *= 2.0;
            if high > SLOWEST_FACTOR {
                return None;
            }
        }
        let mut low = 0.5 * high;
        while low > 1.0 / SLOWEST_FACTOR && fits(low) {
            (high, low) = (low, 0.5 * low);
        }
        while high > low * (1.0 + share) {
            let middle = (low * high).sqrt();
            if fits(middle) { high = middle } else { low = middle }
        }
        Some(high)
    }
}

/// Return four numbers from sampled values: the largest, the smallest, a bound, and the largest change between neighbours. Between samples,
/// the function exceeds the largest or smallest sample by at most the bound. The bound is half of the largest second difference. A function
/// with a corner halfway between two samples reaches this bound.
#[inline(always)]
fn span(samples: std::ops::RangeInclusive<usize>, value: impl Fn(usize) -> f64) -> [f64; 4] {
    let (mut before, mut change) = (value(*samples.start()), f64::NAN);
    let (mut top, mut bottom, mut turn, mut most) = (before, before, 0.0_f64, 0.0_f64);
    for m in *samples.start() + 1..=*samples.end() {
        let here = value(m);
        let next = here - before;
        (top, bottom, most) = (top.max(here), bottom.min(here), most.max(next.abs()));
        // `change` is NaN at first, and max ignores NaN.
        turn = turn.max((next - change).abs());
        (before, change) = (here, next);
    }
    [top, bottom, 0.5 * turn, most]
}

/// The scale of a relative excess: the limit, or the opposite limit if it is zero.
fn size(near: f64, far: f64) -> f64 {
    if near != 0.0 { near.abs() } else { far.abs() }
}

/// Average `fast` over time, and slow it down until all limits are satisfied, including the torque rates `rates`, `(n,)`, N m/s or N/s.
pub(super) fn limit_rate(problem: &PathProblem, fast: TimePath, rates: &[f64], options: &TimePathOptions) -> Result<TimePath> {
    let total = fast.motion.duration();
    if !(total > 0.0) {
        return Ok(fast);
    }
    let viscous = options.friction.as_ref().map_or(vec![0.0; problem.n], |friction| friction.viscous.clone());
    let pieces = problem.path.knots().len() - 1;
    let sampled = |window: f64, per: usize| {
        let nodes = averaged(&fast.motion, window, pieces);
        (RateSamples::new(problem, rates, &viscous, &nodes, per), nodes)
    };
    let mut best: Option<(f64, f64, f64)> = None;
    let try_window = |window: f64, best: &mut Option<(f64, f64, f64)>| {
        if let Some(k) = sampled(window, STEPS_OF_SEARCH).0.slowing(WINDOW_ACCURACY) {
            let duration = k * (total + window);
            if best.is_none_or(|(least, ..)| duration < least) {
                *best = Some((duration, window, k));
            }
        }
    };
    for power in WINDOW_EXPONENTS.rev() {
        try_window(total * f64::powi(2.0, power), &mut best);
    }
    for step in WINDOW_FACTORS {
        let Some((_, window, _)) = best else { break };
        try_window(window * step, &mut best);
        try_window(window / step, &mut best);
    }
    let (samples, nodes) = sampled(best.map_or(total, |(_, window, _)| window), STEPS_OF_CHECK);
    let Some(k) = best.and_then(|_| samples.slowing(FACTOR_ACCURACY)) else {
        let Beyond { excess, joint, limit, s } = samples.worst(SLOWEST_FACTOR, true);
        let reason = problem.reason_of(Shortfall::Slow, (limit, joint.unwrap_or(0)), s, excess);
        if limit == LimitKind::TorqueRate {
            let missing_units = excess * joint.map_or(0.0, |joint| rates[joint]);
            return problem.refuse(PathReason { missing_units, ..reason });
        }
        return problem.refuse(reason);
    };
    let margin = -samples.worst(k, false).excess;
    let scaled = |values: &[f64], by: f64| values.iter().map(|x| x * by).collect::<Vec<f64>>();
    let x = nodes.r.iter().map(|r| (r / k) * (r / k)).collect();
    let motion = TimedPath::cubic(problem.path.clone(), scaled(&nodes.t, k), nodes.s.clone(), x, scaled(&nodes.u, 1.0 / (k * k)))?;
    Ok(TimePath { motion, margin, reason: None })
}
