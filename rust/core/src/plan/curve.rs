//! Phases of constant torque with friction that start (or, run backwards, end) at rest, by integration.
//!
//! ```text
//! push from rest at x0:             I y_ddot = (u_max - c) - G sin(x0 + y) - d y_dot
//! brake to rest at x1, backwards:   I y_ddot = (c - u_min) - G sin(-x1 + y) + d y_dot
//! spread z = d(x + y)/dx at fixed time:   I z_ddot = -G cos(x + y) z -+ d z_dot,   z(0) = 1,  z_dot(0) = 0
//! ```
//!
//! With viscous friction the energy is no longer a function of the angle alone, so the phases are integrated (Taylor series, as in
//! `trajectory.rs`) and meet where their speeds agree. At equal angle and speed the push has the larger acceleration, so the two
//! curves cross once at most.

use super::sine::sin_cos;
use super::trajectory::{ORDER, evaluate, series, step_length};

/// What moves: inertia, gravity, friction. Backwards in time both frictions are negative.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rough {
    pub inertia: f64,
    pub g: f64,
    pub viscous: f64,
    pub coulomb: f64,
}

impl Rough {
    pub fn backwards(self) -> Self {
        Rough { viscous: -self.viscous, coulomb: -self.coulomb, ..self }
    }
}

struct Step {
    time: f64,
    length: f64,
    y: [f64; ORDER + 1],
    spread: [f64; ORDER + 1],
}

/// A phase from rest: Taylor steps until the distance is covered or the link stalls.
#[derive(Default)]
pub(super) struct Curve {
    steps: Vec<Step>,
    /// The distance covered while moving forward.
    pub reach: f64,
}

/// Time since rest, speed and spread somewhere on a curve.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub time: f64,
    pub speed: f64,
    pub spread: f64,
}

const MAX_STEPS: usize = 2000;

/// Taylor coefficients of the spread along those of `cos(x + y)`.
fn spread(start: f64, rate: f64, cos: &[f64; ORDER + 1], link: &Rough) -> [f64; ORDER + 1] {
    let mut z = [0.0; ORDER + 1];
    (z[0], z[1]) = (start, rate);
    for n in 0..ORDER - 1 {
        let turning: f64 = (0..=n).map(|j| cos[j] * z[n - j]).sum();
        z[n + 2] = -(link.g * turning + link.viscous * (n + 1) as f64 * z[n + 1]) / (link.inertia * ((n + 1) * (n + 2)) as f64);
    }
    z
}

impl Curve {
    /// From rest at `x` under `torque`, less the friction, over `distance` at most, or until it is faster than a curve that comes from there.
    pub fn new(x: f64, torque: f64, link: &Rough, distance: f64, against: Option<&Curve>) -> Self {
        let (g, inertia, push) = (link.g, link.inertia, torque - link.coulomb);
        let mut curve = Curve { steps: Vec::new(), reach: 0.0 };
        if push - g * sin_cos(x).0 <= 0.0 {
            return curve;
        }
        let (mut time, mut y, mut v, mut z) = (0.0, 0.0, 0.0, (1.0, 0.0));
        while y < distance && curve.steps.len() < MAX_STEPS {
            let [c, cos] = series(x, y, v, push, g, link.viscous, inertia);
            let s = spread(z.0, z.1, &cos, link);
            // Half the step of full accuracy, so that a stall cannot hide inside one.
            let mut h = 0.5 * step_length(&c, distance);
            let (mut next, mut speed) = evaluate(&c, h);
            for _ in 0..60 {
                // Stop at the goal: the curve beyond it is not needed, and may not be finite.
                if next.is_finite() && next <= 2.0 * distance {
                    break;
                }
                h *= 0.5;
                (next, speed) = evaluate(&c, h);
            }
            if speed <= 0.0 || next <= y {
                // The last moment of forward motion inside the step.
                let (mut a, mut b) = (0.0, h);
                for _ in 0..60 {
                    let middle = 0.5 * (a + b);
                    if evaluate(&c, middle).1 > 0.0 { a = middle } else { b = middle }
                }
                curve.reach = evaluate(&c, a).0.min(distance);
                curve.steps.push(Step { time, length: a, y: c, spread: s });
                return curve;
            }
            curve.steps.push(Step { time, length: h, y: c, spread: s });
            time += h;
            (y, v) = (next, speed);
            z = evaluate(&s, h);
            curve.reach = y.min(distance);
            if let Some(other) = against {
                let left = distance - curve.reach;
                if other.reach > 0.0 && left <= other.reach && v > other.at(left).speed {
                    break;
                }
            }
        }
        curve
    }

    /// At the distance `y <= reach`.
    pub fn at(&self, y: f64) -> Moment {
        let k = self.steps.partition_point(|s| s.y[0] <= y).max(1) - 1;
        let Step { time, length, y: c, spread } = &self.steps[k];
        let (mut a, mut b) = (0.0, *length);
        let mut h = 0.5 * length;
        for _ in 0..60 {
            let (position, speed) = evaluate(c, h);
            if position < y {
                a = h
            } else {
                b = h
            }
            let newton = h - (position - y) / speed;
            let next = if newton > a && newton < b { newton } else { 0.5 * (a + b) };
            if (next - h).abs() <= 4e-16 * length {
                break;
            }
            h = next;
        }
        Moment { time: time + h, speed: evaluate(c, h).1, spread: evaluate(spread, h).0 }
    }
}

/// Where a push meets the brake after it.
pub(super) struct Meeting {
    /// The distance from the start.
    pub at: f64,
    pub push: Moment,
    pub brake: Moment,
}

/// A push and the brake after it, run backwards, over a distance.
pub(super) struct Leg<'a> {
    pub push: &'a Curve,
    pub brake: &'a Curve,
    pub distance: f64,
}

impl Leg<'_> {
    /// The distances between which both curves are, if they are anywhere together.
    fn overlap(&self) -> Result<[f64; 2], f64> {
        let (a, b) = (self.distance - self.brake.reach.min(self.distance), self.push.reach.min(self.distance));
        if a < b { Ok([a, b]) } else { Err(b - a) }
    }

    /// By how much the push is ahead, in squares of the speed.
    fn lead(&self, y: f64) -> f64 {
        self.push.at(y).speed.powi(2) - self.brake.at(self.distance - y).speed.powi(2)
    }

    /// Positive where the curves meet, continuous: the lesser of the two leads at the ends of where they overlap, with the sign that it
    /// must have, over `steep`; or by how much they are apart.
    pub fn margin(&self, steep: f64) -> f64 {
        match self.overlap() {
            Ok([a, b]) => (-self.lead(a)).min(self.lead(b)) / steep,
            Err(apart) => apart,
        }
    }

    /// The crossing of the two curves, if there is one: regula falsi after Illinois.
    pub fn meeting(&self) -> Option<Meeting> {
        let [a, b] = self.overlap().ok()?;
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
