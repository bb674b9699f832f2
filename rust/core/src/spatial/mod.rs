//! Vectors, rotations and inertias over any number type [`Real`], and placements of `f64`.
//!
//! Spatial vectors have the linear part first: `[v; w]` and `[f; n]`. The ten inertial parameters of a body are
//! `m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz`, where the inertia is about the origin of the body frame. This is the order of
//! Pinocchio's `toDynamicParameters`. Units: kg, kg m, kg m^2.

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
pub use vector::{Lift, Vector, unit_vector};

use crate::scalar::Real;

/// The first row of the linear part of a spatial vector.
pub const LINEAR: usize = 0;
/// The first row of the angular part of a spatial vector.
pub const ANGULAR: usize = 3;

/// The placement of frame B in frame A: `x_A = rotation x_B + translation`.
///
/// ```
/// use armlet_core::spatial::{Placement, Vector3};
/// use std::f64::consts::FRAC_PI_2;
///
/// let (elbow, tip) = (Placement::from_rpy([0.0, 0.0, FRAC_PI_2], [0.5, 0.0, 0.0]), Placement::from_rpy([0.0; 3], [0.4, 0.0, 0.0]));
/// let tip_in_base = elbow.then(&tip);
/// assert_eq!(tip_in_base.translation, Vector3::new(0.5, 0.4, 0.0));
/// assert_eq!(elbow.inverse().then(&tip_in_base), tip);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The rotation `R_AB`.
    pub rotation: Matrix3<f64>,
    /// The origin of B in A, `p_AB`, m.
    pub translation: Vector3<f64>,
}

impl Placement {
    /// The placement of a frame in itself.
    pub const IDENTITY: Placement = Placement { rotation: Matrix3::IDENTITY, translation: Vector3::new(0.0, 0.0, 0.0) };

    /// Return the placement with the rotation `Rz(yaw) Ry(pitch) Rx(roll)`, angles in rad, and the translation `xyz`, m. URDF has this
    /// convention.
    pub fn from_rpy(rpy: [f64; 3], xyz: [f64; 3]) -> Self {
        Placement { rotation: Matrix3::from_rpy(rpy), translation: Vector3::from(xyz) }
    }

    /// Return the placement of C in A. `self` is the placement of B in A, and `other` is the placement of C in B.
    pub fn then(&self, other: &Placement) -> Placement {
        Placement { rotation: self.rotation.times(other.rotation), translation: self.rotation.apply(other.translation) + self.translation }
    }

    /// Return the placement of A in B. `self` is the placement of B in A.
    pub fn inverse(&self) -> Placement {
        Placement { rotation: self.rotation.transpose(), translation: -self.rotation.apply_transposed(self.translation) }
    }
}

/// A spatial motion or force at a point: `[linear; angular]`.
///
/// ```
/// use armlet_core::spatial::{Spatial, Vector, Vector3};
///
/// // The velocity of a point at `r` on a body that turns about z with 2 rad/s.
/// let (twist, r) = (Spatial { angular: Vector3::new(0.0, 0.0, 2.0), ..Spatial::<f64>::zero() }, Vector3::new(0.5, 0.0, 0.0));
/// assert_eq!(twist.angular.cross_add(r, twist.linear), Vector3::new(0.0, 1.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Spatial<S: Real> {
    /// The linear part: velocity, m/s, or force, N.
    pub linear: Vector3<S>,
    /// The angular part: angular velocity, rad/s, or moment, N m.
    pub angular: Vector3<S>,
}

impl<S: Real> Spatial<S> {
    /// Return the spatial vector zero.
    #[inline]
    pub fn zero() -> Self {
        Spatial { linear: Vector3::zero(), angular: Vector3::zero() }
    }
}
