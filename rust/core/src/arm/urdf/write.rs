//! The URDF writer. An arm that is written and read again has the same bits, except for the properties in the report. If the centre of mass
//! or the angles of a rotation are rounded, attributes with the exact numbers are added.

use super::plausible::negative_moment;
use super::plausible::{DRIVE, INERTIA, LENGTH, MASS};
use crate::arm::{Arm, Frame, JointKind, STANDARD_GRAVITY};
use crate::error::listed;
use crate::interrupt;
use crate::spatial::{Inertia, PARAMETERS, Placement, RotationMatrix, Vector, Vector3};
use std::collections::HashSet;
use std::fmt::Write;

/// The URDF text of an arm, and a report of the properties that URDF cannot represent.
///
/// ```
/// use armlet_core::arm::{Arm, STANDARD_GRAVITY, Written, example_urdf};
///
/// let arm = Arm::from_urdf(example_urdf("six_axis")?, "six_axis", STANDARD_GRAVITY, None, None)?;
/// let Written { text, report } = arm.with_gravity([0.0; 3])?.to_urdf();
/// assert_eq!(report, ["dropped: gravity [0.0, 0.0, 0.0] (URDF has none)"]);
/// assert_eq!(Arm::from_urdf(&text, "copy.urdf", STANDARD_GRAVITY, None, None)?, arm);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The URDF text.
    pub text: String,
    /// The properties that URDF cannot represent, one line each.
    pub report: Vec<String>,
}

impl Arm {
    /// Return the arm as URDF. Each frame becomes a link. The base and each body also become a link, unless a frame is at their origin.
    pub fn to_urdf(&self) -> Written {
        let mut report = Vec::new();
        let mut taken: HashSet<String> =
            self.frames.iter().map(|f| f.name.clone()).chain(self.joints.iter().map(|j| j.name.clone())).collect();
        let mut fresh = |wanted: String| {
            let mut name = wanted.clone();
            let mut k = 2;
            while !taken.insert(name.clone()) {
                name = format!("{wanted}_{k}");
                k += 1;
            }
            name
        };
        // The base and each body become a link: a frame at the same place if there is one, otherwise a new link.
        let mut own: Vec<Option<usize>> = vec![None; self.joints.len() + 1];
        let slot = |body: Option<usize>| body.map_or(0, |b| b + 1);
        for (k, frame) in self.frames.iter().enumerate() {
            if frame.joint.is_none() && frame.placement == Placement::IDENTITY && own[slot(frame.body)].is_none() {
                own[slot(frame.body)] = Some(k);
            }
        }
        let mut made = Vec::new();
        let names: Vec<String> = (0..=self.joints.len())
            .map(|s| match own[s] {
                Some(k) => self.frames[k].name.clone(),
                None => {
                    let name = fresh(if s == 0 { "base".into() } else { format!("{}_body", self.joints[s - 1].name) });
                    made.push(name.clone());
                    name
                }
            })
            .collect();
        let mut out = String::new();
        let _ = writeln!(out, "<?xml version=\"1.0\"?>\n<robot name=\"{}\">", escaped(&self.name));
        for (s, name) in names.iter().enumerate() {
            interrupt::check();
            if own[s].is_none() {
                let parameters = s.checked_sub(1).map(|b| &self.joints[b].parameters);
                link(&mut out, name, parameters, &mut report);
                if s > 0 {
                    self.moving(&mut out, s - 1, name, &names, &mut report);
                }
            }
        }
        for (k, frame) in self.frames.iter().enumerate() {
            interrupt::check();
            let s = slot(frame.body);
            if own[s] != Some(k) {
                link(&mut out, &frame.name, None, &mut report);
                let joint = frame.joint.clone().unwrap_or_else(|| fresh(format!("{}_fixed", frame.name)));
                fixed(&mut out, &joint, frame, &names[s], &mut report);
            } else {
                link(&mut out, &frame.name, frame.body.map(|b| &self.joints[b].parameters), &mut report);
                if let Some(b) = frame.body {
                    self.moving(&mut out, b, &frame.name, &names, &mut report);
                }
            }
        }
        out.push_str("</robot>\n");
        if !made.is_empty() {
            report.push(format!("added: links for bodies without a frame: {}", listed(&made)));
        }
        if self.gravity != STANDARD_GRAVITY {
            report.push(format!("dropped: gravity {:?} (URDF has none)", self.gravity));
        }
        Written { text: out, report }
    }

    /// Write a moving joint, with its leader if it is a mimic joint.
    fn moving(&self, out: &mut String, i: usize, child: &str, names: &[String], report: &mut Vec<String>) {
        let joint = &self.joints[i];
        let parent = &names[joint.parent.map_or(0, |p| p + 1)];
        if DRIVE.problem(&[joint.damping, joint.friction, joint.armature]).is_some() {
            report.push(format!("joint {} has no possible drive: armlet refuses its damping, friction or armature", joint.name));
        }
        far(&joint.name, &joint.placement, report);
        let _ = writeln!(out, "  <joint name=\"{}\" type=\"{}\">", escaped(&joint.name), joint.kind.name());
        ends(out, parent, child, &joint.placement);
        let _ = writeln!(out, "    <axis xyz=\"{}\"/>", numbers(&joint.axis));
        let limits = [
            ("lower", joint.limits.lower, joint.kind != JointKind::Continuous),
            ("upper", joint.limits.upper, joint.kind != JointKind::Continuous),
            ("velocity", joint.limits.velocity, true),
            ("effort", joint.limits.effort, true),
        ];
        attributes(out, "limit", limits.into_iter().filter(|(_, x, allowed)| *allowed && x.is_finite()).map(|(name, x, _)| (name, x)));
        let dynamics = [("damping", joint.damping), ("friction", joint.friction), ("armature", joint.armature)];
        attributes(out, "dynamics", dynamics.into_iter().filter(|(_, x)| *x != 0.0));
        if let Some(mimic) = self.mimics.iter().find(|mimic| mimic.joint == i) {
            let (leader, multiplier, offset) = (escaped(&self.joints[mimic.leader].name), mimic.multiplier, mimic.offset);
            let _ = writeln!(out, "    <mimic joint=\"{leader}\" multiplier=\"{multiplier:?}\" offset=\"{offset:?}\"/>");
        }
        out.push_str("  </joint>\n");
    }
}

/// Report an origin that the reader would refuse.
fn far(joint: &str, placement: &Placement, report: &mut Vec<String>) {
    if LENGTH.problem(&placement.translation.array()).is_some() {
        report.push(format!("joint {joint} is implausibly far away: armlet refuses its origin"));
    }
}

fn attributes<'a>(out: &mut String, element: &str, list: impl Iterator<Item = (&'a str, f64)>) {
    let text: String = list.map(|(name, x)| format!(" {name}=\"{x:?}\"")).collect();
    if !text.is_empty() {
        let _ = writeln!(out, "    <{element}{text}/>");
    }
}

fn fixed(out: &mut String, name: &str, frame: &Frame, parent: &str, report: &mut Vec<String>) {
    far(name, &frame.placement, report);
    let _ = writeln!(out, "  <joint name=\"{}\" type=\"fixed\">", escaped(name));
    ends(out, parent, &frame.name, &frame.placement);
    out.push_str("  </joint>\n");
}

fn ends(out: &mut String, parent: &str, child: &str, placement: &Placement) {
    // Adding zero removes the sign of a negative zero.
    let rpy = placement.rotation.to_rpy().map(|angle| angle + 0.0);
    let rounded = Placement::from_rpy(rpy, placement.translation.array()).rotation;
    let rows: [f64; 9] = std::array::from_fn(|k| placement.rotation[(k / 3, k % 3)]);
    let rotation = exact("rotation", &rows, rounded == placement.rotation);
    let (xyz, rpy) = (numbers(&placement.translation.array()), numbers(&rpy));
    let _ = writeln!(out, "    <parent link=\"{}\"/>\n    <child link=\"{}\"/>", escaped(parent), escaped(child));
    let _ = writeln!(out, "    <origin xyz=\"{xyz}\" rpy=\"{rpy}\"{rotation}/>");
}

fn link(out: &mut String, name: &str, parameters: Option<&[f64; 10]>, report: &mut Vec<String>) {
    let inertia = parameters.map(|p| Inertia::from_parameters(p)).filter(|inertia| !inertia.is_zero());
    let Some(inertia) = inertia else {
        let _ = writeln!(out, "  <link name=\"{}\"/>", escaped(name));
        return;
    };
    let (com, i) = inertia.com();
    if com.is_none() && inertia.moment.array() != [0.0; 3] {
        report.push(format!("dropped: the first moment of link {name}, which has no mass"));
    }
    let com = com.unwrap_or(Vector3::from([0.0; 3]));
    let beyond = MASS.problem(&[inertia.mass]).or(INERTIA.problem(&i.0)).or(LENGTH.problem(&com.array())).is_some();
    if beyond || inertia.mass < 0.0 || negative_moment(&i, inertia.mass, com).is_some() {
        report.push(format!("link {name} is no possible body: readers, armlet included, refuse its mass or inertia"));
    }
    let [xx, xy, yy, xz, yz, zz] = i.0;
    let mut parameters = [0.0; PARAMETERS];
    inertia.write_parameters(&mut parameters);
    let shifted = Inertia { mass: inertia.mass, moment: Vector3::zero(), inertia: i }.placed(&Placement::from_rpy([0.0; 3], com.array()));
    let added = exact("parameters", &parameters, shifted == inertia);
    let _ = writeln!(
        out,
        "  <link name=\"{}\">\n    <inertial{added}>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>",
        escaped(name),
        numbers(&com.array())
    );
    let _ = writeln!(out, "      <mass value=\"{:?}\"/>", inertia.mass);
    let _ = writeln!(
        out,
        "      <inertia ixx=\"{xx:?}\" ixy=\"{xy:?}\" ixz=\"{xz:?}\" iyy=\"{yy:?}\" iyz=\"{yz:?}\" izz=\"{zz:?}\"/>\n    </inertial>\n  </link>"
    );
}

fn numbers(x: &[f64]) -> String {
    x.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ")
}

/// Return the attribute with exact numbers. The result is empty if the standard attributes are already exact.
fn exact(attribute: &str, x: &[f64], is_exact: bool) -> String {
    if is_exact { String::new() } else { format!(" {attribute}=\"{}\"", numbers(x)) }
}

/// Return text for a quoted attribute. Line breaks and tabs become references, because a parser replaces bare ones by spaces.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\r' | '\t' => {
                let _ = write!(out, "&#{};", c as u32);
            }
            _ => out.push(c),
        }
    }
    out
}
