//! Test whether the mass matrix of a model is positive definite. The matrix is computed only for arms with mimic joints.
//!
//! `M = (1 + K) D (1 + K)'`, where `K` is strictly triangular, and `D` is diagonal with `D_i = S_i' IA_i S_i + armature_i` (Jain 2011,
//! section 7.5). `IA_i` is an articulated inertia. So `M > 0` if all `D_i > 0`. The cost is linear in the number of joints. Rounding errors
//! scale with the inertia of the subtree about the joint origin, or for a prismatic joint with the mass of the subtree. The prime is the
//! transpose.

use super::{Dynamics, Workspace, aba};
use crate::arm::{Arm, BASE, Joint, JointKind, Tree};
use crate::error::listed;
use crate::spatial::Inertia;
use std::f64::consts::PI;

/// Maximum number of sampled configurations: the zero configuration, and others within the limits.
const SAMPLES: usize = 8;
/// Limit of the number of sampled configurations times the number of joints. It limits the time to load a chain of thousands of links. At
/// least the zero configuration is sampled.
const WORK: usize = 20_000;
/// A `D_i` below this fraction of its scale counts as zero.
const ROUNDING: f64 = 1e-12;

/// The warning in the arm's report about the mass matrix; `None` if the mass matrix is positive definite at the sampled configurations.
pub(super) fn indefinite(arm: &Arm) -> Option<String> {
    let tree = Tree::<f64>::new(arm);
    let mut ws = Workspace::new(&tree);
    let movers: Vec<&Joint> = arm.independent().collect();
    let (mut bad, mut count) = (vec![false; arm.n()], 0);
    let samples = (WORK / arm.n().max(1)).clamp(1, SAMPLES);
    for sample in 0..samples {
        let q: Vec<f64> = (0..arm.n()).map(|i| drawn(movers[i], i, sample)).collect();
        let found = if tree.joining.is_some() { free_coordinates(&tree, &mut ws, &q) } else { free_joints(&tree, &mut ws, &q) };
        count += usize::from(found.iter().any(|free| *free));
        for (bad, free) in bad.iter_mut().zip(found) {
            *bad |= free;
        }
    }
    let names: Vec<&str> = arm.joint_names().zip(&bad).filter(|(_, bad)| **bad).map(|(name, _)| name).collect();
    let joints = listed(&names);
    (count > 0).then(|| format!("mass matrix not positive definite at {count} of {samples} sampled configurations: joints {joints}"))
}

/// For each joint, whether it moves no inertia while the joints beyond it are free.
fn free_joints(tree: &Tree<f64>, ws: &mut Workspace<f64>, q: &[f64]) -> Vec<bool> {
    let n = tree.bodies.len();
    let trig: Vec<(f64, f64)> = q.iter().map(|q| q.sin_cos()).collect();
    let (zero, mut a) = (vec![0.0; n], vec![0.0; n]);
    aba::forward_dynamics(tree, ws, &trig, q, &zero, &zero, &mut a);
    // Each subtree as one rigid body, about the origin of its joint, in world axes.
    let mut rigid: Vec<Inertia<f64>> = tree.bodies.iter().zip(&ws.poses).map(|(b, pose)| b.inertia.rotated(pose.rotation)).collect();
    let mut free = vec![false; n];
    for i in (0..n).rev() {
        let body = &tree.bodies[i];
        let [xx, _, yy, _, _, zz] = rigid[i].inertia.0;
        let scale = if body.revolute { xx + yy + zz } else { rigid[i].mass } + body.armature;
        // The comparison is negated, because it must be true if the inverse is NaN.
        free[i] = !(ws.articulated[i].inverse.recip() > ROUNDING * scale.abs());
        if body.parent != BASE {
            rigid[body.parent] = rigid[body.parent].plus(&rigid[i].shifted(ws.articulated[i].p));
        }
    }
    free
}

/// For an arm with mimic joints, and for each coordinate: whether the elimination of the mass matrix has no positive pivot.
fn free_coordinates(tree: &Tree<f64>, ws: &mut Workspace<f64>, q: &[f64]) -> Vec<bool> {
    let n = tree.n();
    let trig: Vec<(f64, f64)> = q.iter().map(|q| q.sin_cos()).collect();
    let mut m = vec![0.0; n * n];
    tree.mass_matrix(ws, &trig, q, &mut m);
    let scales: Vec<f64> = (0..n).map(|i| m[i * n + i]).collect();
    let mut free = vec![false; n];
    for k in 0..n {
        let pivot = m[k * n + k];
        free[k] = !(pivot > ROUNDING * scales[k].abs());
        for i in (k + 1..n).filter(|_| !free[k]) {
            let share = m[i * n + k] / pivot;
            for j in k + 1..n {
                m[i * n + j] -= share * m[k * n + j];
            }
        }
    }
    free
}

/// A position of joint `i`, equal in every run. The first sample is zero, and the others are within the limits. A limit that is absent, or
/// at least 1000 rad or m in magnitude, is replaced by 180 degrees or 1 m.
fn drawn(joint: &Joint, i: usize, sample: usize) -> f64 {
    let far = if joint.kind == JointKind::Prismatic { 1.0 } else { PI };
    let within = |x: f64, other: f64| if x.is_finite() && x.abs() < 1e3 { x } else { other };
    let (low, high) = (within(joint.limits.lower, -far), within(joint.limits.upper, far));
    // The fractional parts of multiples of the golden ratio are spread evenly. Each joint has a different offset.
    let share = (0.618_033_988_749_895 * (sample * (i + 1)) as f64 + 0.13 * i as f64).fract();
    if sample == 0 { 0.0 } else { low + share * (high - low) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::{EXAMPLES, STANDARD_GRAVITY};

    fn read(text: &str) -> Arm {
        Arm::from_urdf(text, "r", STANDARD_GRAVITY, None, None).unwrap()
    }

    /// A chain of two joints about `axes`. The second body has `mass`, and the first body has none.
    fn two(axes: [&str; 2], mass: &str, inertia: &str, armature: &str) -> Arm {
        let joint = |k: usize, parent: &str, child: &str, xyz: &str| {
            format!(
                "<joint name='j{k}' type='revolute'><parent link='{parent}'/><child link='{child}'/><origin xyz='{xyz}'/>\
                 <axis xyz='{}'/><dynamics armature='{armature}'/></joint>",
                axes[k - 1]
            )
        };
        read(&format!(
            "<robot><link name='a'/><link name='b'/><link name='c'><inertial><origin xyz='0.3 0 0'/><mass value='{mass}'/>\
             <inertia ixx='{inertia}' iyy='{inertia}' izz='{inertia}'/></inertial></link>{}{}</robot>",
            joint(1, "a", "b", "0 0 0"),
            joint(2, "b", "c", "0 0 0")
        ))
    }

    #[test]
    fn examples_are_definite() {
        for (name, text) in EXAMPLES {
            assert_eq!(indefinite(&read(text)), None, "{name}");
        }
    }

    #[test]
    fn joints_without_inertia_are_named() {
        // In the first case, no body has mass. In the second, the joints are coaxial, and only the sum of their rates moves the body.
        let line = |names: &str| Some(format!("mass matrix not positive definite at 8 of 8 sampled configurations: joints {names}"));
        assert_eq!(indefinite(&two(["0 0 1", "0 1 0"], "0", "0", "0")), line("j1, j2"));
        assert_eq!(indefinite(&two(["0 0 1", "0 0 1"], "1", "0.1", "0")), line("j1"));
        assert_eq!(indefinite(&two(["0 0 1", "0 0 1"], "1", "0.1", "0.01")), None);
        assert_eq!(indefinite(&two(["0 0 1", "0 1 0"], "1", "0.1", "0")), None);
        // The body is a point mass, 0.3 m away from both axes.
        assert_eq!(indefinite(&two(["0 0 1", "0 1 0"], "1", "0", "0")), None);
    }

    #[test]
    fn some_configurations_can_be_worse_than_others() {
        // The body is a point mass on the x axis of j2. At j2 = 90 degrees, it is on the axis of j1. No sample has exactly this angle.
        let arm = two(["0 0 1", "0 1 0"], "1", "0", "0");
        let tree = Tree::<f64>::new(&arm);
        let mut ws = Workspace::new(&tree);
        assert_eq!(free_joints(&tree, &mut ws, &[0.0, 0.5 * PI]), [true, false]);
        assert_eq!(free_joints(&tree, &mut ws, &[0.0, 0.4 * PI]), [false, false]);
    }
}
