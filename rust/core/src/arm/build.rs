//! Arms built from lists of joints.

use super::mimic::{Leader, no_motion, resolved};
use super::{Arm, Follows, Frame, Joint, JointKind, Limits, writable};
use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::memory;
use crate::spatial::{Inertia, Placement, unit_vector};
use std::collections::HashSet;

/// The type of a joint in a list.
///
/// ```
/// use armlet_core::arm::{JointKind, JointType};
///
/// assert_eq!(JointType::parse("R"), Some(JointType::Moving(JointKind::Revolute)));
/// assert_eq!(JointType::parse("fixed"), Some(JointType::Fixed));
/// assert_eq!(JointType::parse("ball"), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointType {
    /// A joint with one degree of freedom.
    Moving(JointKind),
    /// A rigid connection, without a degree of freedom.
    Fixed,
}

impl JointType {
    /// Return the type with this name: `"R"`, `"P"`, `"F"`, or a name of URDF. The result is `None` for other names.
    pub fn parse(name: &str) -> Option<JointType> {
        Some(match name {
            "R" | "revolute" => JointType::Moving(JointKind::Revolute),
            "continuous" => JointType::Moving(JointKind::Continuous),
            "P" | "prismatic" => JointType::Moving(JointKind::Prismatic),
            "F" | "fixed" => JointType::Fixed,
            _ => return None,
        })
    }
}

/// One joint of [`Arm::from_chain`], with the body that it moves.
///
/// At `q = 0`, the joint frame has the placement `(rpy, xyz)` in the frame of the parent body. The joint rotates about `axis` or slides
/// along it. The body frame is the moved joint frame.
///
/// ```
/// use armlet_core::arm::{Arm, ChainJoint, JointKind, JointType, Limits, STANDARD_GRAVITY};
///
/// # let body = [2.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1];
/// let lift = ChainJoint {
///     name: Some("lift".into()),
///     limits: Limits { lower: 0.0, upper: 0.5, ..Limits::default() },
///     ..ChainJoint::new(JointType::Moving(JointKind::Prismatic), [0.0, 0.0, 2.0], [0.0; 3], [0.0; 3], body)
/// };
/// let flange = ChainJoint::new(JointType::Fixed, [0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, 0.3], [0.0; 10]);
/// let arm = Arm::from_chain(&[lift, flange], STANDARD_GRAVITY)?;
/// assert_eq!((arm.n(), arm.joints[0].axis), (1, [0.0, 0.0, 1.0]));
/// assert_eq!(arm.frames[arm.frame_index("link2")?].placement.translation.z, 0.3);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ChainJoint {
    /// Name of the joint. `None` selects `"joint1"`, `"joint2"`, ..
    pub name: Option<String>,
    /// Type of the joint.
    pub kind: JointType,
    /// Axis in the joint frame, dimensionless, with any length > 0.
    pub axis: [f64; 3],
    /// Roll, pitch and yaw of the joint frame in the parent body frame, rad.
    pub rpy: [f64; 3],
    /// Origin of the joint frame in the parent body frame, m.
    pub xyz: [f64; 3],
    /// Inertial parameters of the body, in the body frame, in the order of [`crate::spatial`]. SI units.
    pub phi: [f64; 10],
    /// Index of the parent joint, which must precede this joint in the list. `Some(None)` selects the base as the parent. `None` selects
    /// the previous joint of the list, or the base for the first joint.
    pub parent: Option<Option<usize>>,
    /// Limits of position, speed and torque.
    pub limits: Limits,
    /// Rotor inertia reflected to the joint through its gear, kg m^2, or kg for a prismatic joint.
    pub armature: f64,
    /// Viscous friction, N m s/rad or N s/m.
    pub damping: f64,
    /// Coulomb friction, N m or N.
    pub friction: f64,
    /// The leader of a mimic joint, as `(index, multiplier, offset)` with `q = multiplier q_leader + offset`.
    pub mimic: Option<Follows>,
}

impl ChainJoint {
    /// Return a joint without limits, rotor inertia and friction. Its parent is the previous joint of the list.
    pub fn new(kind: JointType, axis: [f64; 3], rpy: [f64; 3], xyz: [f64; 3], phi: [f64; 10]) -> Self {
        let limits = Limits::default();
        ChainJoint { name: None, kind, axis, rpy, xyz, phi, parent: None, limits, armature: 0.0, damping: 0.0, friction: 0.0, mimic: None }
    }
}

/// The approximate memory of a joint in an arm and in its model, including names, in bytes.
const BYTES_PER_JOINT: usize = 4096;

/// Refuse a number of joints that needs more memory than is available, before allocation begins. Errors: `Memory`.
pub(crate) fn require_memory(joints: usize) -> Result<()> {
    memory::require(joints.saturating_mul(BYTES_PER_JOINT))
}

impl Arm {
    /// Return an arm from a list of joints. `gravity`: world axes, m/s^2. The frames `"link1"`, .. are the body frames, one per list entry,
    /// including fixed joints. The joints in `q` are in depth-first order, and siblings keep the order of the list. Errors: `Input`,
    /// `Memory`.
    pub fn from_chain(list: &[ChainJoint], gravity: [f64; 3]) -> Result<Arm> {
        finite("gravity", &gravity)?;
        if list.is_empty() {
            return Err(Error::input("joints", "is empty: expected at least one joint, got none"));
        }
        require_memory(list.len())?;
        let parents = parents_of(list)?;
        let mut arm = Arm { name: "chain".into(), joints: Vec::new(), mimics: Vec::new(), frames: Vec::new(), gravity, report: Vec::new() };
        // For each list entry: the moving joint whose body contains it, and its placement in the frame of this body.
        let mut place: Vec<(Option<usize>, Placement)> = vec![(None, Placement::IDENTITY); list.len()];
        let mut names = HashSet::new();
        let mut index = vec![None; list.len()];
        for i in depth_first(&parents) {
            interrupt::check();
            let item = &list[i];
            let (body, base) = parents[i].map_or((None, Placement::IDENTITY), |p| place[p]);
            let at = |what: &str| format!("joints[{i}].{what}");
            for (what, values) in [("rpy", &item.rpy[..]), ("xyz", &item.xyz), ("phi", &item.phi)] {
                finite(&at(what), values)?;
            }
            for (what, value) in [("armature", item.armature), ("damping", item.damping), ("friction", item.friction)] {
                finite(&at(what), &[value])?;
            }
            let placement = base.then(&Placement::from_rpy(item.rpy, item.xyz));
            let name = item.name.clone().unwrap_or_else(|| format!("joint{}", i + 1));
            writable(&at("name"), &name)?;
            let frame = Frame { name: format!("link{}", i + 1), body, placement, joint: Some(name.clone()) };
            match item.kind {
                JointType::Fixed => {
                    place[i] = (body, placement);
                    arm.merge(body, &Inertia::from_parameters(&item.phi), &placement);
                    arm.frames.push(frame);
                }
                JointType::Moving(kind) => {
                    if !names.insert(name.clone()) {
                        return Err(Error::input(at("name"), format!("is a duplicate: expected distinct names, got {name} again")));
                    }
                    index[i] = Some(arm.joints.len());
                    place[i] = (index[i], Placement::IDENTITY);
                    arm.frames.push(Frame { body: Some(arm.joints.len()), placement: Placement::IDENTITY, joint: None, ..frame });
                    arm.joints.push(Joint {
                        limits: item.limits,
                        armature: item.armature,
                        damping: item.damping,
                        friction: item.friction,
                        parameters: item.phi,
                        ..Joint::new(name, kind, body, placement, unit(&at("axis"), item.axis)?)
                    });
                }
            }
        }
        arm.follow(&list.iter().map(|item| item.mimic).collect::<Vec<_>>(), &index)?;
        Ok(arm)
    }

    /// Return the arm with mimic joints. `given`: for each joint its leader, multiplier and offset, or `None`. Errors: `Input` for an
    /// invalid leader or number, or too many joints.
    pub fn following(mut self, given: &[Option<Follows>]) -> Result<Arm> {
        let index: Vec<Option<usize>> = (0..self.joints.len()).map(Some).collect();
        self.follow(given, &index)?;
        Ok(self)
    }

    /// Connect mimic joints with their leaders. `index` maps entries of the list to joints of the arm.
    fn follow(&mut self, given: &[Option<Follows>], index: &[Option<usize>]) -> Result<()> {
        for (i, follows) in given.iter().enumerate() {
            let Some((leader, multiplier, offset)) = *follows else { continue };
            let refused = |problem: &str| Err(Error::input(format!("joints[{i}].mimic"), problem.to_string()));
            finite(&format!("joints[{i}].mimic"), &[multiplier, offset])?;
            if leader >= given.len() {
                return refused(&format!("is out of range: expected an index below {}, got {leader}", given.len()));
            }
            if index[leader].is_none() || index[i].is_none() {
                return refused("is for joints that move: expected no fixed joint on either side");
            }
        }
        let followed = resolved(given).map_err(|i| {
            Error::input(format!("joints[{i}].mimic"), "leads back to the joint itself: expected a leader that follows no follower of it")
        })?;
        let mut pairs = Vec::new();
        for (follows, joint) in followed.into_iter().zip(index) {
            let (Some((leader, multiplier, offset)), Some(joint)) = (follows, *joint) else { continue };
            let Some(at) = index[leader] else { continue };
            let (of, own) = (&self.joints[at], &self.joints[joint]);
            let (sum, empty) = of.moved().with(&own.moved(), multiplier, offset);
            if empty {
                self.report.push(no_motion(&own.name, &of.name));
            }
            pairs.push((joint, Leader { at: Some(at), name: of.name.clone(), moved: of.moved(), multiplier, offset }));
            self.joints[at].set_moved(&sum);
            self.joints[joint].undriven();
        }
        self.set_mimics(pairs)?;
        self.report_mimics();
        Ok(())
    }

    /// Add a body that is fixed to body `body`. A body that is fixed to the base does not move and has no effect.
    pub(super) fn merge(&mut self, body: Option<usize>, inertia: &Inertia<f64>, placement: &Placement) {
        if let Some(b) = body {
            let sum = Inertia::from_parameters(&self.joints[b].parameters).plus(&inertia.placed(placement));
            sum.write_parameters(&mut self.joints[b].parameters);
        }
    }
}

fn parents_of(list: &[ChainJoint]) -> Result<Vec<Option<usize>>> {
    let parent = |(i, item): (usize, &ChainJoint)| match item.parent {
        None => Ok(i.checked_sub(1)),
        Some(Some(p)) if p >= i => {
            Err(Error::input(format!("joints[{i}].parent"), format!("is not an earlier joint: expected an index below {i}, got {p}")))
        }
        Some(parent) => Ok(parent),
    };
    list.iter().enumerate().map(parent).collect()
}

/// Return the indices in depth-first order. Siblings have the order of the list. The function is not recursive.
pub(super) fn depth_first(parents: &[Option<usize>]) -> Vec<usize> {
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); parents.len()];
    let mut stack = Vec::new();
    for (i, parent) in parents.iter().enumerate().rev() {
        match parent {
            Some(p) => children[*p].push(i),
            None => stack.push(i),
        }
    }
    let mut order = Vec::with_capacity(parents.len());
    while let Some(i) = stack.pop() {
        order.push(i);
        stack.append(&mut children[i]);
    }
    order
}

/// Return the unit vector along `axis`. Errors: `Input` for an axis that is zero or not finite.
pub(super) fn unit(argument: &str, axis: [f64; 3]) -> Result<[f64; 3]> {
    finite(argument, &axis)?;
    unit_vector(axis).ok_or_else(|| Error::input(argument, "is zero: expected a vector with a direction, got (0, 0, 0)"))
}
