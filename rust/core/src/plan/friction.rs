//! The monotone time optimum of one link with viscous and Coulomb friction, by integration.
//!
//! ```text
//! I theta_ddot + G sin theta + d theta_dot + c sign(theta_dot) = tau
//! push from rest at x0:             I y_ddot = (u_max - c) - G sin(x0 + y) - d y_dot
//! brake to rest at x1, backwards:   I y_ddot = (c - u_min) - G sin(-x1 + y) + d y_dot
//! ```
//!
//! With viscous friction the energy is no longer a function of the angle alone, so both phases are integrated (Taylor series, as in
//! `trajectory.rs`) and meet where their speeds agree. At equal angle and speed the push has the larger acceleration, so the two
//! curves cross once at most. Coulomb friction alone only shifts the two bounds: a test uses it as an independent check.

use super::link::{Link, check_ends};
use super::sine::sin_cos;
use super::trajectory::{ORDER, evaluate, series, step_length};
use crate::error::{Error, Result};

/// The monotone optimum with friction; NaN if infeasible.
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
}

/// A phase from rest: Taylor steps until the distance is covered or the link stalls.
struct Curve {
    steps: Vec<(f64, [f64; ORDER + 1], f64)>,
    /// The distance covered while moving forward.
    reach: f64,
}

const MAX_STEPS: usize = 2000;

impl Curve {
    fn new(x: f64, push: f64, link: &Link, viscous: f64, distance: f64) -> Self {
        let (g, inertia) = (link.gravity_moment, link.inertia);
        let mut curve = Curve { steps: Vec::new(), reach: 0.0 };
        if push - g * sin_cos(x).0 <= 0.0 {
            return curve;
        }
        let (mut time, mut y, mut v) = (0.0, 0.0, 0.0);
        while y < distance && curve.steps.len() < MAX_STEPS {
            let c = series(x, y, v, push, g, viscous, inertia);
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
                curve.steps.push((time, c, a));
                return curve;
            }
            curve.steps.push((time, c, h));
            time += h;
            (y, v) = (next, speed);
            curve.reach = y.min(distance);
        }
        curve
    }

    /// Time and speed at the distance `y <= reach`.
    fn at(&self, y: f64) -> (f64, f64) {
        let k = self.steps.partition_point(|s| s.1[0] <= y).max(1) - 1;
        let (time, c, length) = &self.steps[k];
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
            if (next - h).abs() <= 1e-16 * length {
                break;
            }
            h = next;
        }
        (time + h, evaluate(c, h).1)
    }
}

/// The fastest monotone `theta0 -> thetaf` (rad), rest to rest, with friction torques `viscous * v` (N m s) and `coulomb * sign(v)` (N m).
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
    if distance == 0.0 {
        return Ok(FrictionOptimum {
            feasible: true,
            t: 0.0,
            theta_switch: theta0,
            t_switch: 0.0,
            v_peak: 0.0,
            theta_stall: [f64::NAN; 2],
        });
    }
    let push = Curve::new(x0, along.tau_max - coulomb, &link, viscous, distance);
    let brake = Curve::new(-x1, coulomb - along.tau_min, &link, -viscous, distance);
    // Push faster than brake allows at `b`, slower at `a`.
    let (mut a, mut b) = (distance - brake.reach, push.reach);
    let none = FrictionOptimum {
        feasible: false,
        t: f64::NAN,
        theta_switch: f64::NAN,
        t_switch: f64::NAN,
        v_peak: f64::NAN,
        theta_stall: [sign * (x0 + push.reach), sign * (x1 - brake.reach)],
    };
    if push.steps.is_empty() || brake.steps.is_empty() || a >= b {
        return Ok(none);
    }
    let faster = |y: f64| push.at(y).1 >= brake.at(distance - y).1;
    if faster(a) || !faster(b) {
        return Ok(none);
    }
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if faster(middle) { b = middle } else { a = middle }
    }
    let y = 0.5 * (a + b);
    let ((t1, v), (t2, _)) = (push.at(y), brake.at(distance - y));
    Ok(FrictionOptimum {
        feasible: true,
        t: t1 + t2,
        theta_switch: sign * (x0 + y),
        t_switch: t1,
        v_peak: sign * v,
        theta_stall: [f64::NAN; 2],
    })
}
