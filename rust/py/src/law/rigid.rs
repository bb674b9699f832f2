//! Laws of rigid arms.

use super::{Arguments, Law};
use crate::arrays::{Axis, Form, Looked, SCALAR, WHATEVER, numbers, owned, shown, spread};
use crate::errors::{Failure, entry, input_error};
use armlet_core::law::{Adaptation, AdaptiveSpec, Base, CartesianImpedanceSpec, ComputedTorqueSpec, PdGravitySpec, PidSpec, Projection};
use armlet_core::motion::Motion;
use armlet_macros::entered;
use pyo3::prelude::*;

/// Adaptive tracking (Slotine and Li): `tau = Y a_hat + Kp e + Kd e_dot`, `a_hat_dot = Gamma Y' s`.
///
/// `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `s = v_r - v`, `Y` the arm's regressor. The error
/// goes to zero from any initial state and any estimate; the estimate converges only under excitation. Rotors' inertia is
/// known, not estimated: `armature a_r` of the arm is added to the torque.
///
/// Args:
///     arm: the arm whose regressor is used; its parameters are not.
///     motion: the desired motion.
///     kp, kd: positive definite gains: scalar, `(n,)` or `(n, n)`; `kp = kd Lambda`.
///     gamma: positive definite adaptation gain: scalar, `(p,)` or `(p, p)`.
///     estimate: initial estimate `(p,)`; zero if None (keyword only).
///     base: what `arm.base_parameters()` returns: only this base set of parameters is estimated, and p is its size (keyword only).
///     natural: adapt in the metric of the bodies' pseudo-inertias: the estimate stays physically possible for ever; it has
///         to start so, and gamma is a scalar or one number per body (keyword only).
///     projection: keep the estimate physically possible in the metric of gamma: the least body as a mass in kg (with a radius
///         of gyration of 0.1 m), or the least bodies as parameters `(p,)`, which the true ones must exceed. A start outside is
///         moved to the nearest inside (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite.
///
/// Source: Slotine and Li, On the adaptive control of robot manipulators, IJRR 6(3), 1987; natural: Lee, Kwon and Park, A natural
/// adaptive control law for robot manipulators, IROS 2018; projection: Pomet and Praly, Adaptive nonlinear regulation, IEEE TAC 37(6), 1992.
///
/// >>> import armlet as al
/// >>> arm = al.planar_pr(2.0, 0.5, 0.5)
/// >>> law = al.Adaptive(arm, al.Hold([1.0, 0.0]), kp=40.0, kd=20.0, gamma=5.0)
/// >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
/// array([40.,  0.])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct Adaptive;

/// The columns and the projection of a `BaseParameters`.
fn base_of<'py>(given: &mut Arguments<'py>, base: &Bound<'py, PyAny>, p: usize) -> Result<Base, Failure> {
    let refused = || input_error(base.py(), "Adaptive", "base", "is not a base set: expected what arm.base_parameters() returns, or None");
    let field = |name: &str| base.getattr(name).map_err(|_| refused());
    let columns: Vec<usize> = field("columns")?.call_method0("tolist")?.extract().map_err(|_| refused())?;
    let field = field("projection")?;
    let (shape, projection) = numbers("Adaptive", "base", &field, &[WHATEVER])?;
    let projection = owned(projection)?;
    if shape != [columns.len(), p] {
        let problem =
            format!("is of another arm or has columns of friction: expected a projection ({}, {p}), got {}", columns.len(), shown(&shape));
        return Err(input_error(base.py(), "Adaptive", "base", problem).into());
    }
    given.plain("base", base);
    Ok(Base { columns, projection })
}

/// The radius of gyration of a least body that is given by its mass, m: that of the metric of `project_parameters`.
const LENGTH: f64 = 0.1;

/// A mass, or the parameters of the least bodies.
fn least_bodies<'py>(given: &mut Arguments<'py>, projection: &Bound<'py, PyAny>, p: usize) -> Result<Projection, Failure> {
    if Looked::at("Adaptive", "projection", projection)?.shape.is_empty() {
        let mass = given.number("projection", projection)?;
        return Ok(Projection::of_mass(p, mass, LENGTH)?);
    }
    Ok(Projection::new(p, &given.vector("projection", projection, p)?)?)
}

#[entered]
#[pymethods]
impl Adaptive {
    #[new]
    #[pyo3(
        signature = (arm, motion, kp, kd, gamma, *, estimate=None, base=None, natural=None, projection=None),
        text_signature = "(arm, motion, kp, kd, gamma, *, estimate=None, base=None, natural=False, projection=None)"
    )]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        motion: &Bound<'py, PyAny>,
        kp: &Bound<'py, PyAny>,
        kd: &Bound<'py, PyAny>,
        gamma: &Bound<'py, PyAny>,
        estimate: Option<&Bound<'py, PyAny>>,
        base: Option<&Bound<'py, PyAny>>,
        natural: Option<&Bound<'py, PyAny>>,
        projection: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        entry(arm.py(), "Adaptive", || {
            let mut given = Arguments::new("Adaptive", arm)?;
            let model = given.model();
            let (n, p) = (model.n(), model.parameter_count());
            let motion = given.motion("motion", motion)?;
            let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
            let base = base.filter(|base| !base.is_none()).map(|base| base_of(&mut given, base, p)).transpose()?;
            let estimated = base.as_ref().map_or(p, |base| base.columns.len());
            let adaptation = if given.flag("natural", natural)? {
                let bodies = p / 10;
                let gamma = given.gain("gamma", gamma, bodies)?;
                if !gamma.is_diagonal() {
                    let problem = format!("is a matrix: expected a scalar or ({bodies},), one number per body, for natural adaptation");
                    return Err(input_error(arm.py(), "Adaptive", "gamma", problem).into());
                }
                Adaptation::Natural((0..bodies).map(|i| gamma.at(i, i)).collect())
            } else {
                Adaptation::Euclidean(given.gain("gamma", gamma, estimated)?)
            };
            let start = estimate.map(|estimate| given.vector("estimate", estimate, estimated)).transpose()?;
            let mut spec = AdaptiveSpec::new(model, motion, kp, kd, adaptation, base, start)?;
            if let Some(projection) = projection.filter(|projection| !projection.is_none()) {
                spec = spec.projected(least_bodies(&mut given, projection, p)?)?;
            }
            Ok(given.law(spec).add_subclass(Adaptive))
        })
    }
}

/// Computed torque: `tau = M (a_d + Kd e_dot + Kp e) + C v + g`, so that `e_ddot + Kd e_dot + Kp e = 0`.
///
/// Args:
///     arm: the model of the plant.
///     motion: the desired motion.
///     kp, kd: positive definite gains, 1/s^2 and 1/s: scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite.
///
/// >>> import armlet as al
/// >>> law = al.ComputedTorque(al.planar_pr(2.0, 0.5, 0.5), al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
/// >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
/// array([200.,  50.])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct ComputedTorque;

#[entered]
#[pymethods]
impl ComputedTorque {
    #[new]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        motion: &Bound<'py, PyAny>,
        kp: &Bound<'py, PyAny>,
        kd: &Bound<'py, PyAny>,
    ) -> PyResult<PyClassInitializer<Self>> {
        entry(arm.py(), "ComputedTorque", || {
            let mut given = Arguments::new("ComputedTorque", arm)?;
            let model = given.model();
            let n = model.n();
            let motion = given.motion("motion", motion)?;
            let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
            let spec = ComputedTorqueSpec::new(model, motion, kp, kd)?;
            Ok(given.law(spec).add_subclass(ComputedTorque))
        })
    }
}

/// PD control with gravity compensation: `tau = Kp (q_d - q) - Kd v + g(q)`.
///
/// The arm comes to rest at the target from any state when `Kp` and `Kd` are positive definite.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d`, `(n,)`, rad or m.
///     kp, kd: positive definite gains, N m/rad and N m s/rad: scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite.
///
/// Source: Takegaki and Arimoto, A new feedback method for dynamic control of manipulators, 1981.
///
/// >>> import armlet as al
/// >>> law = al.PDGravity(al.pendulum(1.0, 5.0), [1.0], kp=10.0, kd=4.0)
/// >>> law(0.0, [0.0], [0.5])
/// array([8.])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct PDGravity;

#[entered]
#[pymethods]
impl PDGravity {
    #[new]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        target: &Bound<'py, PyAny>,
        kp: &Bound<'py, PyAny>,
        kd: &Bound<'py, PyAny>,
    ) -> PyResult<PyClassInitializer<Self>> {
        entry(arm.py(), "PDGravity", || {
            let mut given = Arguments::new("PDGravity", arm)?;
            let model = given.model();
            let n = model.n();
            let target = given.vector("target", target, n)?;
            let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
            let spec = PdGravitySpec::new(model, target, kp, kd)?;
            Ok(given.law(spec).add_subclass(PDGravity))
        })
    }
}

/// PID control with gravity compensation: `u = Kp (q_d - q) - Kd v + w + g(q)`, `w' = Ki (q_d - q)`, `tau` = `u` within `tau_max`.
///
/// The integral torque `w` `(n,)`, N m or N, is the law's state: `run.estimate` records it, and it starts at zero. It leaves no error under
/// a load that the model does not know. While `u_i` is beyond the limit of joint `i`, `w_i` does not go further that way.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d`, `(n,)`, rad or m.
///     kp, ki, kd: positive definite gains, N m/rad, N m/(rad s) and N m s/rad: scalar, `(n,)` or `(n, n)`. The loop of a joint of inertia
///         `m` is stable where `ki < kp kd / m`.
///     tau_max: the largest torque that the law asks for, N m or N, scalar or `(n,)`; no limit if None.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite, a limit is not positive.
///
/// Source: Arimoto and Miyazaki, Stability and robustness of PID feedback control for robot manipulators, 1984; conditional integration:
/// Astrom and Hagglund, Advanced PID Control, section 3.5.
///
/// >>> import armlet as al
/// >>> law = al.PID(al.pendulum(1.0, 5.0), [1.0], kp=10.0, ki=5.0, kd=4.0, tau_max=9.0)
/// >>> law(0.0, [0.0], [0.5], state=[0.5])
/// array([8.5])
/// >>> law(0.0, [0.0], [0.0], state=[0.5])
/// array([9.])
#[pyclass(frozen, extends = Law, module = "armlet")]
#[allow(clippy::upper_case_acronyms)] // The name in Python.
pub struct PID;

#[entered]
#[pymethods]
impl PID {
    #[new]
    #[pyo3(signature = (arm, target, kp, ki, kd, tau_max=None))]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        target: &Bound<'py, PyAny>,
        kp: &Bound<'py, PyAny>,
        ki: &Bound<'py, PyAny>,
        kd: &Bound<'py, PyAny>,
        tau_max: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        entry(arm.py(), "PID", || {
            let mut given = Arguments::new("PID", arm)?;
            let model = given.model();
            let n = model.n();
            let target = given.vector("target", target, n)?;
            let gains = [given.gain("kp", kp, n)?, given.gain("ki", ki, n)?, given.gain("kd", kd, n)?];
            let mut spec = PidSpec::new(model, target, gains)?;
            if let Some(limits) = tau_max.filter(|limits| !limits.is_none()) {
                let (shape, values) = numbers("PID", "tau_max", limits, &[SCALAR, Form(&[Axis::Is(n)])])?;
                spec = spec.limited(spread(&shape, values, n)?)?;
                given.keep("tau_max", limits)?;
            }
            Ok(given.law(spec).add_subclass(PID))
        })
    }
}

/// Cartesian impedance: a spring and a damper between a frame and its target, `tau = J'(K (x_d - x) - D J v) + g(q)`.
///
/// `axes` chooses the rows, in order: letters of "xyz" for position, "rx ry rz" for orientation (error `log(R_d R')`,
/// `R_d` from the target's rotation vector). The law has no inverse of `J` and stays defined at singularities.
///
/// Args:
///     arm: the model: its kinematics and its gravity.
///     target: `x_d`, one number per row, m or rad.
///     stiffness, damping: positive definite, N/m and N s/m (N m/rad, N m s/rad): scalar, `(m,)` or `(m, m)`.
///     frame: name of the controlled frame (keyword only).
///     axes: the rows, such as "xyz", "xy" or "xyz rx ry rz" (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a matrix is not positive definite, a name is unknown.
///
/// Source: Hogan, Impedance control: an approach to manipulation, J. Dyn. Sys. Meas. Control 107, 1985.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> law = al.CartesianImpedance(arm, [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], frame="link2", axes="xy")
/// >>> run = al.simulate(al.RigidArm(arm), law, [0.3, 1.0], t_end=3.0, method="dop853", t_eval=[0.0, 3.0])
/// >>> arm.position(run.q[-1], "link2").round(3)
/// array([0.4, 0.5, 0. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct CartesianImpedance;

#[entered]
#[pymethods]
impl CartesianImpedance {
    #[new]
    #[pyo3(signature = (arm, target, stiffness, damping, *, frame, axes=None))]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        target: &Bound<'py, PyAny>,
        stiffness: &Bound<'py, PyAny>,
        damping: &Bound<'py, PyAny>,
        frame: &Bound<'py, PyAny>,
        axes: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "CartesianImpedance";
        entry(arm.py(), NAME, || {
            let mut given = Arguments::new(NAME, arm)?;
            let (frame, axes, m) = given.frame_and_axes(frame, axes)?;
            let target = given.vector("target", target, m)?;
            let (stiffness, damping) = (given.gain("stiffness", stiffness, m)?, given.gain("damping", damping, m)?);
            let spec = CartesianImpedanceSpec::new(given.model(), Motion::Hold(target), stiffness, damping, &frame, &axes)?;
            Ok(given.law(spec).add_subclass(CartesianImpedance))
        })
    }
}
