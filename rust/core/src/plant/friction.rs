//! The dry friction of a plant: one of two models.

use super::{LuGre, StickSlip};
use crate::error::{Error, Result};

/// The friction of a plant's joints, or of its motors.
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
