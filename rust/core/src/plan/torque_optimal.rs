//! The time optimum of one link under torque bounds, rest to rest: monotone, and with one reversal.
//!
//! ```text
//! monotone: push u_max on [x0, xs], brake u_min on [xs, x1], x = direction theta
//! xs - x0 = ( -u_min D + G (cos x0 - cos x1) ) / (u_max - u_min)
//! T = int dx / sqrt(2 K(x)/I)     feasible iff K > 0 inside and the net torque is positive at both ends
//! certified global iff min(u_max, -u_min) >= |G| and T <= pi sqrt(I/|G|)
//! ```
//!
//! The certificate is Sturm's comparison: the adjoint obeys `psi_ddot = -(G cos theta/I) psi`, so two switches are
//! more than `pi sqrt(I/|G|)` apart. Without it the optimum may back up first or overshoot: see `swing.rs`.

use super::link::{Link, check_ends};
use super::phase::Phase;
use super::report::MonotoneReason;
use super::search::Swing;
use super::sine::sin_cos;
use super::steps::Rough;
use super::swing::{back_swing, overshoot};
use crate::error::Result;
use crate::scalar::Real;
use std::f64::consts::PI;

/// The torque sequence of an optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Push, then brake.
    Monotone,
    /// Away from the goal first: (-, +, -) for a motion in the positive direction.
    BackSwing,
    /// Past the goal and back: (+, -, +) for a motion in the positive direction.
    Overshoot,
    NoneFound,
}

impl Family {
    pub fn name(self) -> &'static str {
        match self {
            Family::Monotone => "monotone",
            Family::BackSwing => "back-swing",
            Family::Overshoot => "overshoot",
            Family::NoneFound => "none found",
        }
    }
}

/// The best motion of the three families.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    pub kind: Family,
    /// Duration, s; NaN if none was found.
    pub t: f64,
    /// Angles (rad) and times (s) of the torque switches, NaN beyond `switches`.
    pub theta_switches: [f64; 2],
    pub t_switches: [f64; 2],
    pub switches: usize,
    /// Where and when a swing reverses, NaN for the monotone motion.
    pub theta_turn: f64,
    pub t_turn: f64,
}

/// The monotone optimum and the best of the three families.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueOptimum {
    /// Whether the monotone motion exists.
    pub feasible: bool,
    /// Its duration, s, and its switch, rad and s; NaN if none.
    pub t: f64,
    pub theta_switch: f64,
    pub t_switch: f64,
    /// Its speed at the switch, rad/s, signed.
    pub v_peak: f64,
    pub certified_global: bool,
    /// `pi / sqrt(|G|/I - (d/2I)^2)`, s: without Coulomb friction no optimal motion shorter than this has more than one switch.
    pub sturm_bound: f64,
    pub reason: MonotoneReason,
    pub best: Best,
    pub(super) theta0: f64,
    pub(super) thetaf: f64,
    pub(super) limits: [f64; 2],
    pub(super) link: Rough,
}

/// A push and a brake from rest at `x0` to rest at `x1 > x0`, with their lengths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Monotone<S = f64> {
    pub push: Phase<S>,
    pub brake: Phase<S>,
    pub push_length: S,
    pub brake_length: S,
}

/// Kinetic energies of a push and a brake: at the switch, and at the hump of either, infinite if it has none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Energies {
    pub peak: f64,
    pub push_hump: f64,
    pub brake_hump: f64,
}

/// `cos x0 - cos x1` from the sines of half the sum and of half the difference: exact for moves of any smallness.
#[inline(always)]
pub(super) fn drop<S: Real>(sum: S, difference: S) -> S {
    S::splat(2.0) * sum * difference
}

impl Monotone {
    /// `up`, `down`: sizes of the pushing and of the braking torque bound, both >= 0.
    #[inline]
    pub fn new(x0: f64, x1: f64, g: f64, up: f64, down: f64) -> Self {
        let drop = drop(sin_cos(0.5 * x0 + 0.5 * x1).0, sin_cos(0.5 * (x1 - x0)).0);
        Monotone::between(Phase::new(x0, up, g), Phase::new(-x1, down, g), drop)
    }

    /// Why the motion is impossible, if it is: every test is on the sign of a quantity whose size is the margin.
    #[inline]
    pub fn reason(&self) -> MonotoneReason {
        let Monotone { push, brake, push_length, brake_length } = *self;
        if push.net() <= 0.0 {
            return MonotoneReason::StartBlocked { missing: -push.net() };
        }
        if brake.net() <= 0.0 {
            return MonotoneReason::EndBlocked { missing: -brake.net() };
        }
        if push_length <= 0.0 || brake_length <= 0.0 {
            return MonotoneReason::Work {
                missing: -push_length.min(brake_length) * (push.push + brake.push) / (push_length + brake_length),
            };
        }
        let peak = push.energy(push_length);
        if let Some(y) = push.hump(push_length) {
            let energy = push.energy(y);
            if energy <= 0.0 {
                return MonotoneReason::Hump { x: push.x + y, missing: -energy / y };
            }
        }
        if let Some(y) = brake.hump(brake_length) {
            let energy = brake.energy(y);
            if energy <= 0.0 {
                return MonotoneReason::Hump { x: -brake.x - y, missing: -energy / y };
            }
        }
        if peak <= 0.0 {
            return MonotoneReason::Hump { x: push.x + push_length, missing: -peak / push_length };
        }
        MonotoneReason::Feasible
    }

    /// The kinetic energies, if the motion is possible.
    #[inline]
    pub fn energies(&self) -> Option<Energies> {
        let Monotone { push, brake, push_length, brake_length } = *self;
        if !(push_length > 0.0 && brake_length > 0.0 && push.net() > 0.0 && brake.net() > 0.0) {
            return None;
        }
        let (push_hump, brake_hump) = (push.lowest(push_length), brake.lowest(brake_length));
        if !(push_hump > 0.0 && brake_hump > 0.0) {
            return None;
        }
        let peak = push.energy(push_length);
        (peak > 0.0).then_some(Energies { peak, push_hump, brake_hump })
    }

    /// Durations of the two phases over `sqrt(I/2)`.
    #[inline]
    pub fn time_factors(&self) -> (f64, f64) {
        (self.push.time_factor(self.push_length), self.brake.time_factor(self.brake_length))
    }
}

impl<S: Real> Monotone<S> {
    /// From where `push` is at rest to where `brake` is, which runs backwards in the mirrored coordinate; `drop = cos x0 - cos x1`.
    #[inline(always)]
    pub fn between(push: Phase<S>, brake: Phase<S>, drop: S) -> Self {
        let (up, down) = (push.push, brake.push);
        let (distance, work) = (-brake.x - push.x, push.g * drop);
        let (push_length, brake_length) = ((down * distance + work) / (up + down), (up * distance - work) / (up + down));
        Monotone { push, brake, push_length, brake_length }
    }

    /// The least of all margins of feasibility, N m: positive iff `reason` is `Feasible`, continuous in the end points. Where it is at
    /// most `least`, any number up to that.
    #[inline(always)]
    pub fn margin(&self, least: S) -> S {
        let Monotone { push, brake, push_length, brake_length } = *self;
        let (shorter, per) = (push_length.min(brake_length), push_length + brake_length);
        let ends = push.net().min(brake.net()).min(shorter * (push.push + brake.push) / per);
        let moves = S::zero().lt(shorter);
        if !S::any(least.lt(S::select(moves, ends, least))) {
            return ends;
        }
        let energy = push.energy(push_length).min(push.lowest(push_length)).min(brake.lowest(brake_length));
        S::select(moves, ends.min(energy / per), ends)
    }
}

/// The fastest `theta0 -> thetaf` (rad), rest to rest, under `tau_min <= tau <= tau_max` (N m): the monotone optimum with its
/// certificate, and the best of monotone, back-swing and overshoot.
pub fn torque_optimal_time(
    theta0: f64,
    thetaf: f64,
    inertia: f64,
    gravity_moment: f64,
    tau_min: f64,
    tau_max: f64,
) -> Result<TorqueOptimum> {
    check_ends(theta0, thetaf)?;
    let link = Link::new(inertia, gravity_moment, tau_min, tau_max)?;
    let forward = thetaf >= theta0;
    let sign = if forward { 1.0 } else { -1.0 };
    let along = link.along(forward);
    let (x0, x1, g, up, down) = (sign * theta0, sign * thetaf, gravity_moment, along.tau_max, -along.tau_min);
    let mut optimum = TorqueOptimum::new(theta0, thetaf, &link, [0.0; 2]);
    if x0 == x1 {
        optimum.set_monotone(0.0, theta0, 0.0, 0.0);
        optimum.certified_global = true;
        return Ok(optimum);
    }
    let unit = (0.5 * inertia).sqrt();
    let monotone = Monotone::new(x0, x1, g, up, down);
    optimum.reason = monotone.reason().along(sign);
    if optimum.reason == MonotoneReason::Feasible {
        let (push, brake) = monotone.time_factors();
        let v_peak = monotone.push.energy(monotone.push_length).sqrt() / unit;
        optimum.set_monotone(unit * (push + brake), sign * (x0 + monotone.push_length), unit * push, sign * v_peak);
        optimum.certified_global = up.min(down) >= g.abs() && optimum.t <= optimum.sturm_bound;
        if optimum.certified_global {
            return Ok(optimum);
        }
    }
    let bound = |best: &Best| if best.t.is_nan() { f64::INFINITY } else { best.t / unit };
    for (kind, search) in
        [(Family::BackSwing, back_swing as fn(f64, f64, f64, f64, f64, f64) -> Option<Swing>), (Family::Overshoot, overshoot)]
    {
        if let Some(swing) = search(x0, x1, g, up, down, bound(&optimum.best)) {
            optimum.best = Best::swing(kind, &swing, sign, unit);
        }
    }
    Ok(optimum)
}

impl TorqueOptimum {
    /// None found yet.
    #[inline]
    pub(super) fn new(theta0: f64, thetaf: f64, link: &Link, [viscous, coulomb]: [f64; 2]) -> Self {
        let Link { inertia, gravity_moment: g, tau_min, tau_max } = *link;
        TorqueOptimum {
            feasible: false,
            t: f64::NAN,
            theta_switch: f64::NAN,
            t_switch: f64::NAN,
            v_peak: f64::NAN,
            certified_global: false,
            sturm_bound: PI * (inertia / (g.abs() - viscous * viscous / (4.0 * inertia)).max(0.0)).sqrt(),
            reason: MonotoneReason::Feasible,
            best: Best::NONE,
            theta0,
            thetaf,
            limits: [tau_min, tau_max],
            link: Rough { inertia, g, viscous, coulomb },
        }
    }

    #[inline]
    pub(super) fn set_monotone(&mut self, t: f64, theta_switch: f64, t_switch: f64, v_peak: f64) {
        (self.feasible, self.t, self.theta_switch, self.t_switch, self.v_peak) = (true, t, theta_switch, t_switch, v_peak);
        self.best = Best::monotone(t, theta_switch, t_switch);
    }
}

impl Best {
    pub(super) const NONE: Best = Best {
        kind: Family::NoneFound,
        t: f64::NAN,
        theta_switches: [f64::NAN; 2],
        t_switches: [f64::NAN; 2],
        switches: 0,
        theta_turn: f64::NAN,
        t_turn: f64::NAN,
    };

    /// Of a swing along `sign theta`, whose times are in `unit` seconds.
    pub(super) fn swing(kind: Family, swing: &Swing, sign: f64, unit: f64) -> Self {
        Best {
            kind,
            t: unit * swing.time,
            theta_switches: swing.x_switches.map(|x| sign * x),
            t_switches: swing.t_switches.map(|t| unit * t),
            switches: 2,
            theta_turn: sign * swing.x_turn,
            t_turn: unit * swing.t_turn,
        }
    }

    pub(super) fn monotone(t: f64, theta_switch: f64, t_switch: f64) -> Self {
        Best {
            kind: Family::Monotone,
            t,
            theta_switches: [theta_switch, f64::NAN],
            t_switches: [t_switch, f64::NAN],
            switches: 1,
            ..Best::NONE
        }
    }
}
