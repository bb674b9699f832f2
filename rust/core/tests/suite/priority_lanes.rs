//! Tests of batches with programs (recorded machine code) and threads. Every row must have the bits, ranks and status of its single solve,
//! for regular and singular stacks. Other rows, the number of rows and the number of threads must have no effect.

use crate::priority_support::Random;
use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackAnswers, StackRows};
use armlet_core::simulate::solve_stacks;
use armlet_core::status::Status;

const SEED: u64 = 20220611;

struct Batch {
    n: usize,
    rows: Vec<usize>,
    jacobians: Vec<Vec<f64>>,
    velocities: Vec<Vec<f64>>,
}

/// Return `count` stacks of one size, with 4 to 9 joints and 2 to 4 levels. In every fifth stack, a row repeats the previous one exactly or
/// nearly. Every thirty-first stack has a number that is not finite.
fn batch(random: &mut Random, count: usize) -> Batch {
    let n = 4 + random.below(6);
    let rows: Vec<usize> = (0..2 + random.below(3)).map(|_| [0, 1, 2, 3, n, n + 1][random.below(6)]).collect();
    let total: usize = rows.iter().sum();
    let (mut jacobians, mut velocities) = (vec![vec![]; rows.len()], vec![vec![]; rows.len()]);
    for i in 0..count {
        let mut stack = random.normals(total * n);
        if i % 5 == 0 && total > 1 {
            let at = 1 + random.below(total - 1);
            let distance = if i % 2 == 0 { 0.0 } else { 10f64.powf(-16.0 + 14.0 * random.uniform()) };
            for c in 0..n {
                stack[at * n + c] = stack[(at - 1) * n + c] + distance * random.normal();
            }
        }
        if i % 31 == 30 && total > 0 {
            stack[random.below(total * n)] = [f64::NAN, f64::INFINITY][i % 2];
        }
        let mut at = 0;
        for (level, &m) in rows.iter().enumerate() {
            jacobians[level].extend_from_slice(&stack[at * n..(at + m) * n]);
            velocities[level].extend(random.normals(m));
            at += m;
        }
    }
    Batch { n, rows, jacobians, velocities }
}

#[derive(Debug, Clone, PartialEq)]
struct Answers {
    v: Vec<u64>,
    residuals: Vec<Vec<u64>>,
    ranks: Vec<i64>,
    scales: Vec<u64>,
    status: Vec<i32>,
}

/// Return the bits of the numbers. All NaN have the same bits here, regardless of payload and sign.
fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect()
}

fn solved(b: &Batch, solver: &PrioritySolver, count: usize, threads: usize) -> Answers {
    let levels = b.rows.len();
    let (mut v, mut scales) = (vec![0.0; count * b.n], vec![0.0; count * levels]);
    let (mut ranks, mut status) = (vec![-1; count * levels], vec![-1; count]);
    let mut residuals: Vec<Vec<f64>> = b.rows.iter().map(|m| vec![0.0; count * m]).collect();
    let jacobians: Vec<&[f64]> = b.jacobians.iter().zip(&b.rows).map(|(j, m)| &j[..count * m * b.n]).collect();
    let velocities: Vec<&[f64]> = b.velocities.iter().zip(&b.rows).map(|(v, m)| &v[..count * m]).collect();
    let answers = StackAnswers {
        v: &mut v,
        residuals: residuals.iter_mut().map(Vec::as_mut_slice).collect(),
        ranks: &mut ranks,
        scales: &mut scales,
        status: &mut status,
        bounded: None,
    };
    let given = StackRows { jacobians: &jacobians, velocities: &velocities, uppers: &[] };
    assert!(!solve_stacks(solver, &given, answers, threads, &mut || false));
    Answers { v: bits(&v), residuals: residuals.iter().map(|r| bits(r)).collect(), ranks, scales: bits(&scales), status }
}

fn alone(b: &Batch, solver: &mut PrioritySolver, count: usize) -> Answers {
    let mut all = Answers { v: vec![], residuals: vec![vec![]; b.rows.len()], ranks: vec![], scales: vec![], status: vec![] };
    for i in 0..count {
        let part = |x: &'_ [Vec<f64>], width: &dyn Fn(usize) -> usize| -> Vec<Vec<f64>> {
            x.iter().zip(&b.rows).map(|(x, &m)| x[i * width(m)..(i + 1) * width(m)].to_vec()).collect()
        };
        let (j, v) = (part(&b.jacobians, &|m| m * b.n), part(&b.velocities, &|m| m));
        let (j, v): (Vec<&[f64]>, Vec<&[f64]>) = (j.iter().map(Vec::as_slice).collect(), v.iter().map(Vec::as_slice).collect());
        // After some calls, a program for one lane computes the result.
        solver.used();
        match solver.solve(&j, &v) {
            Ok(solution) => {
                all.v.extend(bits(&solution.v));
                (0..b.rows.len()).for_each(|level| all.residuals[level].extend(bits(solution.residual(level))));
                all.ranks.extend(solution.ranks().iter().map(|&r| r as i64));
                all.scales.extend(bits(&solution.scales()));
                all.status.push(solution.status.code());
            }
            Err(_) => {
                all.v.extend(vec![u64::MAX; b.n]);
                all.residuals.iter_mut().zip(&b.rows).for_each(|(r, &m)| r.extend(vec![u64::MAX; m]));
                all.ranks.extend(vec![0; b.rows.len()]);
                all.scales.extend(vec![u64::MAX; b.rows.len()]);
                all.status.push(Status::Diverged.code());
            }
        }
    }
    all
}

#[test]
fn a_row_of_a_batch_is_its_single_solve_to_the_bit() {
    let mut random = Random::new(SEED);
    let (mut regular, mut degraded, mut failed) = (0, 0, 0);
    for trial in 0..150 {
        let count = [1, 33, 40, 49, 67][trial % 5];
        let b = batch(&mut random, count);
        let weight: Vec<f64> = (0..b.n * b.n).map(|k| if k / b.n == k % b.n { 2.0 + (k / b.n) as f64 } else { 0.3 }).collect();
        for method in PriorityMethod::ALL {
            let v_max = (method == PriorityMethod::Sns).then(|| vec![0.7; b.n]);
            let (eps, weight) = ((trial % 3 == 1).then(|| vec![0.1]), (trial % 4 == 3).then(|| weight.clone()));
            let mut solver =
                PrioritySolver::new(b.n, &b.rows, &PriorityOptions { v_max, eps, weight, ..PriorityOptions::new(method) }).unwrap();
            let (lanes, single) = (solved(&b, &solver, count, 1), alone(&b, &mut solver, count));
            assert_eq!(lanes, single, "{method:?}, {} joints, rows {:?}, trial {trial}", b.n, b.rows);
            let seen = |status: Status| lanes.status.iter().filter(|s| **s == status.code()).count();
            regular += seen(Status::Success);
            degraded += seen(Status::Degraded);
            failed += seen(Status::Diverged);
        }
    }
    println!("seed {SEED}: {regular} regular, {degraded} degraded, {failed} failed");
    assert!(regular > 1000 && degraded > 1000 && failed > 100, "{regular} {degraded} {failed}");
}

#[test]
fn the_number_of_threads_and_of_rows_changes_no_bit() {
    let mut random = Random::new(SEED + 1);
    let count = 5000;
    let b = batch(&mut random, count);
    let solver = PrioritySolver::new(b.n, &b.rows, &PriorityOptions::default()).unwrap();
    let one = solved(&b, &solver, count, 1);
    for threads in [2, 3] {
        assert_eq!(solved(&b, &solver, count, threads), one, "{threads} threads");
    }
    let fewer = solved(&b, &solver, 1237, 2);
    assert_eq!(fewer.v[..], one.v[..1237 * b.n]);
    // `poll` requests a stop. The work must end before the last row.
    let many = StackRows { jacobians: &[&[1.0, 0.0]], velocities: &[&[1.0]], uppers: &[] };
    let small = PrioritySolver::new(2, &[1], &PriorityOptions::new(PriorityMethod::Chiaverini)).unwrap();
    let rows = 200_000;
    let (mut v, mut r, mut ranks, mut scales, mut status) =
        (vec![0.0; 2 * rows], vec![0.0; rows], vec![0; rows], vec![0.0; rows], vec![-1; rows]);
    let answers =
        StackAnswers { v: &mut v, residuals: vec![&mut r], ranks: &mut ranks, scales: &mut scales, status: &mut status, bounded: None };
    assert!(solve_stacks(&small, &many, answers, 1, &mut || true));
    assert_eq!(status[rows - 1], -1);
}

#[test]
fn the_regular_route_is_the_recursion_over_singular_values() {
    let mut random = Random::new(SEED + 2);
    for method in PriorityMethod::ALL {
        let (mut stood, mut declined) = (0, 0);
        for trial in 0..200 {
            let b = batch(&mut random, 30);
            let weight: Vec<f64> = (0..b.n * b.n).map(|k| if k / b.n == k % b.n { 2.0 + (k / b.n) as f64 } else { 0.3 }).collect();
            // In every tenth trial, both bounds have the same sign, so that zero is out of bounds.
            let v_min = vec![if trial % 10 == 9 { 0.1 } else { -1.5 }; b.n];
            let bounds = (method == PriorityMethod::Sns).then(|| (v_min, vec![2.0; b.n]));
            let (v_min, v_max) = bounds.unzip();
            let (eps, weight) = ((trial % 3 == 1).then(|| vec![0.1]), (trial % 4 == 3).then_some(weight));
            let options = PriorityOptions { v_min, v_max, eps, weight, ..PriorityOptions::new(method) };
            let mut solver = PrioritySolver::new(b.n, &b.rows, &options).unwrap();
            let mut route = solver.regular::<f64>();
            for i in (0..30).filter(|i| i % 5 > 0) {
                let part = |x: &[Vec<f64>], width: usize| -> Vec<f64> {
                    x.iter().zip(&b.rows).flat_map(|(x, &m)| x[i * m * width..(i + 1) * m * width].to_vec()).collect()
                };
                let (jacobian, command) = (part(&b.jacobians, b.n), part(&b.velocities, 1));
                if route.solve(8.0 * f64::EPSILON, &jacobian, &command) != 1.0 {
                    declined += 1;
                    continue;
                }
                stood += 1;
                let (to, wanted) = solver.inputs();
                to.copy_from_slice(&jacobian);
                wanted.copy_from_slice(&command);
                let solution = solver.run_hierarchy().unwrap();
                assert_eq!(solution.status, Status::Success, "{method:?}, rows {:?}", b.rows);
                assert!(solution.scales().iter().all(|&scale| scale == 1.0));
                let largest = route.v.iter().fold(1.0f64, |most, v| most.max(v.abs()));
                for (regular, singular) in route.v.iter().zip(&solution.v) {
                    // The tolerance is the rounding error, multiplied with the condition number of random stacks.
                    assert!((regular - singular).abs() < 1e-9 * largest, "{method:?}, rows {:?}: {regular} {singular}", b.rows);
                }
                let ranks = solution.ranks();
                assert_eq!(solver.run().unwrap().ranks(), ranks, "{method:?}, rows {:?}", b.rows);
            }
        }
        println!("seed {SEED}: {method:?}: {stood} solved, {declined} declined");
        assert!(stood > 300 && (declined > 300 || method != PriorityMethod::Sns), "{method:?}: {stood} {declined}");
    }
}
