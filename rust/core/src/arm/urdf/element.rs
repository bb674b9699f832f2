//! The links and joints of a file: XML elements as numbers, with their line numbers.

use super::plausible::{ANGLE, Bound, DRIVE, INERTIA, LENGTH, MASS, axis_problem, negative_moment};
use super::source::{Source, XACRO};
use crate::arm::build::unit;
use crate::arm::{JointKind, Limits};
use crate::error::Result;
use crate::interrupt::look;
use crate::spatial::{Inertia, Matrix3, PARAMETERS, Placement, Sym3, Vector, Vector3};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

pub struct Robot {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<UrdfJoint>,
    /// Remarks for the report, one line each.
    pub report: Vec<String>,
}

pub struct Link {
    pub name: String,
    pub line: u32,
    /// The inertia about the link frame.
    pub inertia: Inertia<f64>,
}

pub struct UrdfJoint {
    pub name: String,
    pub line: u32,
    /// The kind of motion. `None` for a fixed joint.
    pub kind: Option<JointKind>,
    pub parent: String,
    pub child: String,
    pub placement: Placement,
    pub axis: [f64; 3],
    pub limits: Limits,
    pub armature: f64,
    pub damping: f64,
    pub friction: f64,
    pub mimic: Option<Imitated>,
}

/// The content of a `mimic` element.
pub struct Imitated {
    pub line: u32,
    pub leader: String,
    pub multiplier: f64,
    pub offset: f64,
}

/// A violation of the triangle inequality by more than this fraction of the largest entry causes a warning.
const TRIANGLE: f64 = 1e-6;

struct Reader<'a> {
    source: &'a Source<'a>,
    report: Vec<String>,
    /// The ignored elements: names of parent and element, number of occurrences, first line.
    dropped: BTreeMap<String, (usize, u32)>,
}

pub fn read(source: &Source, document: &Document) -> Result<Robot> {
    let root = document.root_element();
    let mut reader = Reader { source, report: Vec::new(), dropped: BTreeMap::new() };
    if let Some(node) = document.descendants().find(|n| n.tag_name().namespace().is_some_and(|ns| ns.contains("xacro"))) {
        return Err(reader.error(node, format!("holds the xacro element {}{XACRO}", node.tag_name().name())));
    }
    if root.tag_name().name() != "robot" {
        return Err(reader.error(root, format!("is not a robot: expected the root element robot, got {}", root.tag_name().name())));
    }
    let (mut links, mut joints) = (Vec::new(), Vec::new());
    for node in root.children().filter(Node::is_element) {
        look();
        match node.tag_name().name() {
            "link" => links.push(reader.link(node)?),
            "joint" => joints.push(reader.joint(node)?),
            _ => reader.drop(node),
        }
    }
    let name = root.attribute("name").unwrap_or("robot").into();
    let mut report = reader.report;
    for (what, (count, line)) in reader.dropped {
        report.push(format!("dropped: {what} ({count}, first in line {line})"));
    }
    Ok(Robot { name, links, joints, report })
}

impl Reader<'_> {
    fn line(&self, node: Node) -> u32 {
        self.source.line(node.range().start)
    }
    fn error(&self, node: Node, problem: impl Into<String>) -> crate::error::Error {
        self.source.error(self.line(node), problem)
    }
    fn warn(&mut self, node: Node, what: String) {
        let line = self.line(node);
        self.report.push(format!("line {line}: {what}"));
    }
    fn drop(&mut self, node: Node) {
        let parent = node.parent().map_or("", |p| p.tag_name().name());
        let line = self.line(node);
        self.dropped.entry(format!("{} of {parent}", node.tag_name().name())).or_insert((0, line)).0 += 1;
    }

    fn required<'n>(&self, node: Node<'n, '_>, attribute: &str) -> Result<&'n str> {
        match node.attribute(attribute).map(str::trim) {
            Some(text) if left_over(text) => Err(self.error(node, format!("{attribute} holds {}{XACRO}", shortened(text)))),
            Some(text) if !text.is_empty() => Ok(text),
            _ => Err(self.error(node, format!("{} has no {attribute}", node.tag_name().name()))),
        }
    }

    fn numbers<const N: usize>(&self, node: Node, attribute: &str, text: &str) -> Result<[f64; N]> {
        let label = || format!("{attribute} of {}", node.tag_name().name());
        let mut out = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace() {
            let Ok(x) = word.parse::<f64>() else {
                let hint = if left_over(word) { XACRO } else { "" };
                return Err(self.error(node, format!("{} is not a number: got {}{hint}", label(), shortened(word))));
            };
            if !x.is_finite() {
                return Err(self.error(node, format!("{} is not finite: got {}", label(), shortened(word))));
            }
            if count < N {
                out[count] = x;
            }
            count += 1;
        }
        if count != N {
            return Err(self.error(node, format!("{} has the wrong length: expected {N} numbers, got {count}", label())));
        }
        Ok(out)
    }

    fn number(&self, node: Node, attribute: &str) -> Result<Option<f64>> {
        node.attribute(attribute).map(|text| self.numbers::<1>(node, attribute, text).map(|x| x[0])).transpose()
    }

    fn vector(&self, node: Node, attribute: &str) -> Result<Option<[f64; 3]>> {
        node.attribute(attribute).map(|text| self.numbers(node, attribute, text)).transpose()
    }

    /// Refuse values beyond their limit. `what` is their name in the message.
    fn plausible(&self, node: Node, what: impl FnOnce() -> String, bound: Bound, values: &[f64]) -> Result<()> {
        bound.problem(values).map_or(Ok(()), |problem| Err(self.error(node, format!("{} {problem}", what()))))
    }

    fn placement(&mut self, node: Option<Node>) -> Result<Placement> {
        let Some(node) = node else { return Ok(Placement::IDENTITY) };
        let rpy = self.vector(node, "rpy")?.unwrap_or_default();
        let xyz = self.vector(node, "xyz")?.unwrap_or_default();
        self.plausible(node, || "rpy of origin".into(), ANGLE, &rpy)?;
        self.plausible(node, || "xyz of origin".into(), LENGTH, &xyz)?;
        let mut placement = Placement::from_rpy(rpy, xyz);
        let rounded: [f64; 9] = std::array::from_fn(|k| placement.rotation[(k / 3, k % 3)]);
        if let Some(r) = self.exact(node, "rotation", rounded, [1.0; 9], "rpy")? {
            placement.rotation = Matrix3::from_row_slice(&r);
        }
        Ok(placement)
    }

    /// Read the exact numbers that armlet's writer adds to a file, because the standard numbers of URDF are rounded. The exact numbers are
    /// used if they agree with the rounded numbers, relative to `scales`. The tolerance of 1e-9 covers the rounding error of the angles of
    /// a rotation at a pitch of 90 degrees.
    fn exact<const N: usize>(
        &mut self,
        node: Node,
        attribute: &str,
        rounded: [f64; N],
        scales: [f64; N],
        rest: &str,
    ) -> Result<Option<[f64; N]>> {
        let Some(text) = node.attribute(attribute) else { return Ok(None) };
        let given = self.numbers::<N>(node, attribute, text)?;
        if (0..N).all(|k| (given[k] - rounded[k]).abs() <= 1e-9 * scales[k]) {
            return Ok(Some(given));
        }
        self.warn(node, format!("{attribute} of {} differs from its {rest}: ignored", node.tag_name().name()));
        Ok(None)
    }

    /// Return the children of a node with these names. Each name may occur once. Other children are counted as ignored.
    fn children<'a, 'i, const N: usize>(&mut self, node: Node<'a, 'i>, names: [&str; N]) -> Result<[Option<Node<'a, 'i>>; N]> {
        let mut found = [None; N];
        for child in node.children().filter(Node::is_element) {
            match names.iter().position(|name| *name == child.tag_name().name()) {
                None => self.drop(child),
                Some(k) if found[k].is_some() => {
                    return Err(self.error(child, format!("{} has a second {}", node.tag_name().name(), names[k])));
                }
                Some(k) => found[k] = Some(child),
            }
        }
        Ok(found)
    }

    fn link(&mut self, node: Node) -> Result<Link> {
        let name = self.required(node, "name")?.to_string();
        let line = self.line(node);
        let [inertial] = self.children(node, ["inertial"])?;
        let inertia = inertial.map(|node| self.inertial(node, &name)).transpose()?.unwrap_or_default();
        Ok(Link { name, line, inertia })
    }

    fn inertial(&mut self, node: Node, link: &str) -> Result<Inertia<f64>> {
        let whole = node;
        let [origin, mass, inertia] = self.children(node, ["origin", "mass", "inertia"])?;
        let placement = self.placement(origin)?;
        let Some(mass_node) = mass else { return Err(self.error(node, format!("link {link} has an inertial without mass"))) };
        let Some(mass) = self.number(mass_node, "value")? else { return Err(self.error(mass_node, "mass has no value")) };
        if mass < 0.0 {
            return Err(self.error(mass_node, format!("mass of link {link} is negative: got {mass}")));
        }
        self.plausible(mass_node, || format!("mass of link {link}"), MASS, &[mass])?;
        let Some(node) = inertia else { return Err(self.error(node, format!("link {link} has an inertial without inertia"))) };
        let entry = |name: &str, needed: bool| match self.number(node, name)? {
            Some(x) => Ok(x),
            None if needed => Err(self.error(node, format!("inertia of link {link} has no {name}"))),
            None => Ok(0.0),
        };
        let moments = Sym3([
            entry("ixx", true)?,
            entry("ixy", false)?,
            entry("iyy", true)?,
            entry("ixz", false)?,
            entry("iyz", false)?,
            entry("izz", true)?,
        ]);
        self.plausible(node, || format!("inertia of link {link}"), INERTIA, &moments.0)?;
        if mass == 0.0 {
            self.warn(node, format!("link {link} has zero mass"));
        }
        let largest = moments.0.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let principal = moments.principal();
        if let Some(worst) = negative_moment(&moments, mass, placement.translation) {
            return Err(self.error(node, format!("inertia of link {link} has a negative principal moment: got {worst:e}")));
        }
        if principal[2] > principal[0] + principal[1] + TRIANGLE * largest {
            let [a, b, c] = principal;
            self.warn(
                node,
                format!(
                    "inertia of link {link} is no rigid body's: principal moments {a:.4e}, {b:.4e}, {c:.4e} break the triangle inequality"
                ),
            );
        }
        // The file has the moments of inertia about the centre of mass, in axes rotated by rpy.
        let turned = Inertia { mass, moment: Vector3::zero(), inertia: moments };
        let mut inertia = turned.placed(&placement);
        let mut rounded = [0.0; PARAMETERS];
        inertia.write_parameters(&mut rounded);
        let distance = placement.translation.norm();
        let (moment, second) = (mass * distance, mass * distance * distance + largest);
        let scales = std::array::from_fn(|k| [mass, moment, second][usize::from(k > 0) + usize::from(k > 3)]);
        if let Some(exact) = self.exact(whole, "parameters", rounded, scales, "mass and inertia")? {
            inertia = Inertia::from_parameters(&exact);
        }
        Ok(inertia)
    }

    fn joint(&mut self, node: Node) -> Result<UrdfJoint> {
        let name = self.required(node, "name")?.to_string();
        let line = self.line(node);
        let kind = match self.required(node, "type")? {
            "revolute" => Some(JointKind::Revolute),
            "continuous" => Some(JointKind::Continuous),
            "prismatic" => Some(JointKind::Prismatic),
            "fixed" => None,
            other => {
                let problem = format!("joint {name} has the type {}: expected revolute, continuous, prismatic or fixed", shortened(other));
                return Err(self.error(node, problem));
            }
        };
        let [origin, parent, child, axis, limit, dynamics, mimic] =
            self.children(node, ["origin", "parent", "child", "axis", "limit", "dynamics", "mimic"])?;
        let end = |what: &str, node: Option<Node>| match node {
            Some(n) => Ok(self.required(n, "link")?.to_string()),
            None => Err(self.source.error(line, format!("joint {name} has no {what}"))),
        };
        let (parent, child) = (end("parent", parent)?, end("child", child)?);
        let placement = self.placement(origin)?;
        let mut out = UrdfJoint {
            line,
            kind,
            parent,
            child,
            placement,
            axis: [1.0, 0.0, 0.0],
            limits: Limits::default(),
            armature: 0.0,
            damping: 0.0,
            friction: 0.0,
            mimic: None,
            name,
        };
        let Some(kind) = kind else {
            if let Some(node) = mimic {
                self.warn(node, format!("fixed joint {} cannot follow another one: its mimic is ignored", out.name));
            }
            return Ok(out);
        };
        if let Some(axis) = axis {
            let given = self.vector(axis, "xyz")?.unwrap_or(out.axis);
            if given == [0.0; 3] {
                return Err(self.error(axis, format!("axis of joint {} is zero", out.name)));
            }
            if let Some(problem) = axis_problem(&given) {
                return Err(self.error(axis, format!("axis of joint {} {problem}", out.name)));
            }
            out.axis = unit("axis", given)?;
        }
        if let Some(limit) = limit {
            out.limits = self.limits(limit, kind, &out.name)?;
        }
        if let Some(node) = dynamics {
            for (what, value) in [("armature", &mut out.armature), ("damping", &mut out.damping), ("friction", &mut out.friction)] {
                *value = self.number(node, what)?.unwrap_or(0.0);
                self.plausible(node, || format!("{what} of joint {}", out.name), DRIVE, &[*value])?;
                if *value < 0.0 {
                    let problem = format!("joint {} has negative {what}: {value}", out.name);
                    self.warn(node, problem);
                }
            }
        }
        if let Some(node) = mimic {
            let leader = self.required(node, "joint")?.to_string();
            let (multiplier, offset) = (self.number(node, "multiplier")?.unwrap_or(1.0), self.number(node, "offset")?.unwrap_or(0.0));
            out.mimic = Some(Imitated { line: self.line(node), leader, multiplier, offset });
        }
        Ok(out)
    }

    /// Limits that the file does not state are infinite. A continuous joint has no position limits.
    fn limits(&mut self, node: Node, kind: JointKind, joint: &str) -> Result<Limits> {
        let mut limits = Limits::default();
        let bounded = kind != JointKind::Continuous;
        for (what, value, kept) in [
            ("lower", &mut limits.lower, bounded),
            ("upper", &mut limits.upper, bounded),
            ("velocity", &mut limits.velocity, true),
            ("effort", &mut limits.effort, true),
        ] {
            if let (Some(x), true) = (self.number(node, what)?, kept) {
                *value = x;
            }
        }
        for (what, value) in [("velocity", limits.velocity), ("effort", limits.effort)] {
            if value < 0.0 {
                self.warn(node, format!("joint {joint} has a negative {what} limit: {value}"));
            }
        }
        if limits.lower > limits.upper {
            self.warn(node, format!("joint {joint} has its lower limit {} above its upper limit {}", limits.lower, limits.upper));
        }
        Ok(limits)
    }
}

/// Whether a text contains an expression that xacro should have replaced.
fn left_over(text: &str) -> bool {
    text.contains("${") || text.contains("$(")
}

/// Return a word of the file, shortened for a message.
fn shortened(word: &str) -> String {
    let cut: String = word.chars().take(40).collect();
    if cut.len() < word.len() { format!("{cut}...") } else { cut }
}
