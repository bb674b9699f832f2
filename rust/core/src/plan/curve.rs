//! Phases of constant torque with friction, by integration. A push starts at rest. A brake ends at rest, and is integrated backwards in
//! time.
//!
//! ```text
//! push from rest at x0:             I y_ddot = (u_max - c) - G sin(x0 + y) - d y_dot
//! brake to rest at x1, backwards:   I y_ddot = (c - u_min) - G sin(-x1 + y) + d y_dot
//! ```
//!
//! `y` is the distance from the rest point, `I` the inertia and `G` the gravity moment. `u_min` and `u_max` are the torque bounds. `d` is
//! the viscous and `c` the Coulomb friction coefficient. With viscous friction the energy is not a function of the angle alone. So the
//! phases are integrated (`steps.rs`). The torque switches where push and brake have equal speeds. At equal angle and speed the push has
//! the larger acceleration, so the two speed curves cross at most once.

use super::steps::{FrictionLink, Progress, Step, evaluate};
use crate::interrupt;

/// A phase from rest, as integration steps.
#[derive(Default)]
pub(super) struct Curve {
    steps: Vec<Step>,
    /// Duration of one unit of time of `steps`, s.
    unit: f64,
    /// The distance that the phase covers while it moves forward, rad.
    pub reach: f64,
}

/// A point of a curve: time since rest (s), speed (rad/s), and spread. The spread is the derivative of the angle with respect to the start
/// angle, at a fixed time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub time: f64,
    pub speed: f64,
    pub spread: f64,
}

const MAX_STEPS: usize = 2000;

impl Curve {
    /// Integrate from rest at `x` under `torque` minus friction. The curve ends after `distance`, or where the link stops. It also ends
    /// where its speed exceeds the speed of the curve `against`, which starts at rest at the other end.
    pub fn new(x: f64, torque: f64, link: &FrictionLink, distance: f64, against: Option<&Curve>) -> Self {
        let mut at = Progress::new(x, torque, link);
        let mut curve = Curve { steps: Vec::new(), unit: at.unit, reach: 0.0 };
        if at.net() <= 0.0 {
            return curve;
        }
        while at.y < distance && curve.steps.len() < MAX_STEPS && !at.is_near_equilibrium() {
            interrupt::check();
            let mut step = at.step(distance);
            if !(step.length > 0.0) {
                break;
            }
            for _ in 0..60 {
                // Shorten a step that ends far beyond `distance`. The curve beyond `distance` is not required, and may not be finite.
                let (next, _) = evaluate(&step.y, step.length);
                if next.is_finite() && next <= 2.0 * distance {
                    break;
                }
                step.length *= 0.5;
            }
            if let Some(after) = stall(&step) {
                step.length = after;
                curve.reach = evaluate(&step.y, after).0.min(distance);
                curve.steps.push(step);
                return curve;
            }
            at.advance(&step);
            curve.steps.push(step);
            curve.reach = at.y.min(distance);
            if let Some(other) = against {
                let left = distance - curve.reach;
                if other.reach > 0.0 && left <= other.reach && at.v / at.unit > other.at(left).speed {
                    break;
                }
            }
        }
        curve
    }

    /// Time since rest (s), speed (rad/s) and derivative of the angle by the start angle, at the distance `y <= reach`, rad.
    pub fn at(&self, y: f64) -> Moment {
        let k = self.steps.partition_point(|s| s.y[0] <= y).max(1) - 1;
        let Step { time, length, y: c, spread } = &self.steps[k];
        let (mut a, mut b) = (0.0, *length);
        // The first estimate of the time. Near rest, the distance is proportional to the square of the time.
        let part = (y - c[0]) / (evaluate(c, b).0 - c[0]);
        let mut h = length * if k == 0 { part.max(0.0).sqrt() } else { part.max(0.0) }.min(1.0);
        let mut last = f64::INFINITY;
        for _ in 0..60 {
            let (position, speed) = evaluate(c, h);
            if position < y {
                a = h
            } else {
                b = h
            }
            let newton = (h - (position - y) / speed).clamp(a, b);
            if (newton - h).abs() <= 4e-16 * (length + y / speed) {
                break;
            }
            let next = if (newton - h).abs() < 0.5 * last { newton } else { 0.5 * (a + b) };
            (h, last) = (next, (next - h).abs());
        }
        Moment { time: (time + h) * self.unit, speed: evaluate(c, h).1 / self.unit, spread: evaluate(spread, h).0 }
    }
}

/// The time after the start of this step at which forward motion ends; `None` if forward motion continues beyond the step.
fn stall(step: &Step) -> Option<f64> {
    let forward = |h: f64| evaluate(&step.y, h).1 > 0.0;
    let parts = [0.25, 0.5, 0.75, 1.0].map(|part| part * step.length);
    let stopped =
        parts.into_iter().find(|&h| !forward(h)).or_else(|| (evaluate(&step.y, step.length).0 <= step.y[0]).then_some(step.length))?;
    let (mut a, mut b) = (0.0, stopped);
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if forward(middle) { a = middle } else { b = middle }
    }
    Some(a)
}

/// The point where a push and the brake after it have equal speeds.
pub(super) struct Meeting {
    /// The distance of this point from the start of the push, rad.
    pub at: f64,
    pub push: Moment,
    pub brake: Moment,
}

/// A push over a distance, and the brake after it. The brake is computed backwards.
pub(super) struct Leg<'a> {
    pub push: &'a Curve,
    pub brake: &'a Curve,
    pub distance: f64,
}

impl Leg<'_> {
    /// The interval of distances that both curves cover, if there is one.
    fn overlap(&self) -> Option<[f64; 2]> {
        let (a, b) = (self.distance - self.brake.reach.min(self.distance), self.push.reach.min(self.distance));
        (a < b).then_some([a, b])
    }

    /// At the distance `y`: the squared speed of the push minus the squared speed of the brake.
    fn lead(&self, y: f64) -> f64 {
        self.push.at(y).speed.powi(2) - self.brake.at(self.distance - y).speed.powi(2)
    }

    /// Find the point where push and brake have equal speeds, by regula falsi in the Illinois variant; `None` if no such point exists.
    pub fn meeting(&self) -> Option<Meeting> {
        let [a, b] = self.overlap()?;
        let (mut low, mut high) = ((a, self.lead(a)), (b, self.lead(b)));
        if !(low.1 < 0.0 && high.1 >= 0.0) {
            return None;
        }
        let (mut side, mut y) = (0, b);
        for _ in 0..100 {
            let next = low.0 + (high.0 - low.0) * (low.1 / (low.1 - high.1));
            if (next - y).abs() <= 2e-16 * self.distance || !(next > low.0 && next < high.0) {
                break;
            }
            y = next;
            let lead = self.lead(y);
            if lead < 0.0 {
                low = (y, lead);
                high.1 *= if side < 0 { 0.5 } else { 1.0 };
                side = -1;
            } else {
                high = (y, lead);
                low.1 *= if side > 0 { 0.5 } else { 1.0 };
                side = 1;
            }
        }
        Some(Meeting { at: y, push: self.push.at(y), brake: self.brake.at(self.distance - y) })
    }
}
