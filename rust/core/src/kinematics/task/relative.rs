//! A task on the pose of a frame relative to a reference frame `r`. Rows of position have the error `x_d - R_r'(p - p_r)` and the Jacobian
//! `R_r'(J_v - J_v,r + [p - p_r]x J_w,r)`. Rows of orientation have the error `log(R_d (R_r' R)')` and the Jacobian `R_r'(J_w - J_w,r)`.
//! `p` and `R` are the position and the rotation matrix of the frame. `J_v` and `J_w` are the linear and angular rows of the geometric
//! Jacobian, and `[p]x` is the cross-product matrix. The prime is the transpose.

use super::TaskFunction;
use super::frame::pose_error;
use super::kind::{TaskKind, frame_of};
use crate::arm::{Arm, Tree};
use crate::error::{Error, Result};
use crate::kinematics::coordinates::parse_axes;
use crate::kinematics::{Bodies, Column};
use crate::scalar::Real;
use crate::spatial::{Matrix, Vector, Vector3};

/// A task on rows of the pose of a frame relative to another frame.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::task::Relative;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let task = TaskFunction::relative(&arm, "link2", "link1", "xy")?;
/// assert_eq!(task, Relative { frame: 1, reference: 0, rows: vec![0, 1] }.into());
/// // The pose of the tip relative to the first link does not depend on the first joint.
/// let mut stack = TaskStack::new(&arm, vec![task]);
/// stack.place(&[0.7, 0.0]);
/// let (mut e, mut w, mut j) = ([0.0; 2], [0.0; 2], [0.0; 4]);
/// stack.error(0, &[0.4, 0.3, 0.0, 0.0, 0.0, 0.0], &mut e, &mut w, None);
/// stack.jacobians(&mut j);
/// assert!(e[0].abs() < 1e-15 && (e[1] - 0.3).abs() < 1e-15 && j[0].abs() + j[2].abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Relative {
    /// Index of the frame.
    pub frame: usize,
    /// Index of the reference frame.
    pub reference: usize,
    /// Controlled rows, as in [`Coordinates`](crate::kinematics::Coordinates).
    pub rows: Vec<usize>,
}

impl TaskFunction {
    /// Create the task for the rows `axes` of the pose of `frame` relative to `reference`. Errors: `Unknown` for a frame, `Input` for two
    /// equal frames or invalid axes.
    pub fn relative(arm: &Arm, frame: &str, reference: &str, axes: &str) -> Result<Self> {
        let (frame, reference) = (frame_of(arm, "frame", frame)?, frame_of(arm, "reference", reference)?);
        if frame == reference {
            return Err(Error::input("reference", "is the frame itself: expected another frame"));
        }
        Ok(Relative { frame, reference, rows: parse_axes(axes)? }.into())
    }
}

impl TaskKind for Relative {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
        Bodies::below(tree, self.frame).max(Bodies::below(tree, self.reference))
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
        let (f, r) = (at.frame(self.frame, false), at.frame(self.reference, false));
        pose_error(&self.rows, r.r.transpose().times(f.r), r.r.apply_transposed(f.p - r.p), target, e);
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        let (n, f, r) = (at.n(), at.frame(self.frame, rate), at.frame(self.reference, rate));
        let (d, d_dot) = (f.p - r.p, f.u - r.u);
        let mut add = |c: &Column<S>, linear: Vector3<S>, angular: Vector3<S>, linear_dot: Vector3<S>, angular_dot: Vector3<S>| {
            // The rate of R_r' y is R_r'(y_dot - w_r x y).
            let (linear, angular) =
                if rate { (linear_dot - r.w.cross(linear), angular_dot - r.w.cross(angular)) } else { (linear, angular) };
            let (linear, angular) = (r.r.apply_transposed(linear), r.r.apply_transposed(angular));
            for (row, &axis) in self.rows.iter().enumerate() {
                let entry = if axis < 3 { linear[axis] } else { angular[axis - 3] };
                j[row * n + c.joint] += if at.tree.joining.is_some() { S::splat(c.multiplier) * entry } else { entry };
            }
        };
        at.columns(self.frame, &f, rate, |c| add(&c, c.linear, c.angular, c.linear_dot, c.angular_dot));
        at.columns(self.reference, &r, rate, |c| {
            let linear = d.cross(c.angular) - c.linear;
            let linear_dot = d_dot.cross(c.angular) + d.cross(c.angular_dot) - c.linear_dot;
            add(&c, linear, -c.angular, linear_dot, -c.angular_dot);
        });
    }
}
