//! The motion of minimum time: angle, speed, acceleration and torque at any time.
//!
//! Every phase starts or ends at rest. A phase that ends at rest is computed backwards, in steps of `steps.rs`. Without friction, the
//! durations come from quadrature, an independent method. So the phases meet at the switch only if both methods are correct.

use super::sine::sin_cos;
use super::steps::{FrictionLink, Progress, Step, evaluate};
use super::torque_optimal::{Best, Family, TorqueOptimum};

/// The largest number of steps of a phase.
const MAX_STEPS: usize = 4000;

/// A phase of constant torque that starts or ends at rest at the angle `theta`.
#[derive(Debug, Clone, PartialEq)]
struct RestPhase {
    theta: f64,
    /// +1 or -1. The angle at the distance `y` from rest is `q = theta + direction * y`.
    direction: f64,
    tau: f64,
    /// The time at which the phase is at rest, s.
    rest_time: f64,
    /// +1 if the phase starts at rest, -1 if it ends at rest.
    sense: f64,
    /// The time at which the phase ends, s.
    end: f64,
    steps: Vec<Step>,
    /// Duration of one unit of time of the steps, s.
    unit: f64,
}

/// State and torque of a motion at one time.
///
/// ```
/// use armlet_core::plan::{Sample, torque_optimal_time};
///
/// let profile = torque_optimal_time(0.0, 1.0, 1.0, 0.0, -4.0, 4.0)?.profile().expect("feasible");
/// let Sample { q, v, a, tau } = profile.at(0.25);
/// assert!((q - 0.125).abs() < 1e-12 && (v - 1.0).abs() < 1e-12);
/// assert_eq!((a, tau), (4.0, 4.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Angle, rad.
    pub q: f64,
    /// Speed, rad/s.
    pub v: f64,
    /// Acceleration, rad/s^2.
    pub a: f64,
    /// Torque, N m.
    pub tau: f64,
}

/// A torque profile with its motion. The link is at rest before the start and after the end.
///
/// ```
/// use armlet_core::plan::torque_optimal_time;
///
/// let profile = torque_optimal_time(0.2, 1.2, 1.0, 2.0, -6.0, 6.0)?.profile().expect("feasible");
/// let (start, end) = (profile.at(0.0), profile.at(profile.duration()));
/// assert!(start.tau == 6.0 && start.q == 0.2 && (end.q - 1.2).abs() < 1e-9);
/// // After the end, the torque holds the link.
/// assert!(end.v == 0.0 && (end.tau - 2.0 * 1.2f64.sin()).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueProfile {
    link: FrictionLink,
    theta0: f64,
    thetaf: f64,
    duration: f64,
    runs: Vec<RestPhase>,
}

impl RestPhase {
    /// Compute the steps of the phase, which takes `duration`, s.
    fn with_steps(mut self, link: &FrictionLink, duration: f64) -> Self {
        let along = if self.sense > 0.0 { *link } else { link.backwards() };
        let mut at = Progress::new(self.direction * self.theta, self.direction * self.tau, &along);
        let size = at.net().abs() / link.inertia * duration * duration;
        self.unit = at.unit;
        let duration = duration / at.unit;
        while at.time < duration && self.steps.len() < MAX_STEPS {
            let mut step = at.step(size + at.y);
            step.length = step.length.min(duration - at.time);
            if !(step.length > 0.0) {
                break;
            }
            at.advance(&step);
            self.steps.push(step);
        }
        self
    }

    fn sample(&self, t: f64, link: &FrictionLink) -> Sample {
        let time = (self.sense * (t - self.rest_time)).max(0.0) / self.unit;
        let k = self.steps.partition_point(|s| s.time <= time).max(1) - 1;
        let (y, v) = evaluate(&self.steps[k].y, time - self.steps[k].time);
        let way = self.sense * self.direction;
        let (q, v) = (self.theta + self.direction * y, way * v / self.unit);
        let friction = link.viscous * v + link.coulomb * way;
        Sample { q, v, a: (self.tau - link.g * sin_cos(q).0 - friction) / link.inertia, tau: self.tau }
    }
}

impl TorqueProfile {
    fn new(optimum: &TorqueOptimum, best: &Best) -> Option<Self> {
        let TorqueOptimum { theta0, thetaf, limits, link, .. } = *optimum;
        let mut runs = Vec::new();
        let mut leg = |from: f64, to: f64, t0: f64, ts: f64, t1: f64| {
            let direction = if to >= from { 1.0 } else { -1.0 };
            let (push, brake) = if direction > 0.0 { (limits[1], limits[0]) } else { (limits[0], limits[1]) };
            let (steps, unit) = (Vec::new(), 1.0);
            let push = RestPhase { theta: from, direction, tau: push, rest_time: t0, sense: 1.0, end: ts, steps, unit };
            let brake =
                RestPhase { theta: to, direction: -direction, tau: brake, rest_time: t1, sense: -1.0, end: t1, steps: Vec::new(), unit };
            runs.push(push.with_steps(&link, ts - t0));
            runs.push(brake.with_steps(&link, t1 - ts));
        };
        match best.kind {
            Family::NoneFound => return None,
            Family::Monotone if best.t == 0.0 => {}
            Family::Monotone => leg(theta0, thetaf, 0.0, best.t_switches[0], best.t),
            Family::BackSwing | Family::Overshoot => {
                leg(theta0, best.theta_turn, 0.0, best.t_switches[0], best.t_turn);
                leg(best.theta_turn, thetaf, best.t_turn, best.t_switches[1], best.t);
            }
        }
        Some(TorqueProfile { link, theta0, thetaf, duration: best.t, runs })
    }

    /// Duration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Angle, speed, acceleration and torque at time `t` (s), right-continuous. The link is at rest before 0 and from the end on.
    pub fn at(&self, t: f64) -> Sample {
        let hold = |q: f64| Sample { q, v: 0.0, a: 0.0, tau: self.link.g * sin_cos(q).0 };
        if t < 0.0 {
            return hold(self.theta0);
        }
        match self.runs.iter().find(|run| t < run.end && !run.steps.is_empty()) {
            Some(run) => run.sample(t, &self.link),
            None => hold(self.thetaf),
        }
    }
}

impl TorqueOptimum {
    /// The fastest motion of the three families (monotone, back-swing and overshoot); `None` if no motion was found.
    pub fn profile(&self) -> Option<TorqueProfile> {
        TorqueProfile::new(self, &self.best)
    }

    /// The monotone motion; `None` if it does not exist.
    pub fn monotone_profile(&self) -> Option<TorqueProfile> {
        if !self.feasible {
            return None;
        }
        TorqueProfile::new(self, &Best::monotone(self.t, self.theta_switch, self.t_switch))
    }
}
