//! Control laws of rigid arms: computed torque, PD and PID with gravity compensation.

use super::adaptive::FRICTION_SPEED;
use super::{Arguments, Law};
use crate::errors::{Failure, input_error};
use armlet_core::law::{ComputedTorqueSpec, PdGravitySpec, PidOptions, PidSpec};
use armlet_macros::entered;
use pyo3::prelude::*;

/// Computed torque: `tau = M (a_d + Kd e_dot + Kp e) + C v + g` with `e = q_d - q`.
///
/// If the plant is the rigid arm of the model, without friction, external forces, sampling and torque limits, the error obeys
/// `e_ddot + Kd e_dot + Kp e = 0`.
///
/// Args:
///     arm: the model of the plant.
///     motion: the desired motion of the joints.
///     kp, kd: positive definite gains, 1/s^2 and 1/s: scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, or a gain is not positive definite.
///
/// Source: [SicilianoEtAl2009], section 8.5.
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
    #[arguments(arm, motion, kp, kd)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let model = given.model();
        let n = model.n();
        let motion = given.motion("motion", motion)?;
        let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
        let spec = ComputedTorqueSpec::new(model, motion, kp, kd)?;
        Ok(given.law(spec).add_subclass(ComputedTorque))
    }
}

/// PD control with gravity compensation: `tau = Kp (q_d - q) - Kd v + g(q)`.
///
/// A rigid arm converges to the target from every state if the model's gravity is exact, and no other forces act. This is proved for a
/// loop without sampling and torque limits.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d`, `(n,)`, rad or m.
///     kp, kd: positive definite gains, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, or a gain is not positive definite.
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
    #[arguments(arm, target, kp, kd)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let model = given.model();
        let n = model.n();
        let target = given.vector("target", target, n)?;
        let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
        let spec = PdGravitySpec::new(model, target, kp, kd)?;
        Ok(given.law(spec).add_subclass(PDGravity))
    }
}

/// PID control with gravity compensation: `u = g(q) + Kp (q_d - q) + Kd (v_d - v) + w` with `w_dot = Ki (q_d - q)`.
///
/// The torque `tau` is `u`, clipped to `tau_max`. With `ki`, the integral torque `w` `(n,)`, N m or N, is the first part of the law's state. It starts
/// at zero, and `run.estimate[:, :n]` records it. The integral removes the error that a constant unknown load would cause. While `u_i`
/// exceeds the limit of joint `i`, `w_i` does not grow in that direction. For a moving target the law adds `M(q) a_d` to `u`.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d`, `(n,)`, rad or m, or a motion of the joints.
///     kp, ki, kd: positive definite gains, N m/rad, N m/(rad s) and N m s/rad (N/m, N/(m s), N s/m): scalar, `(n,)` or `(n, n)`. The loop
///         of a single joint of inertia `m` without filter and observer is stable if `ki < kp kd / m`. `ki=None`: no integral.
///     tau_max: the largest commanded torque, N m or N, scalar or `(n,)`; no limit if None.
///     derivative_filter: `N`, 1/s, scalar or `(n,)` (keyword only). The law replaces `v` by the filtered derivative of `q`,
///         `v_f = N (q - y)` with `y_dot = v_f`. None: the law uses the measured `v`.
///     friction: add the friction of the model at the desired velocity, `damping v_d + friction tanh(v_d / v_s)` (keyword only).
///     friction_speed: `v_s`, rad/s or m/s, > 0, scalar or `(n,)`; 0.1 if None (keyword only).
///     observer_bandwidth: `h`, 1/s, scalar or `(n,)`; None: no disturbance observer (keyword only). The observer estimates
///         `d = h/(p + h) (m a - (tau - g - f))`, where `p` is the Laplace variable and `f` the friction above. The law subtracts `d` from
///         `u`, and adds `m a_d` instead of `M a_d`.
///     nominal_inertia: `m`, kg m^2 or kg, > 0, scalar or `(n,)`; the diagonal of `M` at the first desired position if None (keyword only).
///
/// In `run.estimate`, the state `y` of the filter and then the state `s` of the observer follow `w`. The observer computes
/// `d = h (m v - s)`, or `d = h (m v_f - s)` with a filter.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite, or an option is not positive. It is also
///         raised for `friction_speed` without `friction`, and for `nominal_inertia` without `observer_bandwidth`.
///
/// Source: Arimoto and Miyazaki, Stability and robustness of PID feedback control for robot manipulators, 1984; filter and conditional
/// integration: Astrom and Hagglund, Advanced PID Control, 2006; observer: Ohnishi, Shibata and Murakami, Motion control for advanced
/// mechatronics, 1996.
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
    #[arguments(
        arm, target, kp, ki, kd, tau_max=None, *, derivative_filter=None, friction=false, friction_speed=None, observer_bandwidth=None,
        nominal_inertia=None
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let model = given.model();
        let n = model.n();
        let motion = given.motion_or_hold("target", target, n)?;
        let kp = given.gain("kp", kp, n)?;
        let integral = if ki.is_none() { None } else { Some(given.gain("ki", ki, n)?) };
        if integral.is_none() {
            given.store("ki", ki);
        }
        let kd = given.gain("kd", kd, n)?;
        let friction = given.flag("friction", friction)?;
        let speed = given.rows("friction_speed", friction_speed, n)?;
        if speed.is_some() && !friction {
            return Err(input_error(arm.py(), NAME, "friction_speed", "is not used: expected None without friction").into());
        }
        let options = PidOptions {
            tau_max: given.rows("tau_max", tau_max, n)?,
            derivative_filter: given.rows("derivative_filter", derivative_filter, n)?,
            friction_speed: friction.then(|| speed.unwrap_or_else(|| vec![FRICTION_SPEED; n])),
            observer_bandwidth: given.rows("observer_bandwidth", observer_bandwidth, n)?,
            nominal_inertia: given.rows("nominal_inertia", nominal_inertia, n)?,
        };
        let spec = PidSpec::new(model, motion, kp, integral, kd)?.with(options)?;
        Ok(given.law(spec).add_subclass(PID))
    }
}
