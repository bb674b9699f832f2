//! The analytical derivative of inverse dynamics with respect to positions, in O(n d), with the depth `d` of the tree.
//!
//! The method follows Carpentier and Mansard 2018, and Singh, Russell and Wensing 2022, in the notation of `coriolis`.
//!
//! Joint `j`, with the unit motion `S_j`, moves its subtree as a rigid body. In addition, velocities and accelerations in the subtree
//! change by
//!
//! ```text
//! psi_j = V_p x S_j,   phi_j = A_p x S_j + V_p x psi_j          (p the parent body, at the joint)
//! d f_k / d q_j = S_j x* f_k + I_k phi_j + 2 B_k psi_j,         k in the subtree of j
//! d tau_i / d q_j = S_i . (S_j x* F_j + I_j^c phi_j + 2 B_j^c psi_j)   for i = j, and for an ancestor i of j
//! d tau_i / d q_j = S_i . (I_i^c phi_j + 2 B_i^c psi_j)                for a descendant i of j
//! ```
//!
//! with `B psi = [psi_w x P; (tr K) psi_w - K psi_w]`, and the cross product `x*` of a motion and a force. `V` and `A` are spatial
//! velocities and accelerations, and `f_k` is the force on body `k`. `F_j`, `I_j^c` and `B_j^c` are sums over the bodies of the subtree of
//! `j`. Unlike in `coriolis`, `P` and `K` use velocities relative to the world.

use super::crba::joint_column;
use super::workspace::{Composite, Slope, Workspace};
use crate::arm::{BASE, Tree, second_moment};
use crate::interrupt;
use crate::kinematics::{Pose, place_body};
use crate::memory::set;
use crate::scalar::Real;
use crate::spatial::{Inertia, Lift, Matrix, Matrix3, Vector};

/// Pass outwards: compute poses, velocities and accelerations, and the vectors `phi` and `psi` of each joint.
fn place_slopes<S: Real>(tree: &Tree<S>, ws: &mut Workspace<S>, (trig, q): (&[(S, S)], &[S]), v: &[S], a: &[S]) {
    let Workspace { poses, composites, slopes, .. } = ws;
    let ground = Slope { a: -tree.gravity.lift::<S>(), ..Slope::default() };
    let root = Pose::identity();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        let (parent, up) = if body.parent == BASE { (&root, &ground) } else { (&poses[body.parent], &slopes[body.parent]) };
        let pose = place_body(body, parent, trig[i], q[i]);
        let (p, z) = (pose.origin - parent.origin, pose.z());
        let (w_p, wd_p) = (up.w, up.wd);
        let swept = w_p.cross_add(p, up.v);
        // The acceleration of the parent body's point at the joint.
        let point = w_p.cross_add(w_p.cross(p), wd_p.cross_add(p, up.a));
        let wz = w_p.cross(z);
        let mut me = Slope { w: w_p, v: swept, a: point, wd: wd_p, ..Slope::default() };
        (me.linear, me.angular) = joint_column(body.revolute, &pose);
        if body.revolute {
            me.psi_w = wz;
            let vwz = swept.cross(wz);
            me.phi_v = point.cross_add(z, vwz + vwz);
            me.phi_w = wd_p.cross_add(z, w_p.cross(wz));
            me.w = z.scale_add(v[i], w_p);
            me.wd = z.scale_add(a[i], wz.scale_add(v[i], wd_p));
        } else {
            me.phi_v = wd_p.cross_add(z, w_p.cross(wz));
            me.v = z.scale_add(v[i], swept);
            me.a = z.scale_add(a[i], wz.scale_add(v[i] + v[i], point));
        }
        let inertia = body.inertia.rotated(pose.rotation);
        let Inertia { mass: m, moment: h, inertia: about } = inertia;
        let (w, wd) = (me.w, me.wd);
        me.f = wd.cross_add(h, w.cross_add(w.cross(h), me.a.scale(m)));
        me.n = h.cross_add(me.a, about.apply_add(wd, w.cross(about.apply(w))));
        let s = second_moment(&about).full().axes();
        let k = |c: usize| me.v.scale_add(h[c], w.cross(s[c]));
        composites[i] = Composite { inertia, momentum: w.cross_add(h, me.v.scale(m)), k: Matrix3::from_columns(&[k(0), k(1), k(2)]) };
        poses[i] = pose;
        slopes[i] = me;
    }
}

/// Compute `d tau / d q` for the coordinates of all joints, including joints that follow others.
pub(super) fn bodies_by_q<S: Real>(tree: &Tree<S>, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], a: &[S], d: &mut [S]) {
    place_slopes(tree, ws, (trig, q), v, a);
    let n = tree.bodies.len();
    let Workspace { poses, composites, slopes, .. } = ws;
    set(d, S::zero());
    for j in (0..n).rev() {
        interrupt::check_at_row(j);
        let body = &tree.bodies[j];
        let (me, z, origin) = (slopes[j], poses[j].z(), poses[j].origin);
        let Composite { inertia: Inertia { mass, moment, inertia }, momentum, k } = composites[j];
        let tr = k[(0, 0)] + k[(1, 1)] + k[(2, 2)];
        // `(f, about_joint)` is the wrench `I_j^c phi_j + 2 B_j^c psi_j` about the joint origin.
        let two_psi = me.psi_w + me.psi_w;
        let mut f = me.phi_w.cross_add(moment, two_psi.cross_add(momentum, me.phi_v.scale(mass)));
        let turned = inertia.apply_add(me.phi_w, two_psi.scale(tr) - k.apply(two_psi));
        let mut about_joint = moment.cross_add(me.phi_v, turned);
        // The momentum of the subtree per unit rate of this joint, and the coefficients of an ancestor's `psi` in the torque of this joint.
        let (unit_f, unit_n, by_psi) = if body.revolute {
            f = z.cross_add(me.f, f);
            about_joint = z.cross_add(me.n, about_joint);
            (z.cross(moment), inertia.apply(z), z.scale(tr) - k.apply_transposed(z))
        } else {
            about_joint = z.cross_add(me.f, about_joint);
            (z.scale(mass), moment.cross(z), momentum.cross(z))
        };
        d[j * n + j] = if body.revolute { z.dot(about_joint) } else { z.dot(f) };
        if body.parent == BASE {
            continue;
        }
        let about_origin = origin.cross_add(f, about_joint);
        let unit_n = origin.cross_add(unit_f, unit_n);
        let by_psi = by_psi + by_psi;
        let mut i = body.parent;
        while i != BASE {
            let up = &slopes[i];
            d[i * n + j] = up.linear.dot(f) + up.angular.dot(about_origin);
            let phi_v = poses[i].origin.cross_add(up.phi_w, up.phi_v);
            d[j * n + i] = unit_f.dot(phi_v) + unit_n.dot(up.phi_w) + by_psi.dot(up.psi_w);
            i = tree.bodies[i].parent;
        }
        let p = origin - poses[body.parent].origin;
        let column = |c: usize| momentum.scale_add(p[c], k.axis(c));
        let moved =
            Composite { inertia: composites[j].inertia.shifted(p), momentum, k: Matrix3::from_columns(&[column(0), column(1), column(2)]) };
        composites[body.parent] = composites[body.parent].plus(&moved);
        let up = &mut slopes[body.parent];
        up.f += me.f;
        up.n = p.cross_add(me.f, up.n + me.n);
    }
}
