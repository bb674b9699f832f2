//! A task on rows of the pose of a frame. Error: `p_d - p` in rows of position, and `log(R_d R')` in rows of orientation, with the position
//! `p` and the rotation matrix `R` of the frame. Jacobian: rows of the geometric Jacobian.

use super::{TaskFunction, TaskKind};
use crate::arm::{Arm, Tree};
use crate::error::Result;
use crate::kinematics::jacobian::put;
use crate::kinematics::{Bodies, Coordinates};
use crate::scalar::Real;
use crate::spatial::{Matrix, Matrix3, Vector, Vector3, rotation_exp, rotation_log};

impl TaskFunction {
    /// Create the task for the rows `axes` of the pose of a frame. Errors: as for [`Coordinates::new`].
    pub fn frame(arm: &Arm, frame: &str, axes: &str) -> Result<Self> {
        Ok(Coordinates::new(arm, frame, axes)?.into())
    }
}

impl TaskKind for Coordinates {
    fn rows(&self) -> usize {
        self.m()
    }

    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
        Bodies::below(tree, self.frame)
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
        let frame = at.frame(self.frame, false);
        pose_error(&self.rows, frame.r, frame.p, target, e);
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        let n = at.n();
        at.columns(self.frame, &at.frame(self.frame, rate), rate, |c| {
            let (linear, angular) = if rate { (c.linear_dot, c.angular_dot) } else { (c.linear, c.angular) };
            for (row, &axis) in self.rows.iter().enumerate() {
                let entry = if axis < 3 { linear[axis] } else { angular[axis - 3] };
                put(&at.tree, c.multiplier, &mut j[row * n + c.joint], entry);
            }
        });
    }
}

/// Compute the error of the pose `(r, p)` to a target with the rows `rows`.
pub(super) fn pose_error<S: Real>(rows: &[usize], r: Matrix3<S>, p: Vector3<S>, target: &[S], e: &mut [S]) {
    let turns = rows.iter().any(|&row| row > 2);
    let turn = if turns { rotation_log(&desired_rotation(rows, target).times(r.transpose())) } else { Vector3::zero() };
    for ((e, &row), &x) in e.iter_mut().zip(rows).zip(target) {
        *e = if row < 3 { x - p[row] } else { turn[row - 3] };
    }
}

/// The rotation whose rotation vector has the target's components in `rows`, and zero for each missing component.
fn desired_rotation<S: Real>(rows: &[usize], target: &[S]) -> Matrix3<S> {
    let mut vector = [S::zero(); 3];
    for (&row, &x) in rows.iter().zip(target) {
        if row > 2 {
            vector[row - 3] = x;
        }
    }
    rotation_exp(vector)
}
