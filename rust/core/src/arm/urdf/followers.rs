//! Mimic joints of a file: `<mimic joint= multiplier= offset=/>`. A *follower* is a mimic joint, and its *leader* the joint that it
//! follows.

use super::element::{Robot, UrdfJoint};
use super::options::MimicMode;
use super::source::Source;
use crate::arm::mimic::{Leader, Moved, no_motion, resolved};
use crate::arm::{Arm, Follows};
use crate::error::Result;
use std::collections::HashMap;

impl UrdfJoint {
    fn moved(&self) -> Moved {
        Moved { limits: self.limits, armature: self.armature, damping: self.damping, friction: self.friction }
    }
}

/// For each joint of the file, find the joint without a leader that it follows. Drives and limits of followers are combined with the drives
/// and limits of their leaders. Errors: `Model`.
pub fn join(source: &Source, robot: &mut Robot, mode: MimicMode) -> Result<Vec<Option<Follows>>> {
    let index: HashMap<&str, usize> = robot.joints.iter().enumerate().map(|(i, joint)| (joint.name.as_str(), i)).collect();
    let mut given = vec![None; robot.joints.len()];
    for (joint, given) in robot.joints.iter().zip(&mut given) {
        let Some(mimic) = &joint.mimic else { continue };
        let fault = |problem: &str| source.error(mimic.line, format!("joint {} mimics {}, {problem}", joint.name, mimic.leader));
        if mode == MimicMode::Independent {
            let kept = format!("line {}: joint {} mimics {}: kept as an independent joint", mimic.line, joint.name, mimic.leader);
            robot.report.push(kept);
            continue;
        }
        let leader = *index.get(mimic.leader.as_str()).ok_or_else(|| fault("which is no joint"))?;
        if robot.joints[leader].kind.is_none() {
            return Err(fault("which is fixed"));
        }
        *given = Some((leader, mimic.multiplier, mimic.offset));
    }
    let followed = resolved(&given).map_err(|i| {
        let joint = &robot.joints[i];
        let line = joint.mimic.as_ref().map_or(joint.line, |mimic| mimic.line);
        source.error(line, format!("joint {} mimics itself, directly or by way of others", joint.name))
    })?;
    for (i, follows) in followed.iter().enumerate() {
        let Some((leader, multiplier, offset)) = *follows else { continue };
        let (sum, empty) = robot.joints[leader].moved().with(&robot.joints[i].moved(), multiplier, offset);
        if empty {
            robot.report.push(no_motion(&robot.joints[i].name, &robot.joints[leader].name));
        }
        let of = &mut robot.joints[leader];
        (of.limits, of.armature, of.damping, of.friction) = (sum.limits, sum.armature, sum.damping, sum.friction);
        let own = &mut robot.joints[i];
        (own.armature, own.damping, own.friction) = (0.0, 0.0, 0.0);
    }
    Ok(followed)
}

/// Set the mimic joints of an arm. `index` maps joints of the file to joints of the arm.
pub fn set(arm: &mut Arm, robot: &Robot, followed: &[Option<Follows>], index: &[Option<usize>]) -> Result<()> {
    let pair = |(follows, joint): (&Option<Follows>, &Option<usize>)| {
        let ((leader, multiplier, offset), joint) = ((*follows)?, (*joint)?);
        let of = &robot.joints[leader];
        Some((joint, Leader { at: index[leader], name: of.name.clone(), moved: of.moved(), multiplier, offset }))
    };
    let pairs: Vec<(usize, Leader)> = followed.iter().zip(index).filter_map(pair).collect();
    arm.set_mimics(pairs)?;
    arm.report_mimics();
    Ok(())
}
