//! A task on positions of chosen joints. Error: `q_d - q`. Jacobian: rows of the identity.

use super::{TaskFunction, TaskKind, chosen};
use crate::arm::{Arm, Tree};
use crate::error::Result;
use crate::kinematics::Bodies;
use crate::scalar::Real;

/// A task on positions of chosen joints.
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
