//! Mass matrix by composite bodies (Walker and Orin 1982; Featherstone 2008, section 6.2).
//!
//! With `I_j^c` the inertia of the subtree of `j` about the joint origin, in world axes, `F_j = I_j^c S_j` is the
//! momentum of the subtree per unit rate of `j`, and `M_ij = S_i . F_j` for every joint `i` that carries `j`.
//! Inertias stay about their own joint origin; only the 6-vectors `S_i`, `F_j` are taken at the world origin. They are held as
//! second moments `P = integral of r r' dm = tr(I)/2 1 - I`, which move from point to point in fewer products; `I z = tr(P) z - P z`.

use super::workspace::Column;
use crate::arm::{BASE, Body, Tree};
use crate::kinematics::{Pose, from_parent, place_body};
use crate::scalar::Real;
use crate::spatial::{M3, Sym3, V3};

/// Mass, first and second moment of a subtree about its joint origin, world axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments<S> {
    mass: S,
    first: V3<S>,
    second: Sym3<S>,
}

impl<S: Real> Moments<S> {
    #[inline(always)]
    fn of(body: &Body<S>, r: M3<S>) -> Self {
        Moments { mass: body.inertia.mass, first: r.apply(body.inertia.moment), second: body.second_moment.rotated(r) }
    }
    #[inline(always)]
    fn plus(&self, b: &Self) -> Self {
        Moments { mass: self.mass + b.mass, first: self.first + b.first, second: self.second.plus(&b.second) }
    }
    /// About the point from which the old one is seen at `p`.
    #[inline(always)]
    fn shifted(&self, p: V3<S>) -> Self {
        let (h, moved) = (self.first, p.scale_add(self.mass, self.first));
        let [xx, xy, yy, xz, yz, zz] = self.second.0;
        let entry = |i: usize, j: usize, old: S| p[i].mul_add(moved[j], h[i].mul_add(p[j], old));
        let second = [entry(0, 0, xx), entry(0, 1, xy), entry(1, 1, yy), entry(0, 2, xz), entry(1, 2, yz), entry(2, 2, zz)];
        Moments { mass: self.mass, first: moved, second: Sym3(second) }
    }
}

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
    moments: &mut [Moments<S>],
    columns: &mut [Column<S>],
    trig: &[(S, S)],
    q: &[S],
    m: &mut [S],
) {
    m.fill(S::zero());
    mass_matrix_on_zeros(tree, poses, moments, columns, trig, q, m);
}

/// As [`mass_matrix`], where `m` holds zeros or an earlier `M` of this tree: what vanishes is the same in every state.
#[inline(always)]
pub fn mass_matrix_on_zeros<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    moments: &mut [Moments<S>],
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
        // The first body of a tree is met about its own joint alone: see below.
        moments[i] = if body.parent == BASE { Moments::default() } else { Moments::of(body, pose.rotation) };
        (columns[i].linear, columns[i].angular) = joint_column(body.revolute, &pose);
        poses[i] = pose;
        last = pose;
    }
    // The subtree just finished, while its parent is next in line; lanes have no registers to spare for it.
    let (mut carried, mut carried_to) = (Moments::default(), BASE);
    for j in (0..n).rev() {
        let body = &tree.bodies[j];
        let mut whole = moments[j];
        if S::LANES == 1 && carried_to == j {
            whole = whole.plus(&carried);
        }
        let Pose { origin, .. } = poses[j];
        let z = poses[j].z();
        let Moments { mass, first, second } = whole;
        let (f, about_joint, own) = if body.revolute {
            let [xx, _, yy, _, _, zz] = second.0;
            let about_joint = z.scale((xx + yy) + zz) - second.apply(z);
            (z.cross(first), about_joint, z.dot(about_joint))
        } else {
            (z.scale(mass), first.cross(z), mass)
        };
        if body.parent == BASE {
            // Its own share does not depend on q: the joint axis is z of its frame.
            let share = if body.revolute { body.inertia.inertia.0[5] } else { body.inertia.mass };
            m[j * n + j] = own + share + S::splat(body.armature);
            continue;
        }
        m[j * n + j] = own + S::splat(body.armature);
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
            moments[body.parent] = moments[body.parent].plus(&moved);
        }
    }
}
