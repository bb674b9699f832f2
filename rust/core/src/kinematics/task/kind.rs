//! The interface of a task, and the choice of its frame and joints by name.

use crate::arm::{Arm, Tree};
use crate::error::{Error, Result};
use crate::kinematics::Bodies;
use crate::scalar::Real;

/// A kind of task on an arm.
pub(crate) trait TaskKind {
    /// Number of rows of the task's Jacobian.
    fn rows(&self) -> usize;

    /// Number of entries of the task's target.
    fn target_size(&self) -> usize {
        self.rows()
    }

    /// Refuse an invalid constant target that has the right size. Errors: `Input`.
    fn require(&self, _target: &[f64]) -> Result<()> {
        Ok(())
    }

    /// Number of bodies, from the first on, that must be placed for the task.
    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize;

    /// The error `e` `(rows,)` to a target.
    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]);

    /// Compute the feed-forward velocity `w` for a target with its velocity and its acceleration. If `a` is `Some`, compute the
    /// feed-forward acceleration too.
    fn feedforward<S: Real>(&self, _at: &Bodies<S>, [_, rate, acceleration]: [&[S]; 3], w: &mut [S], a: Option<&mut [S]>) {
        w.copy_from_slice(rate);
        if let Some(a) = a {
            a.copy_from_slice(acceleration);
        }
    }

    /// Write the Jacobian, `(rows, n)`, row-major, to `j`, which contains zeros. With `rate`, write its rate `dJ/dt` instead.
    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]);
}

/// The index of the frame that an argument names.
pub(super) fn frame_of(arm: &Arm, argument: &str, name: &str) -> Result<usize> {
    arm.frame_index(name).map_err(|error| error.of_argument(argument))
}

/// Indices of joints by name. An unknown or repeated name is an error, and so is an empty list.
pub(super) fn chosen(arm: &Arm, names: &[String]) -> Result<Vec<usize>> {
    let mut joints = Vec::with_capacity(names.len());
    for name in names {
        let joint = arm.joint_index(name).map_err(|error| error.of_argument("joints"))?;
        if joints.contains(&joint) {
            return Err(Error::input("joints", format!("repeats a joint: expected each once, got {name} again")));
        }
        joints.push(joint);
    }
    if joints.is_empty() {
        return Err(Error::input("joints", "is empty: expected at least one joint, got none"));
    }
    Ok(joints)
}
