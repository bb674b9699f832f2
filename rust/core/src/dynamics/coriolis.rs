//! The Christoffel Coriolis matrix in O(n d), with the depth `d` of the tree, from composite bodies (after Echeandia and Wensing 2021).
//!
//! Column `j` is the inverse dynamics in polarised form (bilinear in two velocities, see `newton_euler`). The two velocities are the joint
//! velocity and a unit rate of joint `j`. Let `V_j` be the spatial velocity of body `j`. `S_j = (s, z)` is the unit motion of joint `j`,
//! with the linear part `s` and the angular part `z`, which is zero for a prismatic joint. Let `V_j x S_j = (alpha_v, alpha_w)` be a rigid
//! acceleration field. A point at `r` with the velocity `u` then has the acceleration of this field plus `z x u(r)`. So a subtree
//! contributes with its composite inertia (mass `m`, first moment `h`, inertia `I`), its linear momentum `P`, and the matrix
//! `K = integral of u r' dm`. Its force `f` and moment `n` are
//!
//! `f = m alpha_v + alpha_w x h + z x P`,  `n = I alpha_w + h x alpha_v + (tr K) z - K z`.
//!
//! `P` and `K` are relative to the velocity of the joint origin, which prevents the cancellation of large momenta. If the reference moves
//! by `-p` with the relative velocity `-d`, then `P_new = P + m d` and `K_new = K + P p' + d (h + m p)'`. The prime is the transpose.

use super::Dynamics;
use super::crba::joint_column;
use super::workspace::{Column, Composite, Workspace};
use crate::arm::{BASE, Tree, second_moment};
use crate::interrupt;
use crate::kinematics::{Pose, from_parent, place_body};
use crate::memory::set;
use crate::scalar::Real;
use crate::spatial::{Inertia, Matrix, Matrix3, Vector, Vector3};

/// The cross product of `w` with each column of a matrix.
fn cross_columns<S: Real>(w: Vector3<S>, m: Matrix3<S>) -> Matrix3<S> {
    Matrix3::from_columns(&[w.cross(m.axis(0)), w.cross(m.axis(1)), w.cross(m.axis(2))])
}

fn trace<S: Real>(k: &Matrix3<S>) -> S {
    k[(0, 0)] + k[(1, 1)] + k[(2, 2)]
}

/// Pass outwards: compute poses, velocities, the columns of the joints, and the contribution of each body to its subtree.
fn place<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    composites: &mut [Composite<S>],
    columns: &mut [Column<S>],
    (trig, q): (&[(S, S)], &[S]),
    v: &[S],
) {
    let base = || (Pose::identity(), Vector3::zero(), Vector3::zero());
    let mut last = base();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        let (parent, w_p, velocity_p) = from_parent(body.parent, i, last, |p| (poses[p], columns[p].w, columns[p].velocity), base);
        let pose = place_body(body, &parent, trig[i], q[i]);
        let z = pose.z();
        let swept = w_p.cross_add(pose.origin - parent.origin, velocity_p);
        let (w, velocity) = if body.revolute { (z.scale_add(v[i], w_p), swept) } else { (w_p, z.scale_add(v[i], swept)) };
        let wz = w.cross(z);
        let (linear, angular) = joint_column(body.revolute, &pose);
        // V_j x S_j at the world origin is (gamma, alpha), linear part first. The origin of another joint k has the polarised acceleration
        // gamma + alpha x o_k + z x v_k.
        let (alpha, gamma) = if body.revolute { (wz, -(wz.cross_add(pose.origin, z.cross(velocity)))) } else { (Vector3::zero(), wz) };
        columns[i] = Column { linear, angular, w, velocity, alpha, gamma };
        let inertia = body.inertia.rotated(pose.rotation);
        let k = cross_columns(w, second_moment(&inertia.inertia).full());
        composites[i] = Composite { inertia, momentum: w.cross(inertia.moment), k };
        poses[i] = pose;
        last = (pose, w, velocity);
    }
}

/// Compute the Coriolis matrix `C(q, v)`, `(n, n)`, in the Christoffel factorisation.
pub fn coriolis_matrix<S: Real>(tree: &Tree<S>, ws: &mut Workspace<S>, trig: &[(S, S)], q: &[S], v: &[S], c: &mut [S]) {
    let (poses, composites, columns) = (&mut ws.poses[..], &mut ws.composites[..], &mut ws.columns[..]);
    place(tree, poses, composites, columns, (trig, q), v);
    let n = tree.bodies.len();
    set(c, S::zero());
    // A local variable has the sum for the parent if the parent is the next body. So the sum can stay in registers.
    let (mut carried, mut carried_to) = (Composite::default(), BASE);
    for j in (0..n).rev() {
        interrupt::check_at_row(j);
        let body = &tree.bodies[j];
        let mut composite = composites[j];
        if carried_to == j {
            composite = composite.plus(&carried);
        }
        let Composite { inertia: Inertia { mass, moment, inertia }, momentum, k } = composite;
        let me = columns[j];
        let origin = poses[j].origin;
        let z = poses[j].z();
        let tr = trace(&k);
        // Column `j` of `C` needs the force `(f, about_joint)` on the subtree of joint `j`. Row `j` needs the coefficients that multiply
        // the fields `alpha`, `angular` and `gamma` of an ancestor joint.
        let (f, about_joint, by_alpha, by_angular, by_gamma) = if body.revolute {
            let f = me.alpha.cross_add(moment, z.cross(momentum));
            let about_joint = inertia.apply_add(me.alpha, z.scale(tr) - k.apply(z));
            (f, about_joint, inertia.apply(z), z.scale(tr) - k.apply_transposed(z), z.cross(moment))
        } else {
            let wz = me.gamma;
            (wz.scale(mass), moment.cross(wz), moment.cross(z), momentum.cross(z), z.scale(mass))
        };
        c[j * n + j] = if body.revolute { z.dot(about_joint) } else { z.dot(f) };
        if body.parent == BASE {
            continue;
        }
        let about_origin = origin.cross_add(f, about_joint);
        let by_alpha = origin.cross_add(by_gamma, by_alpha);
        let by_angular = me.velocity.cross_add(by_gamma, by_angular);
        let mut i = body.parent;
        while i != BASE {
            let up = &columns[i];
            c[i * n + j] = up.linear.dot(f) + up.angular.dot(about_origin);
            c[j * n + i] = up.alpha.dot(by_alpha) + up.angular.dot(by_angular) + up.gamma.dot(by_gamma);
            i = tree.bodies[i].parent;
        }
        let p = origin - poses[body.parent].origin;
        let d = me.velocity - columns[body.parent].velocity;
        let moved = composite.inertia.shifted(p);
        let [hx, hy, hz] = moved.moment.array();
        let k = Matrix3::from_columns(&[
            d.scale_add(hx, momentum.scale_add(p[0], k.axis(0))),
            d.scale_add(hy, momentum.scale_add(p[1], k.axis(1))),
            d.scale_add(hz, momentum.scale_add(p[2], k.axis(2))),
        ]);
        let moved = Composite { momentum: d.scale_add(mass, momentum), k, inertia: moved };
        if body.parent + 1 == j {
            (carried, carried_to) = (moved, body.parent);
        } else {
            composites[body.parent] = composites[body.parent].plus(&moved);
        }
    }
}

/// Compute the Christoffel symbols `c[i, j, k]`, `(n, n, n)`, with `C(q, v)[i, j] = sum_k c[i, j, k] v[k]`.
///
/// `C` is linear in `v`, so the slice at `k` is `C` at the unit rate of joint `k`. The symbols are symmetric in `j` and `k`. So values for
/// `j <= k` are written to both places.
///
/// `unit`, `(n,)`, and `square`, `(n, n)`, are memory for the unit rate and for `C`.
pub fn christoffel<S: Real>(
    tree: &Tree<S>,
    ws: &mut Workspace<S>,
    trig: &[(S, S)],
    q: &[S],
    unit: &mut [S],
    square: &mut [S],
    c: &mut [S],
) {
    let n = tree.n();
    unit.fill(S::zero());
    for k in 0..n {
        unit[k] = S::splat(1.0);
        tree.coriolis_matrix(ws, trig, q, unit, square);
        unit[k] = S::zero();
        for i in 0..n {
            for j in 0..=k {
                let symbol = square[i * n + j];
                (c[(i * n + j) * n + k], c[(i * n + k) * n + j]) = (symbol, symbol);
            }
        }
    }
}
