//! The feasible durations of the symmetric bang-bang acceleration profile, rest to rest, in closed form.
//!
//! ```text
//! I theta_ddot + G sin theta = tau,  theta_ddot = +-A,  A = 4 D / T^2,  a = I A,  x = direction theta,  xm = (x0 + x1)/2
//! phase 1 on [x0, xm]: tau = G sin x + a        phase 2 on [xm, x1]: tau = G sin x - a
//! a_max = min( tau_max - max_1 G sin, min_2 G sin - tau_min )
//! a_min = max( 0, tau_min - min_1 G sin, max_2 G sin - tau_max )
//! T in [ sqrt(4 I D / a_max), sqrt(4 I D / a_min) ]  iff  a_max > 0 and a_max >= a_min
//! ```
//!
//! Torque is monotone in `a` at every angle, so the two bounds are exact, and the extremes of `sin` on an
//! interval are closed form: nothing is sampled. `docs/minimum_time.md` has the derivation.

use super::link::{Link, check_ends};
use super::report::{Bind, Limit, Place, Reason};
use super::sine::{Sine, crest_inside, select, sine, sines, trough_inside};
use crate::error::Result;
use std::f64::consts::{FRAC_PI_2, TAU};

/// What the profile can and cannot do. Labels and words are computed on request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BangBangReport {
    pub feasible: bool,
    /// Shortest duration, s; NaN if infeasible.
    pub t_min: f64,
    /// Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible.
    pub t_max: f64,
    /// Least `inertia * acceleration` that the limits demand, N m.
    pub a_min: f64,
    /// Largest `inertia * acceleration` that the limits allow, N m.
    pub a_max: f64,
    /// Whether the torque can hold the link at rest at the start, at the end.
    pub hold_start: bool,
    pub hold_end: bool,
    theta0: f64,
    thetaf: f64,
    link: Link,
}

/// Bounds on `a` from each phase: (phase 1, phase 2).
struct Bounds {
    upper: [f64; 2],
    lower: [f64; 2],
}

/// (least, largest) value of `G sin` between two angles.
#[inline(always)]
fn gravity_range(g: f64, a: &Sine, b: &Sine) -> (f64, f64) {
    // An extreme that is not inside counts as 2 or -2, beyond every sine; min and max sort out the sign of g.
    let low = a.sin.min(b.sin).min(2.0 - 3.0 * f64::from(u8::from(trough_inside(a, b))));
    let high = a.sin.max(b.sin).max(3.0 * f64::from(u8::from(crest_inside(a, b))) - 2.0);
    ((g * low).min(g * high), (g * low).max(g * high))
}

#[inline(always)]
fn bounds(link: &Link, s0: &Sine, sm: &Sine, s1: &Sine) -> Bounds {
    let (low1, high1) = gravity_range(link.gravity_moment, s0, sm);
    let (low2, high2) = gravity_range(link.gravity_moment, sm, s1);
    Bounds { upper: [link.tau_max - high1, low2 - link.tau_min], lower: [link.tau_min - low1, high2 - link.tau_max] }
}

/// The durations for which `theta0 -> thetaf` (rad) by constant acceleration and equal braking obeys the torque bounds (N m).
///
/// Any start, end, direction and bounds with `tau_min <= 0 <= tau_max`; every comparison with a bound is granted
/// `1e-12` of the larger bound. `theta0 == thetaf` takes no time and is feasible iff the pose can be held.
#[inline]
pub fn bang_bang_time(theta0: f64, thetaf: f64, inertia: f64, gravity_moment: f64, tau_min: f64, tau_max: f64) -> Result<BangBangReport> {
    check_ends(theta0, thetaf)?;
    let link = Link::new(inertia, gravity_moment, tau_min, tau_max)?;
    let forward = thetaf >= theta0;
    let along = link.along(forward);
    let sign = 1.0f64.copysign(thetaf - theta0);
    let (x0, x1) = (sign * theta0, sign * thetaf);
    let distance = x1 - x0;
    let [s0, sm, s1, _] = sines([x0, 0.5 * x0 + 0.5 * x1, x1, 0.0]);
    let b = bounds(&along, &s0, &sm, &s1);
    let a_max = b.upper[0].min(b.upper[1]);
    let a_min = b.lower[0].max(b.lower[1]).max(0.0);
    let slack = link.slack();
    let holds = |s: &Sine| {
        let tau = gravity_moment * s.sin;
        (tau <= along.tau_max + slack) & (tau >= along.tau_min - slack)
    };
    let (hold_start, hold_end) = (holds(&s0), holds(&s1));
    let (feasible, t_min, t_max) = if distance == 0.0 {
        (hold_start, 0.0, 0.0)
    } else {
        let t_min = 2.0 * (inertia * distance / a_max).sqrt();
        let t_max = 2.0 * (inertia * distance / a_min).sqrt();
        // Within the slack the interval is one duration.
        ((a_max > 0.0) & (a_max >= a_min - slack), t_min, t_max.max(t_min))
    };
    let infeasible = u64::from(!feasible);
    let (t_min, t_max) = (select(infeasible, f64::NAN, t_min), select(infeasible, f64::NAN, t_max));
    Ok(BangBangReport { feasible, t_min, t_max, a_min, a_max, hold_start, hold_end, theta0, thetaf, link })
}

impl BangBangReport {
    fn forward(&self) -> bool {
        self.thetaf >= self.theta0
    }

    /// Start, switch and end along the motion.
    fn ends(&self) -> [f64; 3] {
        let sign = if self.forward() { 1.0 } else { -1.0 };
        [sign * self.theta0, sign * (0.5 * self.theta0 + 0.5 * self.thetaf), sign * self.thetaf]
    }

    /// The limit that decides `t_min`.
    pub fn active_upper(&self) -> Bind {
        self.bind(true, self.a_max)
    }

    /// The limit that decides `t_max`; none if the motion may be arbitrarily slow.
    pub fn active_lower(&self) -> Option<Bind> {
        (self.a_min > 0.0).then(|| self.bind(false, self.a_min))
    }

    fn bind(&self, upper: bool, a: f64) -> Bind {
        let along = self.link.along(self.forward());
        let x = self.ends();
        let s = x.map(sine);
        let b = bounds(&along, &s[0], &s[1], &s[2]);
        let gap = if upper { b.upper[1] - b.upper[0] } else { b.lower[0] - b.lower[1] };
        let tie = self.link.slack();
        let second = gap < -tie;
        // Phase 1 meets its upper torque bound when a is too large, phase 2 its lower one.
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
            // The first extreme after `from`; clamped because pi itself is rounded.
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

    /// Why the motion is possible or not, with the missing torque.
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
            _ => Reason::Blocked { upper, missing: -self.a_max },
        }
    }

    /// Torque (N m) of the motion of duration `t` at its start, just before and just after the switch, and at its end.
    pub fn torques(&self, t: f64) -> [f64; 4] {
        let sign = if self.forward() { 1.0 } else { -1.0 };
        let [x0, xm, x1] = self.ends();
        let a = if x1 > x0 { 4.0 * self.link.inertia * (x1 - x0) / (t * t) } else { 0.0 };
        let g = |x: f64| self.link.gravity_moment * sine(x).sin;
        [g(x0) + a, g(xm) + a, g(xm) - a, g(x1) - a].map(|tau| sign * tau)
    }
}
