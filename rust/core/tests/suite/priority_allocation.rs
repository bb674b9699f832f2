//! Tests that solves do not allocate after the construction of the solver: for every method, with and without weights, at regular and
//! singular configurations.

use crate::counting::counted;
use crate::priority_support::{Random, planar_jacobian};
use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver};

#[test]
fn solves_do_not_allocate() {
    let half = std::f64::consts::FRAC_PI_2;
    let lengths = [1.0, 1.0, 0.25, 0.25];
    let mut random = Random::new(9);
    for method in PriorityMethod::ALL {
        for weighted in [false, true] {
            let weight = weighted.then(|| (0..16).map(|at| if at % 5 == 0 { 1.0 + at as f64 } else { 0.25 }).collect());
            let v_max = (method == PriorityMethod::Sns).then(|| vec![0.7; 4]);
            let mut solver =
                PrioritySolver::new(4, &[2, 2, 4, 0], &PriorityOptions { weight, v_max, ..PriorityOptions::new(method) }).unwrap();
            for q in [[0.1, 0.9, -0.8, 1.2], [0.0, half, half, 0.0], [0.0, 0.0, half, 0.0], [0.4, 0.0, 0.0, 0.0], [0.0, 0.02, 1.0, 0.01]] {
                let (j1, j2) = (planar_jacobian(&lengths, &q, 4), planar_jacobian(&lengths, &q, 2));
                let mut eye = vec![0.0; 16];
                (0..4).for_each(|i| eye[5 * i] = 1.0);
                let command = random.normals(8);
                // The second task has normal units in the first trial. In the second trial its units are so small that the solver scales
                // the level.
                for unit in [1.0, 1e-150] {
                    let j2: Vec<f64> = j2.iter().map(|x| x * unit).collect();
                    let c2 = [command[2] * unit, command[3] * unit];
                    let ((), count) = counted(|| {
                        solver.solve(&[&j1, &j2, &eye, &[]], &[&command[..2], &c2, &command[4..], &[]]).unwrap();
                    });
                    assert_eq!(count, 0, "{method:?} at {q:?}");
                }
            }
        }
    }
}
