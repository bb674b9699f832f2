//! A stack of tasks evaluated at one state, or at one state per lane: bodies are placed once, then every task writes its rows.
//!
//! Column of a turning joint `[z x (p - o); z]`, its rate `[z' x (p - o) + z x (p' - o'); z']` with `z' = w x z`; of the
//! centre of mass `z x (H - m o) / m_total` with the mass `m` and the first moment `H` of the subtree about the world origin.

use super::task::TaskFunction;
use super::{Pose, from_parent, place_body};
use crate::arm::{Arm, BASE, Tree};
use crate::scalar::Real;
use crate::spatial::{Lift, Matrix, Matrix3, Vector, Vector3};

/// Task functions of one arm with their buffers; evaluation allocates nothing.
#[derive(Clone, Debug)]
pub struct TaskStack<S: Real = f64> {
    pub(super) tree: Tree<S>,
    pub(super) functions: Vec<TaskFunction>,
    rows: Vec<usize>,
    /// Bodies that some task depends on.
    needed: usize,
    trig: Vec<(S, S)>,
    pub(super) q: Vec<S>,
    pub(super) poses: Vec<Pose<S>>,
    /// Angular velocity of each body and velocity of its origin.
    motion: Vec<(Vector3<S>, Vector3<S>)>,
    /// Mass, first moment and momentum of each subtree.
    pub(super) subtrees: Vec<(S, Vector3<S>, Vector3<S>)>,
}

/// Position, rotation, angular velocity and velocity of a frame.
#[derive(Clone, Copy)]
pub(super) struct Moving<S: Real> {
    pub r: Matrix3<S>,
    pub p: Vector3<S>,
    w: Vector3<S>,
    u: Vector3<S>,
}

/// The column of one joint: linear and angular part, and the rates of both.
struct Column<S: Real> {
    joint: usize,
    linear: Vector3<S>,
    angular: Vector3<S>,
    linear_dot: Vector3<S>,
    angular_dot: Vector3<S>,
}

impl<S: Real> TaskStack<S> {
    pub fn new(arm: &Arm, functions: Vec<TaskFunction>) -> Self {
        Self::of_tree(Tree::new(arm), functions)
    }

    fn of_tree(tree: Tree<S>, functions: Vec<TaskFunction>) -> Self {
        let n = tree.n();
        let last = |frame: usize| tree.frames.get(frame).map_or(0, |at| if at.body == BASE { 0 } else { at.body + 1 });
        let needed = functions
            .iter()
            .map(|function| match function {
                TaskFunction::Frame(coordinates) => last(coordinates.frame),
                TaskFunction::Axis { frame, .. } => last(*frame),
                TaskFunction::Relative { frame, reference, .. } => last(*frame).max(last(*reference)),
                TaskFunction::CentreOfMass { .. } => n,
                TaskFunction::Posture { .. } | TaskFunction::JointLimits { .. } => 0,
            })
            .max()
            .unwrap_or(0);
        TaskStack {
            rows: functions.iter().map(TaskFunction::rows).collect(),
            needed,
            trig: vec![(S::zero(), S::splat(1.0)); n],
            q: vec![S::zero(); n],
            poses: vec![Pose::identity(); n],
            motion: vec![(Vector3::zero(), Vector3::zero()); n],
            subtrees: vec![(S::zero(), Vector3::zero(), Vector3::zero()); n],
            functions,
            tree,
        }
    }

    pub fn n(&self) -> usize {
        self.q.len()
    }

    /// Rows of each task.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    pub fn functions(&self) -> &[TaskFunction] {
        &self.functions
    }

    /// Relative error of the entries of Jacobians at the last `q`: `8 eps (1 + sum|q|)`.
    pub fn rounding(&self) -> S {
        let turned = self.q.iter().fold(S::splat(1.0), |sum, q| sum + q.abs());
        // Beyond 1 nothing is known of the entries, and no rank can be decided.
        let (relative, most) = (S::splat(8.0 * f64::EPSILON) * turned, S::splat(0.5));
        S::select(relative.lt(most), relative, most)
    }

    /// Place the bodies at `q` `(n,)`.
    pub fn place(&mut self, q: &[S]) {
        for i in 0..self.needed {
            if self.tree.bodies[i].revolute {
                self.trig[i] = q[i].sin_cos();
            }
        }
        self.place_known(q);
    }

    fn place_known(&mut self, q: &[S]) {
        self.q.copy_from_slice(q);
        super::place(&self.tree, &self.trig, q, &mut self.poses[..self.needed]);
    }

    /// As [`TaskStack::place`] with the (sin, cos) of the joints known.
    pub fn place_at(&mut self, q: &[S], trig: &[(S, S)]) {
        self.trig.copy_from_slice(trig);
        self.place_known(q);
    }

    /// How the bodies of the last placement move at joint rates `v` `(n,)`.
    pub fn set_moving(&mut self, v: &[S]) {
        let base = || (Pose::identity(), (Vector3::zero(), Vector3::zero()));
        let mut last = base();
        for i in 0..self.needed {
            let body = &self.tree.bodies[i];
            let (parent, (w, u)) = from_parent(body.parent, i, last, |p| (self.poses[p], self.motion[p]), base);
            let pose = place_body(body, &parent, self.trig[i], self.q[i]);
            let swept = w.cross_add(pose.origin - parent.origin, u);
            let z = pose.z();
            self.motion[i] = if body.revolute { (z.scale_add(v[i], w), swept) } else { (w, z.scale_add(v[i], swept)) };
            last = (pose, self.motion[i]);
        }
    }

    /// The stacked Jacobians `(sum rows, n)`, row-major.
    pub fn jacobians(&mut self, j: &mut [S]) {
        let n = self.n();
        let mut at = 0;
        j.fill(S::zero());
        for k in 0..self.functions.len() {
            let m = self.rows[k];
            self.write(k, &mut j[at * n..(at + m) * n], false);
            at += m;
        }
    }

    /// The stacked `dJ/dt` `(sum rows, n)` at the rates of [`TaskStack::set_moving`].
    pub fn jacobians_dot(&mut self, j: &mut [S]) {
        let n = self.n();
        let mut at = 0;
        j.fill(S::zero());
        for k in 0..self.functions.len() {
            let m = self.rows[k];
            self.write(k, &mut j[at * n..(at + m) * n], true);
            at += m;
        }
    }

    /// The Jacobian of task `k`, or its rate, into zeros.
    fn write(&mut self, k: usize, j: &mut [S], rate: bool) {
        let n = self.n();
        if let TaskFunction::CentreOfMass { .. } = self.functions[k] {
            self.gather_subtrees(rate);
        }
        let (tree, poses, motion) = (&self.tree, &self.poses[..], &self.motion[..]);
        match &self.functions[k] {
            TaskFunction::Posture { joints } | TaskFunction::JointLimits { joints, .. } => {
                if !rate {
                    joints.iter().enumerate().for_each(|(row, &joint)| j[row * n + joint] = S::splat(1.0));
                }
            }
            TaskFunction::Frame(coordinates) => {
                let frame = if rate { moving(tree, poses, motion, coordinates.frame) } else { placed(tree, poses, coordinates.frame) };
                columns(tree, poses, motion, coordinates.frame, &frame, rate, |c| {
                    let (linear, angular) = if rate { (c.linear_dot, c.angular_dot) } else { (c.linear, c.angular) };
                    for (row, &axis) in coordinates.rows.iter().enumerate() {
                        j[row * n + c.joint] = if axis < 3 { linear[axis] } else { angular[axis - 3] };
                    }
                });
            }
            TaskFunction::CentreOfMass { rows } => {
                let top = self.subtrees.iter().zip(&tree.bodies).filter(|(_, body)| body.parent == BASE);
                let inverse = S::splat(1.0) / top.fold(S::zero(), |sum, (subtree, _)| sum + subtree.0);
                for (i, body) in tree.bodies.iter().enumerate() {
                    let (m, moment, momentum) = self.subtrees[i];
                    let (z, o) = (poses[i].z(), poses[i].origin);
                    let column = if !rate {
                        if body.revolute { z.cross(moment - o.scale(m)) } else { z.scale(m) }
                    } else {
                        let (w, u) = motion[i];
                        let z_dot = w.cross(z);
                        if body.revolute { z_dot.cross_add(moment - o.scale(m), z.cross(momentum - u.scale(m))) } else { z_dot.scale(m) }
                    };
                    rows.iter().enumerate().for_each(|(row, &axis)| j[row * n + i] = column[axis] * inverse);
                }
            }
            TaskFunction::Axis { frame, across, .. } => {
                let at = if rate { moving(tree, poses, motion, *frame) } else { placed(tree, poses, *frame) };
                let world = across.map(|b| at.r.apply(b.lift()));
                columns(tree, poses, motion, *frame, &at, rate, |c| {
                    for (row, &b) in world.iter().enumerate() {
                        j[row * n + c.joint] = if rate { at.w.cross(b).dot(c.angular) + b.dot(c.angular_dot) } else { b.dot(c.angular) };
                    }
                });
            }
            TaskFunction::Relative { frame, reference, rows } => {
                let of = |frame: usize| if rate { moving(tree, poses, motion, frame) } else { placed(tree, poses, frame) };
                let (f, r) = (of(*frame), of(*reference));
                let (d, d_dot) = (f.p - r.p, f.u - r.u);
                let mut add = |c: &Column<S>, linear: Vector3<S>, angular: Vector3<S>, linear_dot: Vector3<S>, angular_dot: Vector3<S>| {
                    // The rate of R_r' x is R_r'(x' - w_r x x).
                    let (linear, angular) =
                        if rate { (linear_dot - r.w.cross(linear), angular_dot - r.w.cross(angular)) } else { (linear, angular) };
                    let (linear, angular) = (r.r.apply_transposed(linear), r.r.apply_transposed(angular));
                    for (row, &axis) in rows.iter().enumerate() {
                        j[row * n + c.joint] += if axis < 3 { linear[axis] } else { angular[axis - 3] };
                    }
                };
                columns(tree, poses, motion, *frame, &f, rate, |c| add(&c, c.linear, c.angular, c.linear_dot, c.angular_dot));
                columns(tree, poses, motion, *reference, &r, rate, |c| {
                    let linear = d.cross(c.angular) - c.linear;
                    let linear_dot = d_dot.cross(c.angular) + d.cross(c.angular_dot) - c.linear_dot;
                    add(&c, linear, -c.angular, linear_dot, -c.angular_dot);
                });
            }
        }
    }

    pub(super) fn gather_subtrees(&mut self, rate: bool) {
        let n = self.n();
        for (i, body) in self.tree.bodies.iter().enumerate() {
            let m = body.inertia.mass;
            let arm = self.poses[i].rotation.apply(body.inertia.moment);
            let momentum = if rate { self.motion[i].0.cross_add(arm, self.motion[i].1.scale(m)) } else { Vector3::zero() };
            self.subtrees[i] = (m, self.poses[i].origin.scale_add(m, arm), momentum);
        }
        for i in (0..n).rev() {
            let parent = self.tree.bodies[i].parent;
            if parent != BASE {
                let (m, h, p) = self.subtrees[i];
                let up = &mut self.subtrees[parent];
                *up = (up.0 + m, up.1 + h, up.2 + p);
            }
        }
    }
}

impl TaskStack {
    /// The same tasks on another number.
    pub fn lift<S: Real>(&self) -> TaskStack<S> {
        TaskStack::of_tree(self.tree.lift(), self.functions.clone())
    }
}

pub(super) fn placed<S: Real>(tree: &Tree<S>, poses: &[Pose<S>], frame: usize) -> Moving<S> {
    let (r, p) = super::jacobian::of_frame(tree, poses, frame);
    Moving { r, p, w: Vector3::zero(), u: Vector3::zero() }
}

fn moving<S: Real>(tree: &Tree<S>, poses: &[Pose<S>], motion: &[(Vector3<S>, Vector3<S>)], frame: usize) -> Moving<S> {
    let at = placed(tree, poses, frame);
    match tree.frames[frame].body {
        BASE => at,
        body => {
            let (w, u) = motion[body];
            Moving { w, u: w.cross_add(at.p - poses[body].origin, u), ..at }
        }
    }
}

/// The columns of the geometric Jacobian of a frame, joint by joint from the frame to the base.
fn columns<S: Real>(
    tree: &Tree<S>,
    poses: &[Pose<S>],
    motion: &[(Vector3<S>, Vector3<S>)],
    frame: usize,
    at: &Moving<S>,
    rate: bool,
    mut put: impl FnMut(Column<S>),
) {
    let mut i = tree.frames[frame].body;
    let none = Vector3::zero();
    while i != BASE {
        let (z, o, revolute) = (poses[i].z(), poses[i].origin, tree.bodies[i].revolute);
        let (linear, angular) = if revolute { (z.cross(at.p - o), z) } else { (z, none) };
        let (linear_dot, angular_dot) = if !rate {
            (none, none)
        } else {
            let (w, u) = motion[i];
            let z_dot = w.cross(z);
            if revolute { (z_dot.cross_add(at.p - o, z.cross(at.u - u)), z_dot) } else { (z_dot, none) }
        };
        put(Column { joint: i, linear, angular, linear_dot, angular_dot });
        i = tree.bodies[i].parent;
    }
}
