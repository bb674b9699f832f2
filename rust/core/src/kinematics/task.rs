//! Task functions of an arm: error `e(q)`, feed-forward `w`, Jacobian `J(q)` and `dJ/dt`, so that a command
//! `J v = w + K e` makes the error decay (closed-loop inverse kinematics, `siciliano1990kinematic`).
//!
//! | task | error | Jacobian |
//! |---|---|---|
//! | frame | `x_d - p`, `log(R_d R')` | rows of the geometric one |
//! | posture | `q_d - q` of chosen joints | rows of the identity |
//! | centre of mass | `c_d - c` | `sum m_b J_b / m` |
//! | axis | turn vector from `a` to `a_d`, in the frame's two directions across `a` | the same rows of `R' J_w` |
//! | relative | `x_d - R_r'(p - p_r)`, `log(R_d (R_r' R)')` | `R_r'(J_v - J_v,r + [p - p_r]x J_w,r)`, `R_r'(J_w - J_w,r)` |
//! | joint limits | way back out of the margin, zero inside | rows of the identity |

use super::Coordinates;
use super::coordinates::parse_axes;
use crate::arm::Arm;
use crate::error::{Error, Result, finite};
use crate::scalar::Real;
use crate::spatial::{Matrix, Matrix3, RotationMatrix, Vector, Vector3, rotation_exp};

/// What of an arm is controlled.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskFunction {
    /// Rows of the position and orientation of a frame, world axes.
    Frame(Coordinates),
    /// Positions of chosen joints.
    Posture {
        /// Indices of the joints.
        joints: Vec<usize>,
    },
    /// Rows (0, 1, 2 for x, y, z) of the centre of mass, world axes.
    CentreOfMass {
        /// Controlled rows.
        rows: Vec<usize>,
    },
    /// The direction `axis` of a frame points along a direction of the world; `across` are two unit vectors at right angles to it.
    Axis {
        /// Index of the frame.
        frame: usize,
        /// Unit vector in the frame.
        axis: Vector3<f64>,
        /// Two unit vectors at right angles to it.
        across: [Vector3<f64>; 2],
    },
    /// Rows of the pose of a frame as seen from another frame.
    Relative {
        /// Index of the frame.
        frame: usize,
        /// Index of the frame that it is seen from.
        reference: usize,
        /// Controlled rows, as in [`Coordinates`].
        rows: Vec<usize>,
    },
    /// Chosen joints stay within the narrowed limits `lower`, `upper`.
    JointLimits {
        /// Indices of the joints.
        joints: Vec<usize>,
        /// Least positions.
        lower: Vec<f64>,
        /// Largest positions.
        upper: Vec<f64>,
    },
}

impl TaskFunction {
    /// Rows `axes` of the pose of a frame.
    pub fn frame(arm: &Arm, frame: &str, axes: &str) -> Result<Self> {
        Ok(TaskFunction::Frame(Coordinates::new(arm, frame, axes)?))
    }

    /// `joints`: names; `None`: all of them.
    pub fn posture(arm: &Arm, joints: Option<&[String]>) -> Result<Self> {
        let joints = match joints {
            None => (0..arm.n()).collect(),
            Some(names) => chosen(arm, names)?,
        };
        Ok(TaskFunction::Posture { joints })
    }

    /// `axes`: letters of "xyz".
    pub fn centre_of_mass(arm: &Arm, axes: &str) -> Result<Self> {
        let rows = parse_axes(axes)?;
        if rows.iter().any(|&row| row > 2) {
            return Err(Error::input("axes", format!("names a rotation: expected letters of \"xyz\" for a centre of mass, got {axes:?}")));
        }
        let mass: f64 = arm.joints.iter().map(|joint| joint.parameters[0]).sum();
        if !(mass > 0.0) {
            return Err(Error::input("arm", format!("has no mass: expected a total mass > 0 for a centre of mass, got {mass}")));
        }
        Ok(TaskFunction::CentreOfMass { rows })
    }

    /// `axis`: a direction of the frame, any length > 0.
    pub fn axis(arm: &Arm, frame: &str, axis: [f64; 3]) -> Result<Self> {
        let axis = direction("axis", axis)?;
        let turn = Matrix3::taking_z_to(axis);
        Ok(TaskFunction::Axis { frame: arm.frame_index(frame)?, axis, across: [turn.axis(0), turn.axis(1)] })
    }

    /// Rows `axes` of the pose of `frame` relative to `reference`.
    pub fn relative(arm: &Arm, frame: &str, reference: &str, axes: &str) -> Result<Self> {
        let known = |argument: &str, name: &str| {
            arm.frame_index(name).map_err(|error| match error {
                Error::Input { problem, .. } => Error::input(argument, problem),
                other => other,
            })
        };
        let (frame, reference) = (known("frame", frame)?, known("reference", reference)?);
        if frame == reference {
            return Err(Error::input("reference", "is the frame itself: expected another frame"));
        }
        Ok(TaskFunction::Relative { frame, reference, rows: parse_axes(axes)? })
    }

    /// All joints that have limits; `margin` is the part of the range at either end that is to be left, 0 to 0.5 (centring).
    pub fn joint_limits(arm: &Arm, joints: Option<&[String]>, margin: f64) -> Result<Self> {
        if !(0.0..=0.5).contains(&margin) {
            return Err(Error::input("margin", format!("is not a part of the range: expected 0 <= margin <= 0.5, got {margin}")));
        }
        let limited = |i: &usize| arm.joints[*i].limits.lower.is_finite() && arm.joints[*i].limits.upper.is_finite();
        let joints: Vec<usize> = match joints {
            None => (0..arm.n()).filter(limited).collect(),
            Some(names) => chosen(arm, names)?,
        };
        if let Some(&i) = joints.iter().find(|i| !limited(i)) {
            return Err(Error::input(
                "joints",
                format!("has no limits: expected joints with two finite limits, got {}", arm.joints[i].name),
            ));
        }
        if joints.is_empty() {
            return Err(Error::input("arm", "has no joint with limits: expected at least one, got none"));
        }
        let narrowed = |i: usize, from_lower: f64| {
            let limits = &arm.joints[i].limits;
            limits.lower + from_lower * (limits.upper - limits.lower)
        };
        let lower = joints.iter().map(|&i| narrowed(i, margin)).collect();
        let upper = joints.iter().map(|&i| narrowed(i, 1.0 - margin)).collect();
        Ok(TaskFunction::JointLimits { joints, lower, upper })
    }

    /// Number of rows of its Jacobian.
    pub fn rows(&self) -> usize {
        match self {
            TaskFunction::Frame(coordinates) => coordinates.m(),
            TaskFunction::Posture { joints } | TaskFunction::JointLimits { joints, .. } => joints.len(),
            TaskFunction::CentreOfMass { rows } | TaskFunction::Relative { rows, .. } => rows.len(),
            TaskFunction::Axis { .. } => 2,
        }
    }

    /// Numbers in its target: the rows, but a direction `(3,)` of an axis, and none where the limits are the target.
    pub fn target_size(&self) -> usize {
        match self {
            TaskFunction::Axis { .. } => 3,
            TaskFunction::JointLimits { .. } => 0,
            _ => self.rows(),
        }
    }

    /// Refuse a constant target that the task cannot have.
    pub fn require_target(&self, target: &[f64]) -> Result<()> {
        finite("target", target)?;
        if target.len() != self.target_size() {
            return Err(Error::input(
                "target",
                format!("has the wrong shape: expected ({},), got ({},)", self.target_size(), target.len()),
            ));
        }
        if let (TaskFunction::Axis { .. }, &[x, y, z]) = (self, target) {
            direction("target", [x, y, z])?;
        }
        Ok(())
    }
}

/// Indices of joints by name, each once.
fn chosen(arm: &Arm, names: &[String]) -> Result<Vec<usize>> {
    let mut joints = Vec::with_capacity(names.len());
    for name in names {
        let joint = arm.joint_index(name).map_err(|error| match error {
            Error::Input { problem, .. } => Error::input("joints", problem),
            other => other,
        })?;
        if joints.contains(&joint) {
            return Err(Error::input("joints", format!("repeats a joint: expected each once, got {name} again")));
        }
        joints.push(joint);
    }
    if joints.is_empty() {
        return Err(Error::input("joints", "is empty: expected at least one joint, got none"));
    }
    Ok(joints)
}

/// A unit vector along `x`.
fn direction(argument: &str, x: [f64; 3]) -> Result<Vector3<f64>> {
    finite(argument, &x)?;
    // Scaled first: squares of extreme entries would overflow or vanish.
    let most = x.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if most == 0.0 {
        return Err(Error::input(argument, "has no direction: expected a vector of length > 0, got zeros"));
    }
    let v = Vector3::from(x.map(|x| x / most));
    Ok(v.scale(1.0 / v.norm()))
}

/// The rotation whose vector has these rows, and zeros elsewhere.
pub(super) fn desired_rotation<S: Real>(rows: &[usize], target: &[S]) -> Matrix3<S> {
    let mut vector = [S::zero(); 3];
    for (&row, &x) in rows.iter().zip(target) {
        if row > 2 {
            vector[row - 3] = x;
        }
    }
    rotation_exp(vector)
}

/// The turn vector that takes the unit vector `a` to `d` the short way; `across` chooses the way from opposite to aligned.
pub(super) fn turn_between<S: Real>(a: Vector3<S>, d: Vector3<S>, across: Vector3<S>) -> Vector3<S> {
    let (axis, cosine) = (a.cross(d), a.dot(d));
    let sine = axis.dot(axis).sqrt();
    let angle = sine.atan2(cosine);
    let turns = S::zero().lt(sine);
    let part = angle / sine;
    Vector3::from(std::array::from_fn(|k| S::select(turns, axis[k] * part, across[k] * angle)))
}
