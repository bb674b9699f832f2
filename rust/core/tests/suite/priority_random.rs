//! Tests on random stacks that lower levels do not disturb higher ones. The stacks have 2 to 5 levels and 4 to 9 joints. 30 % are exactly
//! singular, and the same fraction is within 1e-16 to 1e-2 of a singularity. Rows may be duplicate, zero, dependent or conflicting.
//! `ARMLET_RANDOM_STACKS` sets the number of stacks. Strata and seed are printed.

use crate::priority_support::{Random, apart, norm, times};
use armlet_core::linalg::Svd;
use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver};
use armlet_core::status::Status;

const SEED: u64 = 20220610;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stratum {
    Generic,
    Singular,
    Near,
}

#[derive(Debug)]
struct Stack {
    n: usize,
    stratum: Stratum,
    jacobians: Vec<Vec<f64>>,
    velocities: Vec<Vec<f64>>,
    bounds: Vec<f64>,
}

fn count() -> usize {
    std::env::var("ARMLET_RANDOM_STACKS").ok().map_or(20_000, |s| s.parse().expect("ARMLET_RANDOM_STACKS is a number"))
}

fn stack(random: &mut Random) -> Stack {
    let n = 4 + random.below(6);
    let levels = 2 + random.below(4);
    let u = random.uniform();
    let stratum = if u < 0.3 {
        Stratum::Singular
    } else if u < 0.6 {
        Stratum::Near
    } else {
        Stratum::Generic
    };
    let rows: Vec<usize> = (0..levels)
        .map(|_| match random.below(20) {
            0 => 0,
            1 => n + 1,
            2 => n,
            _ => 1 + random.below(3),
        })
        .collect();
    // Tasks have different units. So each level has a different scale.
    let mut jacobians: Vec<Vec<f64>> = rows
        .iter()
        .map(|m| {
            let unit = 10f64.powf(2.0 * random.uniform() - 1.0);
            random.normals(m * n).into_iter().map(|x| x * unit).collect()
        })
        .collect();
    if stratum != Stratum::Generic {
        let distance = if stratum == Stratum::Near { 10f64.powf(-16.0 + 14.0 * random.uniform()) } else { 0.0 };
        for _ in 0..1 + random.below(3) {
            degenerate(&mut jacobians, &rows, n, distance, random);
        }
    }
    let velocities = rows.iter().map(|m| random.normals(*m)).collect();
    let bounds = (0..n).map(|_| 0.05 + 2.0 * random.uniform()).collect();
    Stack { n, stratum, jacobians, velocities, bounds }
}

/// Make one row zero, a duplicate (the commands then conflict), or a combination of the rows above it, up to `distance`.
fn degenerate(jacobians: &mut [Vec<f64>], rows: &[usize], n: usize, distance: f64, random: &mut Random) {
    let all: Vec<(usize, usize)> = rows.iter().enumerate().flat_map(|(i, m)| (0..*m).map(move |r| (i, r))).collect();
    if all.len() < 2 {
        return;
    }
    let at = 1 + random.below(all.len() - 1);
    let kind = random.below(4);
    let mut row = vec![0.0; n];
    if kind > 0 {
        let sources: Vec<usize> = if kind == 1 { vec![random.below(at)] } else { (0..at.min(3)).collect() };
        for s in sources {
            let (i, r) = all[s];
            let weight = if kind == 1 { 1.0 } else { (random.below(9) as f64 - 4.0) / 4.0 };
            (0..n).for_each(|c| row[c] += weight * jacobians[i][r * n + c]);
        }
    }
    let (i, r) = all[at];
    (0..n).for_each(|c| jacobians[i][r * n + c] = row[c] + distance * random.normal());
}

struct Answer {
    v: Vec<f64>,
    scales: Vec<f64>,
    status: Status,
}

/// Solve the first `levels` levels of the stack.
fn prefix(s: &Stack, levels: usize, method: PriorityMethod) -> Answer {
    prefix_eps(s, levels, method, None)
}

fn prefix_eps(s: &Stack, levels: usize, method: PriorityMethod, eps: Option<Vec<f64>>) -> Answer {
    let rows: Vec<usize> = s.velocities[..levels].iter().map(Vec::len).collect();
    let v_max = (method == PriorityMethod::Sns).then(|| s.bounds.clone());
    let mut solver = PrioritySolver::new(s.n, &rows, &PriorityOptions { v_max, eps, ..PriorityOptions::new(method) }).unwrap();
    let j: Vec<&[f64]> = s.jacobians[..levels].iter().map(Vec::as_slice).collect();
    let v: Vec<&[f64]> = s.velocities[..levels].iter().map(Vec::as_slice).collect();
    let solution = solver.solve(&j, &v).unwrap();
    assert!(solution.v.iter().chain(&solution.residuals).all(|x| x.is_finite()));
    Answer { v: solution.v.clone(), scales: solution.scales(), status: solution.status }
}

fn eps(s: &Stack, i: usize) -> f64 {
    0.02 * s.jacobians[i].chunks_exact(s.n).map(norm).fold(0.0, f64::max)
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn check(s: &Stack, method: PriorityMethod) {
    let levels = s.jacobians.len();
    let prefixes: Vec<Answer> = (1..=levels).map(|k| prefix(s, k, method)).collect();
    let last = &prefixes[levels - 1];
    // Near singularities, exact methods have very large velocities. The disturbance due to rounding increases with the velocities.
    let allowed = f64::max(1e-10, 1e-12 * (1.0 + norm(&last.v)));
    let always = matches!(method, PriorityMethod::Exact | PriorityMethod::Chiaverini | PriorityMethod::Sns);
    for i in 0..levels {
        let moved = times(&s.jacobians[i], &difference(&last.v, &prefixes[i].v));
        if always || prefixes[i].status == Status::Success {
            let disturbed = apart(&moved, &vec![0.0; moved.len()]);
            assert!(disturbed <= allowed, "{method:?}: level {i} disturbed by {disturbed:e}, |v| = {:e}, {s:?}", norm(&last.v));
        }
        if matches!(method, PriorityMethod::Clamp | PriorityMethod::Damped) {
            let before = if i == 0 { vec![0.0; s.n] } else { prefixes[i - 1].v.clone() };
            let rest = norm(&difference(&s.velocities[i], &times(&s.jacobians[i], &before)));
            // With damping by manipulability, the largest gain is 1.21/eps. The factor 1.21 is the maximum of x/(x^2 + (1-x)^2).
            let peak = if method == PriorityMethod::Clamp { 1.0 } else { 1.2072 };
            let step = norm(&difference(&prefixes[i].v, &before));
            let e = eps(s, i);
            // For rows of size 1e-16, eps is also of this size, and velocities are very large. The last term is the rounding error of these
            // velocities.
            let most = peak / e * rest * (1.0 + 1e-9) + 1e-12 * (1.0 + norm(&prefixes[i].v).max(norm(&before)));
            assert!(e == 0.0 || step <= most, "{method:?}: level {i} moves {step} for {rest}, eps {e}, |v| = {:e}", norm(&before));
        }
    }
    let (m, n) = (s.velocities[0].len(), s.n);
    let mut svd = Svd::new(m, n);
    svd.decompose(&s.jacobians[0], m, n).unwrap();
    let primary = difference(&s.velocities[0], &times(&s.jacobians[0], &last.v));
    let moved = times(&s.jacobians[0], &difference(&last.v, &prefixes[0].v));
    for j in 0..m.min(n) {
        if svd.s()[j] >= eps(s, 0) {
            let disturbed: f64 = svd.u(j).iter().zip(&moved).map(|(u, x)| u * x).sum();
            assert!(disturbed.abs() <= allowed, "{method:?}: direction {j} of level 0 disturbed by {disturbed:e}");
        }
    }
    let full = m <= n && svd.s().iter().all(|x| *x >= eps(s, 0));
    if full && method != PriorityMethod::Sns {
        assert!(primary.iter().all(|r| r.abs() <= allowed), "{method:?}: primary residual {primary:?}, |v| = {:e}", norm(&last.v));
    }
    if method == PriorityMethod::Sns {
        assert!(last.v.iter().zip(&s.bounds).all(|(v, b)| v.abs() <= *b), "bounds: {:?} in {:?}", last.v, s.bounds);
        if full {
            let scaled: Vec<f64> = s.velocities[0].iter().map(|v| v * last.scales[0]).collect();
            assert!(apart(&times(&s.jacobians[0], &last.v), &scaled) <= 1e-10, "direction of level 0");
        }
    }
    if method == PriorityMethod::Clamp && last.status == Status::Success {
        let exact = prefix(s, levels, PriorityMethod::Exact);
        // With `Success`, no singular value is below its threshold. So both methods agree up to amplified rounding.
        assert!(apart(&last.v, &exact.v) <= 1e-9 * (1.0 + norm(&exact.v)), "clamp {:?} and exact {:?} differ", last.v, exact.v);
    }
}

#[test]
fn no_lower_level_disturbs_a_higher_one() {
    let (mut random, total) = (Random::new(SEED), count());
    let mut strata = [0usize; 3];
    for _ in 0..total {
        let s = stack(&mut random);
        strata[s.stratum as usize] += 1;
        PriorityMethod::ALL.iter().for_each(|m| check(&s, *m));
    }
    println!("{total} stacks, seed {SEED}: {} generic, {} singular, {} near (1e-16..1e-2)", strata[0], strata[1], strata[2]);
    assert!(total < 1000 || strata.iter().all(|s| *s > total / 5), "strata {strata:?}");
}

/// On a line of stacks through a singular one, find the largest step of the clamped method. If the interval around it is refined, the step
/// must vanish.
#[test]
fn clamp_is_continuous_for_any_number_of_levels() {
    let mut random = Random::new(SEED + 1);
    for _ in 0..200 {
        let mut s = stack(&mut random);
        while s.stratum != Stratum::Singular {
            s = stack(&mut random);
        }
        let centre = s.jacobians.clone();
        let noise: Vec<Vec<f64>> = centre.iter().map(|j| random.normals(j.len()).iter().map(|x| 0.1 * x).collect()).collect();
        let mut at = |t: f64| {
            for (j, (c, d)) in s.jacobians.iter_mut().zip(centre.iter().zip(&noise)) {
                *j = c.iter().zip(d).map(|(c, d)| c + t * d).collect();
            }
            // `eps` is fixed. An `eps` relative to a level that is zero at the centre would also be zero there.
            prefix_eps(&s, centre.len(), PriorityMethod::Clamp, Some(vec![0.05])).v
        };
        let (mut from, mut to, mut samples) = (-1.0, 1.0, 500);
        let (mut first, mut step) = (None, 0.0);
        for _ in 0..20 {
            let grid: Vec<f64> = (0..=samples).map(|k| from + (to - from) * k as f64 / samples as f64).collect();
            let v: Vec<Vec<f64>> = grid.iter().map(|t| at(*t)).collect();
            let steps = v.windows(2).map(|w| norm(&difference(&w[1], &w[0])));
            let (k, most) = steps.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            step = most;
            first.get_or_insert(most);
            (from, to, samples) = (grid[k], grid[k + 1], 4);
        }
        // The interval has shrunk by 4^19 = 3e11. A jump would not have become smaller.
        assert!(step <= 1e-6 * (1.0 + first.unwrap()), "step {step} near t = {from}, first {first:?}");
    }
}
