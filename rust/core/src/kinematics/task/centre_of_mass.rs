//! A task on rows of the centre of mass `c`. Error: `c_d - c`. Jacobian: `sum m_b J_b / m_total` over the bodies `b`.
//!
//! The column of a revolute joint is `z x (H - m o) / m_total`. Here `z` is the joint axis, and `o` is the origin of the joint. `m` is the
//! mass of its subtree, and `H` is the first moment of the subtree about the world origin.

use super::{TaskFunction, TaskKind};
use crate::arm::{Arm, BASE, Tree};
use crate::error::{Error, Result};
use crate::kinematics::Bodies;
use crate::kinematics::coordinates::parse_axes;
use crate::kinematics::jacobian::put;
use crate::scalar::Real;
use crate::spatial::{Vector, Vector3};

/// A task on rows of the centre of mass, world axes.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::task::CentreOfMass;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let task = TaskFunction::centre_of_mass(&arm, "x")?;
/// assert_eq!(task, CentreOfMass { rows: vec![0] }.into());
/// // The centre of the straight arm, at 0.45 m, has the target 0.5 m.
/// let mut stack = TaskStack::new(&arm, vec![task]);
/// stack.place(&[0.0, 0.0]);
/// let (mut e, mut w) = ([0.0], [0.0]);
/// stack.error(0, &[0.5, 0.0, 0.0], &mut e, &mut w, None);
/// assert!((e[0] - 0.05).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CentreOfMass {
    /// Controlled rows: 0, 1, 2 for x, y, z.
    pub rows: Vec<usize>,
}

impl TaskFunction {
    /// Create the task for the rows `axes`, letters of "xyz". Errors: `Input` for other axes, or an arm without mass.
    pub fn centre_of_mass(arm: &Arm, axes: &str) -> Result<Self> {
        let rows = parse_axes(axes)?;
        if rows.iter().any(|&row| row > 2) {
            return Err(Error::input("axes", format!("names a rotation: expected letters of \"xyz\" for a centre of mass, got {axes:?}")));
        }
        let mass: f64 = arm.joints.iter().map(|joint| joint.parameters[0]).sum();
        if !(mass > 0.0) {
            return Err(Error::input("arm", format!("has no mass: expected a total mass > 0 for a centre of mass, got {mass}")));
        }
        Ok(CentreOfMass { rows }.into())
    }
}

impl TaskKind for CentreOfMass {
    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
        tree.bodies.len()
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
        at.gather_subtrees(false);
        let top = at.subtrees.iter().zip(&at.tree.bodies).filter(|(_, body)| body.parent == BASE);
        let (m, h) = top.fold((S::zero(), Vector3::zero()), |(m, h), (s, _)| (m + s.0, h + s.1));
        for ((e, &row), &x) in e.iter_mut().zip(&self.rows).zip(target) {
            *e = x - h[row] / m;
        }
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        at.gather_subtrees(rate);
        let n = at.n();
        let top = at.subtrees.iter().zip(&at.tree.bodies).filter(|(_, body)| body.parent == BASE);
        let inverse = S::splat(1.0) / top.fold(S::zero(), |sum, (subtree, _)| sum + subtree.0);
        for (i, body) in at.tree.bodies.iter().enumerate() {
            let (m, moment, momentum) = at.subtrees[i];
            let (z, o) = (at.poses[i].z(), at.poses[i].origin);
            let column = if !rate {
                if body.revolute { z.cross(moment - o.scale(m)) } else { z.scale(m) }
            } else {
                let (w, u) = at.motion[i];
                let z_dot = w.cross(z);
                if body.revolute { z_dot.cross_add(moment - o.scale(m), z.cross(momentum - u.scale(m))) } else { z_dot.scale(m) }
            };
            let (joint, multiplier) = at.tree.mover(i);
            for (row, &axis) in self.rows.iter().enumerate() {
                put(&at.tree, multiplier, &mut j[row * n + joint], column[axis] * inverse);
            }
        }
    }
}
