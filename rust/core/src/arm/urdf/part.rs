//! The part of a robot that becomes the arm, by the options `root` and `tip`. A fault inside this part is an error. A fault outside of it is
//! only reported.

use super::element::Robot;
use super::link_tree::{Fault, LinkTree, Place};
use super::options::UrdfOptions;
use super::source::Source;
use crate::error::{Error, Result, listed};
use crate::interrupt;

pub struct Part {
    /// Whether the arm is the whole robot: neither `root` nor `tip` is given.
    pub unrestricted: bool,
    /// The link that becomes the fixed base. Without options it is only valid after [`Part::check`].
    pub base: usize,
    /// For each link, whether it is in the part.
    pub links: Vec<bool>,
    /// For each joint, whether it connects two links of the part.
    pub joints: Vec<bool>,
    /// The joints at the part that are not in it, because they are off the path from `root` to `tip`.
    pub cut: Vec<usize>,
    /// The joints from the base upwards to the root of the file.
    pub above: Vec<usize>,
    /// The root of the file above the base. `None` if the joints above the base form a cycle.
    pub top: Option<usize>,
    /// Whether a joint leads from the part back to its base.
    closed: bool,
}

impl Part {
    pub fn new(source: &Source, robot: &Robot, tree: &LinkTree, options: &UrdfOptions) -> Result<Part> {
        let unrestricted = options.root.is_none() && options.tip.is_none();
        let (links, joints) = (vec![unrestricted; robot.links.len()], vec![unrestricted; robot.joints.len()]);
        let mut part = Part { unrestricted, base: 0, links, joints, cut: Vec::new(), above: Vec::new(), top: None, closed: false };
        if unrestricted {
            return Ok(part);
        }
        if robot.links.is_empty() {
            tree.single_root(source, robot)?;
        }
        let named = |argument: &str, name: &str| {
            let found = robot.links.iter().position(|link| link.name == name && !name.is_empty());
            let names = robot.links.iter().map(|link| link.name.as_str()).filter(|name| !name.is_empty());
            found.ok_or_else(|| Error::unknown(argument, "links", names, name))
        };
        let (root, tip) = (options.root.map(|name| named("root", name)), options.tip.map(|name| named("tip", name)));
        let (root, tip) = (root.transpose()?, tip.transpose()?);
        part.base = match (root, tip) {
            (Some(root), _) => root,
            (None, Some(tip)) => tree.above(tip).1.ok_or_else(|| tree.cycle(source, robot, tip))?,
            (None, None) => 0,
        };
        (part.above, part.top) = tree.above(part.base);
        let path = tip.map(|tip| tree.path(robot, part.base, tip)).transpose()?;
        part.links[part.base] = true;
        let mut stack = vec![part.base];
        while let Some(link) = stack.pop() {
            interrupt::check();
            for &j in tree.children[link].iter().rev() {
                let Some(child) = tree.ends[j][1] else { continue };
                if robot.joints[j].moves && path.as_ref().is_some_and(|on| !on[child]) {
                    part.cut.push(j);
                } else if child == part.base {
                    part.closed = true;
                } else {
                    (part.joints[j], part.links[child]) = (true, true);
                    stack.push(child);
                }
            }
        }
        part.cut.sort_unstable();
        // A joint that is not in the tree is a part of the arm if it starts or ends at its links. It is cut off like others.
        for fault in &tree.faults {
            let Place::Joint(j) = fault.at else { continue };
            let [parent, child] = tree.ends[j].map(|end| end.is_some_and(|end| part.links[end]));
            let cut = tip.is_some() && robot.joints[j].moves;
            part.joints[j] = (parent && !cut) || (child && tree.ends[j][1] != Some(part.base));
        }
        Ok(part)
    }

    fn contains(&self, fault: &Fault) -> bool {
        match fault.at {
            _ if self.unrestricted => true,
            Place::Link(link) => self.links[link],
            Place::Joint(joint) => self.joints[joint],
            Place::Joints(first, second) => self.joints[first] && self.joints[second],
        }
    }

    /// Return the error of the first faulty element inside the part.
    pub fn check_elements(&self, robot: &Robot) -> Result<()> {
        let links = robot.links.iter().zip(&self.links).map(|(link, inside)| (link.line, &link.fault, *inside));
        let joints = robot.joints.iter().zip(&self.joints).map(|(joint, inside)| (joint.line, &joint.fault, *inside));
        let faults = links.chain(joints).filter(|(.., inside)| *inside).filter_map(|(line, fault, _)| Some((line, fault.as_ref()?)));
        faults.min_by_key(|(line, _)| *line).map_or(Ok(()), |(_, fault)| Err(fault.clone()))
    }

    /// Return the error of the first fault of the structure inside the part. Sets the base of a whole robot.
    pub fn check_structure(&mut self, source: &Source, robot: &Robot, tree: &LinkTree) -> Result<()> {
        if let Some(fault) = tree.faults.iter().find(|fault| self.contains(fault)) {
            return Err(fault.error.clone());
        }
        if self.unrestricted {
            self.base = tree.single_root(source, robot)?;
            self.top = Some(self.base);
        } else if self.closed {
            return Err(tree.cycle(source, robot, self.base));
        }
        Ok(())
    }

    /// Return the lines of the report about the parts that the arm lacks.
    pub fn report(&self, robot: &Robot, tree: &LinkTree) -> Vec<String> {
        let mut report = Vec::new();
        if self.unrestricted {
            return report;
        }
        let cut: Vec<&str> = self.cut.iter().map(|&j| robot.joints[j].name.as_str()).collect();
        if !cut.is_empty() {
            report.push(format!("dropped: joints off the path from root to tip, and what they carry: {}", listed(&cut)));
        }
        let below = self.below(tree);
        let others: Vec<&str> = robot.links.iter().zip(below).filter(|(_, below)| !below).map(|(link, _)| link.name.as_str()).collect();
        if !others.is_empty() {
            let base = &robot.links[self.base].name;
            report.push(format!("dropped: links that {base} does not carry, and their joints: {}", listed(&others)));
        }
        let links = robot.links.iter().zip(&self.links).filter(|(_, inside)| !**inside).filter_map(|(link, _)| link.fault.as_ref());
        let joints = robot.joints.iter().zip(&self.joints).filter(|(_, inside)| !**inside).filter_map(|(joint, _)| joint.fault.as_ref());
        let structure = tree.faults.iter().filter(|fault| !self.contains(fault)).map(|fault| &fault.error);
        let mut faults = links.chain(joints).chain(structure);
        if let Some(first) = faults.next() {
            let more = match faults.count() {
                0 => String::new(),
                more => format!(" (and {more} more)"),
            };
            report.push(format!("ignored: a fault outside of the arm: {}{more}", place_and_problem(first)));
        }
        report
    }

    /// For each link, whether it is the base or is below the base.
    fn below(&self, tree: &LinkTree) -> Vec<bool> {
        let mut below = vec![false; self.links.len()];
        let mut stack = vec![self.base];
        while let Some(link) = stack.pop() {
            if !std::mem::replace(&mut below[link], true) {
                stack.extend(tree.children[link].iter().filter_map(|&j| tree.ends[j][1]));
            }
        }
        below
    }
}

/// The message of an error of a file, without the name of the file.
pub fn place_and_problem(error: &Error) -> String {
    match error {
        Error::Model { line, problem, .. } => format!("line {line}: {problem}"),
        other => other.to_string(),
    }
}
