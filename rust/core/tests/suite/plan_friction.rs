//! Tests of the optimum with friction. Without friction, it must equal the frictionless optimum. With only Coulomb friction, it must equal
//! the optimum with shifted limits. Otherwise it is compared with time stepping.

use crate::plan_support::{Problem, Random, near};
use armlet_core::plan::{Family, MonotoneReason, TorqueOptimum, torque_optimal_time, torque_optimal_time_with_friction};

#[test]
fn without_viscous_friction_the_bounds_are_shifted() {
    let mut random = Random::new(81);
    let mut compared = 0;
    for k in 0..2_000 {
        let p = Problem::nominal(&mut random);
        let c = if k % 2 == 0 { 0.0 } else { random.range(0.0, 0.9) * p.tau_max.min(-p.tau_min) };
        let f = torque_optimal_time_with_friction(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, [0.0, c]).unwrap();
        // Coulomb friction reduces the accelerating torque, and adds to the braking torque. So both torque limits shift against the motion.
        let shift = if p.thetaf > p.theta0 { -c } else { c };
        let o = torque_optimal_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min + shift, p.tau_max + shift).unwrap();
        assert_eq!(f.feasible, o.feasible, "{p:?} {c} {f:?} {o:?}");
        if f.feasible {
            compared += 1;
            // Near an unstable equilibrium of torque and gravity, the rounding errors of both solutions grow with exp(t sqrt(|G|/I)).
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
        let o = torque_optimal_time_with_friction(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, [d, c]).unwrap();
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
        // The checker uses Runge-Kutta of order 4 with 2000 steps per phase. Errors grow by up to exp(6).
        assert!((q - p.thetaf).abs() < 1e-8 && v.abs() < 1e-7, "{p:?} {d} {c} {o:?} {q} {v}");
    }
    assert!(arrived > 100, "{arrived}");
}

fn rough(p: &Problem, viscous: f64, coulomb: f64) -> TorqueOptimum {
    torque_optimal_time_with_friction(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, [viscous, coulomb]).unwrap()
}

#[test]
fn swings_without_friction_are_the_exact_ones() {
    let (mut random, mut swings) = (Random::new(101), 0);
    for _ in 0..40 {
        let p = Problem::nominal(&mut random);
        let (f, o) = (rough(&p, 0.0, 0.0), torque_optimal_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max).unwrap());
        assert_eq!(f.best.kind, o.best.kind, "{p:?} {f:?} {o:?}");
        if f.best.switches == 2 {
            swings += 1;
            // Near an unstable equilibrium of torque and gravity, the rounding errors of both solutions grow with exp(t sqrt(|G|/I)). An
            // error of the turning point has only a second-order effect on the time.
            let growth = (o.best.t * (p.gravity.abs() / p.inertia).sqrt()).exp();
            assert!(near(f.best.t, o.best.t, 1e-13 * growth + 1e-11), "{p:?} {f:?} {o:?}");
        }
    }
    assert!(swings > 3, "{swings}");
}

#[test]
fn swings_with_coulomb_friction_beat_every_detour() {
    // With Coulomb friction alone, the parts before and after the turn are frictionless optima whose limits are both shifted against the
    // motion. `torque_optimal_time` computes these parts without the integration that the solver under test uses. The turning points are
    // scanned here.
    let (mut random, mut swings) = (Random::new(111), 0);
    for _ in 0..30 {
        let p = Problem::nominal(&mut random);
        let c = random.range(0.0, 0.5) * p.tau_max.min(-p.tau_min);
        let best = rough(&p, 0.0, c).best;
        let leg = |a: f64, b: f64| {
            let shift = if b > a { -c } else { c };
            if p.tau_max + shift <= 0.0 || p.tau_min + shift >= 0.0 {
                return f64::NAN;
            }
            torque_optimal_time(a, b, p.inertia, p.gravity, p.tau_min + shift, p.tau_max + shift).unwrap().t
        };
        let detour = |z: f64| leg(p.theta0, z) + leg(z, p.thetaf);
        if best.switches == 2 {
            swings += 1;
            let growth = (best.t * (p.gravity.abs() / p.inertia).sqrt()).exp();
            assert!(near(best.t, detour(best.theta_turn), 1e-13 * growth + 1e-11), "{p:?} {c} {best:?} {}", detour(best.theta_turn));
        }
        let sign = 1.0f64.copysign(p.thetaf - p.theta0);
        for j in 0..80 {
            let depth = 10f64.powf(-3.0 + 3.9 * (j / 2) as f64 / 39.0);
            let z = if j % 2 == 0 { p.theta0 - sign * depth } else { p.thetaf + sign * depth };
            let t = detour(z);
            assert!(t.is_nan() || best.t <= t * (1.0 + 1e-9), "{p:?} {c} {best:?} {z} {t}");
        }
    }
    assert!(swings > 1, "{swings}");
}

#[test]
fn swings_with_viscous_friction_arrive_at_rest() {
    let (mut random, mut kinds) = (Random::new(121), [0; 4]);
    for _ in 0..60 {
        let p = Problem::nominal(&mut random);
        let (d, c) = (random.range(0.0, 0.3) * p.inertia.sqrt(), 0.2 * random.unit() * p.tau_max);
        let o = rough(&p, d, c);
        let best = o.best;
        kinds[best.kind as usize] += 1;
        assert!(!(best.t > o.t), "{p:?} {o:?}");
        if best.switches < 2 || best.t * (p.gravity.abs() / p.inertia).sqrt() > 8.0 {
            continue;
        }
        // The torque switches at the first and the third of these times. The sign of the Coulomb friction changes at the second.
        let first = if (p.thetaf > p.theta0) == (best.kind == Family::Overshoot) { 1.0 } else { -1.0 };
        let times = [best.t_switches[0], best.t_turn, best.t_switches[1], best.t];
        let (mut q, mut v, mut t) = (p.theta0, 0.0, 0.0);
        for (k, (push, way)) in [(first, first), (-first, first), (-first, -first), (first, -first)].into_iter().enumerate() {
            let tau = if push > 0.0 { p.tau_max } else { p.tau_min };
            let f = |q: f64, v: f64| (tau - p.gravity * q.sin() - d * v - c * way) / p.inertia;
            let h = (times[k] - t) / 2000.0;
            for _ in 0..2000 {
                let (k1, l1) = (v, f(q, v));
                let (k2, l2) = (v + 0.5 * h * l1, f(q + 0.5 * h * k1, v + 0.5 * h * l1));
                let (k3, l3) = (v + 0.5 * h * l2, f(q + 0.5 * h * k2, v + 0.5 * h * l2));
                let (k4, l4) = (v + h * l3, f(q + h * k3, v + h * l3));
                q += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
                v += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
            }
            t = times[k];
            if k == 1 {
                // The velocity is zero at the turning point. The checker uses Runge-Kutta of order 4 with 2000 steps. Errors grow by up to
                // exp(8).
                assert!((q - best.theta_turn).abs() < 1e-7 && v.abs() < 1e-6, "{p:?} {d} {c} {o:?} {q} {v}");
            }
        }
        assert!((q - p.thetaf).abs() < 1e-6 && v.abs() < 1e-5, "{p:?} {d} {c} {o:?} {q} {v}");
    }
    assert!(kinds[0] > 10 && kinds[1] + kinds[2] > 2, "{kinds:?}");
}

#[test]
fn friction_that_settles_leaves_the_slow_motion() {
    // With large friction, v = N/d up to a relative error I|G|/d^2, where N is the net torque. So the time is T = d int dx/N (computed with
    // Simpson's rule), plus some time constants at the ends.
    let (mut random, mut settled) = (Random::new(131), 0);
    for _ in 0..300 {
        let p = Problem::nominal(&mut random);
        let (d, c) = ((p.inertia * p.gravity.abs()).sqrt() * 10f64.powf(random.range(2.0, 8.0)), 0.1 * random.unit() * p.tau_max);
        let sign = 1.0f64.copysign(p.thetaf - p.theta0);
        let push = if sign > 0.0 { p.tau_max } else { -p.tau_min } - c;
        let (brake, x0, x1) = (if sign > 0.0 { -p.tau_min } else { p.tau_max } + c, sign * p.theta0, sign * p.thetaf);
        let net = |k: usize| push - p.gravity * (x0 + (x1 - x0) * k as f64 / 2000.0).sin();
        let least = (0..=2000).map(net).fold(f64::INFINITY, f64::min);
        let o = rough(&p, d, c);
        if least <= 1e-3 * push || brake + p.gravity * x1.sin() <= 1e-3 * brake {
            assert!(least > -1e-3 * push.abs() || !o.feasible, "{p:?} {d} {c} {o:?}");
            continue;
        }
        settled += 1;
        let weight = |k: usize| if k == 0 || k == 2000 { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
        let slow = d * (x1 - x0) / 6000.0 * (0..=2000).map(|k| weight(k) / net(k)).sum::<f64>();
        let most = p.inertia / (d * d) * (push.max(brake) + p.gravity.abs());
        assert!(o.feasible && o.certified_global && o.best.kind == Family::Monotone, "{p:?} {d} {c} {o:?}");
        // Simpson's rule is least accurate where the net torque N is small. The formula omits a few time constants at the ends.
        assert!(near(o.t, slow, 1e-7 + 30.0 * most / (least / push * (x1 - x0).min(1.0))), "{p:?} {d} {c} {} {slow}", o.t);
    }
    assert!(settled > 50, "{settled}");
}

#[test]
fn profiles_with_friction_meet_where_the_torque_switches() {
    let (mut random, mut swings) = (Random::new(141), 0);
    for k in 0..200 {
        let p = Problem::nominal(&mut random);
        let scale = (p.inertia * p.gravity.abs()).sqrt();
        let (d, c) = (scale * 10f64.powf(random.range(-2.0, if k % 2 == 0 { -0.5 } else { 4.0 })), 0.2 * random.unit() * p.tau_max);
        let o = rough(&p, d, c);
        let (best, Some(profile)) = (o.best, o.profile()) else { continue };
        swings += usize::from(best.switches == 2);
        // Near an unstable equilibrium of torque and gravity, errors grow with exp(t sqrt(|G|/I)), and less with friction.
        let growth = (best.t * (p.gravity.abs() / p.inertia).sqrt()).exp().min(1e6);
        let speed = p.tau_max.max(-p.tau_min).max(p.gravity.abs()) / p.inertia * (p.inertia / (d + scale));
        for (theta, t) in best.theta_switches.into_iter().zip(best.t_switches).take(best.switches) {
            let (before, after) = (profile.at(t * (1.0 - 1e-15)), profile.at(t));
            assert!((before.q - theta).abs() + (after.q - theta).abs() <= 1e-12 * growth, "{p:?} {d} {c} {o:?} {before:?} {after:?}");
            // The braking phase may be so short that its duration is below the rounding error of the time.
            assert!(
                t == best.t || (before.v - after.v).abs() <= 1e-10 * growth * speed + 2e-15 * t * after.a.abs(),
                "{p:?} {d} {c} {o:?} {before:?} {after:?}"
            );
        }
        let ends = [profile.at(0.0), profile.at(best.t * (1.0 - 1e-15))];
        assert!((ends[0].q - p.theta0).abs() + (ends[1].q - p.thetaf).abs() <= 1e-12 && ends[0].v == 0.0, "{p:?} {d} {c} {ends:?}");
        if best.switches == 2 {
            let turn = profile.at(best.t_turn);
            assert!((turn.q - best.theta_turn).abs() <= 1e-12 && turn.v.abs() <= 1e-12 * speed, "{p:?} {d} {c} {turn:?}");
        }
    }
    assert!(swings > 5, "{swings}");
}

#[test]
fn a_motion_that_friction_stalls_says_what_is_missing() {
    let o = torque_optimal_time_with_friction(0.1, 3.0, 1.0, 1.0, -0.9, 0.9, [30.0, 0.0]).unwrap();
    let MonotoneReason::Apart { push, missing, .. } = o.reason else { panic!("{:?}", o.reason) };
    // The motion is overdamped. The accelerating torque moves the link slowly to the angle at which gravity equals this torque. The missing
    // torque is the difference to the largest gravity torque.
    assert!((push - 0.9f64.asin()).abs() < 1e-6 && (missing - 0.1).abs() < 1e-6 && o.best.kind == Family::NoneFound, "{o:?}");
}

#[test]
fn refusals() {
    for (viscous, coulomb, name) in [(-1.0, 0.0, "viscous"), (f64::NAN, 0.0, "viscous"), (0.0, f64::INFINITY, "coulomb")] {
        let e = torque_optimal_time_with_friction(0.0, 1.0, 1.0, 1.0, -2.0, 2.0, [viscous, coulomb]).unwrap_err();
        assert!(e.to_string().starts_with(name), "{e}");
    }
    // If Coulomb friction is at least the torque, the link does not move.
    let o = torque_optimal_time_with_friction(0.0, 1.0, 1.0, 0.0, -1.0, 1.0, [0.0, 1.0]).unwrap();
    assert!(!o.feasible && o.t.is_nan() && o.reason == MonotoneReason::StartBlocked { missing: 0.0 }, "{:?}", o.reason);
}
