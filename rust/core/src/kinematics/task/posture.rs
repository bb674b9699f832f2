//! A task on positions of chosen joints. Error: `q_d - q`. Jacobian: rows of the identity.

use super::TaskFunction;
use super::kind::{TaskKind, chosen};
use crate::arm::{Arm, Tree};
use crate::error::Result;
use crate::kinematics::Bodies;
use crate::scalar::Real;

/// A task on positions of chosen joints.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::task::Posture;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let task = TaskFunction::posture(&arm, Some(&["joint2".into()]))?;
/// assert_eq!(task, Posture { joints: vec![1] }.into());
/// let mut stack = TaskStack::new(&arm, vec![task]);
/// stack.place(&[0.1, 0.25]);
/// let (mut e, mut w) = ([0.0], [0.0]);
/// // Target 1 rad, with the rate 0.5 rad/s.
/// stack.error(0, &[1.0, 0.5, 0.0], &mut e, &mut w, None);
/// assert_eq!((e, w), ([0.75], [0.5]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Posture {
    /// Indices of the joints.
    pub joints: Vec<usize>,
}

impl TaskFunction {
    /// Create the task for `joints`, by name; `None` means all joints. Errors: `Unknown` for a name, `Input` for a repeated
    /// or no name.
    pub fn posture(arm: &Arm, joints: Option<&[String]>) -> Result<Self> {
        let joints = match joints {
            None => (0..arm.n()).collect(),
            Some(names) => chosen(arm, names)?,
        };
        Ok(Posture { joints }.into())
    }
}

impl TaskKind for Posture {
    fn rows(&self) -> usize {
        self.joints.len()
    }

    fn bodies<S: Real>(&self, _: &Tree<S>) -> usize {
        0
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
        for ((e, &joint), &x) in e.iter_mut().zip(&self.joints).zip(target) {
            *e = x - at.q[joint];
        }
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        if !rate {
            identity_rows(&self.joints, at.n(), j);
        }
    }
}

/// Write the rows of the identity, `(n, n)`, of these joints to `j`, which contains zeros.
pub(super) fn identity_rows<S: Real>(joints: &[usize], n: usize, j: &mut [S]) {
    joints.iter().enumerate().for_each(|(row, &joint)| j[row * n + joint] = S::splat(1.0));
}
