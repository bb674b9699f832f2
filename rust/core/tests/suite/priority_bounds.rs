//! Tests of stacks with bounds: vectors that were solved with 50 digits, the certificate, the active set of the last solve, and memory.

use crate::counting::counted;
use crate::priority_support::{Random, apart, norm, times};
use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, Solution};
use armlet_core::status::Status;
use serde_json::Value;

/// The rows of a level, its lower and its upper bounds.
type Level = (Vec<f64>, Vec<f64>, Vec<f64>);

/// A stack with bounds: the number of joints, and for each level its rows, its lower and its upper bounds.
struct Bounded {
    n: usize,
    levels: Vec<Level>,
}

impl Bounded {
    fn solver(&self, options: &PriorityOptions) -> PrioritySolver {
        let rows: Vec<usize> = self.levels.iter().map(|(_, lower, _)| lower.len()).collect();
        let intervals = vec![true; rows.len()];
        let mut solver = PrioritySolver::new(self.n, &rows, &PriorityOptions { intervals, ..options.clone() }).unwrap();
        solver.keep_active_set();
        solver
    }

    fn load(&self, solver: &mut PrioritySolver) {
        let join = |part: fn(&Level) -> &Vec<f64>| self.levels.iter().flat_map(part).copied().collect::<Vec<_>>();
        solver.upper().copy_from_slice(&join(|level| &level.2));
        let (jacobian, lower) = solver.inputs();
        jacobian.copy_from_slice(&join(|level| &level.0));
        lower.copy_from_slice(&join(|level| &level.1));
    }

    /// A random stack. Rows are small integers, some are copies of others or zero, and bounds often meet in a vertex.
    fn random(random: &mut Random) -> Self {
        let n = 2 + random.below(6);
        let levels = (0..2 + random.below(3)).map(|_| {
            let m = 1 + random.below(4);
            let entry = |random: &mut Random| random.below(7) as f64 - 3.0;
            let mut rows: Vec<f64> = (0..m * n).map(|_| entry(random)).collect();
            match random.below(4) {
                0 => rows[(m - 1) * n..].fill(0.0),
                1 => (0..n).for_each(|j| rows[(m - 1) * n + j] = -rows[j]),
                _ => {}
            }
            let vertex: Vec<f64> = (0..n).map(|_| entry(random)).collect();
            let (mut lower, mut upper) = (times(&rows, &vertex), times(&rows, &vertex));
            for i in 0..m {
                match random.below(4) {
                    0 => lower[i] = f64::NEG_INFINITY,
                    1 => upper[i] += 2.0,
                    2 => (lower[i], upper[i]) = (lower[i] - 1.0, upper[i] + 1.0),
                    _ => {}
                }
            }
            (rows, lower, upper)
        });
        Bounded { n, levels: levels.collect() }
    }
}

fn number(x: &Value, otherwise: f64) -> f64 {
    if x.is_null() { otherwise } else { x.as_f64().unwrap_or_else(|| x.as_str().unwrap().parse().unwrap()) }
}

fn numbers(x: &Value, otherwise: f64) -> Vec<f64> {
    x.as_array().unwrap().iter().map(|x| number(x, otherwise)).collect()
}

fn certified(solution: &Solution) -> bool {
    solution.bounded.as_ref().unwrap().certificate <= 1e-9 && solution.status != Status::MaxSteps
}

#[test]
fn vectors_with_25_digits() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/oracle_i_hierarchy_public.json");
    let oracle: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let cases = oracle["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 40);
    for case in cases {
        let level = |level: &Value| {
            let rows = level["A"].as_array().unwrap().iter().flat_map(|row| numbers(row, f64::NAN)).collect();
            (rows, numbers(&level["lower"], f64::NEG_INFINITY), numbers(&level["upper"], f64::INFINITY))
        };
        let levels = case["levels"].as_array().unwrap().iter().map(level).collect();
        let stack = Bounded { n: number(&case["n"], 0.0) as usize, levels };
        let mut solver = stack.solver(&PriorityOptions::new(PriorityMethod::Exact));
        stack.load(&mut solver);
        let want = numbers(&case["x"], f64::NAN);
        // The second solve starts with the active set of the first.
        for _ in 0..2 {
            let solution = solver.run().unwrap();
            assert!(apart(&solution.v, &want) <= 1e-12 * (1.0 + norm(&want)), "{case}: {:?}", solution.v);
            assert!(certified(solution));
            let violations: Vec<f64> = case["violations"].as_array().unwrap().iter().flat_map(|w| numbers(w, f64::NAN)).collect();
            assert!(apart(&solution.bounded.as_ref().unwrap().violations, &violations) <= 1e-12 * (1.0 + norm(&violations)));
        }
        assert_eq!(solver.solution().bounded.as_ref().unwrap().changes, 0);
    }
}

#[test]
fn the_active_set_of_another_stack_does_not_change_the_solution() {
    let mut random = Random::new(4);
    let (mut changed, mut kept) = (0, 0);
    for _ in 0..2000 {
        let stack = Bounded::random(&mut random);
        for method in [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped] {
            let mut solver = stack.solver(&PriorityOptions::new(method));
            stack.load(&mut solver);
            let cold = solver.run().unwrap().clone();
            assert!(certified(&cold), "{method:?} {:?}", cold.bounded);
            // Solve another stack of the same size in between.
            let (jacobian, lower) = solver.inputs();
            jacobian.iter_mut().for_each(|x| *x += random.normal());
            let lower = lower.to_vec();
            solver.upper().iter_mut().zip(&lower).for_each(|(u, l)| *u = u.max(*l));
            assert!(certified(solver.run().unwrap()));
            stack.load(&mut solver);
            let warm = solver.run().unwrap();
            assert!(certified(warm));
            let changes = warm.bounded.as_ref().unwrap().changes;
            (changed, kept) = (changed + usize::from(changes > 0), kept + usize::from(changes == 0));
            assert!(apart(&warm.v, &cold.v) <= 1e-9 * (1.0 + norm(&cold.v)), "{method:?}: {:?} and {:?}", warm.v, cold.v);
        }
    }
    assert!(changed > 1000 && kept > 500, "{changed} {kept}");
}

#[test]
fn without_active_bounds_the_methods_are_those_without_bounds() {
    let mut random = Random::new(5);
    for method in [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped] {
        for trial in 0..200 {
            let (rows, n) = ([2, 3, 7], 7);
            let mut jacobians: Vec<Vec<f64>> = rows.iter().map(|m| random.normals(m * n)).collect();
            if trial % 2 == 0 {
                // The second level is close to an algorithmic singularity.
                (0..n).for_each(|j| jacobians[1][j] = jacobians[0][j] + 0.01 * jacobians[1][j]);
            }
            let commands: Vec<Vec<f64>> = rows.iter().map(|m| random.normals(*m)).collect();
            let (j, c): (Vec<&[f64]>, Vec<&[f64]>) = jacobians.iter().map(Vec::as_slice).zip(commands.iter().map(Vec::as_slice)).unzip();
            let free = PriorityOptions { eps: Some(vec![0.3]), ..PriorityOptions::new(method) };
            let want = PrioritySolver::new(n, &rows, &free).unwrap().solve(&j, &c).unwrap().clone();
            let bounded = PriorityOptions { v_max: Some(vec![1e6; n]), ..free };
            let got = PrioritySolver::new(n, &rows, &bounded).unwrap().solve(&j, &c).unwrap().clone();
            // The condition numbers of the levels are below 1e4.
            assert!(apart(&got.v, &want.v) <= 1e-10 * (1.0 + norm(&want.v)), "{method:?}: {:?} and {:?}", got.v, want.v);
            assert_eq!(got.ranks(), want.ranks());
            assert!(certified(&got));
        }
    }
}

#[test]
fn refused_bounds_are_named() {
    let solve = |lower: f64, upper: f64| {
        let stack = Bounded { n: 1, levels: vec![(vec![1.0], vec![0.0], vec![1.0]), (vec![1.0, 2.0], vec![0.0, lower], vec![1.0, upper])] };
        let mut solver = stack.solver(&PriorityOptions::default());
        stack.load(&mut solver);
        solver.run().map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(solve(0.0, f64::INFINITY), Ok(()));
    let refused = solve(2.0, 1.0).unwrap_err();
    assert!(refused.contains("velocities[1] is out of order") && refused.contains("first bad index 1"), "{refused}");
    for (lower, upper) in [(f64::NAN, 1.0), (0.0, f64::NAN), (f64::INFINITY, f64::INFINITY)] {
        assert!(solve(lower, upper).is_err());
    }
    let options = PriorityOptions { v_max: Some(vec![1.0]), ..PriorityOptions::new(PriorityMethod::Chiaverini) };
    assert!(PrioritySolver::new(1, &[1], &options).unwrap_err().to_string().contains("method is wrong"));
}

#[test]
fn solves_with_bounds_do_not_allocate() {
    let mut random = Random::new(6);
    for method in [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped] {
        for weighted in [false, true] {
            for _ in 0..50 {
                let stack = Bounded::random(&mut random);
                let n = stack.n;
                let weight = weighted.then(|| (0..n * n).map(|at| if at % (n + 1) == 0 { 2.0 } else { 0.1 }).collect());
                let mut solver = stack.solver(&PriorityOptions { weight, v_max: Some(vec![1.0; n]), ..PriorityOptions::new(method) });
                stack.load(&mut solver);
                let ((), count) = counted(|| {
                    (0..2).for_each(|_| assert!(solver.run().is_ok()));
                });
                assert_eq!(count, 0, "{method:?}");
            }
        }
    }
}

#[test]
fn stacks_that_meet_no_bound_have_the_solution_of_the_search() {
    let (mut random, mut met) = (Random::new(8), [0, 0]);
    for trial in 0..600 {
        let (n, method) = (3 + random.below(5), [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped][trial % 3]);
        let rows = [1 + random.below(2), 1 + random.below(3), random.below(3), 1 + random.below(n)];
        let intervals = [vec![false, true, false, false], vec![true, false, true, false], vec![]][trial / 3 % 3].clone();
        let weight = (trial % 4 == 3).then(|| (0..n * n).map(|at| if at % (n + 1) == 0 { 2.0 } else { 0.1 }).collect());
        let options = PriorityOptions { weight, v_max: Some(vec![1.0; n]), intervals, ..PriorityOptions::new(method) };
        let mut solver = PrioritySolver::new(n, &rows, &options).unwrap();
        let scale = [0.05, 0.3, 1.0][random.below(3)];
        let (jacobian, command) = solver.inputs();
        jacobian.iter_mut().for_each(|a| *a = random.normal());
        command.iter_mut().for_each(|v| *v = scale * random.normal());
        let (lower, width) = (command.to_vec(), 2.0 * scale);
        if !solver.upper().is_empty() {
            let uppers = lower.iter().map(|l| l + width);
            solver.upper().iter_mut().zip(uppers).for_each(|(to, u)| *to = u);
            // A level with bounds is below zero, and the other has zero within its bounds.
            solver.inputs().1.iter_mut().for_each(|l| *l -= if random.below(8) > 0 { 0.5 * width } else { 0.0 });
        }
        let want = solver.run_hierarchy().unwrap().clone();
        let got: Vec<Solution> = (0..40)
            .map(|_| {
                solver.used();
                solver.run().unwrap().clone()
            })
            .collect();
        let (one, bounded) = (&got[0], got[0].bounded.as_ref().unwrap());
        let searched = want.bounded.as_ref().unwrap();
        assert!(apart(&one.v, &want.v) <= 1e-11 * (1.0 + norm(&want.v)), "{trial}");
        assert_eq!((one.status, &one.levels, &bounded.sides), (want.status, &want.levels, &searched.sides), "{trial}");
        assert!(bounded.certificate <= 1e-12 && apart(&bounded.violations, &searched.violations) <= 1e-11);
        // Programs, after some calls, have the same bits.
        for other in &got {
            assert_eq!((&other.v, &other.bounded), (&one.v, &one.bounded), "{trial}");
        }
        met[usize::from(bounded.sides.iter().any(|side| *side != 0))] += 1;
    }
    assert!(met[0] > 100 && met[1] > 100, "{met:?}");
}
