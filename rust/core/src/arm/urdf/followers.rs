//! Mimic joints of a file: `<mimic joint= multiplier= offset=/>`. A *follower* is a mimic joint, and its *leader* the joint that it
//! follows.

use super::element::{Robot, UrdfJoint};
use super::options::MimicMode;
use super::part::Part;
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
/// and limits of their leaders. Faults of joints outside of the part are ignored. Errors: `Model`.
pub fn join(source: &Source, robot: &mut Robot, mode: MimicMode, part: &Part) -> Result<Vec<Option<Follows>>> {
    let names = |inside: bool| move |(i, joint): (usize, &'_ UrdfJoint)| (part.joints[i] == inside).then(|| (joint.name.clone(), i));
    let outer = robot.joints.iter().enumerate().filter_map(names(false));
    // If a joint inside the part has the same name, it is the leader.
    let index: HashMap<String, usize> = outer.chain(robot.joints.iter().enumerate().filter_map(names(true))).collect();
    let mut given = vec![None; robot.joints.len()];
    for (i, (joint, given)) in robot.joints.iter().zip(&mut given).enumerate() {
        let Some(mimic) = joint.mimic.as_ref().filter(|_| joint.fault.is_none()) else { continue };
        let line = mimic.line;
        let fault = |problem: &str| source.error(line, format!("joint {} mimics {}, {problem}", joint.name, mimic.leader));
        let leader = match index.get(&mimic.leader) {
            _ if mode == MimicMode::Independent => {
                if part.joints[i] {
                    let kept = format!("line {line}: joint {} mimics {}: kept as an independent joint", joint.name, mimic.leader);
                    robot.report.push(kept);
                }
                continue;
            }
            Some(&leader) if robot.joints[leader].fault.is_some() => {
                if part.joints[i] {
                    let kept = "which has a fault and is no part of the arm: kept as an independent joint";
                    robot.report.push(format!("line {line}: joint {} mimics {}, {kept}", joint.name, mimic.leader));
                }
                continue;
            }
            Some(&leader) if robot.joints[leader].kind.is_none() => Err(fault("which is fixed")),
            Some(&leader) => Ok(leader),
            None => Err(fault("which is no joint")),
        };
        match leader {
            Ok(leader) => *given = Some((leader, mimic.multiplier, mimic.offset)),
            Err(fault) if part.joints[i] => return Err(fault),
            Err(_) => {}
        }
    }
    let inside: Vec<usize> = (0..given.len()).filter(|&i| part.joints[i]).collect();
    // The followers above the base only matter for gravity. A cycle of them is ignored.
    let above: Vec<usize> = inside.iter().chain(&part.above).copied().collect();
    let connected = |seeds: &[usize]| resolved(&connected(&given, seeds));
    let followed = connected(&above).or_else(|_| connected(&inside)).map_err(|i| {
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

/// Return `given` without the joints that are not connected to `seeds` by leaders and followers.
fn connected(given: &[Option<Follows>], seeds: &[usize]) -> Vec<Option<Follows>> {
    let mut neighbours = vec![Vec::new(); given.len()];
    for (i, follows) in given.iter().enumerate() {
        if let Some((leader, ..)) = *follows {
            neighbours[i].push(leader);
            neighbours[leader].push(i);
        }
    }
    let (mut reached, mut stack) = (vec![false; given.len()], seeds.to_vec());
    while let Some(i) = stack.pop() {
        if !std::mem::replace(&mut reached[i], true) {
            stack.extend(&neighbours[i]);
        }
    }
    given.iter().zip(reached).map(|(follows, reached)| follows.filter(|_| reached)).collect()
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
