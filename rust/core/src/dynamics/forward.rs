//! Forward dynamics from the mass matrix: `M a = tau - C v - g`, `M = L' D L` with a unit lower triangular `L`.
//!
//! The factorisation goes from the tips to the base. So `L`, like `M`, has entries only between a joint and its ancestors (Featherstone
//! 2008, section 6.5).

use super::workspace::{Factors, Workspace};
use super::{crba, newton_euler};
use crate::arm::{BASE, Tree};
use crate::scalar::Real;

/// Compute `a = M^-1 (tau - C v - g)`, `(n,)`. `ws.factors` is memory for the factors `L` and `D`.
pub fn forward_dynamics<S: Real>(tree: &Tree<S>, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], tau: &[S], a: &mut [S]) {
    let n = tree.bodies.len();
    let Factors { matrix, inverse } = &mut ws.factors;
    newton_euler::newton_euler(tree, &mut ws.links, trig, q, v, None, a);
    for i in 0..n {
        a[i] = tau[i] - a[i];
    }
    crba::mass_matrix_entries(tree, &mut ws.mass, trig, q, |i, j, x| matrix[i * n + j] = x);
    for k in (0..n).rev() {
        let pivot = matrix[k * n + k].recip();
        inverse[k] = pivot;
        let mut i = tree.bodies[k].parent;
        while i != BASE {
            let share = matrix[i * n + k] * pivot;
            let mut j = i;
            while j != BASE {
                matrix[j * n + i] = share.neg_mul_add(matrix[j * n + k], matrix[j * n + i]);
                j = tree.bodies[j].parent;
            }
            a[i] = share.neg_mul_add(a[k], a[i]);
            matrix[i * n + k] = share;
            i = tree.bodies[i].parent;
        }
    }
    for k in 0..n {
        let mut rate = a[k] * inverse[k];
        let mut i = tree.bodies[k].parent;
        while i != BASE {
            rate = matrix[i * n + k].neg_mul_add(a[i], rate);
            i = tree.bodies[i].parent;
        }
        a[k] = rate;
    }
}

#[cfg(all(test, feature = "urdf"))]
mod tests {
    use super::super::aba;
    use super::*;
    use crate::arm::{Arm, STANDARD_GRAVITY};

    /// A tree with `branches` branches, each with `n` joints. Some joints are prismatic, and all joints have rotors. With `quarters`,
    /// placements are quarter turns.
    fn tree(branches: usize, n: usize, quarters: bool) -> Tree<f64> {
        let mut text = String::from("<robot name='t'><link name='base'/>");
        for branch in 0..branches {
            for k in 1..=n {
                let parent = match (k, branch) {
                    (1, 0) => "base".to_owned(),
                    (1, _) => format!("l{}_{}", branch - 1, n / 2),
                    _ => format!("l{branch}_{}", k - 1),
                };
                let (rpy, kind) = (if quarters { "0 0 0" } else { "0.3 0.2 0" }, if k % 3 == 2 { "prismatic" } else { "revolute" });
                let axis = ["0 0 1", "0 1 0", "1 0 0"][(k + branch) % 3];
                text += &format!(
                    "<link name='l{branch}_{k}'><inertial><origin xyz='0.1 0.0{k} 0.2'/><mass value='{}'/><inertia ixx='0.2' iyy='0.15' \
                     izz='0.1' ixy='0.01'/></inertial></link><joint name='j{branch}_{k}' type='{kind}'><parent link='{parent}'/>\
                     <child link='l{branch}_{k}'/><origin xyz='0.2 0.1 0.3' rpy='{rpy}'/><axis xyz='{axis}'/>\
                     <limit lower='-3' upper='3' effort='1' velocity='1'/><dynamics armature='0.0{k}'/></joint>",
                    0.5 + k as f64
                );
            }
        }
        Tree::new(&Arm::from_urdf(&(text + "</robot>"), "t", STANDARD_GRAVITY, None, None).unwrap())
    }

    #[test]
    fn agrees_with_articulated_bodies() {
        for (branches, n, quarters) in [(1, 1, true), (1, 7, true), (1, 9, false), (3, 5, true), (3, 4, false)] {
            let tree = tree(branches, n, quarters);
            assert!(tree.is_shallow);
            let (mut ws, n) = (Workspace::new(&tree), tree.bodies.len());
            let wave = |from: f64, size: f64| (0..n).map(|i| size * (from + 2.3 * i as f64).sin()).collect::<Vec<f64>>();
            let (q, v, tau) = (wave(0.4, 1.5), wave(1.0, 2.0), wave(2.0, 30.0));
            let trig: Vec<(f64, f64)> = q.iter().map(|q| q.sin_cos()).collect();
            let (mut a, mut other) = (vec![0.0; n], vec![0.0; n]);
            // Evaluate twice: the second evaluation shows whether the buffers keep values of the first one.
            for _ in 0..2 {
                forward_dynamics(&tree, &mut ws, &trig, &q, &v, &tau, &mut a);
            }
            aba::forward_dynamics(&tree, &mut ws, &trig, &q, &v, &tau, &mut other);
            let largest = other.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            for i in 0..n {
                // The rounding error grows with the condition number of the mass matrix.
                assert!((a[i] - other[i]).abs() < 1e-10 * largest, "{branches} x {n}, joint {i}: {} {}", a[i], other[i]);
            }
        }
    }

    #[test]
    fn long_chains_take_articulated_bodies() {
        assert!(tree(1, 10, false).is_shallow && !tree(1, 11, false).is_shallow && !tree(2, 20, false).is_shallow);
    }
}
