//! The links and joints of a file, with their line numbers. A fault of an element is stored with the element, because it only matters if
//! the arm contains the element.

use super::declaration::{is_xacro, xacro_name};
use super::source::Source;
use crate::arm::{JointKind, Limits};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::spatial::{Inertia, Placement};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::mem::take;

pub struct Robot {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<UrdfJoint>,
    /// Remarks about the whole file for the report, one line each.
    pub report: Vec<String>,
}

/// The lines of the report about an element: the number of the line in the file, and the text.
pub type Notes = Vec<(u32, String)>;

/// A link. The name is empty if the file does not state it; then there is a fault.
pub struct Link {
    pub name: String,
    pub line: u32,
    /// The inertia about the link frame.
    pub inertia: Inertia<f64>,
    pub notes: Notes,
    pub fault: Option<Error>,
}

/// A joint. If there is a fault, the values after the fault are not read. An end that is not read is empty.
pub struct UrdfJoint {
    pub name: String,
    pub line: u32,
    /// Whether the type is another one than fixed.
    pub moves: bool,
    /// The kind of motion. `None` for a fixed joint and for a type that armlet does not support.
    pub kind: Option<JointKind>,
    pub parent: String,
    pub child: String,
    pub placement: Placement,
    /// Whether `placement` is read.
    pub placed: bool,
    pub axis: [f64; 3],
    pub limits: Limits,
    pub armature: f64,
    pub damping: f64,
    pub friction: f64,
    pub mimic: Option<Imitated>,
    pub notes: Notes,
    pub fault: Option<Error>,
}

/// The content of a `mimic` element.
pub struct Imitated {
    pub line: u32,
    pub leader: String,
    pub multiplier: f64,
    pub offset: f64,
}

pub struct Reader<'a> {
    source: &'a Source<'a>,
    notes: Notes,
    /// The ignored elements: names of parent and element, number of occurrences, first line.
    dropped: BTreeMap<String, (usize, u32)>,
}

pub fn read(source: &Source, document: &Document) -> Result<Robot> {
    let root = document.root_element();
    let mut reader = Reader { source, notes: Vec::new(), dropped: BTreeMap::new() };
    match root.tag_name().name() {
        "robot" if !is_xacro(root) => {}
        "mujoco" => return Err(reader.error(root, "is a model of MuJoCo (MJCF): expected URDF; load it with mujoco, then from_mujoco")),
        name => return Err(reader.error(root, format!("is not a robot: expected the root element robot, got {name}"))),
    }
    let (mut links, mut joints) = (Vec::new(), Vec::new());
    for node in root.children().filter(Node::is_element) {
        interrupt::check();
        match node.tag_name().name() {
            _ if is_xacro(node) => reader.leftover(node)?,
            "link" => links.push(reader.link(node)),
            "joint" => joints.push(reader.joint(node)),
            _ => reader.drop(node),
        }
    }
    let name = root.attribute("name").unwrap_or("robot").into();
    let report = reader.dropped.into_iter().map(|(what, (count, line))| format!("dropped: {what} ({count}, first in line {line})"));
    Ok(Robot { name, links, joints, report: report.collect() })
}

impl Reader<'_> {
    pub fn line(&self, node: Node) -> u32 {
        self.source.line(node.range().start)
    }
    pub fn error(&self, node: Node, problem: impl Into<String>) -> Error {
        self.source.error(self.line(node), problem)
    }
    pub fn warn(&mut self, node: Node, what: String) {
        let line = self.line(node);
        self.notes.push((line, format!("line {line}: {what}")));
    }
    /// Count an element that armlet does not read.
    pub fn drop(&mut self, node: Node) {
        let parent = node.parent().map_or("", |p| p.tag_name().name());
        self.count(node, format!("{} of {parent}", node.tag_name().name()));
        node.descendants().skip(1).filter(|inner| is_xacro(*inner)).for_each(|inner| self.drop_xacro(inner));
    }
    /// Count an element of xacro that xacro did not expand.
    pub fn drop_xacro(&mut self, node: Node) {
        let parent = node.parent().map_or("", |p| p.tag_name().name());
        self.count(node, format!("xacro element {} of {parent}, not expanded", xacro_name(node)));
    }
    fn count(&mut self, node: Node, what: String) {
        let line = self.line(node);
        self.dropped.entry(what).or_insert((0, line)).0 += 1;
    }

    fn link(&mut self, node: Node) -> Link {
        let mut link = Link {
            name: node.attribute("name").map_or("", str::trim).to_string(),
            line: self.line(node),
            inertia: Inertia::default(),
            notes: Notes::new(),
            fault: None,
        };
        link.fault = self.fill_link(node, &mut link).err();
        link.notes = take(&mut self.notes);
        link
    }

    fn fill_link(&mut self, node: Node, link: &mut Link) -> Result<()> {
        self.required(node, "name")?;
        self.leftovers(node)?;
        let [inertial] = self.children(node, ["inertial"])?;
        if let Some(node) = inertial {
            link.inertia = self.inertial(node, &link.name)?;
        }
        Ok(())
    }

    fn joint(&mut self, node: Node) -> UrdfJoint {
        let end = |what: &str| {
            let found = node.children().find(|child| child.tag_name().name() == what);
            found.and_then(|child| child.attribute("link")).map_or("", str::trim).to_string()
        };
        let mut joint = UrdfJoint {
            name: node.attribute("name").map_or("", str::trim).to_string(),
            line: self.line(node),
            moves: node.attribute("type").map(str::trim) != Some("fixed"),
            kind: None,
            parent: end("parent"),
            child: end("child"),
            placement: Placement::IDENTITY,
            placed: false,
            axis: [1.0, 0.0, 0.0],
            limits: Limits::default(),
            armature: 0.0,
            damping: 0.0,
            friction: 0.0,
            mimic: None,
            notes: Notes::new(),
            fault: None,
        };
        joint.fault = self.fill_joint(node, &mut joint).err();
        joint.notes = take(&mut self.notes);
        joint
    }
}
