//! Vectors, rotations, placements and inertias over one number, or one number per lane.
//!
//! Spatial vectors are linear first, `[v; w]` and `[f; n]`. The ten inertial parameters of a body are
//! `m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz` with the inertia about the body-frame origin
//! (the order of Pinocchio's `toDynamicParameters`). Only this file defines these orders.

#[doc(hidden)]
mod inertia;
#[doc(hidden)]
mod matrix;
pub mod pseudo_inertia;
#[doc(hidden)]
mod quarter_turn;
mod rotation_log;
mod rotation_rate;
#[doc(hidden)]
mod vector;

pub use inertia::{Inertia, PARAMETERS, parameter};
pub use matrix::{Matrix, RotationMatrix, Sym3};
pub use nalgebra::{Matrix3, Vector3};
pub use quarter_turn::QuarterTurn;
pub use rotation_log::{rotation_exp, rotation_log};
pub use rotation_rate::rotation_rate;
pub use vector::{Lift, Vector};

use crate::scalar::Real;

/// First row of the linear part of a spatial vector.
pub const LINEAR: usize = 0;
/// First row of the angular part of a spatial vector.
pub const ANGULAR: usize = 3;

/// `x_A = rotation x_B + translation`: the placement of frame B in frame A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// `R_AB`.
    pub rotation: Matrix3<f64>,
    /// `p_AB`, m.
    pub translation: Vector3<f64>,
}

impl Placement {
    /// The placement of a frame in itself.
    pub const IDENTITY: Placement = Placement { rotation: Matrix3::IDENTITY, translation: Vector3::new(0.0, 0.0, 0.0) };

    /// `Rz(yaw) Ry(pitch) Rx(roll)` and a translation, the convention of URDF.
    pub fn from_rpy(rpy: [f64; 3], xyz: [f64; 3]) -> Self {
        Placement { rotation: Matrix3::from_rpy(rpy), translation: Vector3::from(xyz) }
    }

    /// The placement of C in A, from the placement of B in A (`self`) and of C in B.
    pub fn then(&self, other: &Placement) -> Placement {
        Placement { rotation: self.rotation.times(other.rotation), translation: self.rotation.apply(other.translation) + self.translation }
    }

    /// The placement of A in B.
    pub fn inverse(&self) -> Placement {
        Placement { rotation: self.rotation.transpose(), translation: -self.rotation.apply_transposed(self.translation) }
    }
}

/// A spatial motion or force: `[linear; angular]` at a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spatial<S: Real> {
    /// Linear part.
    pub linear: Vector3<S>,
    /// Angular part.
    pub angular: Vector3<S>,
}

impl<S: Real> Spatial<S> {
    /// Zero.
    #[inline]
    pub fn zero() -> Self {
        Spatial { linear: Vector3::zero(), angular: Vector3::zero() }
    }
}
