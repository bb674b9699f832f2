//! The laws `PriorityVelocity` and `PriorityAcceleration`, which control tasks with priorities.

use super::{Arguments, Law};
use crate::arrays::{flag, optional_number};
use crate::errors::Failure;
use crate::priority::{Keywords, method_name, per_joint};
use crate::task::levels::Levels;
use crate::warnings::warn;
use armlet_core::law::{Level, LimitOverrides, PriorityAccelerationSpec, PriorityVelocitySpec};
use armlet_core::priority::{PriorityMethod, PriorityOptions};
use armlet_macros::entered;
use pyo3::prelude::*;

/// The name and the value of a keyword of a law; `None` for a missing keyword.
type Keyword<'a, 'py> = (&'static str, Option<&'a Bound<'py, PyAny>>);

impl<'py> Arguments<'py> {
    /// Read the levels of the tasks, the options of the priority method, and the limits of the caller.
    fn levels(
        &mut self,
        function: &str,
        tasks: &Bound<'py, PyAny>,
        method: Option<&Bound<'py, PyAny>>,
        eps: Option<&Bound<'py, PyAny>>,
        limits: &[Keyword<'_, 'py>],
    ) -> Result<(Vec<Level>, PriorityOptions, LimitOverrides), Failure> {
        let method = method_name(function, method)?;
        let model = self.model();
        let arm = model.tree("arm")?;
        let levels = Levels::read(function, tasks, arm)?;
        self.store("tasks", levels.stored.bind(tasks.py()).as_any());
        self.store("method", &pyo3::types::PyString::new(tasks.py(), method).into_any());
        let keywords = Keywords { method, eps, rounding: None, weight: None, v_min: None, v_max: None, scale: None };
        let options = keywords.options(function, model.n(), levels.count())?;
        if let Some(eps) = eps {
            self.store_copy("eps", eps)?;
        }
        let mut given = LimitOverrides::default();
        for &(name, value) in limits {
            let Some(value) = value else { continue };
            if name == "horizon" {
                given.horizon = Some(self.number(name, value)?);
                continue;
            }
            if name == "limits" {
                given.own = Some(flag(function, name, value)?);
                self.store(name, value);
                continue;
            }
            let limit = match name {
                "q_min" => &mut given.q_min,
                "q_max" => &mut given.q_max,
                "v_min" => &mut given.v_min,
                "v_max" => &mut given.v_max,
                _ => &mut given.a_max,
            };
            *limit = Some(per_joint(function, name, value, model.n())?);
            self.store_copy(name, value)?;
        }
        Ok((levels.tasks, options, given))
    }

    /// Warn of limits of the arm that the law ignores. `of_torques`: whether it reads those of torque or force.
    fn warn_of_ignored(&self, limits: &LimitOverrides, method: PriorityMethod, of_torques: bool) -> Result<(), Failure> {
        let ignored = limits.ignored(&self.model(), method, of_torques)?;
        if !ignored.is_empty() {
            let option = if limits.own.is_some() { "limits=True" } else { "the method sns" };
            warn(self.arm.py(), format!("{}: {option} ignores limits of the arm: {}", self.function(), ignored.join("; ")))?;
        }
        Ok(())
    }
}

/// Closed-loop inverse kinematics of tasks with priorities, for an arm whose input `u` is the joint velocities.
///
/// `u` solves `J_i u = x_d_dot,i + K_i e_i` for each task `i`, in the order of priority. `J_i` is the Jacobian of the task, and `x_d_dot,i`
/// the velocity of its target. Away from singularities, the error `e_i` decays with the gain `K_i` if tasks of higher priority do not use
/// its directions. `terms` returns `e`, `J`, `command` and `residuals`, each a list with one entry per level, and the arrays `ranks` and
/// `v`. `run.monitors` has the series `error_i` and `residual_i` of each level. With limits, `terms` also has the bounds `lower` and `upper`
/// of `v`. The terms `limits` and `active` are the active rows as in `PrioritySolution`, and `why` is a list of one sentence per level.
/// `holds` are the bounds that hold a level, with side, level and share. `run.monitors` also has `violation_i`, and the certificate `kkt`.
/// `run.active` lists which bound held which level, and when. The same holds for tasks with bounds.
///
/// Args:
///     arm: the model; not `planar_pr`, which has no links.
///     tasks: `Task` and other tasks, each with a target or bounds, a gain in 1/s and without `damping`, the highest priority first. A list
///         of tasks in place of a task shares one level. Its entries are tasks, or pairs of a task and the weight of its squared error.
///     method: "clamp" (default), "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
///     eps: threshold on singular values, one number or one per level; None: 0.02 times each level's largest row norm. "exact" and "sns" do
///         not accept it.
///     v_min, v_max: velocity bounds, a number or `(n,)`, rad/s or m/s (keyword only). A missing bound is minus the other bound. All limits
///         hold above all levels, with every method but "chiaverini".
///     q_min, q_max: position limits, a number or `(n,)`, rad or m (keyword only). At the distance `d` from a limit, the velocity towards it
///         is at most `a_max h (sqrt(1 + 2 d / (a_max h^2)) - 1)`, which is `d / h` without `a_max`.
///     a_max: deceleration before a position limit, a number or `(n,)`, rad/s^2 or m/s^2 (keyword only). None: without this bound.
///     horizon: the time `h`, s (keyword only). None: the sample period of a sampled loop, otherwise 0.1; "sns": 0.1. It must be at least the
///         step or the sample time. A joint outside of its limits returns within this time, at most with its velocity bound.
///     limits: whether the arm's own limits of velocity and position hold where no other limit is given (keyword only). None: only with
///         "sns", except limits of zero; with other methods, `simulate` and calls of the law warn if commands pass them. True ignores
///         velocity limits that are not positive, and empty ranges of positions, with a warning. False: they do not hold, without a warning.
///
/// Raises:
///     InputError: a shape is wrong, a number is out of its range, a task has no target, or a name or the method is unknown. It is also
///         raised for "sns" without velocity bounds, for limits with "chiaverini", and for `limits=True` if the arm has no limits.
///
/// Source: Siciliano and Slotine, A general framework for managing multiple tasks in highly redundant robotic systems, ICAR 1991.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
/// >>> law = al.PriorityVelocity(arm, [al.Task("link4", "xy", [1.2, 1.0], 5.0), al.Task("link2", "xy", [0.9, 0.8], 5.0)])
/// >>> run = al.simulate(al.VelocityArm(arm), law, [0.0, 1.2, 0.4, 0.4], t_end=4.0, dt=0.01)
/// >>> arm.position(run.q[-1], "link4").round(6)
/// array([1.2, 1. , 0. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct PriorityVelocity;

#[entered]
#[pymethods]
impl PriorityVelocity {
    #[new]
    #[arguments(
        arm, tasks, method="clamp", eps=None, *, v_min=None, v_max=None, q_min=None, q_max=None, a_max=None, horizon=None, limits=None
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let limits = [
            ("v_min", v_min),
            ("v_max", v_max),
            ("q_min", q_min),
            ("q_max", q_max),
            ("a_max", a_max),
            ("horizon", horizon),
            ("limits", limits),
        ];
        let (levels, options, limits) = given.levels(NAME, tasks, method, eps, &limits)?;
        let method_of = options.method;
        let spec = PriorityVelocitySpec::new(given.model(), levels, options, &limits)?;
        given.warn_of_ignored(&limits, method_of, false)?;
        Ok(given.law(spec).add_subclass(PriorityVelocity))
    }
}

/// Computed-torque control of tasks with priorities, for a rigid arm.
///
/// `a` solves `J_i a = x_d_ddot,i + D_i (x_d_dot,i - J_i v) + K_i e_i - dJ_i/dt v` for each task `i`, in the order of priority. In
/// directions that no task uses, `a = -c v`. The torque is `tau = M a + C v + g`.
///
/// With `tau_max` and other limits, a bound of the accelerations can require a torque beyond its limit. Then the torque limit holds, the
/// other limits are missed as little as possible, and the term `status` is `Status.INFEASIBLE`. The term `limit_violations`, `(n,)`, and the
/// monitor `violation_0`, its norm, are the accelerations by which the bounds are missed.
///
/// Args:
///     arm, eps: as for `PriorityVelocity`.
///     tasks: as for `PriorityVelocity`, each with a target or bounds, a gain `K_i` in 1/s^2 and a damping `D_i` in 1/s, the highest
///         priority first.
///     method: "clamp" (default), "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
///     joint_damping: `c`, 1/s, >= 0; 5 if None (keyword only).
///     a_max: bound of the joint accelerations, a number or `(n,)`, rad/s^2 or m/s^2; None: without bound (keyword only).
///     v_min, v_max, q_min, q_max, limits: as for `PriorityVelocity` (keyword only). In a sampled loop, the bounds are the range of
///         accelerations after which the joint can still stop within its limits with `a_max`. A joint outside of its
///         limits returns as fast as they allow.
///     horizon: None for these bounds, except with "sns", whose horizon is 0.1 (keyword only). A time in s, and every continuous loop, have
///         the bound `(v_u - v) / horizon` with `v_u = min(v_max, (q_max - q) / (4 horizon), sqrt(a_max (q_max - q)))`.
///     tau_max: torque limits, a number or `(n,)`, N m or N, which hold above all other limits (keyword only). None: without limits; with
///         `limits=True` the arm's effort limits, of which those that are not positive are ignored with a warning. `inf`: without limits.
///
/// Raises:
///     InputError: a shape is wrong, a number is out of its range, a task has no target, or a name or the method is unknown. It is also
///         raised for "sns" without velocity bounds, for limits with "chiaverini", and for `limits=True` if the arm has no limits.
///
/// Source: [siciliano1991priority, nakanishi2008operational]; bounds: [delprete2018joint, flacco2015saturation].
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4, 0.3])
/// >>> law = al.PriorityAcceleration(arm, [al.Task("link3", "xy", [0.6, 0.5], 100.0)])
/// >>> run = al.simulate(al.RigidArm(arm), law, [0.3, 0.8, 0.4], t_end=2.0, dt=2e-3)
/// >>> arm.position(run.q[-1], "link3").round(4)
/// array([0.6, 0.5, 0. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct PriorityAcceleration;

#[entered]
#[pymethods]
impl PriorityAcceleration {
    #[new]
    #[arguments(
        arm, tasks, method="clamp", eps=None, *, joint_damping=None, a_max=None, v_min=None, v_max=None, q_min=None, q_max=None,
        horizon=None, limits=None, tau_max=None
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let limits = [
            ("a_max", a_max),
            ("v_min", v_min),
            ("v_max", v_max),
            ("q_min", q_min),
            ("q_max", q_max),
            ("horizon", horizon),
            ("limits", limits),
        ];
        let (levels, options, limits) = given.levels(NAME, tasks, method, eps, &limits)?;
        let method_of = options.method;
        let damping = optional_number(NAME, "joint_damping", joint_damping)?.unwrap_or(JOINT_DAMPING);
        if let Some(value) = joint_damping {
            given.store("joint_damping", value);
        }
        let mut spec = PriorityAccelerationSpec::new(given.model(), levels, options, damping, &limits)?;
        if let Some(value) = tau_max {
            spec = spec.with_torque_limits(per_joint(NAME, "tau_max", value, given.model().n())?)?;
            given.store_copy("tau_max", value)?;
        } else if let Some(efforts) = limits.efforts(&given.model(), method_of)? {
            spec = spec.with_torque_limits(efforts)?;
        }
        given.warn_of_ignored(&limits, method_of, tau_max.is_none())?;
        Ok(given.law(spec).add_subclass(PriorityAcceleration))
    }
}

/// The default of `joint_damping`, 1/s: the damping of motions that change no task.
const JOINT_DAMPING: f64 = 5.0;
