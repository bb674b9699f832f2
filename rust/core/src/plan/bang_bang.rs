//! The feasible durations of the symmetric bang-bang acceleration profile, from rest to rest, in closed form.
//!
//! ```text
//! I theta_ddot + G sin theta = tau,  theta_ddot = +-A,  A = 4 D / T^2,  a = I A,  x = direction theta,  xm = (x0 + x1)/2
//! phase 1 on [x0, xm]: tau = G sin x + a        phase 2 on [xm, x1]: tau = G sin x - a
//! a_max = min( tau_max - max_1 G sin, min_2 G sin - tau_min )
//! a_min = max( 0, tau_min - min_1 G sin, max_2 G sin - tau_max )
//! T in [ sqrt(4 I D / a_max), sqrt(4 I D / a_min) ]  iff  a_max > 0 and a_max >= a_min
//! ```
//!
//! `I` is the inertia, `G` the gravity moment, `D` the distance, `T` the duration and `A` the acceleration. `direction` is 1 or -1, so that
//! `x` increases from `x0` to `x1`. `tau_min` and `tau_max` are the torque bounds in the coordinate `x`. `max_1 G sin` and `min_1 G sin`
//! are the largest and the smallest gravity torque in phase 1, and `max_2` and `min_2` those in phase 2. At every angle the torque is a
//! monotone function of `a`. So the bounds `a_min` and `a_max` are exact. The extremes of `sin` on an interval have a closed form, without
//! samples. `docs/minimum_time.md` has the derivation.

use super::link::{Link, SLACK, check_ends};
use super::report::{Bind, Limit, Place, Reason};
use super::sine::{Sine, crest_inside, gravity_range, sine, trough_inside};
use crate::error::{Error, Result};
use crate::scalar::{GenericKernel, Real, run_lanes};
use std::f64::consts::{FRAC_PI_2, TAU};

/// The feasible durations of the profile. The active limits and the reason are computed on request.
///
/// ```
/// use armlet_core::plan::bang_bang_time;
/// use std::f64::consts::FRAC_PI_2;
///
/// // From hanging to level, with `G = 2 N m` and 5 N m: gravity leaves `5 - 2 sin(pi/4)` to accelerate.
/// let report = bang_bang_time(0.0, FRAC_PI_2, 1.0, 2.0, -5.0, 5.0)?;
/// assert!(report.feasible && (report.a_max - (5.0 - 2f64.sqrt())).abs() < 1e-14);
/// assert!((report.t_min - (4.0 * FRAC_PI_2 / report.a_max).sqrt()).abs() < 1e-14);
/// // The torque reaches its limit just before the switch.
/// assert!((report.torques(report.t_min)[1] - 5.0).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BangBangReport {
    /// Whether a feasible duration exists.
    pub feasible: bool,
    /// Shortest duration, s; NaN if infeasible.
    pub t_min: f64,
    /// Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible.
    pub t_max: f64,
    /// Least `inertia * acceleration` that the limits require, N m.
    pub a_min: f64,
    /// Largest `inertia * acceleration` that the limits allow, N m.
    pub a_max: f64,
    /// Whether the torque limits hold the link at the start.
    pub hold_start: bool,
    /// Whether the torque limits hold the link at the end.
    pub hold_end: bool,
    theta0: f64,
    thetaf: f64,
    link: Link,
}

/// Upper and lower bounds of `a = inertia * acceleration`, N m: first the bounds of phase 1, then those of phase 2.
struct Bounds<S> {
    upper: [S; 2],
    lower: [S; 2],
}

#[inline(always)]
fn bounds<S: Real>([g, tau_min, tau_max]: [S; 3], [s0, sm, s1]: &[Sine<S>; 3]) -> Bounds<S> {
    let (low1, high1) = gravity_range(g, s0, sm);
    let (low2, high2) = gravity_range(g, sm, s1);
    Bounds { upper: [tau_max - high1, low2 - tau_min], lower: [tau_min - low1, high2 - tau_max] }
}

/// The results of one problem per SIMD lane. Flags are 1 or 0.
struct Answers<S> {
    /// Durations `t_min` and `t_max`, s, then `a_min` and `a_max`, the bounds of `inertia * acceleration`, N m.
    numbers: [S; 4],
    /// The flags `feasible`, `hold_start` and `hold_end`.
    flags: [S; 3],
    /// 1 if the problem is valid, else 0: see [`Link::new`] and [`check_ends`].
    valid: S,
}

/// Return 1 in the lanes where both masks are true, else 0.
#[inline(always)]
fn both<S: Real>(a: S::Mask, b: S::Mask) -> S {
    S::select(a, S::select(b, S::splat(1.0), S::zero()), S::zero())
}

/// Return 1 in the lanes where `x` is neither below `low` nor above `high`, else 0.
#[inline(always)]
fn between<S: Real>(x: S, low: S, high: S) -> S {
    S::select(x.lt(low), S::zero(), S::select(high.lt(x), S::zero(), S::splat(1.0)))
}

/// Compute the results from `theta0, thetaf, inertia, gravity_moment, tau_min, tau_max`.
#[inline(always)]
fn answers<S: Real>([theta0, thetaf, inertia, g, tau_min, tau_max]: [S; 6]) -> Answers<S> {
    let (zero, one, two) = (S::zero(), S::splat(1.0), S::splat(2.0));
    let finite = S::splat(f64::INFINITY);
    let (way, width) = (thetaf - theta0, tau_max - tau_min);
    let ends = both::<S>(way.abs().lt(finite), g.abs().lt(finite)) * both::<S>(zero.lt(inertia), inertia.lt(finite));
    let limits = both::<S>(zero.lt(width), width.lt(finite)) * between(zero, tau_min, tau_max);
    let reverse = way.lt(zero);
    let sign = S::select(reverse, -one, one);
    let (low, high) = (S::select(reverse, -tau_max, tau_min), S::select(reverse, -tau_min, tau_max));
    let (x0, x1) = (sign * theta0, sign * thetaf);
    let distance = x1 - x0;
    let half = S::splat(0.5);
    let sines = [sine(x0), sine(half * x0 + half * x1), sine(x1)];
    let b = bounds([g, low, high], &sines);
    let a_max = b.upper[0].min(b.upper[1]);
    // `abs` replaces -0 by +0. Otherwise a division by `a_min` could give minus infinity.
    let a_min = b.lower[0].max(b.lower[1]).max(zero).abs();
    let slack = S::splat(SLACK) * tau_max.max(-tau_min);
    let (hold_start, hold_end) =
        (between(g * sines[0].sin, low - slack, high + slack), between(g * sines[2].sin, low - slack, high + slack));
    let moves = zero.lt(distance);
    // If `a_max` is below `a_min` by at most `slack`, the difference counts as a rounding error. Then one duration is feasible.
    let some = S::select(zero.lt(a_max), S::select(a_max.lt(a_min - slack), zero, one), zero);
    let feasible = S::select(moves, some, hold_start);
    let t_min = S::select(moves, two * (inertia * distance / a_max).sqrt(), zero);
    let t_max = S::select(moves, (two * (inertia * distance / a_min).sqrt()).max(t_min), zero);
    let (had, none) = (zero.lt(feasible), S::splat(f64::NAN));
    let numbers = [S::select(had, t_min, none), S::select(had, t_max, none), a_min, a_max];
    Answers { numbers, flags: [feasible, hold_start, hold_end], valid: ends * limits }
}

/// Compute the feasible durations of the motion from `theta0` to `thetaf` (rad) under the torque bounds (N m).
///
/// The acceleration is constant up to the middle of the motion. The deceleration after it is equally large. `inertia` is in kg m^2,
/// `gravity_moment` in N m, and `tau_min <= 0 <= tau_max` is required. The tests `a_max >= a_min`, `hold_start` and `hold_end` have a
/// tolerance of `1e-12` times the larger absolute torque bound. If `theta0 == thetaf`, the duration is zero. This motion is feasible if and
/// only if the torque can hold the pose. Errors: `Input` for an invalid argument.
#[inline]
pub fn bang_bang_time(theta0: f64, thetaf: f64, inertia: f64, gravity_moment: f64, tau_min: f64, tau_max: f64) -> Result<BangBangReport> {
    check_ends(theta0, thetaf)?;
    let link = Link::new(inertia, gravity_moment, tau_min, tau_max)?;
    let Answers { numbers: [t_min, t_max, a_min, a_max], flags, .. } = answers([theta0, thetaf, inertia, gravity_moment, tau_min, tau_max]);
    let [feasible, hold_start, hold_end] = flags.map(|flag| flag > 0.0);
    Ok(BangBangReport { feasible, t_min, t_max, a_min, a_max, hold_start, hold_end, theta0, thetaf, link })
}

/// The output arrays of many problems, `(count,)` each: `t_min, t_max, a_min, a_max`, and `feasible, hold_start, hold_end`.
///
/// ```
/// use armlet_core::plan::{BangBangTimes, bang_bang_times};
///
/// # let (mut t_max, mut a_min, mut a_max) = ([0.0; 3], [0.0; 3], [0.0; 3]);
/// # let (mut hold_start, mut hold_end) = ([false; 3], [false; 3]);
/// let (mut t_min, mut feasible) = ([0.0; 3], [false; 3]);
/// let to = BangBangTimes {
///     numbers: [&mut t_min, &mut t_max, &mut a_min, &mut a_max],
///     flags: [&mut feasible, &mut hold_start, &mut hold_end],
/// };
/// // Three goals; all other numbers are the same: T = 2 sqrt(D / 4).
/// bang_bang_times([&[0.0], &[0.25, 1.0, 4.0], &[1.0], &[0.0], &[-4.0], &[4.0]], to).expect("valid");
/// assert_eq!((t_min, feasible), ([0.5, 1.0, 2.0], [true; 3]));
/// ```
pub struct BangBangTimes<'a> {
    /// Durations `t_min` and `t_max`, s, then `a_min` and `a_max`, the bounds of `inertia * acceleration`, N m.
    pub numbers: [&'a mut [f64]; 4],
    /// Flags: `feasible`, `hold_start` and `hold_end`.
    pub flags: [&'a mut [bool]; 3],
}

struct Batch<'a, 'b> {
    columns: [&'a [f64]; 6],
    to: &'a mut BangBangTimes<'b>,
}

impl GenericKernel for Batch<'_, '_> {
    type Output = Option<usize>;
    #[inline(always)]
    fn run<S: Real>(self) -> Option<usize> {
        let Batch { columns, to } = self;
        let count = to.flags[0].len();
        let mut first = 0;
        while first < count {
            let lanes = S::LANES.min(count - first);
            let mut problem = [S::zero(); 6];
            for k in 0..6 {
                let column = columns[k];
                problem[k] = if let [x] = column {
                    S::splat(*x)
                } else if lanes == S::LANES {
                    S::load(&column[first..])
                } else {
                    S::from_lanes(|lane| column[first + lane.min(lanes - 1)])
                };
            }
            let answers = answers(problem);
            if S::any(answers.valid.lt(S::splat(0.5))) {
                return (0..lanes).find(|&lane| answers.valid.lane(lane) < 0.5).map(|lane| first + lane);
            }
            for k in 0..4 {
                let out = &mut to.numbers[k][first..first + lanes];
                if lanes == S::LANES {
                    answers.numbers[k].store(out);
                } else {
                    (0..lanes).for_each(|lane| out[lane] = answers.numbers[k].lane(lane));
                }
            }
            for k in 0..3 {
                let out = &mut to.flags[k][first..first + lanes];
                (0..lanes).for_each(|lane| out[lane] = answers.flags[k].lane(lane) > 0.0);
            }
            first += lanes;
        }
        None
    }
}

/// Compute [`bang_bang_time`] for many problems in SIMD lanes. The results have the same bits as those of single calls.
///
/// `columns` are `theta0, thetaf, inertia, gravity_moment, tau_min, tau_max`, each one number for all problems or one per problem. Errors:
/// the index of the first invalid problem, and its error.
pub fn bang_bang_times(columns: [&[f64]; 6], mut to: BangBangTimes) -> std::result::Result<(), (usize, Error)> {
    let Some(bad) = run_lanes(Batch { columns, to: &mut to }) else { return Ok(()) };
    let [theta0, thetaf, inertia, g, tau_min, tau_max] = columns.map(|column| if let [x] = column { *x } else { column[bad] });
    bang_bang_time(theta0, thetaf, inertia, g, tau_min, tau_max).map(|_| ()).map_err(|error| (bad, error))
}

impl BangBangReport {
    fn forward(&self) -> bool {
        self.thetaf >= self.theta0
    }

    /// The angles `x = direction theta`, rad, of the start, the switch and the end.
    fn ends(&self) -> [f64; 3] {
        let sign = if self.forward() { 1.0 } else { -1.0 };
        [sign * self.theta0, sign * (0.5 * self.theta0 + 0.5 * self.thetaf), sign * self.thetaf]
    }

    /// The limit that determines `t_min`.
    pub fn active_upper(&self) -> Bind {
        self.bind(true, self.a_max)
    }

    /// The limit that determines `t_max`; `None` if the motion may be arbitrarily slow.
    pub fn active_lower(&self) -> Option<Bind> {
        (self.a_min > 0.0).then(|| self.bind(false, self.a_min))
    }

    fn bind(&self, upper: bool, a: f64) -> Bind {
        let along = self.link.along(self.forward());
        let x = self.ends();
        let s = x.map(sine);
        let b = bounds([along.gravity_moment, along.tau_min, along.tau_max], &s);
        let gap = if upper { b.upper[1] - b.upper[0] } else { b.lower[0] - b.lower[1] };
        let tie = self.link.slack();
        let second = gap < -tie;
        // If `a` is too large, the torque exceeds its upper bound in phase 1, and its lower bound in phase 2.
        let top = upper != second;
        let (from, to) = if second { (1, 2) } else { (0, 1) };
        let crest = top == (along.gravity_moment >= 0.0);
        let sign = if crest { 1.0 } else { -1.0 };
        let (switch, end) = if second { (from, to) } else { (to, from) };
        let inside = if crest { crest_inside(&s[from], &s[to]) } else { trough_inside(&s[from], &s[to]) };
        let value = |k: usize| sign * s[k].sin;
        let extreme = if inside { 1.0 } else { value(from).max(value(to)) };
        let (place, position) = if self.link.gravity_moment == 0.0 || value(switch) >= extreme {
            (Place::Switch, x[switch])
        } else if value(end) >= extreme {
            (if second { Place::End } else { Place::Start }, x[end])
        } else {
            // The first extreme of the sine after `x[from]`. The clamp is necessary because the constant pi is rounded.
            let turns = ((x[from] - sign * FRAC_PI_2) / TAU).ceil();
            (Place::Interior, (sign * FRAC_PI_2 + turns * TAU).clamp(x[from], x[to]))
        };
        let time = if self.feasible && self.t_min > 0.0 {
            let inertia = self.link.inertia;
            let run = (2.0 * inertia * if second { x[2] - position } else { position - x[0] } / a).sqrt();
            if second { if upper { self.t_min - run } else { self.t_max - run } } else { run }
        } else {
            f64::NAN
        };
        let limit = if top == self.forward() { Limit::TauMax } else { Limit::TauMin };
        let theta = if self.forward() { position } else { -position };
        Bind { limit, phase: 1 + u8::from(second), place, theta, time, tie: gap.abs() <= tie }
    }

    /// Whether the motion is possible, or the reason why not, with the missing torque.
    pub fn reason(&self) -> Reason {
        if self.feasible {
            return Reason::Feasible;
        }
        if self.theta0 == self.thetaf {
            let tau = self.link.gravity_moment * sine(self.theta0).sin;
            let (limit, missing) =
                if tau > self.link.tau_max { (Limit::TauMax, tau - self.link.tau_max) } else { (Limit::TauMin, self.link.tau_min - tau) };
            return Reason::CannotHold { limit, theta: self.theta0, missing };
        }
        let upper = self.active_upper();
        match self.active_lower() {
            Some(lower) if self.a_min + self.a_max > 0.0 => Reason::Conflict { upper, lower, missing: 0.5 * (self.a_min - self.a_max) },
            _ => Reason::Blocked { upper, missing: 0.0 - self.a_max },
        }
    }

    /// Torques (N m) of the motion of duration `t` (s): at its start, just before and just after the switch, and at its end.
    pub fn torques(&self, t: f64) -> [f64; 4] {
        let sign = if self.forward() { 1.0 } else { -1.0 };
        let [x0, xm, x1] = self.ends();
        let a = if x1 > x0 { 4.0 * self.link.inertia * (x1 - x0) / (t * t) } else { 0.0 };
        let g = |x: f64| self.link.gravity_moment * sine(x).sin;
        [g(x0) + a, g(xm) + a, g(xm) - a, g(x1) - a].map(|tau| sign * tau)
    }
}
