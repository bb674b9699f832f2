//! Functions of an arm as C code. Each quantity is recorded once, and [`crate::trace::c`] prints it. The C code returns the same bits as
//! [`super::Evaluator`] or [`PlanarPr::evaluate`] under two conditions: [`COptions::fused`] equals [`crate::scalar::fuses`], and the
//! compiler fuses only calls of `fma`.

use super::closed_form::require_rigid_bodies;
use super::{Dynamics, Model, PlanarPr, Quantity, Query, Size};
use crate::arm::JointKind;
use crate::error::{Error, Result};
use crate::scalar::Real;
use crate::trace::Sym;
use crate::trace::c::{CFile, COptions, CSource, Routine, comment, require_names};
use crate::trace::function::{Recorded, recorded};

/// Largest number of operations of a function that is printed.
const LONGEST: f64 = 600_000.0;

/// A function of an arm to print as C.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::{CFunction, Model, Quantity, Query};
/// use armlet_core::trace::c::COptions;
///
/// let arm = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let tip = Query { frame: 1, ..Quantity::Position.into() };
/// let files = arm.export_c(&[CFunction { name: "tip".into(), query: tip }], &COptions::new("arm"))?;
/// assert!(files[0].text.contains("int arm_tip(const double q[2], double out[3]);"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CFunction {
    /// Name of the C function, after the prefix.
    pub name: String,
    /// The quantity that the function computes.
    pub query: Query,
}

impl Quantity {
    /// The quantities that can be printed, with the names of their C functions.
    pub const PRINTED: [(&'static str, Quantity); 18] = [
        ("mass_matrix", Quantity::MassMatrix),
        ("coriolis_matrix", Quantity::CoriolisMatrix),
        ("christoffel", Quantity::Christoffel),
        ("gravity", Quantity::Gravity),
        ("bias", Quantity::Bias),
        ("inverse_dynamics", Quantity::InverseDynamics),
        ("forward_dynamics", Quantity::ForwardDynamics),
        ("regressor", Quantity::Regressor),
        ("energy", Quantity::Energy),
        ("pose", Quantity::Pose),
        ("pose_vector", Quantity::PoseVector),
        ("position", Quantity::Position),
        ("jacobian", Quantity::Jacobian),
        ("jacobian_dot", Quantity::JacobianDot),
        ("center_of_mass", Quantity::Com),
        ("center_of_mass_jacobian", Quantity::ComJacobian),
        ("inverse_dynamics_derivatives", Quantity::InverseDynamicsDerivatives),
        ("forward_dynamics_derivatives", Quantity::ForwardDynamicsDerivatives),
    ];

    /// The meaning of the result, in one line.
    fn meaning(self) -> &'static str {
        match self {
            Quantity::MassMatrix => "M(q), N x N",
            Quantity::CoriolisMatrix => "C(q, v) with Christoffel symbols, N x N",
            Quantity::Christoffel => "the Christoffel symbols c[i][j][k], N x N x N: C[i][j] = sum over k of c[i][j][k] v[k]",
            Quantity::Gravity => "g(q), N",
            Quantity::Bias => "C(q, v) v + g(q), N",
            Quantity::InverseDynamics => "tau = M a + C v + g, N",
            Quantity::ForwardDynamics => "a = M^-1 (tau - C v - g), N",
            Quantity::Regressor => "Y with Y pi = M a_r + C(q, v) v_r + g, N x P",
            Quantity::Energy => "kinetic and potential energy, J",
            Quantity::Pose => "the pose of the frame in world axes, 4 x 4",
            Quantity::PoseVector => "the pose of the frame in world axes, [p; rotation vector], 6",
            Quantity::Position => "the position of the frame in world axes, m",
            Quantity::JointPoses => "the pose of the body of every joint in world axes, 4 x 4 each",
            Quantity::Jacobian => "the geometric Jacobian of the frame in world axes, rows [v; w], 6 x N",
            Quantity::JacobianDot => "the rate of the Jacobian of the frame, 6 x N",
            Quantity::Com => "the centre of mass in world axes, m",
            Quantity::ComJacobian => "the Jacobian of the centre of mass, 3 x N",
            Quantity::InverseDynamicsDerivatives => "d tau/d q over d tau/d v over d tau/d a, 3 N x N",
            Quantity::ForwardDynamicsDerivatives => "d a/d q over d a/d v over d a/d tau, 3 N x N",
            Quantity::PathDynamics => "M v, M a + C v and g, 3 x N",
        }
    }
}

impl Model {
    /// Print the functions as C: a header, a source file and a CMake file. Errors: `Input` for invalid names, or a function that is too
    /// long or that the arm does not have.
    ///
    /// ```
    /// use armlet_core::arm::Arm;
    /// use armlet_core::dynamics::{CFunction, Model, Quantity};
    /// use armlet_core::trace::c::COptions;
    ///
    /// let arm = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
    /// let gravity = CFunction { name: "gravity".into(), query: Quantity::Gravity.into() };
    /// let files = arm.export_c(&[gravity], &COptions::new("arm"))?;
    /// assert_eq!(files[0].name, "arm.h");
    /// assert!(files[0].text.contains("int arm_gravity(const double q[2], double out[2]);"));
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn export_c(&self, functions: &[CFunction], options: &COptions) -> Result<Vec<CFile>> {
        require_names("functions", functions.iter().map(|function| function.name.as_str()))?;
        let (mut source, n) = (CSource::new(options)?, self.n());
        source.define("N", n, "joints");
        source.write(&answer(source.prefix(), source.upper()));
        for function in functions {
            self.print(function, &mut source)?;
        }
        let about = format!("Functions of an arm.\n\n{}", self.described());
        Ok(source.files(&about))
    }

    fn print(&self, function: &CFunction, source: &mut CSource) -> Result<()> {
        let (n, query, name) = (self.n(), &function.query, &function.name);
        let recorded = self.recorded(query)?;
        let given = given(&recorded);
        let inputs: Vec<(&str, usize)> = query.inputs().iter().enumerate().map(|(k, &input)| (input, query.input_length(k, n))).collect();
        let (count, answers) = (inputs.iter().map(|(_, width)| width).sum::<usize>(), recorded.answer.len());
        let routine = Routine { ops: &recorded.ops, given: &given, answer: &recorded.answer, fused: source.fused() };
        let (calls, slots) = source.routine(&routine, name);
        let (prefix, upper) = (source.prefix().to_string(), source.upper().to_string());
        let parameters: String = inputs.iter().map(|(input, width)| format!("const double {input}[{width}], ")).collect();
        let head = format!("int {prefix}_{name}({parameters}double out[{answers}])");
        let work = if slots > 0 { format!(", w[{slots}]") } else { String::new() };
        let mut copies = String::new();
        let mut at = 0;
        for (input, width) in &inputs {
            copies += &format!("    memcpy(x + {at}, {input}, {width} * sizeof(double));\n");
            at += width;
        }
        source.write(&format!(
            "{head}\n{{\n    double x[{count}], y[{answers}]{work};\n    int sound = 1;\n{copies}    if (!{prefix}_finite(x, {count}))\n        \
return {prefix}_refuse({upper}_NOT_FINITE, {answers}, out);\n{calls}    return {prefix}_answer(sound, {answers}, y, out);\n}}\n\n"
        ));
        source.declare(&format!("\n/* {}. */\n{head};\n", self.meaning(query)));
        Ok(())
    }

    fn meaning(&self, query: &Query) -> String {
        let mut text = query.quantity.meaning().to_string();
        if let Model::Tree(arm) = self {
            if query.is_framed() {
                text += &format!("; frame {}", comment(&arm.frames[query.frame].name));
            }
            if let Some(frame) = query.wrench {
                text += &format!("; wrench [f; n] in world axes at frame {}", comment(&arm.frames[frame].name));
            }
        }
        if query.friction {
            text +=
                if query.quantity == Quantity::Regressor { "; columns of damping and friction appended" } else { "; friction included" };
        }
        if query.armature {
            text += "; columns of armature appended";
        }
        if query.offset {
            text += "; columns of torque offsets appended";
        }
        text
    }

    /// Record the operations of a query.
    pub(crate) fn recorded(&self, query: &Query) -> Result<Recorded> {
        let n = self.n();
        if self.operations(query) > LONGEST {
            let problem =
                format!("has a function that is too long to be printed: expected fewer joints or another function, got {n} joints");
            return Err(Error::input("arm", problem));
        }
        match self {
            Model::Tree(arm) => {
                let frames = arm.frames.len();
                if (query.is_framed() && query.frame >= frames) || query.wrench.is_some_and(|frame| frame >= frames) {
                    return Err(Error::input("frame", format!("is out of range: expected an index below {frames}")));
                }
                super::recorded::recording(arm, query)
            }
            Model::PlanarPr(arm) => planar_pr(arm, query),
        }
    }

    /// Describe the arm in lines for a header: joints with their units, and the inertial parameters.
    pub(crate) fn described(&self) -> String {
        let (names, slides): (Vec<String>, Vec<bool>) = match self {
            Model::PlanarPr(_) => (vec!["p1".into(), "r2".into()], vec![true, false]),
            Model::Tree(arm) => {
                (arm.joint_names().map(comment).collect(), arm.independent().map(|joint| joint.kind == JointKind::Prismatic).collect())
            }
        };
        let mut text = String::from("Joints, in the order of q, v, a and tau:\n");
        for (i, (name, slides)) in names.iter().zip(slides).enumerate() {
            let units = if slides { "m, m/s, m/s^2, N" } else { "rad, rad/s, rad/s^2, N m" };
            text += &format!("  {i}  {name}  ({units})\n");
        }
        text += match self {
            Model::PlanarPr(_) => "Inertial parameters, in this order: A, B, C.",
            Model::Tree(_) => "Inertial parameters, in this order: per joint m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz.",
        };
        if let Model::Tree(arm) = self {
            for mimic in &arm.mimics {
                let (joint, leader) = (comment(&arm.joints[mimic.joint].name), comment(&arm.joints[mimic.leader].name));
                text += &format!("\nJoint {joint} follows: {} {leader} + {}.", mimic.multiplier, mimic.offset);
            }
        }
        text
    }
}

/// For each input of a recorded function: its value if it is a set-up parameter (a constant, such as a mass), otherwise `None`.
pub(crate) fn given(recorded: &Recorded) -> Vec<Option<f64>> {
    recorded.values.iter().map(|&x| Some(x)).chain((0..recorded.inputs).map(|_| None)).collect()
}

/// Record a query of the planar PR arm.
fn planar_pr(arm: &PlanarPr<f64>, query: &Query) -> Result<Recorded> {
    require_rigid_bodies(query)?;
    let length = if query.quantity == Quantity::Regressor { 6 } else { query.length(Size { n: 2, bodies: 2 }) };
    let mut known = true;
    let answer = |arm: PlanarPr<Sym>, x: &[Sym]| {
        let part = |k: usize| x.get(2 * k..2 * k + 2).unwrap_or(&[]);
        let (q, v, a, b) = (part(0), part(1), part(2), part(3));
        let trig = [q[0].sin_cos(), q[1].sin_cos()];
        let mut out = vec![Sym::zero(); length];
        match query.quantity {
            Quantity::MassMatrix => arm.mass_matrix(&mut (), &trig, q, &mut out),
            Quantity::CoriolisMatrix => arm.coriolis_matrix(&mut (), &trig, q, v, &mut out),
            Quantity::Gravity => arm.gravity(&mut (), &trig, q, &mut out),
            Quantity::Bias => arm.bias(&mut (), &trig, q, v, &mut out),
            Quantity::InverseDynamics => arm.inverse_dynamics(&mut (), &trig, q, v, a, &mut out),
            Quantity::ForwardDynamics => arm.forward_dynamics(&mut (), &trig, q, v, a, &mut out),
            Quantity::Regressor => arm.regressor(&mut (), &trig, q, [v, a, b], &mut out),
            Quantity::Energy => (out[0], out[1]) = arm.energy(&mut (), &trig, q, v),
            _ => known = false,
        }
        out
    };
    let made = recorded(2 * query.inputs().len(), || arm.lift(), answer);
    match made {
        Some(recorded) if known => Ok(recorded),
        _ => Err(Error::input("functions", "has one that planar_pr does not have: expected its dynamics, such as mass_matrix")),
    }
}

/// The C code that returns the numbers of a result, or NaN and a status.
fn answer(prefix: &str, upper: &str) -> String {
    format!(
        "static int {prefix}_refuse(int status, int count, double *out)\n{{\n    int k;\n    for (k = 0; k < count; k++)\n        \
out[k] = NAN;\n    return status;\n}}\n\n\
static int {prefix}_answer(int sound, int count, const double *y, double *out)\n{{\n    int k;\n    if (!sound)\n        \
return {prefix}_refuse({upper}_ANGLE, count, out);\n    if (!{prefix}_finite(y, count))\n        \
return {prefix}_refuse({upper}_RESULT, count, out);\n    /* No zero is negative. */\n    for (k = 0; k < count; k++)\n        \
out[k] = y[k] + 0.0;\n    return {upper}_OK;\n}}\n\n"
    )
}
