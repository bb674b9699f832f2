//! The bodies of an arm at one state, or at one state per lane (one entry of a SIMD register). Bodies are *placed* when their poses are
//! computed. Task functions read poses and velocities of placed bodies.
//!
//! The Jacobian column of a revolute joint is `[z x (p - o); z]`. Its rate is `[z' x (p - o) + z x (p' - o'); z']` with `z' = w x z`. Here
//! `z` is the joint axis, `o` the origin of the joint, and `p` the origin of the frame. `w` is the angular velocity of the body, and the
//! prime is the time derivative.

use super::Pose;
use super::jacobian::{column_rate, of_frame};
use crate::arm::{BASE, Tree};
use crate::scalar::Real;
use crate::spatial::{Matrix, Matrix3, Vector, Vector3};

/// The bodies of one arm, with buffers. Evaluation allocates nothing.
#[derive(Clone, Debug)]
pub struct Bodies<S: Real = f64> {
    pub(super) tree: Tree<S>,
    /// Number of bodies that are placed: the first ones in the order of the arm.
    needed: usize,
    trig: Vec<(S, S)>,
    pub(super) q: Vec<S>,
    pub(super) poses: Vec<Pose<S>>,
    /// Angular velocity of each body, rad/s, and velocity of its origin, m/s, in world axes.
    pub(super) motion: Vec<(Vector3<S>, Vector3<S>)>,
    /// Mass, first moment about the world origin, and momentum of each subtree.
    pub(super) subtrees: Vec<(S, Vector3<S>, Vector3<S>)>,
}

/// Rotation `r`, position `p`, angular velocity `w` and velocity `u` of a frame, in world axes.
#[derive(Clone, Copy)]
pub(super) struct Moving<S: Real> {
    pub r: Matrix3<S>,
    pub p: Vector3<S>,
    pub w: Vector3<S>,
    pub u: Vector3<S>,
}

/// The Jacobian column of one joint: its linear and angular part, and the rates of both.
pub(super) struct Column<S: Real> {
    /// The coordinate that moves the joint, and the rate of the joint per unit rate of the coordinate.
    pub joint: usize,
    pub multiplier: f64,
    pub linear: Vector3<S>,
    pub angular: Vector3<S>,
    pub linear_dot: Vector3<S>,
    pub angular_dot: Vector3<S>,
}

impl<S: Real> Bodies<S> {
    /// Create the bodies of a tree, of which the first `needed` are placed.
    pub(super) fn new(tree: Tree<S>, needed: usize) -> Self {
        let (n, bodies) = (tree.n(), tree.bodies.len());
        Bodies {
            needed,
            trig: vec![(S::zero(), S::splat(1.0)); n],
            q: vec![S::zero(); n],
            poses: vec![Pose::identity(); bodies],
            motion: vec![(Vector3::zero(), Vector3::zero()); bodies],
            subtrees: vec![(S::zero(), Vector3::zero(), Vector3::zero()); bodies],
            tree,
        }
    }

    pub(super) fn n(&self) -> usize {
        self.q.len()
    }

    /// Number of bodies, from the first on, that must be placed for a frame.
    pub(super) fn below(tree: &Tree<S>, frame: usize) -> usize {
        tree.frames.get(frame).map_or(0, |at| if at.body == BASE { 0 } else { at.body + 1 })
    }

    /// Place the bodies at `q` `(n,)`.
    pub(super) fn place(&mut self, q: &[S]) {
        // The joint of a needed body may follow any coordinate, so all coordinates are needed.
        let needed = if self.tree.joining.is_some() { q.len() } else { self.needed };
        for i in 0..needed {
            if self.tree.leader(i).revolute {
                self.trig[i] = q[i].sin_cos();
            }
        }
        self.place_known(q);
    }

    fn place_known(&mut self, q: &[S]) {
        self.q.copy_from_slice(q);
        super::place(&self.tree, &self.trig, q, &mut self.poses[..self.needed]);
    }

    /// Place the bodies at `q`, `(n,)`, whose (sin, cos) are known.
    pub(super) fn place_at(&mut self, q: &[S], trig: &[(S, S)]) {
        self.trig.copy_from_slice(trig);
        self.place_known(q);
    }

    /// Compute the velocities of the placed bodies at joint rates `v`, `(n,)`.
    pub(super) fn set_moving(&mut self, v: &[S]) {
        super::place_moving(&self.tree, (&self.trig, &self.q), v, &mut self.poses[..self.needed], &mut self.motion);
    }

    /// The pose of a frame, and its velocity if `moving` is true. Otherwise the velocity is zero.
    pub(super) fn frame(&self, frame: usize, moving: bool) -> Moving<S> {
        let (r, p) = of_frame(&self.tree, &self.poses, frame);
        let body = self.tree.frames[frame].body;
        if !moving || body == BASE {
            return Moving { r, p, w: Vector3::zero(), u: Vector3::zero() };
        }
        let (w, u) = self.motion[body];
        Moving { r, p, w, u: w.cross_add(p - self.poses[body].origin, u) }
    }

    /// Call `put` for each column of the geometric Jacobian of a frame, joint by joint from the frame to the base. Without `rate`, the
    /// rates of the columns are zero.
    pub(super) fn columns(&self, frame: usize, at: &Moving<S>, rate: bool, mut put: impl FnMut(Column<S>)) {
        let mut i = self.tree.frames[frame].body;
        let none = Vector3::zero();
        while i != BASE {
            let (z, o, revolute) = (self.poses[i].z(), self.poses[i].origin, self.tree.bodies[i].revolute);
            let (linear, angular) = if revolute { (z.cross(at.p - o), z) } else { (z, none) };
            let (linear_dot, angular_dot) =
                if rate { column_rate(revolute, &self.poses[i], self.motion[i], at.p, at.u) } else { (none, none) };
            let (joint, multiplier) = self.tree.mover(i);
            put(Column { joint, multiplier, linear, angular, linear_dot, angular_dot });
            i = self.tree.bodies[i].parent;
        }
    }

    /// Compute mass and first moment of each subtree, and its momentum if `rate` is true.
    pub(super) fn gather_subtrees(&mut self, rate: bool) {
        for (i, body) in self.tree.bodies.iter().enumerate() {
            let m = body.inertia.mass;
            let arm = self.poses[i].rotation.apply(body.inertia.moment);
            let momentum = if rate { self.motion[i].0.cross_add(arm, self.motion[i].1.scale(m)) } else { Vector3::zero() };
            self.subtrees[i] = (m, self.poses[i].origin.scale_add(m, arm), momentum);
        }
        for i in (0..self.tree.bodies.len()).rev() {
            let parent = self.tree.bodies[i].parent;
            if parent != BASE {
                let (m, h, p) = self.subtrees[i];
                let up = &mut self.subtrees[parent];
                *up = (up.0 + m, up.1 + h, up.2 + p);
            }
        }
    }
}
