//! Where bodies and frames are, and how they move with the joints.
//!
//! `R_i = R_p R_0 Rz(q)`, `o_i = o_p + R_p p_0` (a slide: `R_i = R_p R_0`, `o_i = o_p + R_p p_0 + z_i q`),
//! from the base outwards; `z_i` is the third column of `R_i`.

mod jacobian;

pub use jacobian::{com, com_jacobian, frame_pose, jacobian, jacobian_dot};

use crate::arm::{BASE, Body, Tree};
use crate::scalar::Real;
use crate::spatial::{M3, V3};

/// World placement of a body's compiled frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pose<S> {
    pub rotation: M3<S>,
    pub origin: V3<S>,
}

impl<S: Real> Pose<S> {
    #[inline(always)]
    pub fn identity() -> Self {
        Pose { rotation: M3::IDENTITY.lift(), origin: V3::zero() }
    }
    /// The joint axis in world axes.
    #[inline(always)]
    pub fn z(&self) -> V3<S> {
        self.rotation.0[2]
    }
}

/// One step of the recursion.
#[inline(always)]
pub(crate) fn place_body<S: Real>(body: &Body<S>, parent: &Pose<S>, trig: (S, S), q: S) -> Pose<S> {
    let base = if body.rotated { parent.rotation.mul(body.rotation.lift()) } else { parent.rotation };
    let origin = parent.rotation.apply_add(body.translation.lift(), parent.origin);
    if body.revolute {
        Pose { rotation: base.rotate_z(trig), origin }
    } else {
        Pose { rotation: base, origin: base.0[2].scale_add(q, origin) }
    }
}

/// World placements of the first `poses.len()` bodies.
#[inline(always)]
pub fn place<S: Real>(tree: &Tree<S>, trig: &[(S, S)], q: &[S], poses: &mut [Pose<S>]) {
    let root = Pose::identity();
    for i in 0..poses.len() {
        let body = &tree.bodies[i];
        let parent = if body.parent == BASE { root } else { poses[body.parent] };
        poses[i] = place_body(body, &parent, trig[i], q[i]);
    }
}
