//! The arm of a file, assembled from its links and joints. Fixed joints are merged. The code is not recursive.

use super::element::{Notes, Robot, UrdfJoint};
use super::followers;
use super::link_tree::LinkTree;
use super::options::UrdfOptions;
use super::part::Part;
use super::source::Source;
use crate::arm::{Arm, Follows, Frame, Joint, STANDARD_GRAVITY};
use crate::error::{Result, listed};
use crate::interrupt;
use crate::spatial::{Matrix, Placement, Vector, Vector3};

pub fn arm(source: &Source, mut robot: Robot, options: &UrdfOptions) -> Result<Arm> {
    let tree = LinkTree::new(source, &robot);
    let mut part = Part::new(source, &robot, &tree, options)?;
    part.check_elements(&robot)?;
    let stated = zero_limits(&robot, &part);
    let followed = followers::join(source, &mut robot, options.mimic, &part)?;
    part.check_structure(source, &robot, &tree)?;

    let mut report = notes(&robot, &part);
    report.append(&mut robot.report);
    let gravity = gravity(&robot, &part, &followed, options.gravity, &mut report);
    let mut arm = Arm { name: robot.name.clone(), joints: Vec::new(), mimics: Vec::new(), frames: Vec::new(), gravity, report };
    let mut index = vec![None; robot.joints.len()];
    let mut on_base = Vec::new();
    // Each entry has a link, the joint that leads to it, the last moving joint before that joint, and the placement of the parent link in
    // the body of the moving joint.
    let mut stack: Vec<(usize, Option<usize>, Option<usize>, Placement)> = vec![(part.base, None, None, Placement::IDENTITY)];
    while let Some((link, through, carrier, parent)) = stack.pop() {
        interrupt::check();
        let placement = through.map_or(parent, |j| parent.then(&robot.joints[j].placement));
        let frame = Frame { name: robot.links[link].name.clone(), body: carrier, placement, joint: None };
        let inertia = &robot.links[link].inertia;
        let (body, place) = match through.map(|j| (j, &robot.joints[j])) {
            Some((j, joint)) if joint.kind.is_some() => {
                let own = Some(arm.joints.len());
                index[j] = own;
                arm.frames.push(Frame { body: own, placement: Placement::IDENTITY, ..frame });
                arm.joints.push(moving(joint, carrier, placement));
                arm.merge(own, inertia, &Placement::IDENTITY);
                (own, Placement::IDENTITY)
            }
            fixed => {
                arm.frames.push(Frame { joint: fixed.map(|(_, joint)| joint.name.clone()), ..frame });
                arm.merge(carrier, inertia, &placement);
                if carrier.is_none() && !inertia.is_zero() {
                    on_base.push(robot.links[link].name.as_str());
                }
                (carrier, placement)
            }
        };
        for &j in tree.children[link].iter().rev().filter(|&&j| part.joints[j]) {
            if let Some(child) = tree.ends[j][1] {
                stack.push((child, Some(j), body, place));
            }
        }
    }
    let massless: Vec<&str> = arm.joints.iter().filter(|joint| joint.parameters[0] == 0.0).map(|joint| joint.name.as_str()).collect();
    let lines =
        [("zero mass: the bodies moved by ", massless), ("dropped: inertia of links fixed to the base, which never move: ", on_base)];
    let lines: Vec<String> =
        lines.into_iter().filter(|(_, names)| !names.is_empty()).map(|(what, names)| what.to_string() + &listed(&names)).collect();
    arm.report.extend(lines);
    arm.report.extend(stated);
    arm.report.extend(part.report(&robot, &tree));
    followers::set(&mut arm, &robot, &followed, &index)?;
    Ok(arm)
}

/// The remarks about the elements of the part, in the order of the file.
fn notes(robot: &Robot, part: &Part) -> Vec<String> {
    let links = robot.links.iter().zip(&part.links).map(|(link, inside)| (&link.notes, *inside));
    let joints = robot.joints.iter().zip(&part.joints).map(|(joint, inside)| (&joint.notes, *inside));
    let mut notes: Notes = links.chain(joints).filter(|(_, inside)| *inside).flat_map(|(notes, _)| notes.clone()).collect();
    notes.sort_by_key(|(line, _)| *line);
    notes.into_iter().map(|(_, text)| text).collect()
}

/// The lines about limits of zero in the file. In URDF, zero does not mean that there is no limit.
fn zero_limits(robot: &Robot, part: &Part) -> Vec<String> {
    let moving =
        || robot.joints.iter().zip(&part.joints).filter(|(joint, inside)| **inside && joint.kind.is_some()).map(|(joint, _)| joint);
    let line = |what: &str, zero: fn(&UrdfJoint) -> bool| {
        let names: Vec<&str> = moving().filter(|joint| zero(joint)).map(|joint| joint.name.as_str()).collect();
        (!names.is_empty()).then(|| format!("{what}: {}", listed(&names)))
    };
    let effort = line("zero effort limit in the file, which allows no torque", |joint| joint.limits.effort == 0.0);
    let velocity = line("zero velocity limit in the file, which allows no motion", |joint| joint.limits.velocity == 0.0);
    effort.into_iter().chain(velocity).collect()
}

/// Return gravity in the axes of the base, m/s^2. `given` is in these axes already. Otherwise gravity has its direction in the axes of the
/// file's root, where the joints between the root and the base are at zero. If `root` moves the base, the report has a line about this.
fn gravity(robot: &Robot, part: &Part, followed: &[Option<Follows>], given: Option<[f64; 3]>, report: &mut Vec<String>) -> [f64; 3] {
    let base = &robot.links[part.base].name;
    let mut rotation = Placement::IDENTITY;
    for &j in &part.above {
        let joint = &robot.joints[j];
        // A follower is at its offset if its leader is at zero.
        let position = followed[j].map_or(0.0, |(_, _, offset)| offset);
        let moved = joint.kind.map_or(Placement::IDENTITY, |kind| kind.displacement(joint.axis, position));
        rotation = joint.placement.then(&moved).then(&rotation);
    }
    // Adding zero removes the sign of a negative zero.
    let turned = rotation.rotation.apply_transposed(Vector3::from(STANDARD_GRAVITY)).array().map(|x| x + 0.0);
    let unplaced = part.above.iter().find(|&&j| !robot.joints[j].placed);
    let (gravity, source) = match (given, part.top, unplaced) {
        (Some(given), ..) => (given, "as given".to_string()),
        (None, None, _) => (STANDARD_GRAVITY, format!("along -z of {base}, because the joints above {base} form a cycle")),
        (None, Some(_), Some(&j)) => {
            let name = &robot.joints[j].name;
            (STANDARD_GRAVITY, format!("along -z of {base}, because the origin of joint {name} above {base} cannot be read"))
        }
        (None, Some(top), None) => {
            let moving: Vec<&str> =
                part.above.iter().rev().map(|&j| &robot.joints[j]).filter(|j| j.moves).map(|j| j.name.as_str()).collect();
            let at_zero = if moving.is_empty() { String::new() } else { format!(", with the joints between at zero: {}", listed(&moving)) };
            (turned, format!("along -z of the file's root {}{at_zero}", robot.links[top].name))
        }
    };
    if !part.above.is_empty() || part.top.is_none() {
        report.push(format!("gravity in the axes of {base}: {gravity:?} m/s^2, {source}"));
    }
    gravity
}

fn moving(joint: &UrdfJoint, parent: Option<usize>, placement: Placement) -> Joint {
    let kind = joint.kind.unwrap_or(crate::arm::JointKind::Revolute);
    Joint {
        limits: joint.limits,
        armature: joint.armature,
        damping: joint.damping,
        friction: joint.friction,
        ..Joint::new(joint.name.clone(), kind, parent, placement, joint.axis)
    }
}
