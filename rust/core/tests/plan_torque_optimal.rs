//! The torque optimum: the public oracle, random problems against a time-stepping checker, symmetry laws, refusals.

mod plan_support;
use armlet_core::plan::{Family, MonotoneReason, TorqueOptimum, bang_bang_time, torque_optimal_time};
use plan_support::{Problem, Random, cases, near, number, oracle, random_count};
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
            // The place of a minimum is known to the root of the tolerance of its value.
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
    // SPEC: pi/2 -> 3 at tau_max = 1.02 G.
    let o = torque_optimal_time(FRAC_PI_2, 3.0, 1.0, 1.0, -1.02, 1.02).unwrap();
    assert!((o.t - 8.419).abs() < 5e-4 && (o.best.t - 5.702).abs() < 5e-4 && o.best.kind == Family::BackSwing, "{o:?}");
    // Its mirror in time: from pi - 3 past the goal and back.
    let o = torque_optimal_time(-3.0, -FRAC_PI_2, 1.0, 1.0, -1.02, 1.02).unwrap();
    assert!((o.best.t - 5.702).abs() < 5e-4 && o.best.kind == Family::Overshoot, "{o:?}");
    // Too weak to leave the horizontal: only a swing can.
    let o = torque_optimal_time(FRAC_PI_2, PI, 1.0, 1.0, -0.9, 0.9).unwrap();
    assert!(!o.feasible && matches!(o.reason, MonotoneReason::StartBlocked { .. }) && o.best.kind == Family::BackSwing, "{o:?}");
    // Far too weak for one reversal.
    let o = torque_optimal_time(0.0, PI, 1.0, 1.0, -0.01, 0.01).unwrap();
    assert!(!o.feasible && o.best.kind == Family::NoneFound && o.best.t.is_nan(), "{o:?}");
}
