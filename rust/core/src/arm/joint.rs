//! Joints and frames of an arm, as the user describes them.

use crate::spatial::Placement;

/// The kind of motion of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Rotation about the axis, within limits.
    Revolute,
    /// Rotation about the axis, without position limits.
    Continuous,
    /// Translation along the axis, within limits.
    Prismatic,
}

impl JointKind {
    /// Whether the coordinate is an angle.
    pub fn is_angle(self) -> bool {
        self != JointKind::Prismatic
    }
    /// The name of the kind in URDF.
    pub fn name(self) -> &'static str {
        match self {
            JointKind::Revolute => "revolute",
            JointKind::Continuous => "continuous",
            JointKind::Prismatic => "prismatic",
        }
    }
}

/// The limits of a joint. A limit that the model does not state is infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Smallest position, rad or m.
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

/// A moving joint with its body. The body frame is the moved joint frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name of the joint, unique in the arm.
    pub name: String,
    /// The kind of motion.
    pub kind: JointKind,
    /// Index of the joint whose body is the parent. `None` for the base.
    pub parent: Option<usize>,
    /// Placement of the joint frame in the parent's body frame at `q = 0`.
    pub placement: Placement,
    /// Axis of the joint in the joint frame, a unit vector.
    pub axis: [f64; 3],
    /// Limits of position, speed and torque.
    pub limits: Limits,
    /// Rotor inertia reduced to the joint, kg m^2, or kg for a prismatic joint. It is added to the diagonal of `M`.
    pub armature: f64,
    /// Viscous friction, N m s/rad or N s/m.
    pub damping: f64,
    /// Coulomb friction, N m or N.
    pub friction: f64,
    /// The ten inertial parameters of the body in the body frame, including all bodies fixed to it, in the order of [`crate::spatial`]. SI
    /// units.
    pub parameters: [f64; 10],
}

impl Joint {
    /// Return a joint without limits, rotor inertia, friction or mass.
    pub fn new(name: String, kind: JointKind, parent: Option<usize>, placement: Placement, axis: [f64; 3]) -> Self {
        let limits = Limits::default();
        Joint { name, kind, parent, placement, axis, limits, armature: 0.0, damping: 0.0, friction: 0.0, parameters: [0.0; 10] }
    }
}

/// A named frame that is fixed to a body or to the base.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name of the frame.
    pub name: String,
    /// Index of the joint whose body has the frame. `None` for the base.
    pub body: Option<usize>,
    /// Placement of the frame in the body frame.
    pub placement: Placement,
    /// Name of the fixed joint that connects the frame to its body, if there is one.
    pub joint: Option<String>,
}
