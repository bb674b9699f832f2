//! The dry friction of a plant: one of two models.

use super::{LuGre, StickSlip};
use crate::error::{Error, Result};

/// The friction of a plant's joints, or of its motors.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::plant::{FrictionCurve, JointFriction, PlantSpec, RigidSpec, StickSlip};
///
/// let curve = FrictionCurve::new(vec![2.0], Some(vec![3.0]), None, None, None)?;
/// let friction = JointFriction::StickSlip(StickSlip { curve });
/// assert!(friction.n() == 1 && friction.bristles().is_none());
/// let arm = RigidSpec::new(Model::from(Arm::pendulum(1.0, 5.0)?)).with_friction(Some(friction.clone()))?;
/// assert!(PlantSpec::from(arm).sticks());
/// // The number of joints must agree.
/// let arm = RigidSpec::new(Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0; 2])?));
/// assert!(arm.with_friction(Some(friction)).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum JointFriction {
    /// LuGre friction, with bristles whose deflections are states of the plant.
    LuGre(LuGre),
    /// Stick-slip friction, which can hold joints at rest.
    StickSlip(StickSlip),
}

impl JointFriction {
    /// Number of joints.
    pub fn n(&self) -> usize {
        match self {
            JointFriction::LuGre(friction) => friction.curve.n(),
            JointFriction::StickSlip(friction) => friction.curve.n(),
        }
    }

    /// The LuGre friction; `None` for stick-slip friction.
    pub fn bristles(&self) -> Option<&LuGre> {
        match self {
            JointFriction::LuGre(friction) => Some(friction),
            JointFriction::StickSlip(_) => None,
        }
    }

    /// The stick-slip friction; `None` for LuGre friction.
    pub fn stick_slip(&self) -> Option<&StickSlip> {
        match self {
            JointFriction::LuGre(_) => None,
            JointFriction::StickSlip(friction) => Some(friction),
        }
    }

    /// Refuse friction whose number of joints is not `n`.
    pub(super) fn require_joints(&self, name: &str, n: usize) -> Result<()> {
        match self.n() {
            own if own == n => Ok(()),
            own => Err(Error::wrong(name, "number of joints", n, own)),
        }
    }
}
