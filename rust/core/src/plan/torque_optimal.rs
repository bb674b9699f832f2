//! The time optimum of one link under torque bounds, rest to rest: monotone, and with one reversal.
//!
//! ```text
//! monotone: push u_max on [x0, xs], brake u_min on [xs, x1], x = direction theta
//! xs - x0 = ( -u_min D + G (cos x0 - cos x1) ) / (u_max - u_min)
//! T = int dx / sqrt(2 K(x)/I)     feasible iff K > 0 inside and the net torque is positive at both ends
//! certified global iff min(u_max, -u_min) >= |G| and T <= pi sqrt(I/|G|)
//! x0 = x1: T = 0, feasible and certified iff u_min <= G sin x0 <= u_max
//! ```
//!
//! The certificate is Sturm's comparison: the adjoint obeys `psi_ddot = -(G cos theta/I) psi`, so two switches are
//! more than `pi sqrt(I/|G|)` apart. Without it the optimum may swing back first, or overshoot: see `swing.rs`.

use super::link::{Link, check_ends};
use super::monotone::Straight;
use super::report::{Limit, MonotoneReason};
use super::search::Swing;
use super::sine::sin_cos;
use super::steps::Rough;
use super::swing::{back_swing, overshoot};
use crate::error::Result;
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
    /// No motion was found.
    NoneFound,
}

impl Family {
    /// The name used in Python.
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
    /// Its torque sequence.
    pub kind: Family,
    /// Duration, s; NaN if none was found.
    pub t: f64,
    /// Angles (rad) and times (s) of the torque switches, NaN beyond `switches`.
    pub theta_switches: [f64; 2],
    /// Times of the switches, s.
    pub t_switches: [f64; 2],
    /// Number of switches.
    pub switches: usize,
    /// The place and the time of the reversal of a swing, NaN for the monotone motion.
    pub theta_turn: f64,
    /// When the swing reverses, s.
    pub t_turn: f64,
}

/// The monotone optimum and the best of the three families.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueOptimum {
    /// Whether the monotone motion exists.
    pub feasible: bool,
    /// Its duration, s, and its switch, rad and s; NaN if none.
    pub t: f64,
    /// Angle of the switch, rad.
    pub theta_switch: f64,
    /// Time of the switch, s.
    pub t_switch: f64,
    /// Its speed at the switch, rad/s, signed.
    pub v_peak: f64,
    /// Whether the monotone motion is proven to be the fastest of all.
    pub certified_global: bool,
    /// `pi / sqrt(|G|/I - (d/2I)^2)`, s: without Coulomb friction no optimal motion shorter than this has more than one switch.
    pub sturm_bound: f64,
    /// Why the monotone motion exists or not.
    pub reason: MonotoneReason,
    /// The fastest motion of the three families.
    pub best: Best,
    pub(super) theta0: f64,
    pub(super) thetaf: f64,
    pub(super) limits: [f64; 2],
    pub(super) link: Rough,
}

/// The fastest `theta0 -> thetaf` (rad), rest to rest, under `tau_min <= tau <= tau_max` (N m): the monotone optimum with its
/// certificate, and the best of monotone, back-swing and overshoot.
///
/// ```
/// use armlet_core::plan::{Family, bang_bang_time, torque_optimal_time};
/// use std::f64::consts::PI;
///
/// // Without gravity both are bang-bang: T = 2 sqrt(I D / tau).
/// let (optimum, profile) = (torque_optimal_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?, bang_bang_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?);
/// assert!((optimum.t - 1.0).abs() < 1e-9 && (profile.t_min - 1.0).abs() < 1e-9);
/// // Half of the torque that holds the link level does not lift it at once: it swings back first.
/// let swing = torque_optimal_time(0.0, PI, 1.0, 2.0, -1.0, 1.0)?;
/// assert!(!swing.feasible && swing.best.kind != Family::Monotone);
/// let profile = optimum.profile().expect("feasible");
/// assert!((profile.at(0.5).v - 2.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
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
    let forward = link.is_ahead(theta0, thetaf);
    let sign = if forward { 1.0 } else { -1.0 };
    let along = link.along(forward);
    let (x0, x1, g, up, down) = (sign * theta0, sign * thetaf, gravity_moment, along.tau_max, -along.tau_min);
    let mut optimum = TorqueOptimum::new(theta0, thetaf, &link, [0.0; 2]);
    if x0 == x1 && optimum.set_still(&link) {
        return Ok(optimum);
    }
    let unit = (0.5 * inertia).sqrt();
    let straight = Straight::new(x0, x1, g, up, down);
    let monotone = &straight.monotone;
    if x0 != x1 {
        optimum.reason = monotone.reason().along(sign);
    }
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
    for (kind, search) in [(Family::BackSwing, back_swing as fn(&Straight, f64) -> Option<Swing>), (Family::Overshoot, overshoot)] {
        if let Some(swing) = search(&straight, bound(&optimum.best)) {
            optimum.best = Best::swing(kind, &swing, sign, unit);
        }
    }
    Ok(optimum)
}

impl TorqueOptimum {
    /// Without a motion so far.
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

    /// For equal ends: no time if the torque and Coulomb friction can hold the pose, else the reason. Returns whether they can.
    pub(super) fn set_still(&mut self, link: &Link) -> bool {
        let (theta, load) = (self.theta0, link.gravity_moment * sin_cos(self.theta0).0);
        let missing = [link.tau_min - load, load - link.tau_max].map(|missing| missing - self.link.coulomb);
        let (limit, missing) = if missing[0] > missing[1] { (Limit::TauMin, missing[0]) } else { (Limit::TauMax, missing[1]) };
        self.certified_global = missing <= link.slack();
        if self.certified_global {
            self.set_monotone(0.0, theta, 0.0, 0.0);
        } else {
            self.reason = MonotoneReason::CannotHold { limit, theta, missing };
        }
        self.certified_global
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

    /// From a swing along `sign theta`, whose times are in `unit` seconds.
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
