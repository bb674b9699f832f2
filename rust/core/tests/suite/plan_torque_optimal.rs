//! Tests of the torque optimum: the vectors of `oracle_ex4_bangbang_public.json`, random problems against time stepping, symmetries, and
//! errors.

use crate::plan_support::{Problem, Random, cases, near, number, oracle, random_count};
use armlet_core::plan::{Family, MonotoneReason, TorqueOptimum, bang_bang_time, torque_optimal_time, torque_optimal_time_with_friction};
use std::f64::consts::{FRAC_PI_2, PI};

fn optimum(p: &Problem) -> TorqueOptimum {
    torque_optimal_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max).expect("valid problem")
}

#[test]
fn public_oracle() {
    for case in &cases() {
        let id = case["id"].as_str().unwrap();
        let p = Problem::of_case(case);
        let (expected, t_rel) = (&case["expected"]["optimal_monotone"], number(&case["tolerance"]["T_rel"]));
        let o = optimum(&p);
        assert_eq!(o.feasible, expected["feasible"].as_bool().unwrap(), "{id}");
        if !o.feasible {
            assert!(o.t.is_nan() && o.theta_switch.is_nan() && matches!(o.reason, MonotoneReason::Work { .. }), "{id}");
            continue;
        }
        assert!(near(o.t, number(&expected["T"]), t_rel), "{id}: {} {}", o.t, expected["T"]);
        assert!((o.theta_switch - number(&expected["theta_switch"])).abs() < 1e-12, "{id}: {}", o.theta_switch);
        assert!(near(o.t_switch, number(&expected["t_switch"]), 1e-11), "{id}: {} {}", o.t_switch, expected["t_switch"]);
        assert!(near(o.v_peak, number(&expected["omega_peak"]), 1e-12), "{id}: {}", o.v_peak);
        assert_eq!(o.certified_global, expected["globally_optimal_certified"].as_bool().unwrap(), "{id}");
        assert!(near(o.sturm_bound, number(&expected["sturm_bound"]), 1e-14), "{id}");
        if let Some(ratio) = case["expected"]["ratio_profile_over_optimal"].as_f64() {
            let profile = bang_bang_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max).unwrap();
            assert!(near(profile.t_min / o.t, ratio, number(&case["tolerance"]["ratio_rel"])), "{id}");
        }
        assert!(o.best.t <= o.t);
        let swing = &case["expected"]["optimal_with_backswing"];
        if swing.is_object() {
            assert_eq!(o.best.kind, Family::BackSwing, "{id}");
            assert!(near(o.best.t, number(&swing["T"]), number(&case["tolerance"]["backswing_T_rel"])), "{id}: {:?}", o.best);
            // The error of the position of a minimum is the square root of the tolerance of its value.
            assert!((o.best.theta_switches[0] - number(&swing["theta_first_switch"])).abs() < 1e-6, "{id}: {:?}", o.best);
        }
    }
}

#[test]
fn ratio_table() {
    for row in oracle()["seed_ratio_table"].as_array().unwrap() {
        let gamma = number(&row["gamma"]);
        let o = torque_optimal_time(-FRAC_PI_2, FRAC_PI_2, 1.0, gamma, -1.0, 1.0).unwrap();
        assert!(near(o.t, number(&row["T_optimal"]), 1e-12), "{gamma}: {}", o.t);
        assert_eq!(o.certified_global, row["certified"].as_bool().unwrap(), "{gamma}");
        let profile = bang_bang_time(-FRAC_PI_2, FRAC_PI_2, 1.0, gamma, -1.0, 1.0).unwrap();
        match row["T_profile"].as_f64() {
            Some(t) => assert!(near(profile.t_min, t, 1e-12) && near(profile.t_min / o.t, number(&row["ratio"]), 1e-11), "{gamma}"),
            None => assert!(!profile.feasible, "{gamma}"),
        }
    }
}

#[test]
fn a_swing_can_win_and_can_make_feasible() {
    // This case has a known result: the motion from pi/2 to 3 rad with tau_max = 1.02 G.
    let o = torque_optimal_time(FRAC_PI_2, 3.0, 1.0, 1.0, -1.02, 1.02).unwrap();
    assert!((o.t - 8.419).abs() < 5e-4 && (o.best.t - 5.702).abs() < 5e-4 && o.best.kind == Family::BackSwing, "{o:?}");
    // The same motion, mirrored and reversed in time, first passes the goal and then returns.
    let o = torque_optimal_time(-3.0, -FRAC_PI_2, 1.0, 1.0, -1.02, 1.02).unwrap();
    assert!((o.best.t - 5.702).abs() < 5e-4 && o.best.kind == Family::Overshoot, "{o:?}");
    // The torque is too weak to leave the horizontal directly. Only a swing is feasible.
    let o = torque_optimal_time(FRAC_PI_2, PI, 1.0, 1.0, -0.9, 0.9).unwrap();
    assert!(!o.feasible && matches!(o.reason, MonotoneReason::StartBlocked { .. }) && o.best.kind == Family::BackSwing, "{o:?}");
    // The torque is much too weak for a swing with one reversal.
    let o = torque_optimal_time(0.0, PI, 1.0, 1.0, -0.01, 0.01).unwrap();
    assert!(!o.feasible && o.best.kind == Family::NoneFound && o.best.t.is_nan(), "{o:?}");
}

#[test]
fn equal_ends_take_no_time_where_the_torque_holds_the_pose() {
    // The gravity torque G sin(pi/6) = 1/2 equals the first limit. It exceeds the second limit by more than the tolerance.
    let at = |limit: f64| torque_optimal_time(PI / 6.0, PI / 6.0, 1.0, 1.0, -2.0, limit).unwrap();
    let o = at(0.5);
    assert!(o.feasible && o.t == 0.0 && o.certified_global && o.reason == MonotoneReason::Feasible, "{o:?}");
    let o = at(0.5 - 1e-9);
    assert!(!o.feasible && o.t.is_nan() && !o.certified_global && o.best.kind != Family::Monotone, "{o:?}");
    assert!(matches!(o.reason, MonotoneReason::CannotHold { missing, .. } if near(missing, 1e-9, 1e-6)), "{o:?}");
    // Coulomb friction holds the part of gravity that the torque does not hold.
    let o = torque_optimal_time_with_friction(PI / 6.0, PI / 6.0, 1.0, 1.0, -2.0, 0.4, [0.2, 0.11]).unwrap();
    assert!(o.feasible && o.t == 0.0, "{o:?}");
    let o = torque_optimal_time_with_friction(PI / 6.0, PI / 6.0, 1.0, 1.0, -2.0, 0.4, [0.2, 0.09]).unwrap();
    assert!(!o.feasible && matches!(o.reason, MonotoneReason::CannotHold { .. }) && o.best.t.is_finite(), "{o:?}");
}

#[test]
fn narrow_minima_are_found() {
    // The best turning points are close to a limit of the feasible set. The times come from golden section searches of the sum of the two
    // monotone optima.
    for (problem, kind, t) in [
        (
            [-0.24539383661196013, 1.2645826390094088, 0.1651331798136474, 1.4220160377317037, 0.610841926842161, -0.5009252063825774],
            Family::BackSwing,
            1.4434239519552108,
        ),
        (
            [-0.9782697222453969, -0.04498512308293989, 0.16597001605560568, 1.264433145687061, 0.3893604294127465, -0.5571794395158006],
            Family::Overshoot,
            1.4672574171790076,
        ),
        (
            [18.617020823068344, 16.19708547953003, 5.5371694328622105, -1.2791548339270395, 0.2966228967373024, -0.529494046613606],
            Family::Overshoot,
            21.1160829033533,
        ),
    ] {
        let [theta0, thetaf, inertia, gravity, tau_max, tau_min] = problem;
        let o = torque_optimal_time(theta0, thetaf, inertia, gravity, tau_min, tau_max).unwrap();
        assert!(o.best.kind == kind && near(o.best.t, t, 1e-10), "{o:?}");
    }
}

/// Return displacement and speed at the end of the torque sequence, computed with the classical Runge-Kutta method and without formulas of
/// the planner. The integrated variable is the displacement instead of the angle, so that tiny motions keep their digits.
fn drive(p: &Problem, o: &TorqueOptimum, steps: usize) -> (f64, f64) {
    let b = &o.best;
    let first_up = (p.thetaf >= p.theta0) == (b.kind != Family::BackSwing);
    let (mut q, mut v, mut t) = (0.0, 0.0, 0.0);
    for k in 0..=b.switches {
        let end = if k < b.switches { b.t_switches[k] } else { b.t };
        let tau = if (k % 2 == 0) == first_up { p.tau_max } else { p.tau_min };
        let f = |q: f64| (tau - p.gravity * (p.theta0 + q).sin()) / p.inertia;
        let h = (end - t) / steps as f64;
        for _ in 0..steps {
            let (k1, l1) = (v, f(q));
            let (k2, l2) = (v + 0.5 * h * l1, f(q + 0.5 * h * k1));
            let (k3, l3) = (v + 0.5 * h * l2, f(q + 0.5 * h * k2));
            let (k4, l4) = (v + h * l3, f(q + h * k3));
            q += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
            v += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
        }
        t = end;
    }
    (q, v)
}

/// Return the smallest quotient of the kinetic energy of the monotone motion and the distance to the nearer end, by sampling of `cos`.
fn sampled_margin(p: &Problem) -> f64 {
    let s = if p.thetaf >= p.theta0 { 1.0 } else { -1.0 };
    let (x0, x1) = (s * p.theta0, s * p.thetaf);
    let (up, down) = if s > 0.0 { (p.tau_max, -p.tau_min) } else { (-p.tau_min, p.tau_max) };
    let n = 4000;
    let mut least = f64::INFINITY;
    for k in 1..n {
        let x = x0 + (x1 - x0) * k as f64 / n as f64;
        let push = up * (x - x0) - p.gravity * (x0.cos() - x.cos());
        let brake = down * (x1 - x) - p.gravity * (x1.cos() - x.cos());
        // The energy is divided by the distance to the nearer end, because it is zero at both ends.
        least = least.min(push.min(brake) / (x - x0).min(x1 - x));
    }
    least
}

#[test]
fn random_problems_arrive_at_rest() {
    let mut random = Random::new(21);
    let (mut counts, mut worst) = ([0usize; 4], 0.0f64);
    for k in 0..random_count() / 4 {
        let p = Problem::stratum(&mut random, k);
        let o = optimum(&p);
        counts[o.best.kind as usize] += 1;
        let scale = p.tau_max.max(-p.tau_min) + p.gravity.abs();
        let distance = (p.thetaf - p.theta0).abs();
        if distance > 1e-3 {
            // The result for the monotone motion must be correct up to rounding and sampling.
            let margin = sampled_margin(&p) / scale;
            assert!(if o.feasible { margin > -1e-9 } else { margin < 2e-2 }, "{p:?} {o:?} {margin}");
        }
        if o.best.kind == Family::NoneFound || distance == 0.0 {
            continue;
        }
        assert!(o.best.t.is_finite() && o.best.t >= 0.0 && (o.t.is_nan() || o.best.t <= o.t), "{p:?} {o:?}");
        // The open loop is unstable. An error grows by at most exp(t sqrt(|G|/I)). The profile test covers problems with a growth above
        // 1e4.
        let growth = (o.best.t * (p.gravity.abs() / p.inertia).sqrt()).exp();
        if growth < 1e4 {
            let (q, v) = drive(&p, &o, 400);
            let size = distance + if o.best.switches == 2 { (o.best.theta_turn - p.theta0).abs() } else { 0.0 };
            let error = (q - (p.thetaf - p.theta0)).abs().max(v.abs() * o.best.t) / size;
            // Runge-Kutta of order 4 with 400 steps per phase has an error of (t/400)^4, which then grows.
            assert!(error < 1e-8 * growth, "{p:?} {o:?} {q} {v} {error}");
            worst = worst.max(error / growth);
        }
    }
    println!("monotone, back-swing, overshoot, none: {counts:?}; worst end error {worst:.1e}");
    assert!(counts[0] > 1000 && counts[1] > 10 && counts[2] > 10, "{counts:?}");
}

#[test]
fn no_detour_beats_the_best() {
    // T(a, z) + T(z, b) is the time of two monotone motions with the turning point z. The points z are outside of the path, on a separate
    // grid.
    let mut random = Random::new(31);
    let mut detours = 0;
    for k in 0..random_count() / 80 {
        let p = Problem::stratum(&mut random, if k % 4 == 1 { 0 } else { k });
        let o = optimum(&p);
        let sign = if p.thetaf >= p.theta0 { 1.0 } else { -1.0 };
        for j in 0..40 {
            let depth = 10f64.powf(-3.0 + 3.9 * (j / 2) as f64 / 19.0);
            let z = if j % 2 == 0 { p.theta0 - sign * depth } else { p.thetaf + sign * depth };
            let detour = optimum(&Problem { thetaf: z, ..p }).t + optimum(&Problem { theta0: z, ..p }).t;
            if detour.is_finite() {
                detours += 1;
                assert!(o.best.t <= detour * (1.0 + 1e-9), "{p:?} {o:?} {z} {detour}");
            }
        }
    }
    assert!(detours > 1000, "{detours}");
}

#[test]
fn profiles_are_continuous_and_obey_the_dynamics() {
    let mut random = Random::new(41);
    let mut swings = 0;
    for k in 0..2_000 {
        let p = Problem::stratum(&mut random, k);
        let o = optimum(&p);
        let Some(profile) = o.profile() else { continue };
        if o.best.t == 0.0 {
            assert_eq!((profile.at(0.0).q, profile.at(1.0).q), (p.theta0, p.thetaf));
            continue;
        }
        swings += usize::from(o.best.kind != Family::Monotone);
        let t = profile.duration();
        let size = (p.thetaf - p.theta0).abs() + if o.best.switches == 2 { (o.best.theta_turn - p.theta0).abs() } else { 0.0 };
        let (first, last) = (profile.at(0.0), profile.at(t));
        assert!(first.q == p.theta0 && first.v == 0.0 && last.q == p.thetaf && last.v == 0.0);
        let top = (2.0 * (p.tau_max - p.tau_min + 2.0 * p.gravity.abs()) * size / p.inertia).sqrt();
        // The phases are integrated from rest at both ends. A jump at a switch is the error of both phases, which grows with exp(t
        // sqrt(|G|/I)).
        let growth = (t * (p.gravity.abs() / p.inertia).sqrt()).exp().min(1e6);
        for s in o.best.t_switches.iter().take(o.best.switches) {
            let (before, after) = (profile.at(s * (1.0 - 1e-15)), profile.at(*s));
            let place = 1e-13 * size * growth + 1e-15 * p.theta0.abs().max(p.thetaf.abs()) * growth;
            assert!((before.q - after.q).abs() <= place, "{p:?} {o:?} {before:?} {after:?}");
            assert!((before.v - after.v).abs() <= 1e-12 * top * growth, "{p:?} {o:?} {before:?} {after:?}");
        }
        for j in 0..50 {
            let time = t * random.unit();
            let s = profile.at(time);
            assert!(s.tau == p.tau_max || s.tau == p.tau_min, "{p:?} {s:?}");
            // The torque of a sample must satisfy the dynamics I a + G sin q = tau.
            assert!((p.inertia * s.a + p.gravity * s.q.sin() - s.tau).abs() <= 1e-12 * (s.tau.abs() + p.gravity.abs()), "{j}");
            // The speed is the derivative of the angle. It is compared with a central difference, away from the switches.
            let h = 1e-5 * t;
            let near_switch = o.best.t_switches.iter().chain([&o.best.t_turn, &0.0, &t]).any(|x| (x - time).abs() < 2.0 * h);
            if !near_switch && size > 1e-3 {
                let slope = (profile.at(time + h).q - profile.at(time - h).q) / (2.0 * h);
                assert!((slope - s.v).abs() <= 1e-6 * top, "{p:?} {s:?} {slope}");
            }
        }
    }
    assert!(swings > 20, "{swings}");
}

#[test]
fn mirror_and_reversal_laws() {
    let mut random = Random::new(51);
    for k in 0..1_000 {
        let p = Problem::stratum(&mut random, k);
        let o = optimum(&p);
        let mirrored = optimum(&Problem { theta0: -p.theta0, thetaf: -p.thetaf, tau_min: -p.tau_max, tau_max: -p.tau_min, ..p });
        assert_eq!((o.t.to_bits(), o.best.t.to_bits(), o.best.kind), (mirrored.t.to_bits(), mirrored.best.t.to_bits(), mirrored.best.kind));
        assert!(o.theta_switch == -mirrored.theta_switch || o.theta_switch.is_nan() && mirrored.theta_switch.is_nan());
        // A back-swing becomes an overshoot if time is reversed. The order of sums differs, and so does rounding.
        let reversed = optimum(&Problem { theta0: p.thetaf, thetaf: p.theta0, ..p });
        assert_eq!(o.feasible, reversed.feasible, "{p:?}");
        assert!(!o.feasible || near(o.t, reversed.t, 1e-13), "{p:?}");
        assert!(o.best.t.is_nan() && reversed.best.t.is_nan() || near(o.best.t, reversed.best.t, 1e-9), "{p:?} {o:?} {reversed:?}");
    }
}

#[test]
fn small_arguments_and_refusals() {
    // For equal ends, the time is zero if the torque holds the link (2 sin 0.3 < 1). Otherwise a swing returns to the start (2 sin 1 > 1).
    let o = torque_optimal_time(0.3, 0.3, 1.0, 2.0, -1.0, 1.0).unwrap();
    assert!(o.feasible && o.t == 0.0 && o.best.t == 0.0 && o.best.kind == Family::Monotone);
    let o = torque_optimal_time(1.0, 1.0, 1.0, 2.0, -1.0, 1.0).unwrap();
    assert!(!o.feasible && !o.certified_global && o.best.t > 0.0 && o.best.kind == Family::BackSwing);
    // In tiny motions, gravity is constant, and T = sqrt(2 I D (u1 + u2)/(u1 u2)) with the net torques u1 and u2.
    for d in [1e-16, 1e-12, 1e-8] {
        let o = torque_optimal_time(0.0, d, 2.0, 0.7, -1.0, 3.0).unwrap();
        assert!(near(o.t, (2.0 * 2.0 * d * 4.0 / 3.0f64).sqrt(), 1e-7), "{d}: {}", o.t);
    }
    // The quadrature changes its formula at a phase length of pi. At the distance 2 pi, both phases have this length. The test compares
    // both sides.
    let f = |d: f64| torque_optimal_time(-0.3, -0.3 + d, 1.0, 0.4, -1.0, 1.0).unwrap().t;
    assert!(near(f(2.0 * PI - 1e-9), f(2.0 * PI + 1e-9), 1e-8) && near(f(6.1), 0.5 * (f(6.1 - 1e-4) + f(6.1 + 1e-4)), 1e-8));
    for (name, bad) in [
        ("theta0", [f64::NAN, 1.0, 1.0, 1.0, -1.0, 1.0]),
        ("thetaf", [0.0, f64::NEG_INFINITY, 1.0, 1.0, -1.0, 1.0]),
        ("inertia", [0.0, 1.0, -1.0, 1.0, -1.0, 1.0]),
        ("gravity_moment", [0.0, 1.0, 1.0, f64::NAN, -1.0, 1.0]),
        ("tau_max", [0.0, 1.0, 1.0, 1.0, -1.0, -2.0]),
    ] {
        let [a, b, i, g, lo, hi] = bad;
        let message = torque_optimal_time(a, b, i, g, lo, hi).unwrap_err().to_string();
        assert!(message.starts_with(name), "{message}");
    }
}
