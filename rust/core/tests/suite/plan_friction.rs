//! The optimum with friction: without it the frictionless optimum, with Coulomb friction alone shifted bounds, else time stepping.

use crate::plan_support::{Problem, Random, near};
use armlet_core::plan::{torque_optimal_time, torque_optimal_time_with_friction};

#[test]
fn without_viscous_friction_the_bounds_are_shifted() {
    let mut random = Random::new(81);
    let mut compared = 0;
    for k in 0..2_000 {
        let p = Problem::nominal(&mut random);
        let c = if k % 2 == 0 { 0.0 } else { random.range(0.0, 0.9) * p.tau_max.min(-p.tau_min) };
        let f = torque_optimal_time_with_friction(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, 0.0, c).unwrap();
        // Friction weakens the push and helps the brake: both bounds move against the motion.
        let shift = if p.thetaf > p.theta0 { -c } else { c };
        let o = torque_optimal_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min + shift, p.tau_max + shift).unwrap();
        assert_eq!(f.feasible, o.feasible, "{p:?} {c} {f:?} {o:?}");
        if f.feasible {
            compared += 1;
            // Near a hump the errors of both grow with exp(t sqrt(|G|/I)).
            let growth = (o.t * (p.gravity.abs() / p.inertia).sqrt()).exp();
            assert!(near(f.t, o.t, 1e-13 * growth + 1e-12), "{p:?} {c} {} {}", f.t, o.t);
            assert!((f.theta_switch - o.theta_switch).abs() <= 1e-12 * growth, "{p:?} {c}");
        }
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn with_viscous_friction_the_motion_arrives_at_rest() {
    let mut random = Random::new(91);
    let mut arrived = 0;
    for _ in 0..500 {
        let p = Problem::nominal(&mut random);
        let (d, c) = (random.range(0.0, 1.0), 0.1 * random.unit());
        let o = torque_optimal_time_with_friction(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, d, c).unwrap();
        if !o.feasible || o.t * (p.gravity.abs() / p.inertia).sqrt() > 6.0 {
            continue;
        }
        arrived += 1;
        let sign = 1.0f64.copysign(p.thetaf - p.theta0);
        let (first, second) = if sign > 0.0 { (p.tau_max, p.tau_min) } else { (p.tau_min, p.tau_max) };
        let (mut q, mut v) = (p.theta0, 0.0);
        for (tau, time) in [(first, o.t_switch), (second, o.t - o.t_switch)] {
            let f = |q: f64, v: f64| (tau - p.gravity * q.sin() - d * v - c * sign) / p.inertia;
            let h = time / 2000.0;
            for _ in 0..2000 {
                let (k1, l1) = (v, f(q, v));
                let (k2, l2) = (v + 0.5 * h * l1, f(q + 0.5 * h * k1, v + 0.5 * h * l1));
                let (k3, l3) = (v + 0.5 * h * l2, f(q + 0.5 * h * k2, v + 0.5 * h * l2));
                let (k4, l4) = (v + h * l3, f(q + h * k3, v + h * l3));
                q += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                v += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
            }
        }
        // Runge-Kutta of order 4 with 2000 steps per phase, growth up to exp(6).
        assert!((q - p.thetaf).abs() < 1e-8 && v.abs() < 1e-7, "{p:?} {d} {c} {o:?} {q} {v}");
    }
    assert!(arrived > 100, "{arrived}");
}

#[test]
fn refusals() {
    for (viscous, coulomb, name) in [(-1.0, 0.0, "viscous"), (f64::NAN, 0.0, "viscous"), (0.0, f64::INFINITY, "coulomb")] {
        let e = torque_optimal_time_with_friction(0.0, 1.0, 1.0, 1.0, -2.0, 2.0, viscous, coulomb).unwrap_err();
        assert!(e.to_string().starts_with(name), "{e}");
    }
    // Coulomb friction above the torque: nothing moves.
    let o = torque_optimal_time_with_friction(0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0, 1.0).unwrap();
    assert!(!o.feasible && o.t.is_nan() && o.theta_stall[0] == 0.0);
}
