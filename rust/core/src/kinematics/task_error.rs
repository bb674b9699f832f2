//! Errors of the tasks of a stack at its last placement: `x_d - x` and `log(R_d R')`, and the feed-forward of their targets.

use super::task::{TaskFunction, desired_rotation, turn_between};
use super::task_stack::{TaskStack, placed};
use crate::arm::BASE;
use crate::scalar::Real;
use crate::spatial::{Lift, Matrix, Matrix3, Vector, Vector3, rotation_log};

impl<S: Real> TaskStack<S> {
    /// Error `e` and feed-forward velocity `w` of task `k`, `(rows,)` each, for its target `[x_d, x_d', x_d'']`; the feed-forward
    /// acceleration into `a` where it is asked for.
    pub fn error(&mut self, k: usize, desired: &[S], e: &mut [S], w: &mut [S], a: Option<&mut [S]>) {
        let m = self.functions[k].target_size();
        let (target, rest) = desired.split_at(m);
        let (rate, acceleration) = rest.split_at(m);
        if let TaskFunction::CentreOfMass { .. } = self.functions[k] {
            self.gather_subtrees(false);
        }
        let (tree, poses) = (&self.tree, &self.poses[..]);
        let pose_error = |rows: &[usize], r: Matrix3<S>, p: Vector3<S>, e: &mut [S]| {
            let turns = rows.iter().any(|&row| row > 2);
            let turn = if turns { rotation_log(&desired_rotation(rows, target).times(r.transpose())) } else { Vector3::zero() };
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
                let (m, h) = top.fold((S::zero(), Vector3::zero()), |(m, h), (s, _)| (m + s.0, h + s.1));
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
                    e[row] = self.q[joint].max(S::splat(lower[row])).min(S::splat(upper[row])) - self.q[joint];
                }
                w.fill(S::zero());
                if let Some(a) = a {
                    a.fill(S::zero());
                }
                return;
            }
            TaskFunction::Axis { frame, axis, across } => {
                let r = placed(tree, poses, *frame).r;
                let world = across.map(|b| r.apply(b.lift()));
                let three = |x: &[S]| Vector3::from([x[0], x[1], x[2]]);
                let (d, d_dot, d_ddot) = (three(target), three(rate), three(acceleration));
                let (one, square) = (S::splat(1.0), d.dot(d));
                let turn = turn_between(r.apply(axis.lift()), d.scale(one / square.sqrt()), world[0]);
                // The direction turns at d x d' / |d|^2.
                let spin = d.cross(d_dot).scale(one / square);
                let spin_dot = (d.cross(d_ddot) - spin.scale(S::splat(2.0) * d.dot(d_dot))).scale(one / square);
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
