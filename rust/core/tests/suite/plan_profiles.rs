//! Tests of the trapezoid and the minimum-jerk profile under torque limits, against independent samples of their torque.

use crate::plan_support::{Problem, Random, near, random_count};
use armlet_core::plan::{bang_bang_time, minimum_jerk_time, trapezoid_time};

type Shape = Box<dyn Fn(f64) -> (f64, f64)>;

/// Return `s` and `s'' = d^2 s/du^2` of the trapezoid at the time fraction `u`.
fn trapezoid(u: f64, r: f64) -> (f64, f64) {
    let v = 1.0 / (1.0 - r);
    if u < r {
        (0.5 * v / r * u * u, v / r)
    } else if u <= 1.0 - r {
        (0.5 * v * r + v * (u - r), 0.0)
    } else {
        (1.0 - 0.5 * v / r * (1.0 - u) * (1.0 - u), -v / r)
    }
}

fn quintic(u: f64) -> (f64, f64) {
    (u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u), 60.0 * u - 180.0 * u * u + 120.0 * u.powi(3))
}

/// Return the largest excess over the torque limits for a motion of duration t.
fn excess(p: &Problem, t: f64, ramp: f64, s: impl Fn(f64) -> (f64, f64)) -> f64 {
    let d = p.thetaf - p.theta0;
    // The samples include the ends of the ramps, where the torque jumps.
    (0..=900).map(|k| k as f64 / 900.0).chain([ramp, 1.0 - ramp]).fold(f64::NEG_INFINITY, |worst, u| {
        let (s, second) = s(u);
        let tau = p.inertia * d * second / (t * t) + p.gravity * (p.theta0 + d * s).sin();
        worst.max(tau - p.tau_max).max(p.tau_min - tau)
    })
}

#[test]
fn half_ramps_are_the_bang_bang_profile() {
    let mut random = Random::new(61);
    for k in 0..5_000 {
        let p = Problem::stratum(&mut random, k);
        let a = bang_bang_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max).unwrap();
        let b = trapezoid_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, 0.5).unwrap();
        assert_eq!((a.feasible, a.hold_start, a.hold_end), (b.feasible, b.hold_start, b.hold_end), "{p:?}");
        assert!(!a.feasible || near(a.t_min, b.t_min, 1e-14) && near(a.t_max, b.t_max, 1e-14), "{p:?} {a:?} {b:?}");
    }
}

#[test]
fn random_problems_against_a_sampling_checker() {
    let mut random = Random::new(71);
    let mut counts = [[0usize; 2]; 2];
    for k in 0..random_count() / 10 {
        let p = Problem::stratum(&mut random, k);
        if p.theta0 == p.thetaf {
            continue;
        }
        let ramp = random.range(0.05, 0.5);
        let shapes: [(_, Shape); 2] = [
            (
                trapezoid_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max, ramp).unwrap(),
                Box::new(move |u| trapezoid(u, ramp)),
            ),
            (minimum_jerk_time(p.theta0, p.thetaf, p.inertia, p.gravity, p.tau_min, p.tau_max).unwrap(), Box::new(quintic)),
        ];
        let scale = p.tau_max.max(-p.tau_min) + p.gravity.abs();
        for (j, (r, shape)) in shapes.iter().enumerate() {
            counts[j][usize::from(r.feasible)] += 1;
            if r.feasible {
                assert!(r.t_min.is_finite() && r.t_min > 0.0 && r.t_max >= r.t_min && r.missing == 0.0, "{p:?} {r:?}");
                // In the checker, polynomials have a rounding error of 1e-16 of their largest term. The rounding error of T^2 changes the
                // torque by 1e-16 of its value.
                assert!(excess(&p, r.t_min, ramp, shape) <= 1e-9 * scale, "{j} {p:?} {r:?} {}", excess(&p, r.t_min, ramp, shape));
                assert!(r.t_max.is_infinite() || excess(&p, r.t_max, ramp, shape) <= 1e-9 * scale, "{j} {p:?} {r:?}");
                // The duration must be minimal: a slightly faster motion must violate a limit. If gravity equals the torque limit, `k_max`
                // is a rounding error, and the duration is not checked.
                assert!(
                    r.k_max < 1e-3 * scale
                        || excess(&p, 0.99 * r.t_min, ramp, shape) > 0.0
                        || excess(&p, 0.95 * r.t_min, ramp, shape) > 0.0,
                    "{j} {p:?} {r:?}"
                );
            } else {
                assert!(r.missing >= 0.0 && r.t_min.is_nan(), "{j} {p:?} {r:?}");
                let base = (p.inertia * (p.thetaf - p.theta0).abs() / scale).sqrt();
                for e in 0..50 {
                    // Between two samples, a maximum of the torque may exceed the samples by (s' D/900)^2/8 of the scale. `D` is the
                    // distance from start to end, and `s' = ds/du <= 2`.
                    let hidden = 1e-6 * (1.0 + (p.thetaf - p.theta0).powi(2)) * scale;
                    assert!(excess(&p, base * 10f64.powf(-0.5 + 0.1 * e as f64), ramp, shape) > -hidden, "{j} {p:?} {r:?}");
                }
            }
        }
    }
    println!("trapezoid, minimum jerk: [infeasible, feasible] {counts:?}");
    assert!(counts.iter().flatten().all(|&n| n > 100), "{counts:?}");
}

#[test]
fn known_values_and_refusals() {
    // Without gravity, k_max = tau_max / max s''. The maximum of s'' is 4.5 for the trapezoid with r = 1/3, and 10/sqrt(3) for the quintic.
    let r = trapezoid_time(0.0, 1.0, 2.0, 0.0, -3.0, 3.0, 1.0 / 3.0).unwrap();
    assert!(near(r.t_min, (2.0 * 4.5 / 3.0f64).sqrt(), 1e-14) && r.t_max.is_infinite());
    let r = minimum_jerk_time(0.0, 1.0, 2.0, 0.0, -3.0, 3.0).unwrap();
    assert!(near(r.t_min, (2.0 * 10.0 / 3.0f64.sqrt() / 3.0).sqrt(), 1e-14), "{r:?}");
    // The quintic starts and ends with zero acceleration. So it cannot reach an end that cannot be held.
    assert!(!minimum_jerk_time(-1.5, 1.5, 1.0, 1.5, -1.0, 1.0).unwrap().feasible);
    for ramp in [0.0, -0.1, 0.51, f64::NAN, f64::INFINITY] {
        assert!(trapezoid_time(0.0, 1.0, 1.0, 1.0, -2.0, 2.0, ramp).unwrap_err().to_string().starts_with("ramp"));
    }
    assert!(minimum_jerk_time(f64::NAN, 1.0, 1.0, 1.0, -2.0, 2.0).unwrap_err().to_string().starts_with("theta0"));
    let held = minimum_jerk_time(0.3, 0.3, 1.0, 1.0, -2.0, 2.0).unwrap();
    assert!(held.feasible && held.t_min == 0.0);
}
