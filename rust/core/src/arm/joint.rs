//! Joints and frames of an arm, as the user describes them.

use crate::spatial::{Matrix3, Placement, RotationMatrix, Vector, Vector3};
use std::ops::RangeInclusive;

/// The kind of motion of a joint.
///
/// ```
/// use armlet_core::arm::{Arm, JointKind, STANDARD_GRAVITY, example_urdf};
///
/// let arm = Arm::from_urdf(example_urdf("planar_pr")?, "planar_pr", STANDARD_GRAVITY, None, None)?;
/// let kinds: Vec<_> = arm.joints.iter().map(|joint| joint.kind).collect();
/// assert_eq!(kinds, [JointKind::Prismatic, JointKind::Revolute]);
/// assert_eq!((kinds[0].name(), kinds[0].is_angle(), kinds[1].is_angle()), ("prismatic", false, true));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
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
    /// The unit of the coordinate.
    pub fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "m" }
    }
    /// Return the displacement of the moved joint frame from the joint frame, at a position in rad or m. `axis`: unit vector.
    pub(crate) fn displacement(self, axis: [f64; 3], position: f64) -> Placement {
        let axis = Vector3::from(axis);
        if self.is_angle() {
            Placement { rotation: Matrix3::from_axis_angle(axis, position), translation: Vector3::from([0.0; 3]) }
        } else {
            Placement { rotation: Matrix3::IDENTITY, translation: axis.scale(position) }
        }
    }
    /// The unit in which a position is plausible, if it is too large for rad or m.
    pub(super) fn other_unit(self, position: f64) -> Option<&'static str> {
        let (range, unit) = if self.is_angle() { (ANGLES, "degrees") } else { (DISTANCES, "millimetres") };
        range.contains(&position.abs()).then_some(unit)
    }
    /// The unit in which the position limits are plausible, if they are too large for rad or m.
    pub fn doubtful_unit(self, limits: &Limits) -> Option<&'static str> {
        [limits.lower, limits.upper].into_iter().find_map(|end| self.other_unit(end))
    }
    /// The unit of a position in which the velocity limit is plausible, if it is too large for rad/s or m/s.
    pub fn doubtful_speed_unit(self, limits: &Limits) -> Option<&'static str> {
        let (range, unit) = if self.is_angle() { (TURNING_SPEEDS, "degrees") } else { (SPEEDS, "millimetres") };
        range.contains(&limits.velocity.abs()).then_some(unit)
    }
}

/// Position limits of a rotation that are probably in degrees, rad: more than two turns to either side. Robots with more exist, but are
/// rare. Larger numbers than these ranges stand for a joint without limits.
const ANGLES: RangeInclusive<f64> = 12.6..=7200.0;
/// Position limits of a translation that are probably in millimetres, m.
const DISTANCES: RangeInclusive<f64> = 10.1..=1e5;
/// Velocity limits of a rotation that are probably in degrees/s, rad/s.
const TURNING_SPEEDS: RangeInclusive<f64> = 50.0..=7200.0;
/// Velocity limits of a translation that are probably in mm/s, m/s.
const SPEEDS: RangeInclusive<f64> = 20.0..=1e5;

/// The limits of a joint. A limit that the model does not state is infinite.
///
/// ```
/// use armlet_core::arm::{Arm, Limits, STANDARD_GRAVITY, example_urdf};
///
/// let arm = Arm::from_urdf(example_urdf("six_axis")?, "six_axis", STANDARD_GRAVITY, None, None)?;
/// let elbow = arm.joints[2].limits;
/// assert_eq!(elbow, Limits { lower: -3.1, upper: 3.1, velocity: 3.1, effort: 100.0 });
/// assert_eq!(Limits::default().effort, f64::INFINITY);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
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
///
/// ```
/// use armlet_core::arm::Arm;
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?.with_drives(Some(&[0.02, 0.01]), None, None)?;
/// let elbow = &arm.joints[1];
/// assert_eq!((elbow.name.as_str(), elbow.parent, elbow.armature), ("joint2", Some(0), 0.01));
/// assert_eq!(elbow.placement.translation.x, 0.5);
/// // A uniform rod with 1 kg/m: its mass, and its first moment about the joint.
/// assert!((elbow.parameters[0] - 0.4).abs() < 1e-15 && (elbow.parameters[1] - 0.08).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
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
    /// Rotor inertia reflected to the joint through its gear, kg m^2, or kg for a prismatic joint. It is added to the diagonal of `M`.
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
///
/// ```
/// use armlet_core::arm::Arm;
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let arm = arm.with_frame("tool", "link2", [0.0; 3], [0.1, 0.0, 0.0])?;
/// let tool = &arm.frames[arm.frame_index("tool")?];
/// assert_eq!((tool.body, tool.placement.translation.x), (Some(1), 0.5));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
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

/// A mimic joint.
///
/// ```
/// use armlet_core::arm::{Arm, Mimic};
///
/// // The second joint turns back twice as far as the first joint.
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0; 2])?.following(&[None, Some((0, -2.0, 0.0))])?;
/// assert_eq!((arm.n(), arm.mimics[0]), (1, Mimic { joint: 1, leader: 0, multiplier: -2.0, offset: 0.0 }));
/// let mut joints = [0.0; 2];
/// arm.joint_positions(&[0.3], &mut joints);
/// assert_eq!(joints, [0.3, -0.6]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Index of the follower.
    pub joint: usize,
    /// Index of the leader, which is not a follower.
    pub leader: usize,
    /// The rate of the follower divided by the rate of the leader.
    pub multiplier: f64,
    /// The position of the follower when the leader is at zero, rad or m.
    pub offset: f64,
}
