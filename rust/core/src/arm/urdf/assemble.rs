//! The arm of a file, assembled from its links and joints: one root, no cycles, fixed joints merged. The code is not recursive.

use super::element::{Robot, UrdfJoint};
use super::followers;
use super::options::UrdfOptions;
use super::source::Source;
use crate::arm::{Arm, Frame, Joint};
use crate::error::{Error, Result, listed};
use crate::interrupt::look;
use crate::spatial::Placement;
use std::collections::HashMap;

pub fn arm(source: &Source, mut robot: Robot, options: &UrdfOptions) -> Result<Arm> {
    let UrdfOptions { gravity, root, tip, mimic } = *options;
    let followed = followers::join(source, &mut robot, mimic)?;
    let tree = LinkTree::new(source, &robot)?;
    let named = |argument: &str, name: &str| {
        tree.index.get(name).copied().ok_or_else(|| Error::unknown(argument, "links", robot.links.iter().map(|l| l.name.as_str()), name))
    };
    let base = root.map_or(Ok(tree.root), |name| named("root", name))?;
    let path = tip.map(|name| named("tip", name).and_then(|tip| tree.path(&robot, base, tip))).transpose()?;

    let mut arm =
        Arm { name: robot.name.clone(), joints: Vec::new(), mimics: Vec::new(), frames: Vec::new(), gravity, report: robot.report.clone() };
    let mut index = vec![None; robot.joints.len()];
    let (mut cut, mut on_base) = (Vec::new(), Vec::new());
    // Each entry has a link, the joint that leads to it, the last moving joint before that joint, and the placement of the parent link in
    // the body of the moving joint.
    let mut stack: Vec<(usize, Option<usize>, Option<usize>, Placement)> = vec![(base, None, None, Placement::IDENTITY)];
    while let Some((link, through, carrier, parent)) = stack.pop() {
        look();
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
        for &j in tree.children[link].iter().rev() {
            let child = tree.child[j];
            if robot.joints[j].kind.is_some() && path.as_ref().is_some_and(|on| !on[child]) {
                cut.push(robot.joints[j].name.as_str());
            } else {
                stack.push((child, Some(j), body, place));
            }
        }
    }
    cut.reverse();
    let massless = arm.joints.iter().filter(|joint| joint.parameters[0] == 0.0).map(|joint| joint.name.as_str()).collect();
    let kept: Vec<String> = [
        ("zero mass: the bodies moved by ", massless),
        ("dropped: inertia of links fixed to the base, which never move: ", on_base),
        ("dropped: joints off the path from root to tip, and what they carry: ", cut),
    ]
    .into_iter()
    .filter(|(_, names)| !names.is_empty())
    .map(|(what, names)| what.to_string() + &listed(&names))
    .collect();
    arm.report.extend(kept);
    followers::set(&mut arm, &robot, &followed, &index)?;
    Ok(arm)
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

struct LinkTree<'r> {
    index: HashMap<&'r str, usize>,
    root: usize,
    /// The joints that start at each link, in file order.
    children: Vec<Vec<usize>>,
    /// The joint that leads to each link.
    joint_of: Vec<Option<usize>>,
    /// For each joint, the link that it moves.
    child: Vec<usize>,
    /// For each joint, the link at which it starts.
    parent: Vec<usize>,
}

impl<'r> LinkTree<'r> {
    fn new(source: &Source, robot: &'r Robot) -> Result<Self> {
        let mut index: HashMap<&str, usize> = HashMap::new();
        for (k, link) in robot.links.iter().enumerate() {
            if let Some(first) = index.insert(&link.name, k) {
                return Err(duplicate(source, "link", &link.name, link.line, robot.links[first].line));
            }
        }
        let mut names: HashMap<&str, u32> = HashMap::new();
        let mut tree = LinkTree {
            root: 0,
            children: vec![Vec::new(); robot.links.len()],
            joint_of: vec![None; robot.links.len()],
            child: Vec::new(),
            parent: Vec::new(),
            index,
        };
        for (k, joint) in robot.joints.iter().enumerate() {
            if let Some(first) = names.insert(&joint.name, joint.line) {
                return Err(duplicate(source, "joint", &joint.name, joint.line, first));
            }
            let link = |what: &str, name: &str| {
                let found = tree.index.get(name).copied();
                found.ok_or_else(|| source.error(joint.line, format!("joint {} has the {what} {name}, which is no link", joint.name)))
            };
            let (parent, child) = (link("parent", &joint.parent)?, link("child", &joint.child)?);
            if let Some(other) = tree.joint_of[child] {
                let problem = format!("link {} is the child of two joints: {} and {}", joint.child, robot.joints[other].name, joint.name);
                return Err(source.error(joint.line, problem));
            }
            tree.joint_of[child] = Some(k);
            tree.children[parent].push(k);
            tree.child.push(child);
            tree.parent.push(parent);
        }
        tree.root = tree.single_root(source, robot)?;
        Ok(tree)
    }

    /// Return the only link without a parent. Each other link has one parent. So a link that is not reached from the root is on a cycle, or
    /// below a cycle.
    fn single_root(&self, source: &Source, robot: &Robot) -> Result<usize> {
        let roots: Vec<usize> = (0..robot.links.len()).filter(|&k| self.joint_of[k].is_none()).collect();
        if robot.links.is_empty() {
            return Err(source.error(1, "has no links: expected a robot with at least one link"));
        }
        if roots.len() > 1 {
            let names: Vec<&str> = roots.iter().map(|&k| robot.links[k].name.as_str()).collect();
            let problem = format!("has {} root links: expected one, got {}", roots.len(), listed(&names));
            return Err(source.error(robot.links[roots[1]].line, problem));
        }
        let mut reached = vec![false; robot.links.len()];
        let mut stack = roots.clone();
        while let Some(link) = stack.pop() {
            reached[link] = true;
            stack.extend(self.children[link].iter().map(|&j| self.child[j]));
        }
        match reached.iter().position(|r| !r) {
            None => Ok(roots[0]),
            Some(k) => {
                let joint = self.joint_of[k].map_or(robot.links[k].line, |j| robot.joints[j].line);
                Err(source.error(joint, format!("has a cycle of joints through or above link {}", robot.links[k].name)))
            }
        }
    }

    /// For each link, whether it is on the path from `base` to `tip`.
    fn path(&self, robot: &Robot, base: usize, tip: usize) -> Result<Vec<bool>> {
        let mut on = vec![false; self.joint_of.len()];
        let mut link = tip;
        on[link] = true;
        while link != base {
            let Some(joint) = self.joint_of[link] else {
                let (tip, base) = (&robot.links[tip].name, &robot.links[base].name);
                return Err(Error::input("tip", format!("is not below the root: expected a link carried by {base}, got {tip}")));
            };
            link = self.parent[joint];
            on[link] = true;
        }
        Ok(on)
    }
}

fn duplicate(source: &Source, kind: &str, name: &str, line: u32, first: u32) -> Error {
    source.error(line, format!("{kind} {name} is a duplicate: the first is in line {first}"))
}
