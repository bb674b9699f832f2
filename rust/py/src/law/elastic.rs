//! Control laws of arms with elastic joints. An *outer loop* computes a torque `u`, and an *inner loop* reduces the motors' inertia.

use super::impedance::{self, OptionArguments};
use super::{Arguments, Law};
use crate::errors::{Failure, input_error};
use armlet_core::law::{
    CartesianImpedanceSpec, ElasticImpedanceSpec, JointImpedanceSpec, JointTrackingSpec, MotorPdSpec, PdGravitySpec, ReductionSpec,
    StateFeedbackSpec,
};
use armlet_core::motion::Motion;
use armlet_macros::entered;
use pyo3::exceptions::PyDeprecationWarning;
use pyo3::prelude::*;

/// The arguments of the inner loop.
struct Inner<'a, 'py> {
    joint_stiffness: &'a Bound<'py, PyAny>,
    motor_inertia: &'a Bound<'py, PyAny>,
    reduced_inertia: &'a Bound<'py, PyAny>,
    motor_damping: Option<&'a Bound<'py, PyAny>>,
    damping_ratio: Option<&'a Bound<'py, PyAny>>,
    relative_damping: Option<&'a Bound<'py, PyAny>>,
}

impl<'py> Inner<'_, 'py> {
    fn read(self, given: &mut Arguments<'py>) -> Result<ReductionSpec, Failure> {
        let n = given.model().n();
        let joint_stiffness = given.gain("joint_stiffness", self.joint_stiffness, n)?;
        let motor_inertia = given.gain("motor_inertia", self.motor_inertia, n)?;
        let reduced_inertia = given.gain("reduced_inertia", self.reduced_inertia, n)?;
        if let (Some(_), Some(ratio)) = (self.motor_damping, self.damping_ratio) {
            let problem = "is a second source of damping: expected motor_damping or damping_ratio, got both";
            return Err(input_error(ratio.py(), given.function(), "damping_ratio", problem).into());
        }
        let damping = self.motor_damping.map(|value| given.gain("motor_damping", value, n)).transpose()?;
        let ratio = self.damping_ratio.map(|value| given.number("damping_ratio", value)).transpose()?.unwrap_or(1.0);
        let relative = given.flag("relative_damping", self.relative_damping)?;
        Ok(ReductionSpec::new(n, joint_stiffness, motor_inertia, reduced_inertia, damping, ratio, relative)?)
    }
}

/// The arguments of the outer loop, without its target.
struct Outer<'a, 'py> {
    stiffness: &'a Bound<'py, PyAny>,
    damping: &'a Bound<'py, PyAny>,
    frame: &'a Bound<'py, PyAny>,
    axes: Option<&'a Bound<'py, PyAny>>,
    options: OptionArguments<'a, 'py>,
}

/// Make a law with a Cartesian impedance as the outer loop, and an inner loop. `target` reads the motion of the target for given axes.
fn cartesian<'py>(
    given: &mut Arguments<'py>,
    outer: Outer<'_, 'py>,
    inner: Inner<'_, 'py>,
    target: impl FnOnce(&mut Arguments<'py>, &str) -> Result<Motion, Failure>,
) -> Result<ElasticImpedanceSpec, Failure> {
    let (frame, axes, m) = given.frame_and_axes(outer.frame, outer.axes)?;
    let target = target(given, &axes)?;
    let (stiffness, damping) = (given.gain("stiffness", outer.stiffness, m)?, given.gain("damping", outer.damping, m)?);
    let law = CartesianImpedanceSpec::new(given.model(), target, stiffness, damping, &frame, &axes)?;
    let inner = inner.read(given)?;
    let outer = law.with(outer.options.read(given, m)?)?;
    Ok(ElasticImpedanceSpec { outer, inner })
}

/// Cartesian impedance of an arm with elastic joints: a spring and a damper at a frame, and a reduction of the motors' inertia.
///
/// `tau = (I - B B0^-1) K_J (theta - q) + B B0^-1 (u - D0 theta_dot)` with `u = J'(K (x_d - x) - D J v) + g(q)`. Motors of inertia `B` then
/// behave like motors of the smaller inertia `B0`. With an external force `F` and without options, the equilibrium is `x_E = x_d + K^-1 F`
/// if that pose is reachable, regular and stable (see `equilibrium`). The joint torque is then `tau_E = g(q_E) - J'F`. Without options the
/// law uses no inverse of `J`. For diagnosis, `terms()` returns the mass and Coriolis matrices `M_x`, `S_x` in the coordinates of the
/// target, NaN where `J` loses rank.
///
/// Args:
///     arm: the model of the links, for kinematics and gravity.
///     target: `x_d`, `(m,)`, m or rad; a pose `(4, 4)`; or a motion of the m coordinates.
///     stiffness, damping: `K` and `D`, positive definite, N/m and N s/m (N m/rad, N m s/rad): scalar, `(m,)` or `(m, m)`.
///     joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
///     motor_inertia, reduced_inertia: `B` and `B0`, kg m^2 or kg, positive definite: scalar, `(n,)` or `(n, n)`.
///     frame: name of the controlled frame (keyword only).
///     axes: the m controlled coordinates in world axes, such as "xy" or "xyz rx ry rz"; "xyz" if None (keyword only).
///
/// Other Args:
///     motor_damping: `D0`, N m s/rad or N s/m, positive definite: scalar, `(n,)` or `(n, n)`; computed from `damping_ratio` if None
///         (keyword only).
///     damping_ratio: `zeta` > 0 of `D0 = 2 zeta B0^1/2 (B0^-1/2 K_J B0^-1/2)^1/2 B0^1/2`; 1 if None (keyword only).
///     relative_damping: `D0` acts on `theta_dot - v` (keyword only). The motion is then nearer to the motion of a rigid arm with the same
///         outer loop.
///     nullspace, feedforward, compensate_coupling, eps, integral_gain, wrench_max: options of the outer loop, as for
///         `CartesianImpedance` (keyword only).
///     tau_max: the largest commanded motor torque, N m or N, scalar or `(n,)`; no limit if None (keyword only). While a motor torque
///         exceeds its limit, the integral wrench does not change in directions that increase the excess.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a matrix is not positive definite, a name is unknown, or a limit is
///         not positive.
///
/// Source: Ott, Albu-Schaeffer, Kugi and Hirzinger, On the passivity-based impedance control of flexible joint robots,
/// IEEE Trans. Robotics 24(2), 2008.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> plant = al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25])
/// >>> law = al.ElasticImpedance(arm, [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], [800.0, 500.0], [0.4, 0.25], [0.02, 0.0125],
/// ...                           frame="link2", axes="xy")
/// >>> law.terms(0.0, [0.3, 1.0], [0.0, 0.0], theta=[0.3, 1.0], theta_dot=[0.0, 0.0])["D0"]
/// array([[8., 0.],
///        [0., 5.]])
/// >>> run = al.simulate(plant, law, [0.3, 1.0], t_end=5.0, method="dop853", t_eval=[0.0, 5.0], force=[10.0, -15.0])
/// >>> arm.position(run.q[-1], "link2").round(3)
/// array([0.433, 0.425, 0.   ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct ElasticImpedance;

#[entered]
#[pymethods]
impl ElasticImpedance {
    #[new]
    #[arguments(
        arm, target, stiffness, damping, joint_stiffness, motor_inertia, reduced_inertia, *, frame, axes=None, motor_damping=None,
        damping_ratio=None, relative_damping=false, nullspace=None, feedforward=None, compensate_coupling=false, eps=None,
        integral_gain=None, wrench_max=None, tau_max=None
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let inner = Inner { joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping };
        let options = OptionArguments { nullspace, feedforward, compensate_coupling, eps, integral_gain, wrench_max, tau_max };
        let outer = Outer { stiffness, damping, frame, axes, options };
        let law = cartesian(&mut given, outer, inner, |given, axes| impedance::target(given, target, axes))?;
        Ok(given.law(law).add_subclass(ElasticImpedance))
    }
}

/// Deprecated: `ElasticImpedance` with a motion as its target is the same law, with more options. A construction issues a
/// `DeprecationWarning`.
///
/// The outer loop is `u = J'(K (x_d(t) - x) + D (x_d_dot(t) - J v)) + g(q)`, and the inner loop is the same as in `ElasticImpedance`. The
/// law has no feed-forward of the arm's inertia, so it follows an accelerating target with an error.
///
/// Args:
///     target: the motion of the target in the m coordinates of `axes`, m or rad.
///     arm, stiffness, damping, joint_stiffness, frame, axes: as for `ElasticImpedance`.
///     motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping: as for `ElasticImpedance`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite or out of its range, a matrix is not positive definite, or a name is unknown.
///
/// Source: [Ott2008]; docs/elastic.md.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> line = al.Quintic([0.6, 0.3], [0.4, 0.5], 2.0)
/// >>> law = al.ElasticImpedance(arm, line, 300.0, 40.0, 800.0, 0.4, 0.02, frame="link2", axes="xy", relative_damping=True)
/// >>> law.terms(2.0, [0.3, 1.0], [0.0, 0.0], theta=[0.3, 1.0], theta_dot=[0.0, 0.0])["x_d"]
/// array([0.4, 0.5])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct ElasticTracking;

#[entered]
#[pymethods]
impl ElasticTracking {
    #[new]
    #[arguments(
        arm, target, stiffness, damping, joint_stiffness, motor_inertia, reduced_inertia, *, frame, axes=None, motor_damping=None,
        damping_ratio=None, relative_damping=false
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let replacement = c"armlet.ElasticTracking is deprecated: use armlet.ElasticImpedance, whose target may be a motion";
        PyErr::warn(py, &py.get_type::<PyDeprecationWarning>(), replacement, 1)?;
        let mut given = Arguments::new(NAME, arm)?;
        let inner = Inner { joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping };
        let outer = Outer { stiffness, damping, frame, axes, options: OptionArguments::default() };
        let law = cartesian(&mut given, outer, inner, |given, _| given.motion("target", target))?;
        Ok(given.law(law).add_subclass(ElasticTracking))
    }
}

/// Joint impedance of an arm with elastic joints: `u = K (q_d - q) + D (v_d - v) + g(q)`.
///
/// The inner loop, which computes the motor torque from `u`, is the same as in `ElasticImpedance`. The velocity `v_d` of the target is zero
/// for a constant target. The law has no feed-forward of inertia, so the links follow an accelerating target with an error. If the target
/// has a constant velocity, and mass matrix and gravity are constant, the error vanishes with `relative_damping=True`. Without it, the
/// motor damping `D0` causes the error `K^-1 D0 v_d`. `JointTracking` follows every smooth motion without error.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d`, `(n,)`, rad or m, or a motion of the joints.
///     stiffness, damping: `K` and `D`, N m/rad and N m s/rad (N/m, N s/m), positive definite: scalar, `(n,)` or `(n, n)`.
///     joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping: as for `ElasticImpedance`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite or out of its range, or a matrix is not positive definite.
///
/// Source: Albu-Schaeffer, Ott and Hirzinger, A unified passivity-based control framework for flexible joint robots,
/// IJRR 26(1), 2007.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> law = al.JointImpedance(arm, [0.3, 1.0], 50.0, [4.0, 2.0], [800.0, 500.0], [0.4, 0.25], [0.02, 0.0125])
/// >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.0, 0.5], t_end=3.0, method="dop853")
/// >>> run.q[-1].round(3)
/// array([0.3, 1. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct JointImpedance;

#[entered]
#[pymethods]
impl JointImpedance {
    #[new]
    #[arguments(
        arm, target, stiffness, damping, joint_stiffness, motor_inertia, reduced_inertia, *, motor_damping=None, damping_ratio=None,
        relative_damping=false
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let n = given.model().n();
        let target = given.motion_or_hold("target", target, n)?;
        let (stiffness, damping) = (given.gain("stiffness", stiffness, n)?, given.gain("damping", damping, n)?);
        let outer = PdGravitySpec::following(given.model(), target, stiffness, damping)?;
        let inner = Inner { joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping };
        let inner = inner.read(&mut given)?;
        Ok(given.law(JointImpedanceSpec { outer, inner }).add_subclass(JointImpedance))
    }
}

/// Tracking of a joint motion with elastic joints: feed-forward of links and motors, and PD control of the motors.
///
/// `tau = B theta_d_ddot + tau_J,d + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot)` with the desired joint torque
/// `tau_J,d = M(q_d) a_d + C(q_d, v_d) v_d + g(q_d)` and the desired motor position `theta_d = q_d + K_J^-1 tau_J,d`. `theta_d_dot` and
/// `theta_d_ddot` contain jerk and snap of the motion. With an exact model, and a start at `theta_d` and `theta_d_dot`, the links follow
/// the motion without error.
///
/// Args:
///     arm: the model of the links.
///     motion: `q_d(t)` of the links, with jerk and snap at every time: no `BangBang`, and no path whose acceleration jumps.
///     kp, kd: positive definite gains of the motors, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
///     joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
///     motor_inertia: `B`, kg m^2 or kg, positive definite: scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, the acceleration of the motion jumps, or a gain, `joint_stiffness` or
///         `motor_inertia` is not positive definite.
///
/// Source: [DeLucaBook2016, Spong1987]; docs/elastic.md.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> motion = al.Sinusoid([0.3, 1.0], 0.4, 3.0, 0.3)
/// >>> law = al.JointTracking(arm, motion, 100.0, 10.0, [800.0, 500.0], [0.4, 0.25])
/// >>> q, v, _ = motion(0.0)
/// >>> start = law.terms(0.0, q, v, theta=q, theta_dot=v)
/// >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, q, v0=v, theta0=start["theta_d"],
/// ...                   theta_dot0=start["theta_d_dot"], t_end=2.0, method="dop853", rtol=1e-10, atol=1e-12)
/// >>> bool(abs(run.q[-1] - motion(2.0)[0]).max() < 1e-7)
/// True
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct JointTracking;

#[entered]
#[pymethods]
impl JointTracking {
    #[new]
    #[arguments(arm, motion, kp, kd, joint_stiffness, motor_inertia)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let n = given.model().n();
        let motion = given.motion("motion", motion)?;
        let gains = [given.gain("kp", kp, n)?, given.gain("kd", kd, n)?];
        let joint_stiffness = given.gain("joint_stiffness", joint_stiffness, n)?;
        let motor_inertia = given.gain("motor_inertia", motor_inertia, n)?;
        let spec = JointTrackingSpec::new(given.model(), motion, gains, joint_stiffness, motor_inertia)?;
        Ok(given.law(spec).add_subclass(JointTracking))
    }
}

/// PD control of the motors of elastic joints with gravity compensation: `tau = Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot) + g`.
///
/// `theta_d = q_d + K_J^-1 g(q_d)`. The compensation is that of the target, `g = g(q_d)`, or online, `g = g(theta - K_J^-1 g(q_d))`. With an
/// exact model and no external force, `q_d` is an equilibrium in both cases. If `kp` is too small compared with the derivative of gravity,
/// there may be further equilibria (see `equilibrium`).
///
/// For a motion `q_d(t)`, `theta_d` and `g(q_d)` follow the motion, and `theta_d_dot` is the derivative of `theta_d` with respect to time.
/// This is the feed-forward of gravity and of the deflection that it causes, without a feed-forward of inertia. The error vanishes where the
/// motion rests. It also vanishes at constant velocity if mass matrix and gravity are constant, and the plant has no friction.
/// `JointTracking` follows every smooth motion without error.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d` of the links, `(n,)`, rad or m, or a motion of the joints.
///     kp, kd: positive definite gains of the motors, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
///     joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
///     online: compute the gravity compensation from the motor positions at every instant (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, or a gain or `joint_stiffness` is not positive definite.
///
/// Source: Tomei, A simple PD controller for robots with elastic joints, IEEE Trans. Automatic Control 36(10), 1991; De Luca,
/// Siciliano and Zollo, PD control with on-line gravity compensation for robots with elastic joints, Automatica 41, 2005.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> law = al.MotorPD(arm, [0.3, 1.0], 100.0, 20.0, [800.0, 500.0], online=True)
/// >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.0, 0.5], t_end=10.0, method="dop853")
/// >>> run.q[-1].round(3)
/// array([0.3, 1. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct MotorPD;

#[entered]
#[pymethods]
impl MotorPD {
    #[new]
    #[arguments(arm, target, kp, kd, joint_stiffness, *, online=false)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let n = given.model().n();
        let target = given.motion_or_hold("target", target, n)?;
        let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
        let joint_stiffness = given.gain("joint_stiffness", joint_stiffness, n)?;
        let online = given.flag("online", online)?;
        let spec = MotorPdSpec::new(given.model(), target, kp, kd, joint_stiffness, online)?;
        Ok(given.law(spec).add_subclass(MotorPD))
    }
}

/// Regulation of elastic joints by feedback of motor position, motor velocity, joint torque `tau_J` and its time derivative.
///
/// `tau = g_d + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot) + Kt (g_d - tau_J) + Ks (g_d_dot - tau_J_dot)` with `g_d = g(q_d)`,
/// `theta_d = q_d + K_J^-1 g_d` and `tau_J = K_J (theta - q)`.
///
/// For a constant target, `theta_d_dot` and `g_d_dot` are zero. For a motion, they are derivatives with respect to time. As for `MotorPD`,
/// this is a feed-forward of gravity and deflection, without a feed-forward of inertia, and the error vanishes under the same conditions.
///
/// Args:
///     arm: the model whose gravity is compensated.
///     target: `q_d` of the links, `(n,)`, rad or m, or a motion of the joints.
///     kp, kd: positive definite gains of the motors, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
///     kt: positive definite gain of the joint torque, without unit: scalar, `(n,)` or `(n, n)`.
///     ks: positive definite gain of the derivative of the joint torque, s: scalar, `(n,)` or `(n, n)`.
///     joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, or a gain or `joint_stiffness` is not positive definite.
///
/// Source: Albu-Schaeffer and Hirzinger, A globally stable state feedback controller for flexible joint robots,
/// Advanced Robotics 15(8), 2001.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> law = al.StateFeedback(arm, [0.3, 1.0], 200.0, 20.0, 1.0, 0.02, [800.0, 500.0])
/// >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.0, 0.5], t_end=10.0, method="dop853")
/// >>> run.q[-1].round(3)
/// array([0.3, 1. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct StateFeedback;

#[entered]
#[pymethods]
impl StateFeedback {
    #[new]
    #[arguments(arm, target, kp, kd, kt, ks, joint_stiffness)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let n = given.model().n();
        let target = given.motion_or_hold("target", target, n)?;
        let gains = [given.gain("kp", kp, n)?, given.gain("kd", kd, n)?, given.gain("kt", kt, n)?, given.gain("ks", ks, n)?];
        let joint_stiffness = given.gain("joint_stiffness", joint_stiffness, n)?;
        let spec = StateFeedbackSpec::new(given.model(), target, gains, joint_stiffness)?;
        Ok(given.law(spec).add_subclass(StateFeedback))
    }
}
