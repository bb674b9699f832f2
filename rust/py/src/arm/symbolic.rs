//! The parameters of an arm for `armlet.symbolic`, which makes formulas from them.

use super::{Arm, ArmModel};
use crate::arrays::flag_or_false;
use crate::errors::{Failure, input_error};
use armlet_core::arm::JointKind;
use armlet_core::spatial::Vector;
use armlet_macros::entered;
use pyo3::prelude::*;

/// The largest number of joints, including mimic joints: formulas of more joints are too long to read.
const MOST_JOINTS: usize = 4;

#[entered]
#[pymethods]
impl Arm {
    /// Formulas of an arm of at most four joints as sympy expressions: `M(q)`, `C(q, v)`, `g(q)` and the regressor `Y(q, v, v_r, a_r)`.
    ///
    /// The extra `sympy` installs sympy. The inertial parameters of joint 1 are the symbols `m1, mcx1, .., Izz1`, and `Ir1` is the
    /// inertia of its rotor. The parameters of `planar_pr` are `A, B, C`. Parameters that are zero in this arm do not appear in `M`, `C`
    /// and `g`. Each expression is collected by parameter and simplified.
    ///
    /// Args:
    ///     lengths: True for symbols of lengths and gravity (keyword only). `x2, y2, z2` is the offset of joint 2 in the axes of the link
    ///         before it, and `gx, gy, gz` is gravity. By default lengths and gravity are numbers.
    ///
    /// Returns:
    ///     An `armlet.symbolic.Formulas`: `.M`, `.C`, `.g`, `.Y`, the symbols `.q, .v, .v_r, .a_r`, their `.values`, `.latex()` and
    ///     `.function(name)`.
    ///
    /// Raises:
    ///     InputError: the arm has more than four joints, including mimic joints.
    ///     ImportError: sympy is not installed.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_pr(2.0, 0.5, 0.5).symbolic().M
    /// Matrix([
    /// [        A, B*cos(q2)],
    /// [B*cos(q2),         C]])
    #[arguments(*, lengths=false)]
    fn symbolic<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "symbolic";
        let lengths = flag_or_false(NAME, "lengths", lengths)?;
        let n = slf.get().model.size().bodies;
        if n > MOST_JOINTS {
            let problem = format!("has too many joints for readable formulas: expected at most {MOST_JOINTS}, got {n}");
            return Err(input_error(py, NAME, "arm", problem).into());
        }
        let module = py.import("armlet.symbolic")?;
        let ArmModel::Tree(tree) = &slf.get().model else {
            return Ok(module.getattr("of_planar_pr")?.call1((slf.get().model.parameters(),))?);
        };
        let arm = tree.arm();
        let joints: Vec<_> = arm
            .joints
            .iter()
            .map(|joint| {
                let turn = joint.placement.rotation;
                let rotation: [[f64; 3]; 3] = std::array::from_fn(|row| std::array::from_fn(|column| turn[(row, column)]));
                let parent = joint.parent.map_or(-1, |parent| parent as i64);
                let slides = joint.kind == JointKind::Prismatic;
                (parent, rotation, joint.placement.translation.array(), joint.axis, slides, joint.parameters, joint.armature)
            })
            .collect();
        let rows = arm.joining().map(|joining| joining.rows);
        Ok(module.getattr("of_tree")?.call1((joints, arm.gravity, lengths, rows))?)
    }
}
