//! The minimum time of one link under torque bounds, from rest to rest: the monotone motion, and motions with one reversal.
//!
//! ```text
//! monotone: push u_max on [x0, xs], brake u_min on [xs, x1], x = direction theta
//! xs - x0 = ( -u_min D + G (cos x0 - cos x1) ) / (u_max - u_min)
//! T = int dx / sqrt(2 K(x)/I), K: kinetic energy     feasible iff K > 0 inside and the net torque is positive at both ends
//! certified global iff min(u_max, -u_min) >= |G| and T <= pi sqrt(I/|G|)
//! x0 = x1: T = 0, feasible and certified iff u_min <= G sin x0 <= u_max
//! ```
//!
//! `x0` is the start, `x1` the goal, `D = x1 - x0`, and `xs` the switch. `I` is the inertia and `G` the gravity moment. `direction` is 1 or
//! -1, so that `x1 >= x0`. `u_min` and `u_max` are the torque bounds in the coordinate `x`. Sturm's comparison theorem certifies that a
//! monotone motion is the fastest of all motions. The adjoint variable `psi` obeys `psi_ddot = -(G cos theta/I) psi`, and its zeros are the
//! torque switches. So two switches are more than `pi sqrt(I/|G|)` apart. If a motion is not certified, a back-swing or an overshoot may be
//! faster (`swing.rs`).

use super::link::{Link, check_ends};
use super::monotone::MonotoneMotion;
use super::report::{Limit, MonotoneReason};
use super::search::Swing;
use super::sine::sin_cos;
use super::steps::FrictionLink;
use super::swing::{back_swing, overshoot};
use crate::error::Result;
use std::f64::consts::PI;

/// The torque sequence of an optimum.
///
/// ```
/// use armlet_core::plan::{Family, torque_optimal_time};
/// use std::f64::consts::PI;
///
/// let family = |limit: f64| torque_optimal_time(0.0, PI, 1.0, 2.0, -limit, limit).map(|optimum| optimum.best.kind);
/// assert_eq!((family(5.0)?, family(1.0)?), (Family::Monotone, Family::BackSwing));
/// assert_eq!(Family::BackSwing.name(), "back-swing");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Push towards the goal, then brake.
    Monotone,
    /// First move away from the goal: torque signs (-, +, -) for a motion in the positive direction.
    BackSwing,
    /// First pass the goal, then return: torque signs (+, -, +) for a motion in the positive direction.
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

/// The fastest motion of the three families: monotone, back-swing and overshoot.
///
/// ```
/// use armlet_core::plan::torque_optimal_time;
/// use std::f64::consts::PI;
///
/// // The torque is too small for a direct motion: the link first swings back.
/// let best = torque_optimal_time(0.0, PI, 1.0, 2.0, -1.0, 1.0)?.best;
/// assert_eq!(best.switches, 2);
/// assert!(best.theta_turn < 0.0 && best.theta_switches[0] < 0.0 && best.theta_switches[1] > 0.0);
/// assert!(0.0 < best.t_switches[0] && best.t_switches[0] < best.t_turn && best.t_turn < best.t);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// The torque sequence of the motion.
    pub kind: Family,
    /// Duration, s; NaN if none was found.
    pub t: f64,
    /// Angles of the torque switches, rad; NaN beyond the first `switches` entries.
    pub theta_switches: [f64; 2],
    /// Times of the torque switches, s; NaN beyond the first `switches` entries.
    pub t_switches: [f64; 2],
    /// Number of torque switches.
    pub switches: usize,
    /// Angle at which a swing reverses, rad; NaN for a monotone motion.
    pub theta_turn: f64,
    /// Time at which a swing reverses, s; NaN for a monotone motion.
    pub t_turn: f64,
}

/// The fastest monotone motion, and the fastest motion of the three families: monotone, back-swing and overshoot.
///
/// ```
/// use armlet_core::plan::{MonotoneReason, torque_optimal_time};
///
/// // Without gravity: one switch, in the middle of the motion.
/// let optimum = torque_optimal_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?;
/// assert!(optimum.feasible && optimum.certified_global);
/// assert_eq!((optimum.theta_switch, optimum.sturm_bound, optimum.reason), (0.5, f64::INFINITY, MonotoneReason::Feasible));
/// assert!((optimum.t - 1.0).abs() < 1e-9 && (optimum.v_peak - 2.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueOptimum {
    /// Whether the monotone motion exists.
    pub feasible: bool,
    /// Duration of the monotone motion, s; NaN if it does not exist.
    pub t: f64,
    /// Angle at which the monotone motion switches from push to brake, rad; NaN if it does not exist.
    pub theta_switch: f64,
    /// Time at which the monotone motion switches from push to brake, s; NaN if it does not exist.
    pub t_switch: f64,
    /// Signed speed of the monotone motion at its switch, rad/s; NaN if it does not exist.
    pub v_peak: f64,
    /// Whether the monotone motion is proven to be the fastest of all motions.
    pub certified_global: bool,
    /// `pi / sqrt(|G|/I - (d/2I)^2)`, s, with gravity moment `G`, inertia `I` and viscous friction `d`; infinite if the root is zero or not
    /// real. Without Coulomb friction, an optimal motion shorter than this time has at most one switch.
    pub sturm_bound: f64,
    /// Whether the monotone motion exists, or the reason why not.
    pub reason: MonotoneReason,
    /// The fastest motion of the three families: monotone, back-swing and overshoot.
    pub best: Best,
    pub(super) theta0: f64,
    pub(super) thetaf: f64,
    pub(super) limits: [f64; 2],
    pub(super) link: FrictionLink,
}

/// Compute the fastest motion from rest at `theta0` to rest at `thetaf` (rad), under `tau_min <= tau <= tau_max` (N m).
///
/// `inertia` is in kg m^2, `gravity_moment` in N m. The result has the monotone optimum with its certificate, and the fastest of monotone
/// motion, back-swing and overshoot. Errors: `Input` for an invalid argument.
///
/// ```
/// use armlet_core::plan::{Family, bang_bang_time, torque_optimal_time};
/// use std::f64::consts::PI;
///
/// // Without gravity both are bang-bang: T = 2 sqrt(I D / tau).
/// let (optimum, profile) = (torque_optimal_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?, bang_bang_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?);
/// assert!((optimum.t - 1.0).abs() < 1e-9 && (profile.t_min - 1.0).abs() < 1e-9);
/// // Half of the torque that holds the link horizontally cannot lift it by a monotone motion.
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
    let straight = MonotoneMotion::new(x0, x1, g, up, down);
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
    for (kind, search) in [(Family::BackSwing, back_swing as fn(&MonotoneMotion, f64) -> Option<Swing>), (Family::Overshoot, overshoot)] {
        if let Some(swing) = search(&straight, bound(&optimum.best)) {
            optimum.best = Best::swing(kind, &swing, sign, unit);
        }
    }
    Ok(optimum)
}

impl TorqueOptimum {
    /// Create a result without a motion.
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
            link: FrictionLink { inertia, g, viscous, coulomb },
        }
    }

    /// For equal ends: set a motion of zero duration if the torque and Coulomb friction can hold the pose, else set the reason. Return
    /// whether they can hold the pose.
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

    /// Create the result for a swing in the coordinate `sign theta`. The times of the swing are in units of `unit` seconds.
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
