//! Tests of a planar 4R arm with two tasks against vectors from arithmetic with up to 120 digits: classes of singularities, ranks, exact
//! and clamped methods, bounds, continuity.

use crate::priority_support::{apart, norm, planar_jacobian, times};
use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, Solution, solve_priority};
use serde_json::Value;

fn oracle() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/oracle_ex2_taskpriority_public.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(x: &Value) -> f64 {
    x.as_f64().unwrap_or_else(|| x.as_str().unwrap().parse().unwrap())
}

fn numbers(x: &Value) -> Vec<f64> {
    x.as_array().unwrap().iter().map(number).collect()
}

fn stack(length: f64, q: &[f64]) -> [Vec<f64>; 2] {
    let lengths = [length, length, length / 4.0, length / 4.0];
    [planar_jacobian(&lengths, q, 4), planar_jacobian(&lengths, q, 2)]
}

fn options(input: &Value, method: PriorityMethod) -> PriorityOptions {
    let length = number(&input["L"]);
    let eps = vec![number(&input["eps1_over_L"]) * length, number(&input["eps2_over_L"]) * length];
    PriorityOptions { method, eps: Some(eps), ..PriorityOptions::default() }
}

fn solve(input: &Value, q: &[f64], method: PriorityMethod) -> Solution {
    let [j1, j2] = stack(number(&input["L"]), q);
    solve_priority(4, &[&j1, &j2], &[&numbers(&input["pd1"]), &numbers(&input["pd2"])], &options(input, method)).unwrap()
}

fn points(oracle: &Value) -> Vec<&Value> {
    oracle["cases"].as_array().unwrap().iter().filter(|c| c["kind"] != "path").collect()
}

#[test]
fn clamp_is_the_canonical_map() {
    let oracle = oracle();
    let cases = points(&oracle);
    assert_eq!(cases.len(), 36);
    for case in cases {
        let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
        let solution = solve(input, &numbers(&input["q"]), PriorityMethod::Clamp);
        let want = numbers(&expected["reg_qd"]);
        // The vectors allow an error of 1e-9. Here only rounding errors are allowed.
        assert!(apart(&solution.v, &want) <= 1e-12 * (1.0 + norm(&want)), "{id}: {:?} instead of {want:?}", solution.v);
        assert!(apart(solution.residual(0), &numbers(&expected["reg_res1"])) <= 1e-12, "{id}: primary residual");
        assert!(apart(solution.residual(1), &numbers(&expected["reg_res2"])) <= 1e-11, "{id}: secondary residual");
        assert!(norm(&solution.v) <= number(&expected["norm_bound"]) * (1.0 + 1e-9), "{id}: bound");
        if expected["primary_must_be_exact"].as_bool().unwrap() {
            assert!(solution.residual(0).iter().all(|r| r.abs() <= 1e-12), "{id}: primary {:?}", solution.residual(0));
        }
    }
}

#[test]
fn exact_is_equation_5() {
    let oracle = oracle();
    let (mut compared, mut snapped) = (0, 0);
    for case in points(&oracle) {
        let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
        let q = numbers(&input["q"]);
        if number(&expected["exact_norm"]) < 1e3 {
            let (solution, want) = (solve(input, &q, PriorityMethod::Exact), numbers(&expected["exact_qd"]));
            // The vectors state an error of 1e-9. Cases with an angle near 0 or pi, but not 0, are excluded, because a small singular value
            // amplifies rounding errors.
            let near = q.iter().any(|q| *q != 0.0 && q.sin().abs() < 1e-5);
            if !near {
                assert!(apart(&solution.v, &want) <= 1e-9 * norm(&want), "{id}: {:?} instead of {want:?}", solution.v);
                compared += 1;
            }
        }
        // Replace each angle with |sin q| <= angle_tol by the nearest multiple of pi. The ranks must then be the ranks of this singular
        // configuration.
        let tolerance = number(&input["angle_tol"]);
        let pi = std::f64::consts::PI;
        let q: Vec<f64> = q.iter().map(|q| if q.sin().abs() <= tolerance { (q / pi).round() * pi } else { *q }).collect();
        let solution = solve(input, &q, PriorityMethod::Exact);
        let ranks = &expected["ranks_class"];
        assert_eq!(solution.ranks()[0] as u64, ranks["J1"].as_u64().unwrap(), "{id}: rank J1");
        assert_eq!(solution.ranks()[1] as u64, ranks["J2P1"].as_u64().unwrap(), "{id}: rank J2 P1");
        let want = numbers(&expected["class_qd"]);
        // The tolerance is the rounding error of the inputs, divided by the smallest singular value of this configuration.
        let sigma =
            numbers(&expected["sigma_J2P1"]).into_iter().chain(numbers(&expected["sigma_J1"])).filter(|s| *s > 1e-9).fold(1.0, f64::min);
        assert!(apart(&solution.v, &want) <= 4e-15 * (1.0 + norm(&want)) / sigma, "{id}: {:?} instead of {want:?}", solution.v);
        snapped += 1;
    }
    assert_eq!((compared, snapped), (15, 36));
}

#[test]
fn paths_through_singularities_are_continuous() {
    let oracle = oracle();
    let mut paths = 0;
    for case in oracle["cases"].as_array().unwrap().iter().filter(|c| c["kind"] == "path") {
        let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
        let (mid, half) = (numbers(&input["q_mid"]), numbers(&input["q_half"]));
        let count = input["n_points"].as_u64().unwrap() as usize;
        let mut solver = PrioritySolver::new(4, &[2, 2], &options(input, PriorityMethod::Clamp)).unwrap();
        let (mut last, mut step, mut most): (Option<Vec<f64>>, f64, f64) = (None, 0.0, 0.0);
        for i in 0..count {
            let s = -1.0 + 2.0 * i as f64 / (count - 1) as f64;
            let q: Vec<f64> = mid.iter().zip(&half).map(|(m, h)| m + s * h).collect();
            let [j1, j2] = stack(number(&input["L"]), &q);
            let v = solver.solve(&[&j1, &j2], &[&numbers(&input["pd1"]), &numbers(&input["pd2"])]).unwrap().v.clone();
            most = most.max(norm(&v));
            if let Some(last) = &last {
                step = step.max(norm(&v.iter().zip(last).map(|(a, b)| a - b).collect::<Vec<_>>()));
            }
            if let Some(want) = expected["samples"].get(i.to_string()) {
                let want = numbers(want);
                assert!(apart(&v, &want) <= 1e-8 * (1.0 + norm(&want)), "{id} sample {i}: {v:?} instead of {want:?}");
            }
            last = Some(v);
        }
        assert!(step <= 1.02 * number(&expected["max_step"]), "{id}: step {step}");
        assert!((most - number(&expected["max_norm"])).abs() <= 1e-8 * most, "{id}: norm {most}");
        paths += 1;
    }
    assert_eq!(paths, 2);
}

/// Test the velocities at the singularities q4 = 0 (case a) and q2 = q4 = 0 (case b), for any base rotation and after many revolutions of
/// the joints.
#[test]
fn cases_a_and_b_from_any_base_rotation() {
    let half = std::f64::consts::FRAC_PI_2;
    let case_b = [22.0 / 29.0, -15.0 / 29.0, -52.0 / 29.0, -26.0 / 29.0];
    for (q, want) in [([0.0, half, half, 0.0], [1.0, -2.0, 0.8, 0.4]), ([0.0, 0.0, half, 0.0], case_b)] {
        for turns in [0.0, 1.0, -3.0, 1e3, -1e5] {
            for k in 0..24 {
                let angle = 0.2617 * k as f64;
                let (c, s) = (angle.cos(), angle.sin());
                let p = [c - s, s + c];
                let q: Vec<f64> =
                    q.iter().enumerate().map(|(i, q)| q + turns * 2.0 * std::f64::consts::PI + if i == 0 { angle } else { 0.0 }).collect();
                let [j1, j2] = stack(1.0, &q);
                let rounding = 8.0 * f64::EPSILON * (1.0 + q.iter().map(|q| q.abs()).sum::<f64>());
                for method in [PriorityMethod::Exact, PriorityMethod::Clamp] {
                    let o = PriorityOptions { method, rounding: Some(rounding), ..PriorityOptions::default() };
                    let solution = solve_priority(4, &[&j1, &j2], &[&p, &p], &o).unwrap();
                    // The error of the angles is `rounding`, and the inverse of the Jacobians amplifies it.
                    assert!(apart(&solution.v, &want) <= 100.0 * rounding, "{method:?} at {q:?}: {:?}", solution.v);
                    assert!(apart(&times(&j1, &solution.v), &p) <= 1e-13);
                }
            }
        }
    }
}
