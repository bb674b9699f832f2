//! Tests of the bang-bang profile: the vectors of `oracle_ex4_bangbang_public.json`, random problems against samples of the torque,
//! symmetries, and errors.

use crate::plan_support::{Problem, Random, cases, expression, near, number, random_count};
use armlet_core::plan::{BangBangReport, BangBangTimes, Limit, Place, Reason, bang_bang_time, bang_bang_times};

fn report(p: &Problem) -> BangBangReport {
    bang_bang_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max).expect("valid problem")
}

#[test]
fn public_oracle() {
    let all = cases();
    assert_eq!(all.len(), 16);
    for case in &all {
        let id = case["id"].as_str().unwrap();
        let p = Problem::of_case(case);
        let (expected, tolerance) = (&case["expected"]["profile"], &case["tolerance"]);
        let (t_rel, a_abs) = (number(&tolerance["T_rel"]), number(&tolerance["a_abs"]));
        let r = report(&p);
        assert_eq!(r.feasible, expected["feasible"].as_bool().unwrap(), "{id}");
        assert!((r.a_min - number(&expected["a_lo"])).abs() <= a_abs, "{id}: a_min {}", r.a_min);
        assert!((r.a_max - number(&expected["a_hi"])).abs() <= a_abs, "{id}: a_max {}", r.a_max);
        assert_eq!(r.hold_start, expected["hold_start"].as_bool().unwrap(), "{id}");
        assert_eq!(r.hold_end, expected["hold_end"].as_bool().unwrap(), "{id}");
        let upper = r.active_upper();
        assert_eq!(upper.to_string(), expected["active_upper"].as_str().unwrap(), "{id}");
        assert_eq!(upper.tie, expected["active_upper_tie"].as_bool().unwrap(), "{id}");
        assert!(near(upper.theta, number(&expected["active_upper_theta"]), 1e-12), "{id}: theta {}", upper.theta);
        assert_eq!(r.active_lower().map(|b| b.to_string()).as_deref(), expected["active_lower"].as_str(), "{id}");
        if r.feasible {
            assert!(near(r.t_min, number(&expected["T_min"]), t_rel), "{id}: t_min {}", r.t_min);
            assert!(near(r.t_min, expression(expected["T_min_str"].as_str().unwrap()), t_rel), "{id}");
            assert!(near(r.t_max, number(&expected["T_max"]), t_rel), "{id}: t_max {}", r.t_max);
            let tau = r.torques(r.t_min);
            for (k, name) in ["t0", "Thalf_minus", "Thalf_plus", "T"].iter().enumerate() {
                assert!((tau[k] - number(&expected["tau_at_Tmin"][name])).abs() <= 1e-12 * p.tau_max.max(1.0), "{id}: {name} {}", tau[k]);
            }
            assert_eq!(r.reason(), Reason::Feasible);
        } else {
            assert!(r.t_min.is_nan() && r.t_max.is_nan());
        }
    }
}

#[test]
fn infeasible_motions_say_what_is_missing() {
    // With G = 2.5 and tau_max = 1, the motion from -pi/2 to pi/2 requires tau_max = G/2 = 1.25. So 0.25 is missing on both limits.
    let half = std::f64::consts::FRAC_PI_2;
    let r = bang_bang_time(-half, half, 1.0, 2.5, -1.0, 1.0).unwrap();
    let Reason::Conflict { upper, lower, missing } = r.reason() else { panic!("{:?}", r.reason()) };
    assert!((missing - 0.25).abs() < 1e-15);
    assert_eq!((upper.limit, upper.place, lower.limit, lower.place), (Limit::TauMax, Place::Switch, Limit::TauMin, Place::Start));
    assert!(r.reason().to_string().contains("tau_max at theta = 0.000000 rad (phase1:switch)"), "{}", r.reason());
    // `missing` is the exact threshold. Limits that are widened by slightly less are infeasible, and by slightly more are feasible.
    let mut random = Random::new(3);
    let mut checked = 0;
    for _ in 0..20_000 {
        let p = Problem::nominal(&mut random);
        let missing = match report(&p).reason() {
            Reason::Feasible => continue,
            Reason::Conflict { missing, .. } | Reason::Blocked { missing, .. } | Reason::CannotHold { missing, .. } => missing,
        };
        checked += 1;
        let widened = |d: f64| report(&Problem { tau_min: p.tau_min - d, tau_max: p.tau_max + d, ..p }).feasible;
        assert!(!widened(missing * (1.0 - 1e-6)), "{p:?} {missing}");
        assert!(widened(missing * (1.0 + 1e-6) + 1e-12 * (p.tau_max + p.gravity.abs())), "{p:?} {missing}");
    }
    assert!(checked > 2_000, "{checked}");
}

/// Return the largest excess over the torque limits for a motion of duration t, by independent sampling.
fn excess(p: &Problem, t: f64) -> f64 {
    let acceleration = 4.0 * (p.thetaf - p.theta0) / (t * t);
    let middle = 0.5 * (p.theta0 + p.thetaf);
    let samples = 400;
    let mut worst = f64::NEG_INFINITY;
    for k in 0..=samples {
        let s = k as f64 / samples as f64;
        for (theta, a) in [(p.theta0 + (middle - p.theta0) * s, acceleration), (middle + (p.thetaf - middle) * s, -acceleration)] {
            let tau = p.inertia * a + p.gravity * theta.sin();
            worst = worst.max(tau - p.tau_max).max(p.tau_min - tau);
        }
    }
    worst
}

#[test]
fn random_problems_against_a_sampling_checker() {
    let mut random = Random::new(11);
    let (mut feasible, mut infeasible) = (0, 0);
    for k in 0..random_count() {
        let p = Problem::stratum(&mut random, k);
        let r = report(&p);
        let scale = p.tau_max.max(-p.tau_min) + p.gravity.abs();
        assert!(r.a_min.is_finite() && r.a_max.is_finite() && r.a_min >= 0.0, "{p:?}");
        if p.theta0 == p.thetaf {
            assert_eq!((r.feasible, r.hold_start), (r.hold_start, r.hold_end));
            continue;
        }
        if r.feasible {
            feasible += 1;
            assert!(r.t_min.is_finite() && r.t_min > 0.0 && r.t_max >= r.t_min, "{p:?} {r:?}");
            // The tolerance is 1e-9 of the torques, for the rounding of t^2 and of the sines. The planner's tolerance is 1e-12 of the
            // limit.
            assert!(excess(&p, r.t_min) <= 1e-9 * scale, "{p:?} {r:?} {}", excess(&p, r.t_min));
            if r.t_max.is_finite() {
                assert!(excess(&p, r.t_max) <= 1e-9 * scale, "{p:?} {r:?}");
            }
            // At the reported angle, the torque must equal the reported limit.
            let bind = r.active_upper();
            let sign = if (bind.phase == 1) == (p.thetaf > p.theta0) { 1.0 } else { -1.0 };
            let tau = sign * r.a_max + p.gravity * bind.theta.sin();
            let limit = if bind.limit == Limit::TauMax { p.tau_max } else { p.tau_min };
            assert!((tau - limit).abs() <= 1e-9 * scale, "{p:?} {bind:?} {tau}");
            assert!((0.0..=r.t_min * (1.0 + 1e-12)).contains(&bind.time), "{p:?} {bind:?}");
        } else {
            infeasible += 1;
            // If the planner reports infeasible, every duration of a wide scan must violate a limit.
            let base = (p.inertia * (p.thetaf - p.theta0).abs() / scale).sqrt();
            for j in 0..60 {
                assert!(excess(&p, base * 10f64.powf(-1.0 + j as f64 * 0.1)) > 0.0, "{p:?} {r:?} {j}");
            }
        }
    }
    println!("bang-bang: {feasible} feasible, {infeasible} infeasible");
    assert!(feasible * 5 > random_count() && infeasible * 5 > random_count(), "{feasible} {infeasible}");
}

#[test]
fn mirror_reversal_and_shift_laws() {
    let mut random = Random::new(5);
    for k in 0..5_000 {
        let p = Problem::stratum(&mut random, k);
        let r = report(&p);
        // The reflection theta -> -theta exchanges the limits. The reversal of time exchanges the two ends.
        let mirrored = report(&Problem { theta0: -p.theta0, thetaf: -p.thetaf, tau_min: -p.tau_max, tau_max: -p.tau_min, ..p });
        let reversed = report(&Problem { theta0: p.thetaf, thetaf: p.theta0, ..p });
        for other in [mirrored, reversed] {
            assert_eq!(r.feasible, other.feasible, "{p:?}");
            assert_eq!((r.a_min, r.a_max), (other.a_min, other.a_max), "{p:?}");
            assert_eq!(r.t_min.to_bits(), other.t_min.to_bits(), "{p:?}");
        }
        assert_eq!((r.hold_start, r.hold_end), (reversed.hold_end, reversed.hold_start));
        // With G -> -G, theta is measured from the upward vertical, a shift by pi. Only the shifted angle is rounded.
        let pi = std::f64::consts::PI;
        let up = report(&Problem { theta0: p.theta0 + pi, thetaf: p.thetaf + pi, gravity: -p.gravity, ..p });
        let scale = 1e-13 * (p.tau_max - p.tau_min + p.gravity.abs()) * (1.0 + p.theta0.abs() + p.thetaf.abs());
        assert!((up.a_max - r.a_max).abs() <= scale && (up.a_min - r.a_min).abs() <= scale, "{p:?}");
    }
}

#[test]
fn zero_moves_and_asymmetric_bounds() {
    let half = std::f64::consts::FRAC_PI_2;
    let held = bang_bang_time(half, half, 1.0, 1.0, -1.0, 1.0).unwrap();
    assert!(held.feasible && held.t_min == 0.0 && held.t_max == 0.0);
    let falling = bang_bang_time(half, half, 1.0, 1.5, -1.0, 1.0).unwrap();
    assert!(!falling.feasible && falling.t_min.is_nan());
    assert_eq!(falling.reason(), Reason::CannotHold { limit: Limit::TauMax, theta: half, missing: 0.5 });
    // The smallest representable motions in both directions.
    for end in [f64::from_bits(half.to_bits() + 1), f64::from_bits(half.to_bits() - 1)] {
        let tiny = bang_bang_time(half, end, 1.0, 0.5, -1.0, 1.0).unwrap();
        assert!(tiny.feasible && near(tiny.t_min, 2.0 * ((end - half).abs() / 0.5).sqrt(), 1e-12), "{tiny:?}");
    }
    // Without gravity and with tau in [-1, 2], the weaker limit determines the symmetric profile, in the braking phase.
    let r = bang_bang_time(0.0, 1.0, 1.0, 0.0, -1.0, 2.0).unwrap();
    assert!(r.a_max == 1.0 && r.t_min == 2.0 && r.active_upper().limit == Limit::TauMin && r.active_upper().phase == 2);
    // With tau in [0, 1], only gravity brakes. Gravity is weakest at the switch.
    let r = bang_bang_time(0.2, 0.6, 1.0, 1.0, 0.0, 1.0).unwrap();
    assert!(r.feasible && near(r.a_max, 0.4f64.sin(), 1e-15));
}

#[test]
fn refusals() {
    let nan = f64::NAN;
    let inf = f64::INFINITY;
    for (k, bad) in [
        ("theta0", [nan, 1.0, 1.0, 1.0, -1.0, 1.0]),
        ("thetaf", [0.0, inf, 1.0, 1.0, -1.0, 1.0]),
        ("thetaf", [-1e308, 1e308, 1.0, 1.0, -1.0, 1.0]),
        ("inertia", [0.0, 1.0, 0.0, 1.0, -1.0, 1.0]),
        ("inertia", [0.0, 1.0, -1.0, 1.0, -1.0, 1.0]),
        ("inertia", [0.0, 1.0, nan, 1.0, -1.0, 1.0]),
        ("gravity_moment", [0.0, 1.0, 1.0, inf, -1.0, 1.0]),
        ("tau_min", [0.0, 1.0, 1.0, 1.0, 0.5, 1.0]),
        ("tau_min", [0.0, 1.0, 1.0, 1.0, nan, 1.0]),
        ("tau_max", [0.0, 1.0, 1.0, 1.0, 0.0, 0.0]),
        ("tau_max", [0.0, 1.0, 1.0, 1.0, -1.0, -1.0]),
        ("tau_max", [0.0, 1.0, 1.0, 1.0, -1.0, inf]),
        ("tau_max", [0.0, 1.0, 1.0, 1.0, -1e308, 1e308]),
    ] {
        let [a, b, i, g, lo, hi] = bad;
        let message = bang_bang_time(a, b, i, g, lo, hi).unwrap_err().to_string();
        assert!(message.starts_with(k) && message.contains("expected"), "{bad:?}: {message}");
    }
}

/// Test batches of all sizes modulo the number of lanes, with large angles and motions of length zero. The first bad problem of a batch is
/// reported.
#[test]
fn batches_have_the_bits_of_single_calls() {
    let mut random = Random::new(5);
    for count in (1..40).chain([1000]) {
        let mut columns: [Vec<f64>; 6] = Default::default();
        for i in 0..count {
            let mut p = Problem::nominal(&mut random);
            match i % 7 {
                3 => p.thetaf = p.theta0,
                5 => p.thetaf = p.theta0 + 3e6,
                _ => {}
            }
            for (column, x) in columns.iter_mut().zip([p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max]) {
                column.push(x);
            }
        }
        // All problems have the same inertia.
        columns[2].truncate(1);
        let row = |columns: &[Vec<f64>; 6], i: usize| std::array::from_fn::<f64, 6, _>(|k| columns[k][if k == 2 { 0 } else { i }]);
        let run = |columns: &[Vec<f64>; 6]| {
            let (mut numbers, mut flags) = ([(); 4].map(|_| vec![0.0; count]), [(); 3].map(|_| vec![false; count]));
            let to = BangBangTimes { numbers: numbers.each_mut().map(|x| &mut x[..]), flags: flags.each_mut().map(|x| &mut x[..]) };
            bang_bang_times(columns.each_ref().map(|x| &x[..]), to).map(|()| (numbers, flags))
        };
        let (numbers, flags) = run(&columns).unwrap();
        for i in 0..count {
            let [theta0, thetaf, inertia, gravity, tau_min, tau_max] = row(&columns, i);
            let r = bang_bang_time(theta0, thetaf, inertia, gravity, tau_min, tau_max).unwrap();
            for (got, expected) in [r.t_min, r.t_max, r.a_min, r.a_max].into_iter().enumerate() {
                assert_eq!(numbers[got][i].to_bits(), expected.to_bits(), "{count} {i}: number {got}");
            }
            assert_eq!([flags[0][i], flags[1][i], flags[2][i]], [r.feasible, r.hold_start, r.hold_end], "{count} {i}");
        }
        for (k, bad) in [(0, f64::NAN), (1, f64::INFINITY), (3, f64::NAN), (4, 1.0), (5, -1.0)] {
            let mut wrong = columns.clone();
            wrong[k][count / 2] = bad;
            wrong[k][count - 1] = bad;
            assert_eq!(run(&wrong).unwrap_err().0, count / 2, "{count}: argument {k}");
        }
    }
}
