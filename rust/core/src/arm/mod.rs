//! Arms: trees of revolute, continuous, prismatic and fixed joints. [`Arm`] is the model as the user describes it. [`Tree`] is its compiled
//! form, on which the algorithms run. Readers merge fixed joints into bodies, and keep their links as frames. A mimic joint shares one
//! degree of freedom with the joint that it follows.

mod build;
mod classic;
mod edit;
mod joint;
mod mimic;
mod outside;
#[doc(hidden)]
mod tree;
mod turns;
mod urdf;
mod urdf_examples;

pub(crate) use build::require_memory;
pub use build::{ChainJoint, JointType};
pub use classic::{Convention, DhRow};
pub use joint::{Frame, Joint, JointKind, Limits, Mimic};
pub use mimic::{Follows, Joining};
pub use outside::Outside;
pub use tree::{BASE, Body, Tree, TreeFrame, second_moment};
pub use turns::nearest_turn;
pub use urdf::Written;
#[cfg(feature = "urdf")]
pub use urdf::{MAX_BYTES, MAX_DEPTH, MimicMode, UrdfOptions, urdf_joints};
#[cfg(feature = "urdf")]
pub(crate) use urdf::{read_file, read_text};
pub use urdf_examples::{EXAMPLES, example_urdf};

use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::memory::cloned;
use crate::spatial::PARAMETERS;

/// Gravity on Earth along `-z`, m/s^2.
pub const STANDARD_GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// The model of an arm. The order of joints, and of `q`, is depth first, with siblings in the order of the description. Two arms are equal
/// if all fields except `report` are equal.
///
/// ```
/// use armlet_core::arm::{Arm, ChainJoint, Convention, DhRow, JointKind, JointType, STANDARD_GRAVITY};
///
/// // A rod of 1 m and 1 kg along x.
/// let rod = [1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0 / 3.0, 0.0, 0.0, 1.0 / 3.0];
/// let hinge = ChainJoint::new(JointType::Moving(JointKind::Revolute), [0.0, 1.0, 0.0], [0.0; 3], [0.0; 3], rod);
/// let elbow = ChainJoint { xyz: [1.0, 0.0, 0.0], ..hinge.clone() };
/// let arm = Arm::from_chain(&[hinge, elbow], STANDARD_GRAVITY)?;
/// assert_eq!((arm.n(), arm.frame_names().collect::<Vec<_>>()), (2, vec!["link1", "link2"]));
///
/// let row = DhRow { kind: JointKind::Revolute, a: 1.0, alpha: 0.0, d: 0.0, theta: 0.0, phi: rod };
/// assert_eq!(Arm::from_dh(&[row], Convention::Standard, STANDARD_GRAVITY)?.joint_names().next(), Some("joint1"));
///
/// let error = arm.frame_index("hand").unwrap_err();
/// assert_eq!(error.to_string(), "frame is unknown: expected one of the frames link1, link2, got hand");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug)]
pub struct Arm {
    /// Name of the robot.
    pub name: String,
    /// The joints, depth first, parents before children. The joints that are not mimic joints have the order of `q`.
    pub joints: Vec<Joint>,
    /// The mimic joints, in the order of `joints`.
    pub mimics: Vec<Mimic>,
    /// The frames, in the order of the description.
    pub frames: Vec<Frame>,
    /// Gravity in world axes, m/s^2.
    pub gravity: [f64; 3],
    /// Remarks of the reader, including the elements that it ignored.
    pub report: Vec<String>,
}

impl Clone for Arm {
    /// Clone the arm. The copy of a large arm takes long, so this function checks for an interrupt ([`interrupt::check`]).
    fn clone(&self) -> Self {
        Arm {
            name: self.name.clone(),
            joints: cloned(&self.joints),
            mimics: cloned(&self.mimics),
            frames: cloned(&self.frames),
            gravity: self.gravity,
            report: cloned(&self.report),
        }
    }
}

impl PartialEq for Arm {
    fn eq(&self, other: &Self) -> bool {
        (&self.name, &self.joints, &self.mimics, &self.frames, self.gravity)
            == (&other.name, &other.joints, &other.mimics, &other.frames, other.gravity)
    }
}

impl Arm {
    /// The number of coordinates: the number of joints that are not mimic joints.
    pub fn n(&self) -> usize {
        self.joints.len() - self.mimics.len()
    }

    /// The names of the joints that are not mimic joints, in the order of `q`.
    pub fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.independent().map(|joint| joint.name.as_str())
    }

    /// The names of the frames, in the order of the description.
    pub fn frame_names(&self) -> impl Iterator<Item = &str> {
        self.frames.iter().map(|frame| frame.name.as_str())
    }

    /// Return the index of the frame at the tip: the moving frame with the longest path from the base. The length of a path is the sum of
    /// the distances between its successive origins (base, joints and frame) at `q = 0`. If several paths are longest, the last frame is
    /// the tip. The result is `None` without moving frames.
    pub fn tip_frame(&self) -> Option<usize> {
        let mut reach = Vec::<f64>::with_capacity(self.joints.len());
        for joint in &self.joints {
            reach.push(joint.parent.map_or(0.0, |parent| reach[parent]) + joint.placement.translation.norm());
        }
        let moving =
            self.frames.iter().enumerate().filter_map(|(k, frame)| Some((reach[frame.body?] + frame.placement.translation.norm(), k)));
        moving.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
    }

    /// The inertial parameters of all bodies in their body frames, shape `(10 joints,)`, in the order of [`crate::spatial`]. SI units.
    pub fn parameters(&self) -> Vec<f64> {
        self.joints.iter().flat_map(|joint| joint.parameters).collect()
    }

    /// Return the arm with the inertial parameters `pi`, shape `(10 joints,)`, in the layout and the units of [`Arm::parameters`]. Any
    /// finite numbers are allowed. Errors: `WrongShape` for a wrong length, `Input` for other numbers.
    pub fn with_parameters(&self, pi: &[f64]) -> Result<Arm> {
        if pi.len() != PARAMETERS * self.joints.len() {
            return Err(Error::wrong("parameters", "length", format!("{} (10 per joint)", PARAMETERS * self.joints.len()), pi.len()));
        }
        finite("parameters", pi)?;
        let mut arm = self.clone();
        for (joint, p) in arm.joints.iter_mut().zip(pi.chunks_exact(PARAMETERS)) {
            interrupt::check();
            joint.parameters.copy_from_slice(p);
        }
        Ok(arm)
    }

    /// Return the arm with other drives, shape `(n,)` each. `armature`: rotor inertia, kg m^2 or kg. `damping`: viscous friction, N m s/rad
    /// or N s/m. `friction`: Coulomb friction, N m or N. Any finite numbers are allowed. `None` keeps the present values.
    /// Errors: `WrongShape` for a wrong length, `Input` for other numbers.
    pub fn with_drives(&self, armature: Option<&[f64]>, damping: Option<&[f64]>, friction: Option<&[f64]>) -> Result<Arm> {
        type Part = fn(&mut Joint) -> &mut f64;
        let parts: [(_, _, Part); 3] = [
            ("armature", armature, |joint| &mut joint.armature),
            ("damping", damping, |joint| &mut joint.damping),
            ("friction", friction, |joint| &mut joint.friction),
        ];
        let mut arm = self.clone();
        for (name, values, part) in parts {
            let Some(values) = values else { continue };
            if values.len() != self.n() {
                return Err(Error::wrong(name, "length", self.n(), values.len()));
            }
            finite(name, values)?;
            for (i, &value) in self.independent_indices().into_iter().zip(values) {
                *part(&mut arm.joints[i]) = value;
            }
        }
        Ok(arm)
    }

    /// Return the arm with another gravity, world axes, m/s^2. Errors: `Input` for numbers that are not finite.
    pub fn with_gravity(&self, gravity: [f64; 3]) -> Result<Arm> {
        finite("gravity", &gravity)?;
        Ok(Arm { gravity, ..self.clone() })
    }

    /// Return the index of the frame `name`. Errors: `Unknown`, with a list of all frames.
    pub fn frame_index(&self, name: &str) -> Result<usize> {
        index_of(self.frame_names(), name).ok_or_else(|| Error::unknown("frame", "frames", self.frame_names(), name))
    }

    /// Return the index in `q` of the joint `name`. Errors: `Unknown`, with a list of all joints that are not mimic joints.
    pub fn joint_index(&self, name: &str) -> Result<usize> {
        index_of(self.joint_names(), name).ok_or_else(|| Error::unknown("joint", "joints", self.joint_names(), name))
    }
}

/// Refuse a new name that a file cannot represent. XML allows no control characters below U+0020 except tab, newline and carriage return.
/// Many readers end a name at NUL.
pub(crate) fn writable(argument: &str, name: &str) -> Result<()> {
    let bad = |c: char| (c < ' ' && !matches!(c, '\t' | '\n' | '\r')) || matches!(c, '\u{fffe}' | '\u{ffff}');
    match name.chars().find(|c| bad(*c)) {
        None => Ok(()),
        Some(c) => Err(Error::input(argument, format!("holds a control character: expected text, got U+{:04X} in {name:?}", c as u32))),
    }
}

fn index_of<'a>(mut names: impl Iterator<Item = &'a str>, name: &str) -> Option<usize> {
    names.position(|known| known == name)
}
