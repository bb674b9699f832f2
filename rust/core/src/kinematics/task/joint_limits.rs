//! A task that keeps chosen joints within narrowed limits. The error of a joint is the nearest position within these limits, minus its
//! present position. The Jacobian has rows of the identity.

use super::TaskFunction;
use super::kind::{TaskKind, chosen};
use super::posture::identity_rows;
use crate::arm::{Arm, Joint, Tree};
use crate::error::{Error, Result};
use crate::kinematics::Bodies;
use crate::scalar::Real;

/// A task that keeps chosen joints between the narrowed limits `lower` and `upper`.
///
/// ```
/// use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
/// use armlet_core::kinematics::task::JointLimits;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::from_urdf(example_urdf("planar_2r")?, "planar_2r", STANDARD_GRAVITY, None, None)?;
/// // Of the range of 5.6 rad, a quarter at each end is excluded. Only the elbow has limits.
/// let task = TaskFunction::joint_limits(&arm, None, 0.25)?;
/// let TaskFunction::JointLimits(JointLimits { joints, upper, .. }) = &task else { panic!() };
/// assert!(joints == &[1] && (upper[0] - 1.4).abs() < 1e-15);
/// # let mut stack = TaskStack::new(&arm, vec![task]);
/// # stack.place(&[0.0, 2.0]);
/// # let (mut e, mut w) = ([0.0], [0.0]);
/// stack.error(0, &[], &mut e, &mut w, None); // at q2 = 2 rad
/// assert!((e[0] + 0.6).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimits {
    /// Indices of the joints.
    pub joints: Vec<usize>,
    /// Lower narrowed limits of these joints, rad or m.
    pub lower: Vec<f64>,
    /// Upper narrowed limits of these joints, rad or m.
    pub upper: Vec<f64>,
}

impl TaskFunction {
    /// Create the task for `joints`, by name; `None` means all joints that have limits. `margin`, 0 to 0.5, is the fraction of the range
    /// that is excluded at each end. With 0.5, the task moves joints to the middle of their range.
    /// Errors: `Input` for another margin, a joint without two finite limits, or no joint; `Unknown` for a name.
    pub fn joint_limits(arm: &Arm, joints: Option<&[String]>, margin: f64) -> Result<Self> {
        if !(0.0..=0.5).contains(&margin) {
            return Err(Error::input("margin", format!("is not a part of the range: expected 0 <= margin <= 0.5, got {margin}")));
        }
        let movers: Vec<&Joint> = arm.independent().collect();
        let limited = |i: &usize| movers[*i].limits.lower.is_finite() && movers[*i].limits.upper.is_finite();
        let joints: Vec<usize> = match joints {
            None => (0..arm.n()).filter(limited).collect(),
            Some(names) => chosen(arm, names)?,
        };
        if let Some(&i) = joints.iter().find(|i| !limited(i)) {
            return Err(Error::input("joints", format!("has no limits: expected joints with two finite limits, got {}", movers[i].name)));
        }
        if joints.is_empty() {
            return Err(Error::input("arm", "has no joint with limits: expected at least one, got none"));
        }
        let narrowed = |i: usize, from_lower: f64| {
            let limits = &movers[i].limits;
            limits.lower + from_lower * (limits.upper - limits.lower)
        };
        let lower = joints.iter().map(|&i| narrowed(i, margin)).collect();
        let upper = joints.iter().map(|&i| narrowed(i, 1.0 - margin)).collect();
        Ok(JointLimits { joints, lower, upper }.into())
    }
}

impl TaskKind for JointLimits {
    fn rows(&self) -> usize {
        self.joints.len()
    }

    /// The target has no entries, because the limits are the target.
    fn target_size(&self) -> usize {
        0
    }

    fn bodies<S: Real>(&self, _: &Tree<S>) -> usize {
        0
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, _: &[S], e: &mut [S]) {
        for (row, &joint) in self.joints.iter().enumerate() {
            e[row] = at.q[joint].max(S::splat(self.lower[row])).min(S::splat(self.upper[row])) - at.q[joint];
        }
    }

    fn feedforward<S: Real>(&self, _: &Bodies<S>, _: [&[S]; 3], w: &mut [S], a: Option<&mut [S]>) {
        w.fill(S::zero());
        if let Some(a) = a {
            a.fill(S::zero());
        }
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        if !rate {
            identity_rows(&self.joints, at.n(), j);
        }
    }
}
