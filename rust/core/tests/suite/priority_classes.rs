//! Tests of the classification of singularities of a planar 4R arm for all 27 sign patterns of (sin q2, sin q3, sin q4). The tasks are the
//! positions of the tips of link 4 (Jacobian `J1`) and link 2 (`J2`). Link lengths are random, and joints turn many times.

use crate::priority_support;

use crate::priority_support::{Random, norm, planar_jacobian};
use armlet_core::priority::{PriorityMethod, PriorityOptions, SingularityKind, diagnose, solve_priority};
use std::f64::consts::PI;

/// Return the ranks of J1, J2, J_E and J2 P1, and the kind. J_E has the rows of J1 and J2, and P1 projects on the null space of J1. The
/// result depends on which sines vanish.
fn expected(s2: bool, s3: bool, s4: bool) -> ([usize; 4], SingularityKind) {
    match (s2, s3, s4) {
        (true, _, true) => ([2, 2, 4, 2], SingularityKind::Regular),
        (true, _, false) => ([2, 2, 3, 1], SingularityKind::Algorithmic),
        (false, _, true) => ([2, 1, 3, 1], SingularityKind::Kinematic),
        (false, true, false) => ([2, 1, 2, 0], SingularityKind::Both),
        (false, false, false) => ([1, 1, 2, 1], SingularityKind::Kinematic),
    }
}

#[test]
fn all_sign_patterns() {
    let mut random = Random::new(27);
    let mut seen = 0;
    for pattern in 0..27 {
        let signs = [pattern % 3, pattern / 3 % 3, pattern / 9].map(|s| s as f64 - 1.0);
        for trial in 0..40 {
            // Folded configurations are multiples of pi. The number of revolutions increases to 1e4.
            let turns = [0.0, 1.0, 7.0, 1e2, 1e4][trial % 5];
            let lengths: Vec<f64> = (0..4).map(|_| 10f64.powf(2.0 * random.uniform() - 1.0)).collect();
            let mut q = vec![PI * (2.0 * random.uniform() - 1.0)];
            for s in signs {
                let angle = if s == 0.0 { PI * random.below(2) as f64 } else { s * (0.3 + 2.5 * random.uniform()) };
                q.push(angle + 2.0 * PI * (turns * (2.0 * random.uniform() - 1.0)).round());
            }
            // The lengths are random, because special lengths could cancel in a folded arm, and so change the ranks.
            let j1 = planar_jacobian(&lengths, &q, 4);
            let j2 = planar_jacobian(&lengths, &q, 2);
            let rounding = 8.0 * f64::EPSILON * (1.0 + q.iter().map(|q| q.abs()).sum::<f64>());
            let d = diagnose(4, &[2, 2], &[&j1, &j2], None, Some(rounding)).unwrap();
            let (ranks, kind) = expected(signs[0] != 0.0, signs[1] != 0.0, signs[2] != 0.0);
            let got = [d.levels[0].rank, d.levels[1].rank, d.stacked_rank, d.levels[1].projected_rank];
            assert_eq!(got, ranks, "signs {signs:?} at {q:?}, lengths {lengths:?}: {d}");
            assert_eq!(d.kind, kind, "{d}");
            assert_eq!(d.overlap, ranks[0] + ranks[1] - ranks[2]);
            assert_eq!(d.levels[1].algorithmic, matches!(kind, SingularityKind::Algorithmic | SingularityKind::Both));
            assert_eq!((d.levels[0].kinematic, d.levels[1].kinematic), (ranks[0] < 2, ranks[1] < 2));
            assert_eq!(d.levels[1].lost.len(), 2 - ranks[3]);
            // The ranks of the solver must equal the ranks of the diagnosis.
            let options = PriorityOptions { rounding: Some(rounding), ..PriorityOptions::new(PriorityMethod::Exact) };
            let solution = solve_priority(4, &[&j1, &j2], &[&[1.0, 0.5], &[-0.3, 0.7]], &options).unwrap();
            assert_eq!(solution.ranks(), d.projected_ranks());
            seen += 1;
        }
    }
    assert_eq!(seen, 27 * 40);
}

/// Test the residuals in the table of `docs/methods/priority.md`: each residual is the projection of the command that the table states.
#[test]
fn residuals_of_the_table() {
    let (p1, p2) = ([0.4, -0.7], [0.9, 0.2]);
    let lengths = [1.0, 1.0, 0.25, 0.25];
    let residual = |q: [f64; 4]| {
        let (j1, j2) = (planar_jacobian(&lengths, &q, 4), planar_jacobian(&lengths, &q, 2));
        let d = diagnose(4, &[2, 2], &[&j1, &j2], Some(&[&p1, &p2]), Some(1e-14)).unwrap();
        let solution = solve_priority(
            4,
            &[&j1, &j2],
            &[&p1, &p2],
            &PriorityOptions { rounding: Some(1e-14), ..PriorityOptions::new(PriorityMethod::Exact) },
        )
        .unwrap();
        let loss = d.compatibility.as_ref().unwrap();
        for i in 0..2 {
            // Both the diagnosed loss and the residual equal `v_i - J_i v`, up to the rounding error of velocities of order 10.
            assert!(priority_support::apart(&loss[i].loss, solution.residual(i)) < 1e-13, "{d}");
            assert_eq!(loss[i].compatible, norm(solution.residual(i)) < 1e-12, "{d}");
        }
        [0, 1].map(|i| solution.residual(i).to_vec())
    };
    let along = |u: [f64; 2], x: [f64; 2]| {
        let s = u[0] * x[0] + u[1] * x[1];
        [s * u[0], s * u[1]]
    };
    let near = |got: &[f64], want: [f64; 2]| assert!(priority_support::apart(got, &want) < 1e-13, "{got:?} instead of {want:?}");
    let q: [f64; 4] = [0.3, 0.9, -0.6, 1.1];
    let r = residual(q);
    near(&r[0], [0.0; 2]);
    near(&r[1], [0.0; 2]);
    // Case a: the residual is n n'(p2 - p1), with n = (c123, s123).
    let q: [f64; 4] = [0.3, 0.9, -0.6, 0.0];
    let n = [(q[0] + q[1] + q[2]).cos(), (q[0] + q[1] + q[2]).sin()];
    near(&residual(q)[1], along(n, [p2[0] - p1[0], p2[1] - p1[1]]));
    // The second task is singular: the residual is m m' p2.
    let m = [0.3f64.cos(), 0.3f64.sin()];
    near(&residual([0.3, 0.0, -0.6, 1.1])[1], along(m, p2));
    // Case b: the residual is p2 - e1 (n.p1)/sin(q2 + q3), with e1 = (-s1, c1).
    let q: [f64; 4] = [0.3, 0.0, -0.6, 0.0];
    let n = [(q[0] + q[1] + q[2]).cos(), (q[0] + q[1] + q[2]).sin()];
    let s = (n[0] * p1[0] + n[1] * p1[1]) / (q[1] + q[2]).sin();
    near(&residual(q)[1], [p2[0] + m[1] * s, p2[1] - m[0] * s]);
    // The arm is degenerate: the residuals are m m' p1 and m m' p2.
    let r = residual([0.3, 0.0, 0.0, 0.0]);
    near(&r[0], along(m, p1));
    near(&r[1], along(m, p2));
}

#[test]
fn the_sentence_names_level_and_direction() {
    let half = std::f64::consts::FRAC_PI_2;
    let lengths = [1.0, 1.0, 0.25, 0.25];
    let say = |q: [f64; 4], p: &[f64]| {
        let (j1, j2) = (planar_jacobian(&lengths, &q, 4), planar_jacobian(&lengths, &q, 2));
        diagnose(4, &[2, 2], &[&j1, &j2], Some(&[&[1.0, 1.0], p]), Some(1e-14)).unwrap().to_string()
    };
    let a = say([0.0, half, half, 0.0], &[1.0, 1.0]);
    assert!(a.starts_with("algorithmic: stacked rank 3 of 4 joints; level 2 commands 1 of 2 rows"), "{a}");
    assert!(a.contains("loses direction (") && a.ends_with(", compatibly."), "{a}");
    assert!(say([0.0, half, half, 0.0], &[0.0, 1.0]).ends_with(", which the command needs."));
    let b = say([0.0, 0.0, half, 0.0], &[1.0, 1.0]);
    assert!(
        b.starts_with("algorithmic+kinematic: stacked rank 2 of 4 joints; level 2 commands 0 of 2 rows (rank 1 alone, the rest"),
        "{b}"
    );
    assert_eq!(say([0.1, 0.9, -0.8, 1.2], &[1.0, 1.0]), "regular: stacked rank 4 of 4 joints.");
}
