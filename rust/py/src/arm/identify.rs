//! Base parameters, physical consistency and identification. The results are objects of `armlet.identification`.

use super::Arm;
use crate::arrays::{
    ArrayArgument, adopted, any_vector, copied, flag_or_false, index_of, number, owned, per_entry, require_finite, shown, vector,
};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use armlet_core::analysis::base_parameters::{self as base, BaseParameters};
use armlet_core::analysis::{consistency, identification};
use armlet_core::dynamics::JointTerms;
use armlet_core::error::Error;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// Make an object of a class of `armlet.identification` from its fields.
fn made<'py>(py: Python<'py>, class: &str, fields: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
    py.import("armlet.identification")?.getattr(class)?.call((), Some(fields))
}

/// Read the flags of the joint terms.
fn terms_of(function: &str, [armature, friction, offset]: [Option<&Bound<'_, PyAny>>; 3]) -> Result<JointTerms, Failure> {
    Ok(JointTerms {
        armature: flag_or_false(function, "armature", armature)?,
        friction: flag_or_false(function, "friction", friction)?,
        offset: flag_or_false(function, "offset", offset)?,
    })
}

fn base_object<'py>(arm: &Bound<'py, Arm>, found: &BaseParameters, terms: JointTerms) -> Result<Bound<'py, PyAny>, Failure> {
    let py = arm.py();
    let (b, p) = (found.count(), found.names.len());
    let fields = PyDict::new(py);
    fields.set_item("arm", arm)?;
    let columns: Vec<i64> = found.independent.columns.iter().map(|&j| j as i64).collect();
    fields.set_item("columns", adopted(py, &[b], columns)?)?;
    fields.set_item("projection", copied(py, &[b, p], &found.independent.projection)?)?;
    fields.set_item("names", PyTuple::new(py, &found.names)?)?;
    fields.set_item("grouping", PyTuple::new(py, found.grouping())?)?;
    fields.set_item("unseen", PyTuple::new(py, found.unseen())?)?;
    fields.set_item("armature", terms.armature)?;
    fields.set_item("friction", terms.friction)?;
    fields.set_item("offset", terms.offset)?;
    fields.set_item("smallest_kept", found.independent.smallest_kept)?;
    fields.set_item("largest_dropped", found.independent.largest_dropped)?;
    Ok(made(py, "BaseParameters", &fields)?)
}

#[entered]
#[pymethods]
impl Arm {
    /// The base parameters: the smallest set of linear combinations of the inertial parameters that determines the motion of the arm.
    ///
    /// `Y pi = Y_b (P pi)` for every state, where `pi` are the inertial parameters, `Y_b` independent columns of the regressor `Y`, and `P`
    /// is `.projection`. The columns are examined in order, from base to tip. A column belongs to `Y_b` if it is independent of the columns
    /// before it. This is tested with regressors at random states, with a fixed seed and the arm's gravity.
    ///
    /// Args:
    ///     armature: include columns for the rotors' inertia (keyword only).
    ///     friction: include columns for damping and Coulomb friction (keyword only).
    ///     offset: include columns for torque offsets (keyword only).
    ///
    /// Returns:
    ///     An `al.BaseParameters`: `.count`, `.projection` `(b, p)`, `.columns`, `.grouping`, `.values`, `.regressor(q, v, v_r, a_r)`.
    ///
    /// Raises:
    ///     InputError: armature, friction or offset for `planar_pr`, which has none.
    ///
    /// Source: Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8(4), 1991.
    ///
    /// >>> import armlet as al
    /// >>> al.pendulum(2.0, 3.0).base_parameters().grouping
    /// ('mcx[joint1]', 'mcy[joint1]', 'Izz[joint1]')
    #[arguments(*, armature=false, friction=false, offset=false)]
    fn base_parameters<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "base_parameters";
        let terms = terms_of(NAME, [armature, friction, offset])?;
        let arm = slf.get().model.core();
        let found = long(slf.py(), || base::base_parameters(&arm, terms))?;
        base_object(slf, &found, terms)
    }

    /// Check whether inertial parameters are physically possible: the 4 x 4 pseudo-inertia of every body is positive definite.
    ///
    /// The pseudo-inertia is `P = [[S, h], [h', m]]` with the mass `m`, the first moment `h`, and `S = tr(I)/2 1 - I`. `I` is the inertia
    /// about the origin of the body frame, and `1` the identity matrix. `P` is positive definite if and only if two conditions hold. The
    /// mass and the principal moments about the centre of mass are positive, and each moment is below the sum of the other two.
    ///
    /// Args:
    ///     pi: inertial parameters, `(p,)`, ten per joint, in the order and units of `parameters`; the arm's parameters if None.
    ///
    /// Returns:
    ///     An `al.ParameterReport`: true if all bodies are possible, with `.eigenvalues` `(joints, 4)` and `.inconsistent`. `str` has a
    ///     line for each impossible body.
    ///
    /// Raises:
    ///     InputError: `pi` is not finite or has the wrong shape, or the arm has no links.
    ///
    /// Source: Wensing, Kim and Slotine 2018.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.load_urdf(al.example_urdf("six_axis"))
    /// >>> arm.check_parameters().consistent
    /// True
    #[arguments(pi=None)]
    fn check_parameters<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "check_parameters";
        let tree = self.model.tree(NAME)?;
        let pi = match pi {
            Some(pi) => vector(NAME, "pi", pi, 10 * tree.joints.len())?,
            None => tree.parameters(),
        };
        let bodies = long(py, || consistency::check_parameters(&pi))?;
        let fields = PyDict::new(py);
        fields.set_item("joints", PyTuple::new(py, self.model.file_joint_names())?)?;
        let values: Vec<f64> = bodies.iter().flat_map(|body| body.eigenvalues).collect();
        fields.set_item("eigenvalues", copied(py, &[bodies.len(), 4], &values)?)?;
        fields.set_item("problems", PyTuple::new(py, bodies.iter().map(|body| body.problem.as_str()))?)?;
        Ok(made(py, "ParameterReport", &fields)?)
    }

    /// Return the nearest physically possible parameters, `(p,)`, like `al.project_parameters`, and check that `pi` has this arm's size.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.load_urdf(al.example_urdf("six_axis"))
    /// >>> bool((arm.project_parameters(arm.parameters) == arm.parameters).all())
    /// True
    #[arguments(pi, *, length=None, floor=None)]
    fn project_parameters<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "project_parameters";
        let pi = vector(NAME, "pi", pi, 10 * self.model.tree(NAME)?.joints.len())?;
        projected(py, &pi, length, floor)
    }

    /// Identify base parameters from recorded motion and torque by least squares.
    ///
    /// The estimate `beta` of the base parameters is the least-squares solution of `W_b beta = tau`, where `W_b` contains the base
    /// regressors of all samples. The standard deviations of `beta` are computed from the residual.
    ///
    /// Args:
    ///     q, v, a: positions (rad or m), velocities (per s) and accelerations (per s^2), `(samples, n)`. In an array `(..., n)`, every
    ///         vector along the last axis is one sample.
    ///     tau: torques, N m or N, of the shape of `q`.
    ///     armature: also identify the rotors' inertia (keyword only). Otherwise the arm's armature is used.
    ///     friction: also identify damping and Coulomb friction (keyword only). Otherwise the torques must contain no friction.
    ///     offset: also identify a constant torque offset of each joint, such as that of a torque sensor (keyword only). Otherwise an
    ///         offset changes the estimates of gravity.
    ///     noise: standard deviation of the torque of each joint, `(n,)`, N m or N, for weights; equal weights if None (keyword only).
    ///     cutoff: the rank is the number of singular values above this fraction of the largest; 1e-6 if None (keyword only). These are the
    ///         singular values of `W_b` after each column is scaled to unit length.
    ///
    /// Returns:
    ///     An `al.Identification`: `.values`, `.deviations`, `.rank`, `.condition`, `.residuals`, `.unidentified`, `.arm`.
    ///
    /// Raises:
    ///     InputError: an argument is not finite, shapes differ, there are too few samples, or armature, friction or offset is requested
    ///         for `planar_pr`, which has none.
    ///
    /// Source: Gautier and Khalil, Exciting trajectories for the identification of base inertial parameters of robots, IJRR 11(4), 1992.
    ///
    /// >>> import numpy as np
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0, 0.5])
    /// >>> q, v, a = np.random.default_rng(0).normal(size=(3, 100, 2))
    /// >>> found = arm.identify(q, v, a, arm.inverse_dynamics(q, v, a))
    /// >>> np.allclose(found.values, found.base.values)
    /// True
    #[arguments(q, v, a, tau, *, armature=false, friction=false, noise=None, cutoff=None, offset=false)]
    fn identify<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "identify";
        let arm = slf.get().model.core();
        let terms = terms_of(NAME, [armature, friction, offset])?;
        let n = arm.n();
        let mut shape: Option<Vec<usize>> = None;
        let mut record = |name: &str, value: &Bound<'py, PyAny>| -> Result<Vec<f64>, Failure> {
            let argument = ArrayArgument::new(NAME, name, value)?;
            let given = argument.shape.clone();
            if given.len() < 2 || given.last() != Some(&n) || shape.as_ref().is_some_and(|first| *first != given) {
                let wanted = shape.as_ref().map_or(format!("(samples, {n})"), |first| shown(first));
                let problem = format!("has the wrong shape: expected {wanted}, got {}", shown(&given));
                return Err(input_error(py, NAME, name, problem).into());
            }
            let (given, values) = argument.values()?;
            require_finite(py, NAME, name, &given, &values)?;
            shape = Some(given);
            owned(values)
        };
        let [q, v, a, tau] = [record("q", q)?, record("v", v)?, record("a", a)?, record("tau", tau)?];
        let noise = noise.map(|noise| per_entry(NAME, "noise", noise, n)).transpose()?;
        let cutoff = positive(NAME, "cutoff", cutoff, CUTOFF)?;
        let options = identification::IdentificationOptions { terms, noise: noise.as_deref(), cutoff };
        let found = long(py, || identification::identify(&arm, [&q, &v, &a, &tau], &options))?;
        let (b, p) = (found.base.count(), found.base.names.len());
        let fields = PyDict::new(py);
        fields.set_item("base", base_object(slf, &found.base, terms)?)?;
        fields.set_item("values", copied(py, &[b], &found.values)?)?;
        fields.set_item("deviations", copied(py, &[b], &found.deviations)?)?;
        fields.set_item("covariance", copied(py, &[b, b], &found.covariance)?)?;
        fields.set_item("rank", found.rank)?;
        fields.set_item("condition", found.condition)?;
        fields.set_item("singular_values", copied(py, &[b], &found.singular_values)?)?;
        fields.set_item("residuals", copied(py, &[n], &found.residuals)?)?;
        fields.set_item("parameters", copied(py, &[p], &found.parameters)?)?;
        Ok(made(py, "Identification", &fields)?)
    }
}

/// The default of `cutoff`: singular values below this, relative to the largest, count as zero.
const CUTOFF: f64 = 1e-6;
/// The default of `length`, m: about the size of a link.
const LENGTH: f64 = 0.1;
/// The default of `floor`: the smallest eigenvalue of a projected body, relative to the largest eigenvalue of all bodies.
const FLOOR: f64 = 1e-6;

fn positive(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>, default: f64) -> Result<f64, Failure> {
    let Some(value) = value else { return Ok(default) };
    let x = number(function, name, value)?;
    Ok(armlet_core::error::positive(name, x).map(|()| x)?)
}

fn projected<'py>(
    py: Python<'py>,
    pi: &[f64],
    length: Option<&Bound<'py, PyAny>>,
    floor: Option<&Bound<'py, PyAny>>,
) -> Result<Bound<'py, PyAny>, Failure> {
    const NAME: &str = "project_parameters";
    let (length, floor) = (positive(NAME, "length", length, LENGTH)?, positive(NAME, "floor", floor, FLOOR)?);
    let projected = long(py, || consistency::project_parameters(pi, length, floor))?;
    match projected.iter().position(|x| !x.is_finite()) {
        None => copied(py, &[pi.len()], &projected),
        Some(k) => {
            Err(Error::input("pi", format!("overflows: expected moderate numbers (first bad index {})", index_of(&[pi.len()], k))).into())
        }
    }
}

/// Return the nearest inertial parameters that are physically possible.
///
/// For the pseudo-inertia `P` of each body and `D = diag(1/l, 1/l, 1/l, 1)`, the distance is the Frobenius norm of the change of `D P D`,
/// in kg. For a body that is not possible, the projection keeps the eigenvectors of `D P D` and raises eigenvalues below the floor to the
/// floor. Bodies that are already possible do not change, even if an eigenvalue is below the floor.
///
/// Args:
///     pi: inertial parameters, `(10 bodies,)`, in the order and units of `Arm.parameters`: kg, kg m, kg m^2.
///     length: `l`, m, which makes mass and moments comparable; 0.1 if None (keyword only).
///     floor: smallest eigenvalue of a projected body, relative to the largest eigenvalue of all bodies; 1e-6 if None (keyword only).
///
/// Raises:
///     InputError: an argument is not finite or has the wrong shape, or no body has a positive eigenvalue.
///
/// Source: Higham 1988; Wensing, Kim and Slotine 2018.
///
/// Returns:
///     The parameters, `(10 bodies,)`, in the order and units of `pi`.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([1.0])
/// >>> pi = arm.parameters
/// >>> pi[9] = -1.0
/// >>> arm.check_parameters(pi).consistent, arm.check_parameters(al.project_parameters(pi)).consistent
/// (False, True)
#[entered]
#[pyfunction]
#[arguments(pi, *, length=None, floor=None)]
pub fn project_parameters<'py>() -> Result<Bound<'py, PyAny>, Failure> {
    projected(py, &any_vector(NAME, "pi", pi)?, length, floor)
}
