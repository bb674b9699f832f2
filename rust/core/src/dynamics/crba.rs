//! Mass matrix by composite bodies (Walker and Orin 1982; Featherstone 2008, section 6.2).
//!
//! With `I_j^c` the inertia of the subtree of `j` about the joint origin, in world axes, `F_j = I_j^c S_j` is the
//! momentum of the subtree per unit rate of `j`, and `M_ij = S_i . F_j` for every joint `i` that carries `j`.
//! Inertias stay about their own joint origin; only the 6-vectors `S_i`, `F_j` are taken at the world origin.

use super::workspace::{Column, Composite};
use crate::arm::{BASE, Tree};
use crate::kinematics::{Pose, from_parent, place_body};
use crate::scalar::Real;
use crate::spatial::{Inertia, V3};

/// `[v; w]` at the world origin per unit rate of a joint.
#[inline(always)]
pub(crate) fn joint_column<S: Real>(revolute: bool, pose: &Pose<S>) -> (V3<S>, V3<S>) {
    let z = pose.z();
    if revolute { (pose.origin.cross(z), z) } else { (z, V3::zero()) }
}

#[inline(always)]
pub fn mass_matrix<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    composites: &mut [Composite<S>],
    columns: &mut [Column<S>],
    trig: &[(S, S)],
    q: &[S],
    m: &mut [S],
) {
    let n = tree.n();
    let mut last = Pose::identity();
    for i in 0..n {
        let body = &tree.bodies[i];
        let parent = from_parent(body.parent, i, last, |p| poses[p], Pose::identity);
        let pose = place_body(body, &parent, trig[i], q[i]);
        composites[i].inertia = body.inertia.rotated(pose.rotation);
        (columns[i].linear, columns[i].angular) = joint_column(body.revolute, &pose);
        poses[i] = pose;
        last = pose;
    }
    m.fill(S::zero());
    // The subtree just finished, while its parent is next in line; lanes have no registers to spare for it.
    let (mut carried, mut carried_to) = (Inertia::zero(), BASE);
    for j in (0..n).rev() {
        let body = &tree.bodies[j];
        let mut whole = composites[j].inertia;
        if S::LANES == 1 && carried_to == j {
            whole = whole.plus(&carried);
        }
        let Pose { origin, .. } = poses[j];
        let z = poses[j].z();
        let Inertia { mass, moment, inertia } = whole;
        let (f, about_joint) = if body.revolute { (z.cross(moment), inertia.apply(z)) } else { (z.scale(mass), moment.cross(z)) };
        let own = if body.revolute { z.dot(about_joint) } else { mass };
        m[j * n + j] = own + S::splat(body.armature);
        if body.parent == BASE {
            continue;
        }
        let about_origin = origin.cross_add(f, about_joint);
        let mut i = body.parent;
        while i != BASE {
            let entry = columns[i].linear.dot(f) + columns[i].angular.dot(about_origin);
            m[i * n + j] = entry;
            m[j * n + i] = entry;
            i = tree.bodies[i].parent;
        }
        let moved = whole.shifted(origin - poses[body.parent].origin);
        if S::LANES == 1 && body.parent + 1 == j {
            (carried, carried_to) = (moved, body.parent);
        } else {
            composites[body.parent].inertia = composites[body.parent].inertia.plus(&moved);
        }
    }
}
