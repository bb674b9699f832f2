//! Poses of frames, geometric Jacobians in world axes at the frame origin `p`, and the centre of mass.
//!
//! The column of a revolute joint is `[z x (p - o); z]`, and the column of a prismatic joint is `[z; 0]`. Here `z` is the joint axis and
//! `o` the origin of the joint. Time derivatives of the columns use `z' = w x z`, where `w` is the angular velocity of the body. They also
//! use the velocities `o'` and `p'` of the joint origin and of the frame origin. Matrices are `(6, n)` or `(3, n)`, row-major. If a joint
//! follows another joint, its leader, then its column times the multiplier is added to the leader's column.

use super::Pose;
use crate::arm::{BASE, Tree};
use crate::scalar::Real;
use crate::spatial::{ANGULAR, LINEAR, Lift, Matrix, Matrix3, Vector, Vector3};

/// Number of bodies, from the first on, that the placement of a frame depends on.
fn needed<S: Real>(tree: &Tree<S>, frame: usize) -> usize {
    let body = tree.frames[frame].body;
    if body == BASE { 0 } else { body + 1 }
}

pub(super) fn of_frame<S: Real>(tree: &Tree<S>, poses: &[Pose<S>], frame: usize) -> (Matrix3<S>, Vector3<S>) {
    let at = &tree.frames[frame];
    let body = if at.body == BASE { Pose::identity() } else { poses[at.body] };
    let (r, p) = (at.placement.rotation, at.placement.translation);
    (body.rotation.times(r.lift()), body.rotation.apply_add(p.lift(), body.origin))
}

/// Compute the rotation `R_WF` and the origin `p_WF`, m, of a frame.
pub fn frame_pose<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], trig: &[(S, S)], q: &[S], frame: usize) -> (Matrix3<S>, Vector3<S>) {
    super::place(tree, trig, q, &mut poses[..needed(tree, frame)]);
    of_frame(tree, poses, frame)
}

/// Compute the geometric Jacobian, `(6, n)`, and return the position `p_WF` of the frame.
pub fn jacobian<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], trig: &[(S, S)], q: &[S], frame: usize, j: &mut [S]) -> Vector3<S> {
    j.fill(S::zero());
    jacobian_on_zeros(tree, poses, trig, q, frame, j)
}

/// Compute [`jacobian`], but write only the entries that can differ from zero. Before the call, `j` contains zeros, or an earlier Jacobian
/// of this frame.
pub fn jacobian_on_zeros<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    trig: &[(S, S)],
    q: &[S],
    frame: usize,
    j: &mut [S],
) -> Vector3<S> {
    let (_, p) = frame_pose(tree, poses, trig, q, frame);
    if tree.joining.is_some() {
        j.fill(S::zero());
    }
    let mut i = tree.frames[frame].body;
    while i != BASE {
        let z = poses[i].z();
        let (linear, angular) = if tree.bodies[i].revolute { (z.cross(p - poses[i].origin), z) } else { (z, Vector3::zero()) };
        write(tree, j, i, linear, angular);
        i = tree.bodies[i].parent;
    }
    p
}

/// Write the column of a body to the column of its coordinate in `j`. With mimic joints, add it to this column, which must first contain
/// zeros.
fn write<S: Real>(tree: &Tree<S>, j: &mut [S], body: usize, linear: Vector3<S>, angular: Vector3<S>) {
    let (n, (i, multiplier)) = (tree.n(), tree.mover(body));
    for k in 0..3 {
        put(tree, multiplier, &mut j[(LINEAR + k) * n + i], linear[k]);
        put(tree, multiplier, &mut j[(ANGULAR + k) * n + i], angular[k]);
    }
}

/// Write an entry of a column. If joints follow others, add `multiplier value` to the entry instead.
#[inline]
pub(super) fn put<S: Real>(tree: &Tree<S>, multiplier: f64, entry: &mut S, value: S) {
    *entry = if tree.joining.is_some() { S::splat(multiplier).mul_add(value, *entry) } else { value };
}

/// The rate of a joint's column. It is `z' x (p - o) + z x (p' - o')` and `z'`, or `z'` and 0 for a prismatic joint. `velocity` is `p'`,
/// and `u` is `o'`.
pub(super) fn column_rate<S: Real>(
    revolute: bool,
    joint: &Pose<S>,
    (w, u): (Vector3<S>, Vector3<S>),
    p: Vector3<S>,
    velocity: Vector3<S>,
) -> (Vector3<S>, Vector3<S>) {
    let z = joint.z();
    let z_dot = w.cross(z);
    if revolute { (z_dot.cross_add(p - joint.origin, z.cross(velocity - u)), z_dot) } else { (z_dot, Vector3::zero()) }
}

/// Compute `dJ/dt`, `(6, n)`, at joint rates `v`. `motion` is memory for the angular velocity and the velocity of every body.
pub fn jacobian_dot<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    motion: &mut [(Vector3<S>, Vector3<S>)],
    (trig, q): (&[(S, S)], &[S]),
    v: &[S],
    frame: usize,
    j: &mut [S],
) {
    super::place_moving(tree, (trig, q), v, &mut poses[..needed(tree, frame)], motion);
    let (_, p) = of_frame(tree, poses, frame);
    j.fill(S::zero());
    let mut i = tree.frames[frame].body;
    if i == BASE {
        return;
    }
    let (w, u) = motion[i];
    let velocity = w.cross_add(p - poses[i].origin, u);
    while i != BASE {
        let (linear, angular) = column_rate(tree.bodies[i].revolute, &poses[i], motion[i], p, velocity);
        write(tree, j, i, linear, angular);
        i = tree.bodies[i].parent;
    }
}

/// Mass of the moving bodies, kg, and their centre of mass in the world, m. The centre is NaN for a massless arm.
pub fn com<S: Real>(tree: &Tree<S>, poses: &mut [Pose<S>], trig: &[(S, S)], q: &[S]) -> (S, Vector3<S>) {
    super::place(tree, trig, q, &mut poses[..tree.bodies.len()]);
    let (mut mass, mut moment) = (S::zero(), Vector3::zero());
    for (body, pose) in tree.bodies.iter().zip(poses.iter()) {
        mass += body.inertia.mass;
        moment += pose.rotation.apply_add(body.inertia.moment, pose.origin.scale(body.inertia.mass));
    }
    (mass, moment.scale(mass.recip()))
}

/// Compute the Jacobian of the centre of mass, `(3, n)`. `subtree` is memory for the mass of each subtree and its first moment about the
/// origin of its joint.
pub fn com_jacobian<S: Real>(
    tree: &Tree<S>,
    poses: &mut [Pose<S>],
    subtree: &mut [(S, Vector3<S>)],
    trig: &[(S, S)],
    q: &[S],
    j: &mut [S],
) {
    let n = tree.n();
    let (mass, _) = com(tree, poses, trig, q);
    let inverse = mass.recip();
    for (i, body) in tree.bodies.iter().enumerate() {
        subtree[i] = (body.inertia.mass, poses[i].rotation.apply(body.inertia.moment));
    }
    if tree.joining.is_some() {
        j.fill(S::zero());
    }
    for i in (0..tree.bodies.len()).rev() {
        let body = &tree.bodies[i];
        let (m, h) = subtree[i];
        let z = poses[i].z();
        let (column, (at, multiplier)) = (if body.revolute { z.cross(h) } else { z.scale(m) }, tree.mover(i));
        for k in 0..3 {
            put(tree, multiplier, &mut j[k * n + at], column[k] * inverse);
        }
        if body.parent != BASE {
            let p = poses[i].origin - poses[body.parent].origin;
            let (up_m, up_h) = subtree[body.parent];
            subtree[body.parent] = (up_m + m, p.scale_add(m, up_h + h));
        }
    }
}
