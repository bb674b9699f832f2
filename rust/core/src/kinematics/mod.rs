//! Poses of bodies and frames, and their motion with the joints.
//!
//! A revolute joint with the parent `p` has `R_i = R_p R_0 Rz(q)`, `o_i = o_p + R_p p_0`. A prismatic joint has `R_i = R_p R_0`,
//! `o_i = o_p + R_p p_0 + z_i q`. `R_0` and `p_0` are the placement of the joint in the parent's frame at `q = 0`. `z_i` is the third
//! column of `R_i`. The recursion goes from the base outwards.

mod bodies;
pub mod coordinates;
mod jacobian;
pub mod task;
#[doc(hidden)]
mod task_stack;

use bodies::{Bodies, Column};
pub use coordinates::Coordinates;
pub use jacobian::{com, com_jacobian, frame_pose, jacobian, jacobian_dot, jacobian_on_zeros};
pub use task::TaskFunction;
pub use task_stack::TaskStack;

use crate::arm::{BASE, Body, Tree};
use crate::scalar::Real;
use crate::spatial::{Lift, Matrix, Matrix3, RotationMatrix, Vector, Vector3};

/// The pose of a body's compiled frame in the world. This frame has the origin on the joint, and z along the joint axis.
///
/// ```
/// use armlet_core::arm::{Arm, Tree};
/// use armlet_core::kinematics::{Pose, place};
///
/// let tree = Tree::<f64>::new(&Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (q, mut poses) = ([0.3, -0.8], [Pose::identity(); 2]);
/// place(&tree, &q.map(f64::sin_cos), &q, &mut poses);
/// assert!((poses[1].origin.x - 0.5 * 0.3f64.cos()).abs() < 1e-15);
/// assert!((poses[1].rotation[(0, 0)] - 0.5f64.cos()).abs() < 1e-15 && poses[1].z().z == 1.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Pose<S: Real> {
    /// Rotation `R_WB` from the body's axes to the world axes.
    pub rotation: Matrix3<S>,
    /// Origin `p_WB` of the body's frame in the world, m.
    pub origin: Vector3<S>,
}

impl<S: Real> Pose<S> {
    /// The pose of the world frame itself.
    pub fn identity() -> Self {
        Pose { rotation: Matrix3::IDENTITY.lift(), origin: Vector3::zero() }
    }
    /// The joint axis in world axes.
    pub fn z(&self) -> Vector3<S> {
        self.rotation.axis(2)
    }
}

/// Compute the pose of a body from the pose of its parent. If the placement is not a quarter turn, it is first multiplied by the joint's
/// rotation. This product does not depend on the parent, so that the processor can compute it in advance.
pub(crate) fn place_body<S: Real>(body: &Body<S>, parent: &Pose<S>, trig: (S, S), q: S) -> Pose<S> {
    if body.parent == BASE {
        // The base has no rotation.
        let (rotation, origin) = (body.rotation.lift::<S>(), body.translation.lift::<S>());
        return if body.revolute {
            Pose { rotation: rotation.rotate_z(trig), origin }
        } else {
            Pose { rotation, origin: rotation.axis(2).scale_add(q, origin) }
        };
    }
    let origin = parent.rotation.apply_add(body.translation.lift(), parent.origin);
    if body.revolute {
        let rotation = match body.quarter {
            Some(quarter) => quarter.after(parent.rotation).rotate_z(trig),
            None => parent.rotation.times(body.rotation.lift::<S>().rotate_z(trig)),
        };
        Pose { rotation, origin }
    } else {
        let rotation = match body.quarter {
            Some(quarter) => quarter.after(parent.rotation),
            None => parent.rotation.times(body.rotation.lift()),
        };
        Pose { rotation, origin: rotation.axis(2).scale_add(q, origin) }
    }
}

/// Return the result of the parent of body `i`, in a recursion from the base outwards. `last` is the result of body `i - 1`, which is the
/// parent in a chain. It is still in registers, so that the code does not wait for a recent store.
pub(crate) fn from_parent<T: Copy>(parent: usize, i: usize, last: T, stored: impl Fn(usize) -> T, base: impl Fn() -> T) -> T {
    // The comparison is also true for the first body: i - 1 wraps to BASE, and `last` starts with the value of the base.
    if parent == i.wrapping_sub(1) {
        last
    } else if parent == BASE {
        base()
    } else {
        stored(parent)
    }
}

/// Compute the poses of the first `poses.len()` bodies in the world.
pub fn place<S: Real>(tree: &Tree<S>, trig: &[(S, S)], q: &[S], poses: &mut [Pose<S>]) {
    let mut last = Pose::identity();
    for i in 0..poses.len() {
        let body = &tree.bodies[i];
        let parent = from_parent(body.parent, i, last, |p| poses[p], Pose::identity);
        let (trig, q) = tree.position(i, trig, q);
        last = place_body(body, &parent, trig, q);
        poses[i] = last;
    }
}

/// Compute the poses and the velocities of the first `poses.len()` bodies at joint rates `v`. `motion` has the angular velocity of each
/// body, rad/s, and the velocity of its origin, m/s, in world axes.
fn place_moving<S: Real>(
    tree: &Tree<S>,
    (trig, q): (&[(S, S)], &[S]),
    v: &[S],
    poses: &mut [Pose<S>],
    motion: &mut [(Vector3<S>, Vector3<S>)],
) {
    let base = || (Pose::identity(), (Vector3::zero(), Vector3::zero()));
    let mut last = base();
    for i in 0..poses.len() {
        let body = &tree.bodies[i];
        let (parent, (w, u)) = from_parent(body.parent, i, last, |p| (poses[p], motion[p]), base);
        let ((trig, q), rate) = (tree.position(i, trig, q), tree.rate(i, v));
        let pose = place_body(body, &parent, trig, q);
        let swept = w.cross_add(pose.origin - parent.origin, u);
        let z = pose.z();
        motion[i] = if body.revolute { (z.scale_add(rate, w), swept) } else { (w, z.scale_add(rate, swept)) };
        poses[i] = pose;
        last = (pose, motion[i]);
    }
}
