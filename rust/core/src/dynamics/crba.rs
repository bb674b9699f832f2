//! Mass matrix by composite bodies (Walker and Orin 1982; Featherstone 2008, section 6.2), in body axes.
//!
//! With `I_j^c` the inertia of the subtree of `j` about the joint origin, in the axes of `j`, `F_j = I_j^c S_j` is the momentum of
//! the subtree per unit rate of `j`, and `M_ij = S_i . F_j` for every joint `i` that carries `j`, `F_j` carried from body to
//! body towards the base. Inertias are held as second moments `P = integral of r r' dm = tr(I)/2 1 - I`, which move from point to
//! point in fewer products, and of which `S_j = e_z` takes one column: `I e_z = tr(P) e_z - P e_z`.

use super::hinge::{congruence, reach, rotation, to_parent};
use super::workspace::Link;
use crate::arm::{BASE, Body, Tree};
use crate::kinematics::Pose;
use crate::scalar::Real;
use crate::spatial::{Sym3, V3};

/// Mass, first and second moment of a subtree about its joint origin, in the axes of its first body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments<S> {
    mass: S,
    first: V3<S>,
    second: Sym3<S>,
}

impl<S: Real> Moments<S> {
    #[inline(always)]
    fn of(body: &Body<S>) -> Self {
        Moments { mass: body.inertia.mass, first: body.inertia.moment, second: body.second_moment }
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
pub fn mass_matrix<S: Real>(tree: &Tree<S>, links: &mut [Link<S>], moments: &mut [Moments<S>], trig: &[(S, S)], q: &[S], m: &mut [S]) {
    m.fill(S::zero());
    mass_matrix_on_zeros(tree, links, moments, trig, q, m);
}

/// As [`mass_matrix`], where `m` holds zeros or an earlier `M` of this tree: what vanishes is the same in every state.
#[inline(always)]
pub fn mass_matrix_on_zeros<S: Real>(
    tree: &Tree<S>,
    links: &mut [Link<S>],
    moments: &mut [Moments<S>],
    trig: &[(S, S)],
    q: &[S],
    m: &mut [S],
) {
    let n = tree.n();
    for i in 0..n {
        let body = &tree.bodies[i];
        moments[i] = Moments::of(body);
        if body.quarter.is_none() {
            links[i].e = rotation(body, trig[i]);
        }
    }
    // The subtree just finished, while its parent is next in line; lanes have no registers to spare for it.
    let (mut carried, mut carried_to) = (Moments::default(), BASE);
    for j in (0..n).rev() {
        let body = &tree.bodies[j];
        let mut whole = moments[j];
        if S::LANES == 1 && carried_to == j {
            whole = whole.plus(&carried);
        }
        let Moments { mass, first: V3([hx, hy, _]), second: Sym3([xx, _, yy, xz, yz, _]) } = whole;
        let zero = S::zero();
        let (mut f, mut moment, own) = if body.revolute {
            (V3([-hy, hx, zero]), V3([-xz, -yz, xx + yy]), xx + yy)
        } else {
            (V3([zero, zero, mass]), V3([hy, -hx, zero]), mass)
        };
        m[j * n + j] = own + S::splat(body.armature);
        let mut k = j;
        while tree.bodies[k].parent != BASE {
            let over = &tree.bodies[k];
            let turned = to_parent(over, &links[k].e, trig[k], [f, moment]);
            f = turned[0];
            moment = reach(over, q[k]).cross_add(f, turned[1]);
            k = over.parent;
            let entry = if tree.bodies[k].revolute { moment[2] } else { f[2] };
            m[k * n + j] = entry;
            m[j * n + k] = entry;
        }
        if body.parent == BASE {
            continue;
        }
        let e = &links[j].e;
        let [first] = to_parent(body, e, trig[j], [whole.first]);
        let turned = Moments { mass, first, second: congruence(body, e, trig[j], whole.second) };
        let moved = turned.shifted(reach(body, q[j]));
        if S::LANES == 1 && body.parent + 1 == j {
            (carried, carried_to) = (moved, body.parent);
        } else {
            moments[body.parent] = moments[body.parent].plus(&moved);
        }
    }
}
