//! Tests of special inputs: empty stacks, zero rows, more rows than joints, numbers that are not finite, extreme units, weights, bounds.

use crate::priority_support::{Random, apart, norm, product, times};
use armlet_core::error::{Error, Result};
use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, Solution, diagnose, solve_priority};
use armlet_core::status::Status;

fn options(method: PriorityMethod, n: usize) -> PriorityOptions {
    PriorityOptions { v_max: (method == PriorityMethod::Sns).then(|| vec![1e3; n]), ..PriorityOptions::new(method) }
}

fn refused<T: std::fmt::Debug>(result: Result<T>, words: &str) {
    let error = result.unwrap_err();
    assert!(error.argument().is_some() && error.to_string().contains(words), "{error}");
}

#[test]
fn empty_stacks_and_zero_rows_leave_the_arm_at_rest() {
    for method in PriorityMethod::ALL {
        let none = solve_priority(3, &[], &[], &options(method, 3)).unwrap();
        assert_eq!((none.v, none.status), (vec![0.0; 3], Status::Success));
        let zero = solve_priority(3, &[&[], &[1.0, 0.0, 0.0], &[]], &[&[], &[2.0], &[]], &options(method, 3)).unwrap();
        assert!(apart(&zero.v, &[2.0, 0.0, 0.0]) < 1e-15, "{method:?}: {:?}", zero.v);
        assert_eq!((zero.ranks(), zero.status), (vec![0, 1, 0], Status::Success));
        // A row of zeros cannot be commanded.
        let lost = solve_priority(2, &[&[0.0, 0.0], &[0.0, 1.0]], &[&[1.0], &[3.0]], &options(method, 2)).unwrap();
        assert!(apart(&lost.v, &[0.0, 3.0]) < 1e-15, "{method:?}: {:?}", lost.v);
        assert_eq!((lost.ranks(), lost.status, lost.residual(0)[0]), (vec![0, 1], Status::Degraded, 1.0));
    }
}

#[test]
fn more_rows_than_joints_is_least_squares() {
    let mut random = Random::new(11);
    for n in [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 33] {
        let (m, j, c) = (n + 3, random.normals((n + 3) * n), random.normals(n + 3));
        for method in [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped, PriorityMethod::Sns] {
            let s = solve_priority(n, &[&j, &j], &[&c, &c], &options(method, n)).unwrap();
            assert_eq!(s.ranks(), [n, 0], "{method:?}");
            // The normal equations J'(c - J v) = 0 hold up to the rounding of sums of m products of order 1. These random stacks do not
            // reach the thresholds.
            let gradient: Vec<f64> = (0..n).map(|k| (0..m).map(|r| j[r * n + k] * s.residual(0)[r]).sum()).collect();
            if s.status == Status::Success {
                assert!(norm(&gradient) < 1e-11 * (1.0 + norm(&s.v)), "{method:?} n = {n}: {gradient:?}");
            }
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_by_name_and_index() {
    for method in PriorityMethod::ALL {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let o = options(method, 2);
            refused(solve_priority(2, &[&[1.0, 0.0], &[bad, 1.0]], &[&[1.0], &[1.0]], &o), "jacobians[1] is not finite");
            refused(solve_priority(2, &[&[1.0, 0.0, 0.0, 1.0]], &[&[1.0, bad]], &o), "velocities[0] is not finite");
            refused(solve_priority(2, &[&[1.0, 0.0, bad, 1.0]], &[&[1.0, 1.0]], &o), "first bad index 2");
        }
    }
    refused(diagnose(1, &[1], &[&[f64::NAN]], None, None), "jacobians[0] is not finite");
}

#[test]
fn wrong_sizes_and_options_are_refused() {
    let clamp = PriorityOptions::default();
    refused(solve_priority(0, &[], &[], &clamp), "at least one joint");
    refused(solve_priority(3, &[&[1.0, 0.0]], &[&[1.0]], &clamp), "jacobians[0] has the wrong size: expected (1, 3)");
    refused(solve_priority(2, &[&[1.0, 0.0]], &[&[1.0], &[1.0]], &clamp), "jacobians has the wrong number of levels: expected 2, got 1");
    let mut solver = PrioritySolver::new(2, &[1], &clamp).unwrap();
    refused(solver.solve(&[&[1.0, 0.0]], &[&[1.0, 2.0]]), "velocities[0] has the wrong length");
    for eps in [vec![0.0], vec![-1.0], vec![f64::NAN], vec![f64::INFINITY], vec![0.1, 0.1]] {
        refused(PrioritySolver::new(2, &[1], &PriorityOptions { eps: Some(eps), ..PriorityOptions::default() }), "eps");
    }
    refused(PrioritySolver::new(2, &[1], &PriorityOptions { rounding: Some(f64::NAN), ..PriorityOptions::default() }), "rounding");
    for weight in [vec![1.0], vec![1.0, 0.5, 0.0, 1.0], vec![1.0, 2.0, 2.0, 1.0], vec![0.0; 4], vec![f64::NAN; 4]] {
        refused(PrioritySolver::new(2, &[1], &PriorityOptions { weight: Some(weight), ..PriorityOptions::default() }), "weight");
    }
    refused(PrioritySolver::new(2, &[1], &PriorityOptions::new(PriorityMethod::Sns)), "v_max is missing");
    let bounds = |l: [f64; 2], u: [f64; 2]| PriorityOptions {
        v_min: Some(l.to_vec()),
        v_max: Some(u.to_vec()),
        ..PriorityOptions::new(PriorityMethod::Sns)
    };
    refused(PrioritySolver::new(2, &[1], &bounds([0.0, 1.0], [1.0, 0.5])), "first bad index 1");
    refused(PrioritySolver::new(2, &[1], &bounds([f64::NAN, 0.0], [1.0, 0.5])), "first bad index 0");
    refused(PriorityMethod::from_name("pinv"), "exact, clamp");
    assert_eq!(PriorityMethod::from_name("sns").unwrap(), PriorityMethod::Sns);
}

/// The result must not depend on the unit of a level, even if it is extreme.
#[test]
fn extreme_units_change_nothing() {
    let mut random = Random::new(12);
    let (j1, j2) = (random.normals(8), random.normals(8));
    let (c1, c2) = (random.normals(2), random.normals(2));
    for method in PriorityMethod::ALL {
        let solve = |unit: f64| -> Solution {
            let scale = |x: &[f64]| x.iter().map(|x| x * unit).collect::<Vec<f64>>();
            solve_priority(4, &[&j1, &scale(&j2)], &[&c1, &scale(&c2)], &options(method, 4)).unwrap()
        };
        let plain = solve(1.0);
        for unit in [1e-300, 1e-200, 1e-90, 1e90, 1e200, 1e300] {
            let s = solve(unit);
            assert!(apart(&s.v, &plain.v) <= 1e-12 * norm(&plain.v), "{method:?} in units of {unit:e}: {:?} {:?}", s.v, plain.v);
            assert_eq!((s.ranks(), s.status), (plain.ranks(), plain.status));
        }
    }
    let tiny = solve_priority(1, &[&[1e-300]], &[&[1e100]], &PriorityOptions::default());
    assert!(matches!(tiny, Err(Error::Solve { status: Status::Diverged, .. })), "{tiny:?}");
    let d = diagnose(2, &[1, 1], &[&[1e-300, 0.0], &[1e300, 1e300]], None, None).unwrap();
    assert_eq!((d.stacked_rank, d.levels[0].projected_singular_values[0]), (2, 1e-300));
    assert!((d.levels[1].projected_singular_values[0] / 1e300 - 1.0).abs() < 1e-15);
}

/// With the weight `W`, level 1 minimises `v'Wv`. So the gradient `W v` must be in the row space of `J1`.
#[test]
fn weighted_metric_minimises_its_norm() {
    let mut random = Random::new(13);
    for n in [4, 7, 10] {
        for _ in 0..50 {
            let b = random.normals(n * n);
            let mut weight = product(&b, &(0..n * n).map(|at| b[at % n * n + at / n]).collect::<Vec<_>>(), n, n);
            (0..n).for_each(|i| weight[i * (n + 1)] += 1.0);
            let (j, c) = (random.normals(2 * n), random.normals(2));
            for method in [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Sns] {
                let s = solve_priority(n, &[&j], &[&c], &PriorityOptions { weight: Some(weight.clone()), ..options(method, n) }).unwrap();
                if s.status != Status::Success {
                    continue;
                }
                assert!(norm(s.residual(0)) < 1e-12 * (1.0 + norm(&s.v)));
                let gradient = times(&weight, &s.v);
                let rest = solve_priority(
                    2,
                    &[&(0..2 * n).map(|at| j[at % 2 * n + at / 2]).collect::<Vec<_>>()],
                    &[&gradient],
                    &options(PriorityMethod::Exact, 2),
                );
                // The inverse of the weight amplifies rounding.
                assert!(norm(rest.unwrap().residual(0)) < 1e-11 * norm(&gradient), "{method:?} n = {n}");
            }
        }
    }
}

#[test]
fn sns_saturates_before_it_scales() {
    // Both joints move the task. The bound of the first joint is a quarter of its velocity without bounds, and the second joint moves more
    // instead.
    let bounded = |upper: [f64; 2], c: f64| {
        let o = PriorityOptions { v_max: Some(upper.to_vec()), ..PriorityOptions::new(PriorityMethod::Sns) };
        solve_priority(2, &[&[1.0, 1.0]], &[&[c]], &o).unwrap()
    };
    let taken = bounded([0.25, 5.0], 2.0);
    assert!(apart(&taken.v, &[0.25, 1.75]) < 1e-15 && taken.status == Status::Success && taken.scales() == [1.0]);
    let scaled = bounded([0.25, 0.75], 2.0);
    assert!(apart(&scaled.v, &[0.25, 0.75]) < 1e-15 && (scaled.scales()[0] - 0.5).abs() < 1e-15 && scaled.status == Status::Degraded);
    let free = bounded([f64::INFINITY, f64::INFINITY], 2.0);
    assert!(apart(&free.v, &[1.0, 1.0]) < 1e-15 && free.status == Status::Success);
    let still = bounded([0.0, 0.0], 2.0);
    assert_eq!((&still.v, still.scales()), (&vec![0.0, 0.0], vec![0.0]));
    // Zero velocity is out of bounds: one joint is driven back from its limit, and the other joint maintains the task.
    let o = PriorityOptions { v_min: Some(vec![0.5, -9.0]), v_max: Some(vec![1.0, 9.0]), ..PriorityOptions::new(PriorityMethod::Sns) };
    let back = solve_priority(2, &[&[1.0, 1.0]], &[&[0.0]], &o).unwrap();
    assert!(apart(&back.v, &[0.5, -0.5]) < 1e-15 && back.scales() == [1.0], "{back:?}");
}

#[test]
fn reusing_a_solver_gives_the_same_bits() {
    let mut random = Random::new(14);
    for method in PriorityMethod::ALL {
        let mut solver = PrioritySolver::new(5, &[2, 1, 5], &options(method, 5)).unwrap();
        for k in 0..50 {
            let mut j: Vec<Vec<f64>> = [2, 1, 5].iter().map(|m| random.normals(m * 5)).collect();
            if k % 2 == 1 {
                j[1] = j[0][..5].to_vec();
            }
            let c: Vec<Vec<f64>> = [2, 1, 5].iter().map(|m| random.normals(*m)).collect();
            let (j, c): (Vec<&[f64]>, Vec<&[f64]>) = (j.iter().map(Vec::as_slice).collect(), c.iter().map(Vec::as_slice).collect());
            let solution = solver.solve(&j, &c).unwrap();
            let fresh = solve_priority(5, &j, &c, &options(method, 5)).unwrap();
            assert_eq!((&solution.v, solution.ranks(), solution.status), (&fresh.v, fresh.ranks(), fresh.status));
        }
    }
}

/// A level without free directions must not change any bit of the levels above it, even if their solution is ill-conditioned.
#[test]
fn a_level_without_freedom_changes_nothing() {
    let mut random = Random::new(15);
    let (j1, j2, c1, c2) = (random.normals(8), random.normals(12), random.normals(2), random.normals(3));
    for method in PriorityMethod::ALL {
        let two = solve_priority(4, &[&j1, &j2], &[&c1, &c2], &options(method, 4)).unwrap();
        let three = solve_priority(4, &[&j1, &j2, &[0.0; 4]], &[&c1, &c2, &[1.0]], &options(method, 4)).unwrap();
        assert_eq!((&two.v, &two.ranks()[..]), (&three.v, &three.ranks()[..2]), "{method:?}");
        assert_eq!((three.ranks()[2], three.residual(2)[0]), (0, 1.0));
        let bad = solve_priority(4, &[&j1, &j2, &[0.0, f64::NAN, 0.0, 0.0]], &[&c1, &c2, &[1.0]], &options(method, 4));
        refused(bad, "jacobians[2] is not finite");
    }
}
