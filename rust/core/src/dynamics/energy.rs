//! Energy, gravity torque, joint friction and the torque of external wrenches.
//!
//! `T = sum (m u.u + 2 u.(w x h) + w.I w) / 2 + armature v^2 / 2`, `U = -sum gravity.(m o + h)`, `g = dU/dq`,
//! `tau_friction = damping v + friction sign(v)`, `tau_ext = J' F`. `m`, `h` and `I` are mass, first moment and inertia of a body about its
//! origin `o`. `u` is the velocity of `o`, and `w` the angular velocity. `F` is a wrench on a frame with the Jacobian `J`.

use super::workspace::{Column, Composite};
use crate::arm::{BASE, Body, Tree};
use crate::kinematics::{Pose, from_parent, place_body};
use crate::scalar::{Real, sign};
use crate::spatial::{Lift, Matrix, Vector, Vector3};

/// Compute the gravity torque `g(q)`, `(n,)`, from the mass and the first moment of every subtree.
pub fn gravity<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], composites: &mut [Composite<S>], trig: &[(S, S)], q: &[S], g: &mut [S]) {
    let n = tree.bodies.len();
    let mut last = Pose::identity();
    for i in 0..n {
        let body = &tree.bodies[i];
        let parent = from_parent(body.parent, i, last, |p| poses[p], Pose::identity);
        last = place_body(body, &parent, trig[i], q[i]);
        poses[i] = last;
        composites[i].inertia.mass = body.inertia.mass;
        composites[i].inertia.moment = last.rotation.apply(body.inertia.moment);
    }
    let up = -tree.gravity.lift::<S>();
    for i in (0..n).rev() {
        let body = &tree.bodies[i];
        let (mass, moment, z) = (composites[i].inertia.mass, composites[i].inertia.moment, poses[i].z());
        g[i] = if body.revolute { z.dot(moment.cross(up)) } else { mass * z.dot(up) };
        if body.parent != BASE {
            let p = poses[i].origin - poses[body.parent].origin;
            let parent = &mut composites[body.parent].inertia;
            parent.mass += mass;
            parent.moment = p.scale_add(mass, parent.moment + moment);
        }
    }
}

/// Kinetic and potential energy, J.
pub fn energy<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], columns: &mut [Column<S>], trig: &[(S, S)], q: &[S], v: &[S]) -> (S, S) {
    let up = -tree.gravity.lift::<S>();
    let (mut twice, mut potential) = (S::zero(), S::zero());
    let base = || (Pose::identity(), Vector3::zero(), Vector3::zero());
    let mut last = base();
    for i in 0..tree.bodies.len() {
        let body = &tree.bodies[i];
        let (parent, w_p, u_p) = from_parent(body.parent, i, last, |p| (poses[p], columns[p].w, columns[p].velocity), base);
        let pose = place_body(body, &parent, trig[i], q[i]);
        let z = pose.z();
        let swept = w_p.cross_add(pose.origin - parent.origin, u_p);
        let (w, u) = if body.revolute { (z.scale_add(v[i], w_p), swept) } else { (w_p, z.scale_add(v[i], swept)) };
        (columns[i].w, columns[i].velocity) = (w, u);
        let (m, h) = (body.inertia.mass, pose.rotation.apply(body.inertia.moment));
        let w_body = pose.rotation.apply_transposed(w);
        let cross = u.dot(w.cross(h));
        twice += m.mul_add(u.dot(u), cross + cross) + w_body.dot(body.inertia.inertia.apply(w_body));
        twice = body.armature.mul_add(v[i] * v[i], twice);
        potential += up.dot(pose.origin.scale_add(m, h));
        poses[i] = pose;
        last = (pose, w, u);
    }
    (S::splat(0.5) * twice, potential)
}

/// The friction torque of a joint at the rate `v`: `damping v + friction sign(v)`, N m or N.
pub fn friction_torque<S: Real>(body: &Body<S>, v: S) -> S {
    body.friction.mul_add(sign(v), body.damping * v)
}

/// Add the friction torque `damping v + friction sign(v)` to `tau`.
pub fn add_friction<S: Real>(tree: &Tree<S>, v: &[S], tau: &mut [S]) {
    for i in 0..tree.n() {
        tau[i] += friction_torque(tree.leader(i), v[i]);
    }
}

/// Add `factor J' F` to `tau`, for a wrench `F = [f; n]` in world axes at the origin of `frame`. `poses` must be current.
pub fn add_wrench<S: Real>(tree: &Tree<S>, poses: &[Pose<S>], frame: usize, wrench: [S; 6], factor: S, tau: &mut [S]) {
    let f = Vector3::from([wrench[0], wrench[1], wrench[2]]).scale(factor);
    let moment = Vector3::from([wrench[3], wrench[4], wrench[5]]).scale(factor);
    let mut i = tree.frames[frame].body;
    if i == BASE {
        return;
    }
    let point = poses[i].rotation.apply_add(tree.frames[frame].placement.translation.lift(), poses[i].origin);
    while i != BASE {
        let z = poses[i].z();
        let torque = if tree.bodies[i].revolute { z.dot((point - poses[i].origin).cross_add(f, moment)) } else { z.dot(f) };
        let (k, multiplier) = tree.mover(i);
        tau[k] = if tree.joining.is_some() { S::splat(multiplier).mul_add(torque, tau[k]) } else { tau[k] + torque };
        i = tree.bodies[i].parent;
    }
}
