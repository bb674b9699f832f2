//! Joint placements that are quarter turns have special code. Its results must equal the results of the full products.

use crate::arm_common::{Rng, close, lift, random_tree, sin_cos};
use armlet_core::arm::{Arm, ChainJoint, JointKind, JointType, Tree};
use armlet_core::dynamics::{Dynamics, Workspace};
use armlet_core::kinematics;
use armlet_core::scalar::{GenericKernel, Real};
use armlet_core::spatial::QuarterTurn;

/// Compute the results of every algorithm that transforms over joints, and append them to one list.
fn answers<S: Real>(tree: &Tree<S>, [q, v, x, a]: &[Vec<S>; 4]) -> Vec<f64> {
    let n = tree.n();
    let (ws, trig, mut all) = (&mut Workspace::new(tree), sin_cos(q), Vec::new());
    let mut vector = vec![S::zero(); n];
    let mut square = vec![S::zero(); n * n];
    let mut y = vec![S::zero(); 10 * n * n];
    let mut j = vec![S::zero(); 6 * n];
    tree.mass_matrix(ws, &trig, q, &mut square);
    all.extend_from_slice(&square);
    tree.coriolis_matrix(ws, &trig, q, v, &mut square);
    all.extend_from_slice(&square);
    tree.inverse_dynamics(ws, &trig, q, v, a, &mut vector);
    all.extend_from_slice(&vector);
    tree.forward_dynamics(ws, &trig, q, v, &vector.clone(), &mut vector);
    all.extend_from_slice(&vector);
    tree.regressor(ws, &trig, q, [v, x, a], &mut y);
    all.extend_from_slice(&y);
    kinematics::jacobian(tree, &mut ws.poses, &trig, q, tree.frames.len() - 1, &mut j);
    all.extend_from_slice(&j);
    all.iter().map(|x| x.lane(0)).collect()
}

#[derive(Clone, Copy)]
struct Shortcuts;

impl GenericKernel for Shortcuts {
    type Output = ();
    fn run<S: Real>(self) {
        let mut rng = Rng(31);
        let mut met = [0; 7];
        for n in [1, 2, 3, 5, 8, 8, 8, 8, 8, 13] {
            let mut tree = Tree::<S>::new(&random_tree(&mut rng, n));
            for body in &tree.bodies {
                met[body.quarter.map_or(6, |turn| QuarterTurn::ALL.iter().position(|&known| known == turn).unwrap())] += 1;
            }
            let given = std::array::from_fn(|_| lift::<S>(&rng.vector(n, 1.5)));
            let short = answers(&tree, &given);
            tree.bodies.iter_mut().for_each(|body| body.quarter = None);
            // The two results add the same terms in different orders.
            close("quarter turns", &short, &answers(&tree, &given), 1e-13, 1.0);
        }
        // The trees must contain quarter turns and other placements.
        assert!(met[1..6].iter().sum::<i32>() > 3 && met[6] > 0, "{met:?}");
    }
}

#[test]
fn quarter_turns_are_their_products() {
    Shortcuts.run::<f64>();
}

#[test]
fn axes_are_chosen_such_that_square_placements_are_quarter_turns() {
    let half = std::f64::consts::FRAC_PI_2;
    let axes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]];
    for [roll, pitch, yaw] in (0..64).map(|k| [k % 4, k / 4 % 4, k / 16].map(|quarters| f64::from(quarters) * half)) {
        let joint = |axis| ChainJoint::new(JointType::Moving(JointKind::Revolute), axis, [roll, pitch, yaw], [0.1, 0.2, 0.3], [1.0; 10]);
        let arm = Arm::from_chain(&axes.map(joint), [0.0; 3]).unwrap();
        assert!(Tree::<f64>::new(&arm).bodies.iter().all(|body| body.quarter.is_some()), "{roll} {pitch} {yaw}");
    }
}
