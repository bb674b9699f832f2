//! The time optimum of one link with viscous and Coulomb friction: monotone, and with one reversal.
//!
//! ```text
//! I theta_ddot + G sin theta + d theta_dot + c sign(theta_dot) = tau
//! back-swing (-, +, -): x0 -> xt = x0 - e -> x1, the middle torque u+ less c after the turn, and with c before it
//! dT/de = (z/v)_2 + (z/v)_3                     spread and speed (`curve.rs`) at the two switches, of the phase to the turn and of that from it
//! ```
//!
//! The switches drop out of the derivative, since the speeds agree there. An overshoot is the back-swing of the motion mirrored and
//! run backwards in time, with both frictions negative. Coulomb friction alone only shifts the bounds: a test uses it as an
//! independent check.

use super::curve::{Curve, Leg, Meeting, Rough};
use super::link::{Link, check_ends};
use super::search::{BackSwings, FARTHEST, Swing, fastest, next};
use super::torque_optimal::{Best, Family};
use crate::error::{Error, Result};
use std::f64::consts::PI;

/// The optimum with friction: the monotone motion, NaN if infeasible, and the best of the three families.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionOptimum {
    pub feasible: bool,
    /// Duration, s.
    pub t: f64,
    pub theta_switch: f64,
    pub t_switch: f64,
    /// Speed at the switch, rad/s, signed.
    pub v_peak: f64,
    /// Where the push stalls and where the brake must have begun at the earliest, rad, if they do not meet.
    pub theta_stall: [f64; 2],
    pub best: Best,
}

/// The back-swings of `x0 -> x1 > x0`.
struct Search {
    x0: f64,
    x1: f64,
    up: f64,
    down: f64,
    link: Rough,
    /// The outer phases.
    leaves: Curve,
    arrives: Curve,
}

/// The two legs of a swing: where their phases meet.
struct Trial {
    turn: f64,
    away: Meeting,
    towards: Meeting,
}

impl Search {
    /// None where the start can't be left backwards, or nothing comes to rest at the end.
    fn new(x0: f64, x1: f64, up: f64, down: f64, link: Rough, bound: f64) -> Option<Self> {
        let mut search = Search { x0, x1, up, down, link, leaves: Curve::default(), arrives: Curve::default() };
        search.arrives = Curve::new(-x1, down, &link.backwards(), next(search.farthest(bound)) + x1 - x0, None);
        search.leaves = Curve::new(-x0, down, &link, next(search.farthest(bound)), None);
        (search.leaves.reach > 0.0 && search.arrives.reach > 0.0).then_some(search)
    }

    /// What `f` says of the way out, with the phase to the turn run backwards.
    fn away<T>(&self, e: f64, f: impl FnOnce(Leg) -> T) -> T {
        let to = Curve::new(self.x0 - e, self.up, &self.link.backwards(), e, Some(&self.leaves));
        f(Leg { push: &self.leaves, brake: &to, distance: e })
    }

    /// And of the way in.
    fn towards<T>(&self, e: f64, f: impl FnOnce(Leg) -> T) -> T {
        let distance = e + self.x1 - self.x0;
        let from = Curve::new(self.x0 - e, self.up, &self.link, distance, Some(&self.arrives));
        f(Leg { push: &from, brake: &self.arrives, distance })
    }

    fn trial(&self, e: f64) -> Option<Trial> {
        let meeting = |leg: Leg| leg.meeting();
        Some(Trial { turn: self.x0 - e, away: self.away(e, meeting)?, towards: self.towards(e, meeting)? })
    }
}

impl BackSwings for Search {
    fn slope(&self, e: f64, _fine: bool) -> Option<f64> {
        let trial = self.trial(e)?;
        let (first, second) = (trial.away.brake, trial.towards.push);
        let rate = first.spread / first.speed + second.spread / second.speed;
        let slope = rate / (rate.abs() + first.speed.recip() + second.speed.recip());
        slope.is_finite().then_some(slope)
    }

    fn margin(&self, e: f64, least: f64) -> f64 {
        let steep = (self.up + self.down) / self.link.inertia;
        let margin = |leg: Leg| leg.margin(steep);
        let away = self.away(e, margin);
        if away <= least { away } else { away.min(self.towards(e, margin)) }
    }

    fn possible(&self, e: f64) -> bool {
        self.trial(e).is_some()
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let Trial { turn, away, towards } = self.trial(e)?;
        let (t1, t2, t3, t4) = (away.push.time, away.brake.time, towards.push.time, towards.brake.time);
        let time = t1 + t2 + t3 + t4;
        time.is_finite().then_some(Swing {
            time,
            x_switches: [self.x0 - away.at, turn + towards.at],
            t_switches: [t1, t1 + t2 + t3],
            x_turn: turn,
            t_turn: t1 + t2,
        })
    }

    fn nearest(&self) -> f64 {
        (1e-3 * (self.x1 - self.x0).min(1.0)).max(1e-6)
    }

    /// Each stretch from rest with all of a torque and of gravity, and on, at no moment faster than the last brake:
    /// `T > k sqrt(2 I e / p) + T_brake(D)`, `k = 2` for the ways to the turn and back to `x0`; backwards only the first begins at rest.
    fn farthest(&self, limit: f64) -> f64 {
        if limit == f64::INFINITY {
            return FARTHEST;
        }
        let (distance, p) = (self.x1 - self.x0, self.up.max(self.down) + self.link.g.abs());
        let brake = if distance <= self.arrives.reach { self.arrives.at(distance).time } else { 0.0 };
        let stretches = if self.link.viscous < 0.0 || self.link.coulomb < 0.0 { 1.0 } else { 2.0 };
        (((limit - brake).max(0.0) / stretches).powi(2) * 0.5 * p / self.link.inertia).min(FARTHEST)
    }

    fn steepest(&self, _e: f64) -> f64 {
        10.0 * (1.0 + self.link.g.abs() / (self.up + self.down))
    }

    fn weak(&self) -> bool {
        false
    }
}

/// The fastest `theta0 -> thetaf` (rad), rest to rest, with friction torques `viscous * v` (N m s) and `coulomb * sign(v)` (N m).
pub fn torque_optimal_time_with_friction(
    theta0: f64,
    thetaf: f64,
    inertia: f64,
    gravity_moment: f64,
    tau_min: f64,
    tau_max: f64,
    viscous: f64,
    coulomb: f64,
) -> Result<FrictionOptimum> {
    check_ends(theta0, thetaf)?;
    let link = Link::new(inertia, gravity_moment, tau_min, tau_max)?;
    for (name, x) in [("viscous", viscous), ("coulomb", coulomb)] {
        if !(x >= 0.0 && x.is_finite()) {
            return Err(Error::input(name, format!("is not a friction coefficient: expected a finite number >= 0, got {x}")));
        }
    }
    let sign = 1.0f64.copysign(thetaf - theta0);
    let along = link.along(sign > 0.0);
    let (x0, x1, distance) = (sign * theta0, sign * thetaf, (thetaf - theta0).abs());
    let (up, down, link) = (along.tau_max, -along.tau_min, Rough { inertia, g: gravity_moment, viscous, coulomb });
    let mut optimum = FrictionOptimum {
        feasible: false,
        t: f64::NAN,
        theta_switch: f64::NAN,
        t_switch: f64::NAN,
        v_peak: f64::NAN,
        theta_stall: [f64::NAN; 2],
        best: Best::NONE,
    };
    if distance == 0.0 {
        (optimum.feasible, optimum.t, optimum.theta_switch, optimum.t_switch, optimum.v_peak) = (true, 0.0, theta0, 0.0, 0.0);
        optimum.best = Best::monotone(0.0, theta0, 0.0);
        return Ok(optimum);
    }
    let (push, brake) = (Curve::new(x0, up, &link, distance, None), Curve::new(-x1, down, &link.backwards(), distance, None));
    match (Leg { push: &push, brake: &brake, distance }).meeting() {
        Some(Meeting { at, push, brake }) => {
            optimum.feasible = true;
            optimum.t = push.time + brake.time;
            optimum.theta_switch = sign * (x0 + at);
            optimum.t_switch = push.time;
            optimum.v_peak = sign * push.speed;
            optimum.best = Best::monotone(optimum.t, optimum.theta_switch, optimum.t_switch);
        }
        None => optimum.theta_stall = [sign * (x0 + push.reach), sign * (x1 - brake.reach)],
    }
    // Viscous friction only moves the zeros of the adjoint apart: `phi = exp(-d t / 2 I) psi` obeys `phi_ddot = (d^2 / 4 I^2 - G cos theta / I) phi`.
    let g = gravity_moment.abs();
    let certified = coulomb == 0.0 && up.min(down) >= g && optimum.t <= PI * (inertia / g).sqrt();
    if certified || viscous * viscous >= 4.0 * inertia * g {
        return Ok(optimum);
    }
    for (kind, (x0, x1), (up, down), link) in
        [(Family::BackSwing, (x0, x1), (up, down), link), (Family::Overshoot, (-x1, -x0), (down, up), link.backwards())]
    {
        let bound = if optimum.best.t.is_nan() { f64::INFINITY } else { optimum.best.t };
        let swing = Search::new(x0, x1, up, down, link, bound).and_then(|search| fastest(&search, bound));
        if let Some(swing) = swing {
            let swing = if kind == Family::Overshoot { swing.reversed() } else { swing };
            optimum.best = Best::swing(kind, &swing, sign, 1.0);
        }
    }
    Ok(optimum)
}
