//! Trapezoidal-speed and minimum-jerk motions of one link, from rest to rest, under torque bounds.
//!
//! ```text
//! theta = theta0 + (thetaf - theta0) s(u),  u = t/T,  x = direction theta,  k = I D / T^2
//! tau(u) = k s''(u) + G sin x(u)            linear in k: the durations that obey both bounds form one interval
//! trapezoid, ramp fraction r in (0, 1/2]:  s'' = +-1/(r (1 - r)) on the ramps, 0 between;  each ramp covers the angle D r / (2 (1 - r))
//! minimum jerk:  s = 10 u^3 - 15 u^4 + 6 u^5,  s'' = 60 u (1 - u)(1 - 2 u)
//! ```
//!
//! `'` is `d/du`, and `D = |thetaf - theta0|`. The trapezoid has a closed form, because the extremes of `sin` on each part of the motion
//! determine the bounds. With `r = 1/2`, it is the profile of `bang_bang_time`. For the quintic, the bounds of `k` are extremes over `u` of
//! `(bound - G sin x)/s''`. A grid with several points per quarter turn (if `D <= 1e4` rad) brackets them. Golden-section search refines
//! them, and assumes at most one extreme between grid points.

use super::link::{Link, check_ends};
use super::sine::{crest_inside, sine, trough_inside};
use crate::error::{Error, Result};
use crate::memory;

/// The durations that obey the torque bounds.
///
/// ```
/// use armlet_core::plan::{minimum_jerk_time, trapezoid_time};
///
/// // Without gravity, with ramps of a quarter of the duration: `tau = 16/3 I D / T^2`.
/// let report = trapezoid_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0, 0.25)?;
/// assert!(report.feasible && report.missing == 0.0 && (report.k_max - 0.75).abs() < 1e-15);
/// assert!((report.t_min - (1.0f64 / 0.75).sqrt()).abs() < 1e-15);
/// // The quintic takes longer.
/// assert!(minimum_jerk_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?.t_min > report.t_min);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileReport {
    /// Whether a feasible duration exists.
    pub feasible: bool,
    /// Shortest duration, s; NaN if infeasible.
    pub t_min: f64,
    /// Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible.
    pub t_max: f64,
    /// Lower bound of `k = inertia D / T^2`, N m.
    pub k_min: f64,
    /// Upper bound of `k = inertia D / T^2`, N m.
    pub k_max: f64,
    /// Angle at which the upper bound of `k` is reached, rad.
    pub theta_upper: f64,
    /// Angle at which the lower bound of `k` is reached, rad; NaN if there is none.
    pub theta_lower: f64,
    /// Whether the torque limits hold the link at the start.
    pub hold_start: bool,
    /// Whether the torque limits hold the link at the end.
    pub hold_end: bool,
    /// The torque by which both bounds would have to be wider, N m; 0 if feasible.
    pub missing: f64,
}

/// A bound of `k` or a gravity torque, N m, and its place. The place is the angle `x = direction theta`, rad. In `minimum_jerk_time` it is
/// the time fraction `u`.
type At = (f64, f64);

/// Link, ends and direction of a motion.
struct LinkMotion {
    link: Link,
    sign: f64,
    x0: f64,
    x1: f64,
}

impl LinkMotion {
    fn new(theta0: f64, thetaf: f64, inertia: f64, gravity_moment: f64, tau_min: f64, tau_max: f64) -> Result<Self> {
        check_ends(theta0, thetaf)?;
        let link = Link::new(inertia, gravity_moment, tau_min, tau_max)?;
        let sign = 1.0f64.copysign(thetaf - theta0);
        Ok(LinkMotion { link: link.along(sign > 0.0), sign, x0: sign * theta0, x1: sign * thetaf })
    }

    fn gravity(&self, x: f64) -> f64 {
        self.link.gravity_moment * sine(x).sin
    }

    fn holds(&self, x: f64) -> bool {
        let (tau, slack) = (self.gravity(x), self.link.slack());
        tau <= self.link.tau_max + slack && tau >= self.link.tau_min - slack
    }

    /// The smallest and the largest gravity torque on `[a, b]`, with their angles.
    fn range(&self, a: f64, b: f64) -> (At, At) {
        let (sa, sb, g) = (sine(a), sine(b), self.link.gravity_moment);
        let end = |largest: bool| {
            let (va, vb) = (g * sa.sin, g * sb.sin);
            if (va >= vb) == largest { (va, a) } else { (vb, b) }
        };
        let extreme = |crest: bool| {
            let offset = if crest { 0.5 } else { -0.5 } * std::f64::consts::PI;
            let turns = ((a - offset) / std::f64::consts::TAU).ceil();
            (offset + turns * std::f64::consts::TAU).clamp(a, b)
        };
        let (crest, trough) = (crest_inside(&sa, &sb), trough_inside(&sa, &sb));
        let (low_inside, high_inside) = if g >= 0.0 { (trough, crest) } else { (crest, trough) };
        let low = if low_inside { (-g.abs(), extreme(g < 0.0)) } else { end(false) };
        let high = if high_inside { (g.abs(), extreme(g >= 0.0)) } else { end(true) };
        (low, high)
    }

    /// Create the report from the bounds of `k`. `hold` states whether gravity alone is within the torque bounds where `s'' = 0`.
    fn report(&self, lower: At, upper: At, hold: bool, missing: f64) -> ProfileReport {
        let (k_min, k_max, slack) = (lower.0.max(0.0), upper.0, self.link.slack());
        let (hold_start, hold_end) = (self.holds(self.x0), self.holds(self.x1));
        let work = self.link.inertia * (self.x1 - self.x0);
        let (feasible, t_min, t_max) = if work == 0.0 {
            (hold_start, 0.0, 0.0)
        } else {
            let t_min = (work / k_max).sqrt();
            (hold && k_max > 0.0 && k_max >= k_min - slack, t_min, (work / k_min).sqrt().max(t_min))
        };
        ProfileReport {
            feasible,
            t_min: if feasible { t_min } else { f64::NAN },
            t_max: if feasible { t_max } else { f64::NAN },
            k_min,
            k_max,
            theta_upper: self.sign * upper.1,
            theta_lower: if lower.0 > 0.0 { self.sign * lower.1 } else { f64::NAN },
            hold_start,
            hold_end,
            // If the bounds of `k` are equal, `missing` may be a negative rounding error.
            missing: if feasible { 0.0 } else { missing.max(0.0) },
        }
    }
}

fn least(a: At, b: At) -> At {
    if b.0 < a.0 { b } else { a }
}

fn most(a: At, b: At) -> At {
    if b.0 > a.0 { b } else { a }
}

/// Compute the durations for which the trapezoidal-speed motion from `theta0` to `thetaf` (rad) obeys the torque bounds (N m).
///
/// `inertia` is in kg m^2, `gravity_moment` in N m. Each ramp of the speed takes `ramp * T`, with 0 < ramp <= 1/2. Errors: `Input` for an
/// invalid argument.
pub fn trapezoid_time(
    theta0: f64,
    thetaf: f64,
    inertia: f64,
    gravity_moment: f64,
    tau_min: f64,
    tau_max: f64,
    ramp: f64,
) -> Result<ProfileReport> {
    let m = LinkMotion::new(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max)?;
    if !(ramp > 0.0 && ramp <= 0.5) {
        return Err(Error::input("ramp", format!("is not a fraction: expected 0 < ramp <= 0.5, got {ramp}")));
    }
    let second = 1.0 / (ramp * (1.0 - ramp));
    let (a, b) = if ramp == 0.5 {
        (0.5 * m.x0 + 0.5 * m.x1, 0.5 * m.x0 + 0.5 * m.x1)
    } else {
        let length = (m.x1 - m.x0) * ramp / (2.0 * (1.0 - ramp));
        (m.x0 + length, m.x1 - length)
    };
    let ((low1, high1), (low2, high2), (low3, high3)) = (m.range(m.x0, a), m.range(a, b), m.range(b, m.x1));
    let (lo, hi) = (m.link.tau_min, m.link.tau_max);
    let upper = least(((hi - high1.0) / second, high1.1), ((low3.0 - lo) / second, low3.1));
    let lower = most(((lo - low1.0) / second, low1.1), ((high3.0 - hi) / second, high3.1));
    // Between the ramps there is no acceleration: gravity alone must be within the bounds.
    let slack = m.link.slack();
    let cruise = if ramp == 0.5 { f64::NEG_INFINITY } else { (high2.0 - hi).max(lo - low2.0) };
    let missing = cruise.max((-upper.0).max(0.5 * (lower.0.max(0.0) - upper.0)) * second);
    let missing = if m.x0 == m.x1 { (m.gravity(m.x0) - hi).max(lo - m.gravity(m.x0)) } else { missing };
    Ok(m.report(lower, upper, cruise <= slack, missing))
}

fn quintic(u: f64) -> (f64, f64) {
    // `w` is the time fraction from the nearer end, so that no digits are lost near either end.
    let w = u.min(1.0 - u);
    let s = w * w * w * (10.0 - w * (15.0 - 6.0 * w));
    let second = 60.0 * w * (1.0 - w) * (1.0 - 2.0 * w);
    if u <= 0.5 { (s, second) } else { (1.0 - s, -second) }
}

impl LinkMotion {
    fn quintic_angle(&self, u: f64) -> f64 {
        let w = u.min(1.0 - u);
        let s = quintic(w).0 * (self.x1 - self.x0);
        if u <= 0.5 { self.x0 + s } else { self.x1 - s }
    }

    /// Lower and upper bound of `k = I D / T^2` at the time fraction `u`, N m.
    fn quintic_bounds(&self, u: f64) -> (f64, f64) {
        let second = quintic(u).1;
        let gravity = self.gravity(self.quintic_angle(u));
        if second == 0.0 {
            let slack = self.link.slack();
            let fits = gravity <= self.link.tau_max + slack && gravity >= self.link.tau_min - slack;
            return if fits { (0.0, f64::INFINITY) } else { (f64::INFINITY, f64::NEG_INFINITY) };
        }
        let (a, b) = ((self.link.tau_max - gravity) / second, (self.link.tau_min - gravity) / second);
        (a.min(b), a.max(b))
    }
}

/// Compute the durations for which the minimum-jerk (quintic) motion from `theta0` to `thetaf` (rad) obeys the torque bounds (N m).
///
/// `inertia` is in kg m^2, `gravity_moment` in N m. Errors: `Input` for an invalid argument, `Memory` for a grid that does not fit.
pub fn minimum_jerk_time(theta0: f64, thetaf: f64, inertia: f64, gravity_moment: f64, tau_min: f64, tau_max: f64) -> Result<ProfileReport> {
    let m = LinkMotion::new(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max)?;
    let (lo, hi) = (m.link.tau_min, m.link.tau_max);
    if m.x0 == m.x1 {
        let missing = (m.gravity(m.x0) - hi).max(lo - m.gravity(m.x0));
        return Ok(m.report((0.0, m.x0), (0.0, m.x0), true, missing));
    }
    // A quarter turn has several grid points even where the motion is fastest, s' = 15/8. The number of points is limited, so the grid of a
    // very long motion is coarser.
    let n = (128 + 24 * (m.x1 - m.x0).min(1e4) as usize).next_multiple_of(2);
    let at = |k: usize| k as f64 / n as f64;
    let (mut upper, mut lower) = ((f64::INFINITY, 0.5), (f64::NEG_INFINITY, 0.5));
    let polish = |k: usize, f: &dyn Fn(f64) -> f64| golden(f, at(k.saturating_sub(1)), at((k + 1).min(n)), 44);
    let (up, down) = (|u: f64| m.quintic_bounds(u).1, |u: f64| -m.quintic_bounds(u).0);
    for (f, is_upper) in [(&up as &dyn Fn(f64) -> f64, true), (&down, false)] {
        let (mut before, mut here) = (f64::INFINITY, f(at(0)));
        for k in 0..=n {
            let after = if k < n { f(at(k + 1)) } else { f64::INFINITY };
            if here <= before && here <= after {
                let best = if here.is_finite() { least((here, at(k)), polish(k, f)) } else { (here, at(k)) };
                if is_upper {
                    upper = least(upper, best);
                } else {
                    lower = most(lower, (-best.0, best.1));
                }
            }
            (before, here) = (here, after);
        }
    }
    let hold = upper.0 > f64::NEG_INFINITY && lower.0 < f64::INFINITY;
    // The torque of the motion is `k s'' + gravity`, with `k = I D / T^2`. The missing torque is the smallest widening of both torque
    // bounds for which some `k` is feasible. Between grid points, the largest excess of the torque is estimated by a parabola.
    let missing = if hold && upper.0 > 0.0 && upper.0 >= lower.0 {
        0.0
    } else {
        let lines = memory::collected((0..n + 1).map(|j| (quintic(at(j)).1, m.gravity(m.quintic_angle(at(j))))))?;
        let excess = |k: f64| {
            let on_grid = |&(second, gravity): &(f64, f64)| {
                let tau = k * second + gravity;
                (tau - hi).max(lo - tau)
            };
            let [mut before, mut here] = [0, 1].map(|j| on_grid(&lines[j]));
            let mut worst = before;
            for line in &lines[2..] {
                let after = on_grid(line);
                let curvature = 2.0 * here - before - after;
                let crest = here >= before && here >= after && curvature > 0.0;
                worst = worst.max(if crest { here + (after - before) * (after - before) / (8.0 * curvature) } else { here });
                (before, here) = (here, after);
            }
            worst.max(here)
        };
        // Apart from the interpolation, `excess` is a maximum of linear functions, so it is convex in `k`.
        excess(0.0).min(golden(excess, 0.0, hi - lo + gravity_moment.abs(), 60).0)
    };
    Ok(m.report((lower.0, m.quintic_angle(lower.1)), (upper.0, m.quintic_angle(upper.1)), hold, missing))
}

/// The minimum on `[a, b]` of a function with one local minimum, and its argument, by `steps` steps of golden section (Kiefer 1953).
fn golden(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64, steps: usize) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut c, mut d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut fc, mut fd) = (f(c), f(d));
    for _ in 0..steps {
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = b - GOLDEN * (b - a);
            fc = f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + GOLDEN * (b - a);
            fd = f(d);
        }
    }
    if fc < fd { (fc, c) } else { (fd, d) }
}
