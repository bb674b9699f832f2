//! The tree of the links and joints of a file. Faults of its structure are collected, because they only matter if the arm contains them.

use super::element::{Robot, UrdfJoint};
use super::source::Source;
use crate::error::{Error, Result, listed};
use std::collections::HashMap;

pub struct LinkTree {
    /// The joints that start at each link, in file order.
    pub children: Vec<Vec<usize>>,
    /// The joint that leads to each link.
    pub joint_of: Vec<Option<usize>>,
    /// For each joint, the link at which it starts and the link that it leads to. `None` for an end that is no link.
    pub ends: Vec<[Option<usize>; 2]>,
    pub faults: Vec<Fault>,
}

/// A fault of the structure.
pub struct Fault {
    pub at: Place,
    pub error: Error,
}

pub enum Place {
    /// A link of this index.
    Link(usize),
    /// A joint of this index.
    Joint(usize),
    /// Two joints of the same name.
    Joints(usize, usize),
}

impl LinkTree {
    pub fn new(source: &Source, robot: &Robot) -> Self {
        let mut faults = Vec::new();
        let mut index: HashMap<&str, usize> = HashMap::new();
        for (k, link) in robot.links.iter().enumerate().filter(|(_, link)| !link.name.is_empty()) {
            if let Some(&first) = index.get(link.name.as_str()) {
                let error = duplicate(source, "link", &link.name, link.line, robot.links[first].line);
                faults.push(Fault { at: Place::Link(first), error });
            } else {
                index.insert(&link.name, k);
            }
        }
        let count = robot.links.len();
        let mut tree = LinkTree { children: vec![Vec::new(); count], joint_of: vec![None; count], ends: Vec::new(), faults };
        let mut names: HashMap<&str, usize> = HashMap::new();
        for (k, joint) in robot.joints.iter().enumerate() {
            let ends = [&joint.parent, &joint.child].map(|name| index.get(name.as_str()).copied());
            tree.ends.push(ends);
            if let Some(first) = names.insert(&joint.name, k).filter(|_| !joint.name.is_empty()) {
                let error = duplicate(source, "joint", &joint.name, joint.line, robot.joints[first].line);
                tree.faults.push(Fault { at: Place::Joints(first, k), error });
            }
            match tree.problem(robot, joint, ends) {
                Some(problem) => tree.faults.push(Fault { at: Place::Joint(k), error: source.error(joint.line, problem) }),
                None => {
                    if let [Some(parent), Some(child)] = ends {
                        tree.joint_of[child] = Some(k);
                        tree.children[parent].push(k);
                    }
                }
            }
        }
        tree
    }

    /// The reason why a joint cannot be in the tree.
    fn problem(&self, robot: &Robot, joint: &UrdfJoint, ends: [Option<usize>; 2]) -> Option<String> {
        for (what, name, end) in [("parent", &joint.parent, ends[0]), ("child", &joint.child, ends[1])] {
            if end.is_none() {
                return Some(format!("joint {} has the {what} {name}, which is no link", joint.name));
            }
        }
        let other = self.joint_of[ends[1]?]?;
        Some(format!("link {} is the child of two joints: {} and {}", joint.child, robot.joints[other].name, joint.name))
    }

    /// Return the only link without a parent. Each other link has one parent. So a link that is not reached from the root is on a cycle, or
    /// below a cycle.
    pub fn single_root(&self, source: &Source, robot: &Robot) -> Result<usize> {
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
            stack.extend(self.children[link].iter().filter_map(|&j| self.ends[j][1]));
        }
        reached.iter().position(|r| !r).map_or_else(|| Ok(roots[0]), |k| Err(self.cycle(source, robot, k)))
    }

    /// The error for a link that is on a cycle or below a cycle.
    pub fn cycle(&self, source: &Source, robot: &Robot, link: usize) -> Error {
        let line = self.joint_of[link].map_or(robot.links[link].line, |j| robot.joints[j].line);
        source.error(line, format!("has a cycle of joints through or above link {}", robot.links[link].name))
    }

    /// The joints from a link upwards to a root, and that root. The root is `None` if the joints form a cycle.
    pub fn above(&self, link: usize) -> (Vec<usize>, Option<usize>) {
        let (mut joints, mut at) = (Vec::new(), link);
        while joints.len() <= self.joint_of.len() {
            let Some(j) = self.joint_of[at] else { return (joints, Some(at)) };
            joints.push(j);
            at = self.ends[j][0].unwrap_or(at);
        }
        (Vec::new(), None)
    }

    /// For each link, whether it is on the path from `base` to `tip`.
    pub fn path(&self, robot: &Robot, base: usize, tip: usize) -> Result<Vec<bool>> {
        let mut on = vec![false; self.joint_of.len()];
        on[tip] = true;
        let mut link = tip;
        while link != base {
            let next = self.joint_of[link].and_then(|joint| self.ends[joint][0]).filter(|&next| !on[next]);
            let Some(next) = next else {
                let (tip, base) = (&robot.links[tip].name, &robot.links[base].name);
                return Err(Error::input("tip", format!("is not below the root: expected a link carried by {base}, got {tip}")));
            };
            link = next;
            on[link] = true;
        }
        Ok(on)
    }
}

fn duplicate(source: &Source, kind: &str, name: &str, line: u32, first: u32) -> Error {
    source.error(line, format!("{kind} {name} is a duplicate: the first is in line {first}"))
}
