//! A joint, from its `joint` element.

use super::element::{Imitated, Reader, UrdfJoint};
use super::plausible::{DRIVE, axis_problem};
use super::values::shortened;
use crate::arm::build::unit;
use crate::arm::{JointKind, Limits};
use crate::error::Result;
use roxmltree::Node;

impl Reader<'_> {
    /// Read a joint. Its name, its ends and whether it moves are known before.
    pub fn fill_joint(&mut self, node: Node, out: &mut UrdfJoint) -> Result<()> {
        self.required(node, "name")?;
        let given = self.required(node, "type")?;
        self.leftovers(node)?;
        let [origin, parent, child, axis, limit, dynamics, mimic] =
            self.children(node, ["origin", "parent", "child", "axis", "limit", "dynamics", "mimic"])?;
        for (what, end) in [("parent", parent), ("child", child)] {
            let Some(end) = end else { return Err(self.error(node, format!("joint {} has no {what}", out.name))) };
            self.required(end, "link")?;
        }
        out.placement = self.placement(origin)?;
        out.placed = true;
        out.kind = match given {
            "revolute" => Some(JointKind::Revolute),
            "continuous" => Some(JointKind::Continuous),
            "prismatic" => Some(JointKind::Prismatic),
            "fixed" => None,
            other => {
                let expected = "expected revolute, continuous, prismatic or fixed; root= and tip= load a chain without it";
                return Err(self.error(node, format!("joint {} has the type {}: {expected}", out.name, shortened(other))));
            }
        };
        let Some(kind) = out.kind else {
            if let Some(node) = mimic {
                self.warn(node, format!("fixed joint {} cannot follow another one: its mimic is ignored", out.name));
            }
            return Ok(());
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
        Ok(())
    }

    /// Limits that the file does not state are infinite. A continuous joint has no position limits.
    pub fn limits(&mut self, node: Node, kind: JointKind, joint: &str) -> Result<Limits> {
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
        if let Some(unit) = kind.doubtful_unit(&limits) {
            let range = format!("[{}, {}] {}", limits.lower, limits.upper, kind.unit());
            self.warn(node, format!("joint {joint} has the position limits {range}, which is implausibly large: {unit}?"));
        }
        if let Some(unit) = kind.doubtful_speed_unit(&limits) {
            let speed = format!("{} {}/s", limits.velocity, kind.unit());
            self.warn(node, format!("joint {joint} has the velocity limit {speed}, which is implausibly large: {unit}/s?"));
        }
        Ok(limits)
    }
}
