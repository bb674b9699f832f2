//! Joints and frames of the model, as the user describes them.

use crate::spatial::Placement;

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Rotation within limits.
    Revolute,
    /// Revolute without position limits.
    Continuous,
    /// Translation along the axis.
    Prismatic,
}

impl JointKind {
    /// Whether the coordinate is an angle.
    pub fn is_angle(self) -> bool {
        self != JointKind::Prismatic
    }
    /// The name in URDF.
    pub fn name(self) -> &'static str {
        match self {
            JointKind::Revolute => "revolute",
            JointKind::Continuous => "continuous",
            JointKind::Prismatic => "prismatic",
        }
    }
}

/// Bounds of a joint; infinite if the model has none. Units: rad or m, rad/s or m/s, N m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least position, rad or m.
    pub lower: f64,
    /// Largest position, rad or m.
    pub upper: f64,
    /// Largest speed, rad/s or m/s.
    pub velocity: f64,
    /// Largest torque, N m, or force, N.
    pub effort: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, velocity: f64::INFINITY, effort: f64::INFINITY }
    }
}

/// A moving joint and the body that it carries; the body frame is the moved joint frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique in the arm.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the joint that carries the parent body, `None` for the base.
    pub parent: Option<usize>,
    /// Placement of the joint frame in the parent's body frame at `q = 0`.
    pub placement: Placement,
    /// Unit vector in the joint frame.
    pub axis: [f64; 3],
    /// Limits of position, speed and torque.
    pub limits: Limits,
    /// Rotor inertia seen at the joint, kg m^2 (kg for a slide): added to the diagonal of `M`.
    pub armature: f64,
    /// Viscous friction, N m s/rad (N s/m).
    pub damping: f64,
    /// Coulomb friction, N m (N).
    pub friction: f64,
    /// The ten inertial parameters of the body, with everything fixed to it, in SPEC order.
    pub parameters: [f64; 10],
}

impl Joint {
    /// A joint without limits, friction or mass.
    pub fn new(name: String, kind: JointKind, parent: Option<usize>, placement: Placement, axis: [f64; 3]) -> Self {
        let limits = Limits::default();
        Joint { name, kind, parent, placement, axis, limits, armature: 0.0, damping: 0.0, friction: 0.0, parameters: [0.0; 10] }
    }
}

/// A named frame fixed to a body (to the base where `body` is `None`).
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name of the frame.
    pub name: String,
    /// Index of the joint whose body carries it; `None` for the base.
    pub body: Option<usize>,
    /// Placement in the body frame.
    pub placement: Placement,
    /// The fixed joint that held it in the file, if there was one.
    pub joint: Option<String>,
}
