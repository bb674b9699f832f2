//! A stack of tasks evaluated at one state: bodies are placed once, then every task writes its rows.
//!
//! Column of a turning joint `[z x (p - o); z]`, its rate `[z' x (p - o) + z x (p' - o'); z']` with `z' = w x z`; of the
//! centre of mass `z x (H - m o) / m_total` with the mass `m` and the first moment `H` of the subtree about the world origin.

use super::task::{TaskFunction, desired_rotation, turn_between};
use super::{Pose, from_parent, place_body};
use crate::arm::{Arm, BASE, Tree};
use crate::scalar::Real;
use crate::spatial::{M3, V3, rotation_log};

/// Task functions of one arm with their buffers; evaluation allocates nothing.
#[derive(Clone, Debug)]
pub struct TaskStack {
    tree: Tree<f64>,
    functions: Vec<TaskFunction>,
    rows: Vec<usize>,
    /// Bodies that some task depends on.
    needed: usize,
    trig: Vec<(f64, f64)>,
    q: Vec<f64>,
    poses: Vec<Pose<f64>>,
    /// Angular velocity of each body and velocity of its origin.
    motion: Vec<(V3<f64>, V3<f64>)>,
    /// Mass, first moment and momentum of each subtree.
    subtrees: Vec<(f64, V3<f64>, V3<f64>)>,
}

/// Position, rotation, angular velocity and velocity of a frame.
#[derive(Clone, Copy)]
struct Moving {
    r: M3<f64>,
    p: V3<f64>,
    w: V3<f64>,
    u: V3<f64>,
}

/// The column of one joint: linear and angular part, and the rates of both.
struct Column {
    joint: usize,
    linear: V3<f64>,
    angular: V3<f64>,
    linear_dot: V3<f64>,
    angular_dot: V3<f64>,
}

impl TaskStack {
    pub fn new(arm: &Arm, functions: Vec<TaskFunction>) -> Self {
        let tree = Tree::<f64>::new(arm);
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
            trig: vec![(0.0, 1.0); n],
            q: vec![0.0; n],
            poses: vec![Pose::identity(); n],
            motion: vec![(V3::zero(), V3::zero()); n],
            subtrees: vec![(0.0, V3::zero(), V3::zero()); n],
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
    pub fn rounding(&self) -> f64 {
        // Beyond 1 nothing is known of the entries, and no rank can be decided.
        (8.0 * f64::EPSILON * (1.0 + self.q.iter().map(|q| q.abs()).sum::<f64>())).min(0.5)
    }

    /// Place the bodies at `q` `(n,)`.
    pub fn place(&mut self, q: &[f64]) {
        for i in 0..self.needed {
            if self.tree.bodies[i].revolute {
                self.trig[i] = Real::sin_cos(q[i]);
            }
        }
        self.place_known(q);
    }

    /// As [`TaskStack::place`] with the (sin, cos) of the joints known.
    pub fn place_at<S: Real>(&mut self, q: &[f64], trig: &[(S, S)]) {
        for (to, from) in self.trig.iter_mut().zip(trig) {
            *to = (from.0.lane(0), from.1.lane(0));
        }
        self.place_known(q);
    }

    fn place_known(&mut self, q: &[f64]) {
        self.q.copy_from_slice(q);
        super::place(&self.tree, &self.trig, q, &mut self.poses[..self.needed]);
    }

    /// How the bodies of the last placement move at joint rates `v` `(n,)`.
    pub fn set_moving(&mut self, v: &[f64]) {
        let base = || (Pose::identity(), (V3::zero(), V3::zero()));
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
    pub fn jacobians(&mut self, j: &mut [f64]) {
        let n = self.n();
        let mut at = 0;
        j.fill(0.0);
        for k in 0..self.functions.len() {
            let m = self.rows[k];
            self.write(k, &mut j[at * n..(at + m) * n], false);
            at += m;
        }
    }

    /// The stacked `dJ/dt` `(sum rows, n)` at the rates of [`TaskStack::set_moving`].
    pub fn jacobians_dot(&mut self, j: &mut [f64]) {
        let n = self.n();
        let mut at = 0;
        j.fill(0.0);
        for k in 0..self.functions.len() {
            let m = self.rows[k];
            self.write(k, &mut j[at * n..(at + m) * n], true);
            at += m;
        }
    }

    /// The Jacobian of task `k`, or its rate, into zeros.
    fn write(&mut self, k: usize, j: &mut [f64], rate: bool) {
        let n = self.n();
        if let TaskFunction::CentreOfMass { .. } = self.functions[k] {
            self.gather_subtrees(rate);
        }
        let (tree, poses, motion) = (&self.tree, &self.poses[..], &self.motion[..]);
        match &self.functions[k] {
            TaskFunction::Posture { joints } | TaskFunction::JointLimits { joints, .. } => {
                if !rate {
                    joints.iter().enumerate().for_each(|(row, &joint)| j[row * n + joint] = 1.0);
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
                let inverse = 1.0 / self.subtrees.iter().zip(&tree.bodies).filter(|(_, b)| b.parent == BASE).map(|(s, _)| s.0).sum::<f64>();
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
                let world = across.map(|b| at.r.apply(b));
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
                let mut add = |c: &Column, linear: V3<f64>, angular: V3<f64>, linear_dot: V3<f64>, angular_dot: V3<f64>| {
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

    fn gather_subtrees(&mut self, rate: bool) {
        let n = self.n();
        for (i, body) in self.tree.bodies.iter().enumerate() {
            let m = body.inertia.mass;
            let arm = self.poses[i].rotation.apply(body.inertia.moment);
            let momentum = if rate { self.motion[i].0.cross_add(arm, self.motion[i].1.scale(m)) } else { V3::zero() };
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

    /// Error `e` and feed-forward velocity `w` of task `k`, `(rows,)` each, for its target `[x_d, x_d', x_d'']`; the feed-forward
    /// acceleration into `a` where it is asked for.
    pub fn error(&mut self, k: usize, desired: &[f64], e: &mut [f64], w: &mut [f64], a: Option<&mut [f64]>) {
        let m = self.functions[k].target_size();
        let (target, rest) = desired.split_at(m);
        let (rate, acceleration) = rest.split_at(m);
        if let TaskFunction::CentreOfMass { .. } = self.functions[k] {
            self.gather_subtrees(false);
        }
        let (tree, poses) = (&self.tree, &self.poses[..]);
        let pose_error = |rows: &[usize], r: M3<f64>, p: V3<f64>, e: &mut [f64]| {
            let turns = rows.iter().any(|&row| row > 2);
            let turn = if turns { rotation_log(&desired_rotation(rows, target).times(r.transpose())) } else { V3::zero() };
            for ((e, &row), &x) in e.iter_mut().zip(rows).zip(target) {
                *e = if row < 3 { x - p[row] } else { turn[row - 3] };
            }
        };
        match &self.functions[k] {
            TaskFunction::Frame(coordinates) => {
                let at = placed(tree, poses, coordinates.frame);
                pose_error(&coordinates.rows, at.r, at.p, e);
            }
            TaskFunction::Relative { frame, reference, rows } => {
                let (f, r) = (placed(tree, poses, *frame), placed(tree, poses, *reference));
                pose_error(rows, r.r.transpose().times(f.r), r.r.apply_transposed(f.p - r.p), e);
            }
            TaskFunction::CentreOfMass { rows } => {
                let top = self.subtrees.iter().zip(&tree.bodies).filter(|(_, body)| body.parent == BASE);
                let (m, h) = top.fold((0.0, V3::zero()), |(m, h), (s, _)| (m + s.0, h + s.1));
                for ((e, &row), &x) in e.iter_mut().zip(rows).zip(target) {
                    *e = x - h[row] / m;
                }
            }
            TaskFunction::Posture { joints } => {
                for ((e, &joint), &x) in e.iter_mut().zip(joints).zip(target) {
                    *e = x - self.q[joint];
                }
            }
            TaskFunction::JointLimits { joints, lower, upper } => {
                for (row, &joint) in joints.iter().enumerate() {
                    e[row] = self.q[joint].max(lower[row]).min(upper[row]) - self.q[joint];
                }
                w.fill(0.0);
                if let Some(a) = a {
                    a.fill(0.0);
                }
                return;
            }
            TaskFunction::Axis { frame, axis, across } => {
                let r = placed(tree, poses, *frame).r;
                let world = across.map(|b| r.apply(b));
                let three = |x: &[f64]| V3([x[0], x[1], x[2]]);
                let (d, d_dot, d_ddot) = (three(target), three(rate), three(acceleration));
                let (square, length) = (d.dot(d), d.norm());
                let turn = turn_between(r.apply(*axis), d.scale(1.0 / length), world[0]);
                // The direction turns at d x d' / |d|^2.
                let spin = d.cross(d_dot).scale(1.0 / square);
                let spin_dot = (d.cross(d_ddot) - spin.scale(2.0 * d.dot(d_dot))).scale(1.0 / square);
                for (row, &b) in world.iter().enumerate() {
                    (e[row], w[row]) = (b.dot(turn), b.dot(spin));
                }
                if let Some(a) = a {
                    a.iter_mut().zip(world).for_each(|(a, b)| *a = b.dot(spin_dot));
                }
                return;
            }
        }
        w.copy_from_slice(rate);
        if let Some(a) = a {
            a.copy_from_slice(acceleration);
        }
    }
}

fn placed(tree: &Tree<f64>, poses: &[Pose<f64>], frame: usize) -> Moving {
    let (r, p) = super::jacobian::of_frame(tree, poses, frame);
    Moving { r, p, w: V3::zero(), u: V3::zero() }
}

fn moving(tree: &Tree<f64>, poses: &[Pose<f64>], motion: &[(V3<f64>, V3<f64>)], frame: usize) -> Moving {
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
#[inline(always)]
fn columns(
    tree: &Tree<f64>,
    poses: &[Pose<f64>],
    motion: &[(V3<f64>, V3<f64>)],
    frame: usize,
    at: &Moving,
    rate: bool,
    mut put: impl FnMut(Column),
) {
    let mut i = tree.frames[frame].body;
    let none = V3::zero();
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
