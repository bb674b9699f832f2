//! The motion of a torque optimum, to follow: angle, speed, acceleration and torque at any time.
//!
//! ```text
//! I y_ddot = p - G sin(x + y),  y(0) = y_dot(0) = 0        (every phase starts or ends at rest: the latter run backwards)
//! y = sum y_k h^k,   S_k = (1/k) sum_j j y_j C_(k-j),   C_k = -(1/k) sum_j j y_j S_(k-j),   y_(k+2) = (p [k=0] - G S_k) / (I (k+1)(k+2))
//! ```
//!
//! Taylor series of order 24 after Jorba and Zou, in steps whose last terms are below 1e-17 of the motion. Independent
//! of the quadrature that gave the durations: the phases meet at the switch only if both are right.

use super::sine::sin_cos;
use super::torque_optimal::{Best, Family, TorqueOptimum};

pub(super) const ORDER: usize = 24;
/// More steps than any phase of a hundred turns takes.
const MAX_STEPS: usize = 4000;

/// One Taylor step from `time` of its phase.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    time: f64,
    y: [f64; ORDER + 1],
}

/// A phase of constant torque that leaves or reaches rest at `theta`.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    theta: f64,
    /// `q = theta + direction * y`.
    direction: f64,
    tau: f64,
    /// The time of rest, and +1 if the phase leaves it, -1 if it reaches it.
    rest: f64,
    sense: f64,
    /// The time at which the phase ends.
    end: f64,
    steps: Vec<Step>,
}

/// State and input of a motion: rad, rad/s, rad/s^2, N m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub q: f64,
    pub v: f64,
    pub a: f64,
    pub tau: f64,
}

/// A torque profile with its motion; holds its ends.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueProfile {
    inertia: f64,
    gravity_moment: f64,
    theta0: f64,
    thetaf: f64,
    duration: f64,
    runs: Vec<Run>,
}

/// Taylor coefficients at `y`, `v`, and those of `cos(x + y)`; viscous friction, zero for the exact optimum, adds `-viscous y_dot`.
pub(super) fn series(x: f64, y: f64, v: f64, push: f64, g: f64, viscous: f64, inertia: f64) -> [[f64; ORDER + 1]; 2] {
    let mut c = [0.0; ORDER + 1];
    let (mut s, mut k) = ([0.0; ORDER + 1], [0.0; ORDER + 1]);
    (c[0], c[1]) = (y, v);
    (s[0], k[0]) = sin_cos(x + y);
    for n in 0..ORDER - 1 {
        if n > 0 {
            let (mut sine, mut cosine) = (0.0, 0.0);
            for j in 1..=n {
                let weight = j as f64 * c[j];
                sine += weight * k[n - j];
                cosine -= weight * s[n - j];
            }
            (s[n], k[n]) = (sine / n as f64, cosine / n as f64);
        }
        let force = if n == 0 { push - g * s[0] } else { -g * s[n] };
        c[n + 2] = (force - viscous * (n + 1) as f64 * c[n + 1]) / (inertia * ((n + 1) * (n + 2)) as f64);
    }
    [c, k]
}

/// The step whose dropped terms are below 1e-17 of `size`. From rest, and at a crest of the sine, all but every fourth term
/// vanish: the last six decide.
pub(super) fn step_length(c: &[f64; ORDER + 1], size: f64) -> f64 {
    (ORDER - 5..=ORDER).map(|k| (1e-17 * size / c[k].abs()).powf(1.0 / k as f64)).fold(f64::INFINITY, f64::min)
}

/// Position and speed of a step after `h`.
pub(super) fn evaluate(c: &[f64; ORDER + 1], h: f64) -> (f64, f64) {
    let (mut y, mut v) = (0.0, 0.0);
    for k in (0..=ORDER).rev() {
        v = v * h + y;
        y = y * h + c[k];
    }
    (y, v)
}

impl Run {
    fn new(theta: f64, direction: f64, tau: f64, rest: f64, end: f64, sense: f64, inertia: f64, g: f64, duration: f64) -> Self {
        let (x, push) = (direction * theta, direction * tau);
        let (mut time, mut y, mut v) = (0.0, 0.0, 0.0);
        let mut steps = Vec::new();
        while time < duration && steps.len() < MAX_STEPS {
            let [c, _] = series(x, y, v, push, g, 0.0, inertia);
            steps.push(Step { time, y: c });
            let h = step_length(&c, c[2].abs() * duration * duration + c[0].abs()).min(duration - time).max(1e-4 * duration);
            (y, v) = evaluate(&c, h);
            time += h;
        }
        Run { theta, direction, tau, rest, sense, end, steps }
    }

    fn sample(&self, t: f64, inertia: f64, g: f64) -> Sample {
        let time = (self.sense * (t - self.rest)).max(0.0);
        let k = self.steps.partition_point(|s| s.time <= time).max(1) - 1;
        let (y, v) = evaluate(&self.steps[k].y, time - self.steps[k].time);
        let q = self.theta + self.direction * y;
        Sample { q, v: self.sense * self.direction * v, a: (self.tau - g * sin_cos(q).0) / inertia, tau: self.tau }
    }
}

impl TorqueProfile {
    fn new(optimum: &TorqueOptimum, best: &Best) -> Option<Self> {
        let link = &optimum.link;
        let mut runs = Vec::new();
        let mut leg = |from: f64, to: f64, t0: f64, ts: f64, t1: f64| {
            let direction = if to >= from { 1.0 } else { -1.0 };
            let (push, brake) = if direction > 0.0 { (link.tau_max, link.tau_min) } else { (link.tau_min, link.tau_max) };
            runs.push(Run::new(from, direction, push, t0, ts, 1.0, link.inertia, link.gravity_moment, ts - t0));
            runs.push(Run::new(to, -direction, brake, t1, t1, -1.0, link.inertia, link.gravity_moment, t1 - ts));
        };
        let (theta0, thetaf) = (optimum.theta0, optimum.thetaf);
        match best.kind {
            Family::NoneFound => return None,
            Family::Monotone if best.t == 0.0 => {}
            Family::Monotone => leg(theta0, thetaf, 0.0, best.t_switches[0], best.t),
            Family::BackSwing | Family::Overshoot => {
                leg(theta0, best.theta_turn, 0.0, best.t_switches[0], best.t_turn);
                leg(best.theta_turn, thetaf, best.t_turn, best.t_switches[1], best.t);
            }
        }
        Some(TorqueProfile { inertia: link.inertia, gravity_moment: link.gravity_moment, theta0, thetaf, duration: best.t, runs })
    }

    /// Duration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Angle, speed, acceleration and torque at time `t` (s), right-continuous; at rest before 0 and from the end on.
    pub fn at(&self, t: f64) -> Sample {
        let hold = |q: f64| Sample { q, v: 0.0, a: 0.0, tau: self.gravity_moment * sin_cos(q).0 };
        if t < 0.0 {
            return hold(self.theta0);
        }
        match self.runs.iter().find(|run| t < run.end && !run.steps.is_empty()) {
            Some(run) => run.sample(t, self.inertia, self.gravity_moment),
            None => hold(self.thetaf),
        }
    }
}

impl TorqueOptimum {
    /// The motion of the best family; none if no motion was found.
    pub fn profile(&self) -> Option<TorqueProfile> {
        TorqueProfile::new(self, &self.best)
    }

    /// The motion of the monotone optimum; none if it does not exist.
    pub fn monotone_profile(&self) -> Option<TorqueProfile> {
        if !self.feasible {
            return None;
        }
        TorqueProfile::new(self, &Best::monotone(self.t, self.theta_switch, self.t_switch))
    }
}
