//! Laws of rigid arms.

use super::{Arguments, Law};
use crate::arrays::{Axis, Form, SCALAR, numbers, spread};
use crate::errors::entry;
use armlet_core::law::{ComputedTorqueSpec, PdGravitySpec, PidSpec};
use armlet_macros::entered;
use pyo3::prelude::*;

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
