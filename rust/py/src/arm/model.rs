//! The model of an `armlet.Arm`: an arm in closed form or a tree of joints, with one interface.

use armlet_core::arm::{Arm as CoreArm, JointKind};
use armlet_core::dynamics::{Functions, PlanarPr, Quantity, Query, Size};
use armlet_core::error::{Error, Result, all_finite, finite};
use std::sync::Arc;

pub enum ArmModel {
    PlanarPr(PlanarPr<f64>),
    Tree(Box<Functions>),
}

impl PartialEq for ArmModel {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (ArmModel::PlanarPr(a), ArmModel::PlanarPr(b)) => a == b,
            (ArmModel::Tree(a), ArmModel::Tree(b)) => a.arm() == b.arm(),
            _ => false,
        }
    }
}

impl From<CoreArm> for ArmModel {
    fn from(arm: CoreArm) -> Self {
        ArmModel::Tree(Box::new(Functions::new(Arc::new(arm))))
    }
}

impl ArmModel {
    /// A placeholder for a model that has been moved to another owner.
    pub fn nothing() -> Self {
        ArmModel::PlanarPr(PlanarPr::with_parameters([0.0; 3]))
    }

    /// The tree of joints. An arm in closed form has none, which is an error.
    pub fn tree(&self, function: &str) -> Result<&CoreArm> {
        match self {
            ArmModel::Tree(tree) => Ok(tree.arm()),
            ArmModel::PlanarPr(_) => {
                let name = function.rsplit('.').next().unwrap_or(function);
                Err(Error::input("arm", format!("has no links: expected an arm with a kinematic model for {name}, got planar_pr")))
            }
        }
    }

    /// The model of the core, for laws and plants.
    pub fn core(&self) -> armlet_core::dynamics::Model {
        match self {
            ArmModel::PlanarPr(arm) => armlet_core::dynamics::Model::PlanarPr(*arm),
            ArmModel::Tree(tree) => armlet_core::dynamics::Model::Tree(tree.arm().clone()),
        }
    }

    pub fn n(&self) -> usize {
        match self {
            ArmModel::PlanarPr(_) => 2,
            ArmModel::Tree(tree) => tree.arm().n(),
        }
    }

    pub fn size(&self) -> Size {
        match self {
            ArmModel::PlanarPr(_) => Size { n: 2, bodies: 2 },
            ArmModel::Tree(tree) => tree.arm().size(),
        }
    }

    /// Names of all moving joints, including mimic joints. Fixed joints of the file are not included.
    pub fn file_joint_names(&self) -> Vec<String> {
        match self {
            ArmModel::PlanarPr(_) => self.joint_names(),
            ArmModel::Tree(tree) => tree.arm().joints.iter().map(|joint| joint.name.clone()).collect(),
        }
    }

    /// For each joint of [`ArmModel::file_joint_names`], the index of its parent joint; -1 for a joint on the base.
    pub fn file_joint_parents(&self) -> Vec<isize> {
        match self {
            ArmModel::PlanarPr(_) => vec![-1, 0],
            ArmModel::Tree(tree) => tree.arm().joints.iter().map(|joint| index_or_base(joint.parent)).collect(),
        }
    }

    /// For each frame, the index in [`ArmModel::file_joint_names`] of the joint that moves it; -1 for a frame of the base.
    pub fn frame_joints(&self) -> Vec<isize> {
        match self {
            ArmModel::PlanarPr(_) => Vec::new(),
            ArmModel::Tree(tree) => tree.arm().frames.iter().map(|frame| index_or_base(frame.body)).collect(),
        }
    }

    /// Write the positions, rad or m, of the joints of [`ArmModel::file_joint_names`] at `q`, `(n,)`, to `out`.
    pub fn file_positions(&self, q: &[f64], out: &mut [f64]) {
        match self {
            ArmModel::Tree(tree) => tree.arm().joint_positions(q, out),
            ArmModel::PlanarPr(_) => out.copy_from_slice(q),
        }
    }

    pub fn joint_names(&self) -> Vec<String> {
        match self {
            ArmModel::PlanarPr(_) => vec!["p1".into(), "r2".into()],
            ArmModel::Tree(tree) => tree.arm().joint_names().map(String::from).collect(),
        }
    }

    pub fn joint_types(&self) -> Vec<String> {
        match self {
            ArmModel::PlanarPr(_) => vec!["prismatic".into(), "revolute".into()],
            ArmModel::Tree(tree) => tree.arm().independent().map(|joint| joint.kind.name().to_string()).collect(),
        }
    }

    pub fn frame_names(&self) -> Vec<String> {
        match self {
            ArmModel::PlanarPr(_) => Vec::new(),
            ArmModel::Tree(tree) => tree.arm().frame_names().map(String::from).collect(),
        }
    }

    pub fn tip_frame(&self) -> Option<String> {
        match self {
            ArmModel::PlanarPr(_) => None,
            ArmModel::Tree(tree) => tree.arm().tip_frame().map(|frame| tree.arm().frames[frame].name.clone()),
        }
    }

    pub fn report(&self) -> &[String] {
        match self {
            ArmModel::PlanarPr(_) => &[],
            ArmModel::Tree(tree) => &tree.arm().report,
        }
    }

    pub fn frame(&self, name: &str) -> Result<usize> {
        match self {
            ArmModel::PlanarPr(_) => Err(Error::input(
                "frame",
                format!("is unknown: expected one of (), got {name:?}: planar_pr is given by its dynamics alone"),
            )),
            ArmModel::Tree(tree) => tree.arm().frame_index(name),
        }
    }

    pub fn parameters(&self) -> Vec<f64> {
        match self {
            ArmModel::PlanarPr(arm) => arm.parameter_array().to_vec(),
            ArmModel::Tree(tree) => tree.arm().parameters(),
        }
    }

    pub fn with_parameters(&self, pi: &[f64]) -> Result<ArmModel> {
        match self {
            ArmModel::PlanarPr(_) => Ok(ArmModel::PlanarPr(PlanarPr::with_parameters([pi[0], pi[1], pi[2]]))),
            ArmModel::Tree(tree) => Ok(tree.arm().with_parameters(pi)?.into()),
        }
    }

    /// Limits, friction and rotor inertia of the joints, by name.
    pub fn limits(&self) -> Vec<(&'static str, Vec<f64>)> {
        let ArmModel::Tree(tree) = self else { return Vec::new() };
        let arm = tree.arm();
        let of = |get: &dyn Fn(&armlet_core::arm::Joint) -> f64| arm.independent().map(get).collect::<Vec<f64>>();
        vec![
            ("q_min", of(&|j| j.limits.lower)),
            ("q_max", of(&|j| j.limits.upper)),
            ("v_max", of(&|j| j.limits.velocity)),
            ("effort", of(&|j| j.limits.effort)),
            ("damping", of(&|j| j.damping)),
            ("friction", of(&|j| j.friction)),
            ("armature", of(&|j| j.armature)),
        ]
    }

    /// The lengths of the trailing axes of a query's result, padded with zeros, and the number of these axes.
    pub fn shape(&self, query: &Query) -> ([usize; 3], usize) {
        let n = self.n();
        match query.quantity {
            Quantity::Gravity | Quantity::Bias | Quantity::InverseDynamics | Quantity::ForwardDynamics => ([n, 0, 0], 1),
            Quantity::Energy => ([2, 0, 0], 1),
            Quantity::Position | Quantity::Com => ([3, 0, 0], 1),
            Quantity::PoseVector => ([6, 0, 0], 1),
            Quantity::Christoffel => ([n; 3], 3),
            Quantity::JointPoses => ([self.size().bodies, 4, 4], 3),
            Quantity::Regressor if matches!(self, ArmModel::PlanarPr(_)) => ([2, 3, 0], 2),
            Quantity::MassMatrix
            | Quantity::CoriolisMatrix
            | Quantity::Regressor
            | Quantity::Pose
            | Quantity::Jacobian
            | Quantity::JacobianDot
            | Quantity::ComJacobian
            | Quantity::PathDynamics
            | Quantity::InverseDynamicsDerivatives
            | Quantity::ForwardDynamicsDerivatives => {
                let (rows, columns) = query.shape(self.size());
                ([rows, columns, 0], 2)
            }
        }
    }

    /// Evaluate one configuration. The result is true if every number is finite.
    pub fn one(&self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        match self {
            ArmModel::PlanarPr(arm) => {
                inputs.iter().zip(query.inputs()).try_for_each(|(x, name)| finite(name, x))?;
                arm.evaluate(query, inputs, out)?;
                Ok(all_finite(out))
            }
            ArmModel::Tree(tree) => tree.one(query, inputs, out),
        }
    }

    /// Whether the next [`ArmModel::prepare`] records a *program*, the machine code for a query, which takes milliseconds.
    pub fn is_due(&self, query: &Query, count: usize) -> bool {
        matches!(self, ArmModel::Tree(tree) if tree.is_due(query, count))
    }

    /// Prepare the evaluation of `count` configurations.
    pub fn prepare(&self, query: &Query, count: usize) -> Result<()> {
        match self {
            ArmModel::PlanarPr(_) => Ok(()),
            ArmModel::Tree(tree) => tree.prepare(query, count),
        }
    }

    /// Evaluate `count` configurations. Each array has one row per configuration. The result is true if every number is finite.
    pub fn rows(&self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> Result<bool> {
        match self {
            ArmModel::PlanarPr(arm) => {
                inputs.iter().zip(query.inputs()).try_for_each(|(x, name)| finite(name, x))?;
                let width = out.len() / count.max(1);
                let mut sound = true;
                for (i, row) in out.chunks_exact_mut(width.max(1)).enumerate() {
                    let mut one: [&[f64]; 4] = [&[]; 4];
                    for (row, all) in one.iter_mut().zip(inputs) {
                        *row = &all[2 * i..2 * i + 2];
                    }
                    arm.evaluate(query, &one[..inputs.len()], row)?;
                    sound &= all_finite(row);
                }
                Ok(sound)
            }
            ArmModel::Tree(tree) => tree.rows(query, inputs, count, out),
        }
    }

    /// The text of `repr(arm)` and `str(arm)`: a table of the joints, or one line for `planar_pr`.
    pub fn shown(&self) -> String {
        let tree = match self {
            ArmModel::PlanarPr(arm) => {
                let [a, b, c] = arm.parameter_array();
                return format!("planar_pr(A={a}, B={b}, C={c})");
            }
            ArmModel::Tree(tree) => tree.arm(),
        };
        let mut text = format!("Arm {:?}: {} joints, {} frames, gravity {:?}", tree.name, tree.n(), tree.frames.len(), tree.gravity);
        let wide = tree.joints.iter().map(|joint| joint.name.len()).max().unwrap_or(0).max(5);
        text += &format!(
            "\n  {:>3}  {:wide$}  {:10}  {:>10}  {:>10}  {:>9}  {:>9}  {:>9}",
            "", "joint", "type", "lower", "upper", "v_max", "effort", "mass"
        );
        let mut coordinate = 0;
        for (i, joint) in tree.joints.iter().enumerate() {
            if let Some(mimic) = tree.mimics.iter().find(|mimic| mimic.joint == i) {
                let (leader, kind, mass) = (&tree.joints[mimic.leader].name, joint.kind.name(), joint.parameters[0]);
                let follows = format!("= {} {leader} + {}", mimic.multiplier, mimic.offset);
                text += &format!("\n  {:>3}  {:wide$}  {kind:10}  {follows:<44}  {mass:>9.4}", "", joint.name);
                continue;
            }
            let i = coordinate;
            coordinate += 1;
            let unit = if joint.kind == JointKind::Prismatic { "m" } else { "rad" };
            let limit = |x: f64| if x.is_finite() { format!("{x:.4} {unit}") } else { "-".into() };
            let number = |x: f64| if x.is_finite() { format!("{x:.4}") } else { "-".into() };
            text += &format!(
                "\n  {i:>3}  {:wide$}  {:10}  {:>10}  {:>10}  {:>9}  {:>9}  {:>9.4}",
                joint.name,
                joint.kind.name(),
                limit(joint.limits.lower),
                limit(joint.limits.upper),
                number(joint.limits.velocity),
                number(joint.limits.effort),
                joint.parameters[0],
            );
        }
        text
    }
}

/// The index of a joint for Python, where -1 is the base.
fn index_or_base(index: Option<usize>) -> isize {
    index.map_or(-1, |index| index as isize)
}
