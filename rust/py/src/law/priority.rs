//! Laws of tasks in priority.

use super::{Given, Law};
use crate::arrays::optional_number;
use crate::errors::{Failure, entry};
use crate::priority::Keywords;
use crate::task::each;
use armlet_core::law::{LawSpec, Level, PriorityAccelerationSpec, PriorityVelocitySpec};
use armlet_core::priority::Options;
use pyo3::prelude::*;

impl<'py> Given<'py> {
    /// The levels of these tasks and how they are solved.
    fn levels(
        &mut self,
        function: &str,
        tasks: &Bound<'py, PyAny>,
        method: &str,
        options: [(&'static str, Option<&Bound<'py, PyAny>>); 3],
    ) -> Result<(Vec<Level>, Options), Failure> {
        let model = self.model();
        let arm = model.tree("arm")?;
        let (kept, levels) = each(function, tasks, |task| task.level(arm))?;
        self.plain("tasks", &kept.into_bound(tasks.py()).into_any());
        self.plain("method", &pyo3::types::PyString::new(tasks.py(), method).into_any());
        let [(_, eps), (_, v_min), (_, v_max)] = options;
        for (name, value) in options {
            if let Some(value) = value {
                self.keep(name, value)?;
            }
        }
        let keywords = Keywords { method, eps, rounding: None, weight: None, v_min, v_max };
        let options = keywords.options(function, model.n(), levels.len())?;
        Ok((levels, options))
    }
}

/// Tasks in priority on an arm whose joint velocities are the input: `u` solves `J_i u = x_d,i' + K_i e_i`, the highest first.
///
/// Closed-loop inverse kinematics: each error decays with its gain as long as the directions it needs are free. `terms` gives
/// `e`, `J`, `command` and `residuals` as lists with one entry per level, `ranks`, and `v`. Monitors: `error_i`, `residual_i`.
///
/// Args:
///     arm: the model, of links.
///     tasks: `Task` and its kin, the highest first, each with a target.
///     method: "clamp" (default), "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
///     eps: threshold on singular values, one number or one per level; None: 0.02 of each level's largest row norm.
///     v_min, v_max: bounds for "sns", a number or `(n,)`, rad/s or m/s; None: the arm's own (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a name is unknown, a task has no target, the method is unknown.
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

#[pymethods]
impl PriorityVelocity {
    #[new]
    #[pyo3(signature = (arm, tasks, method="clamp", eps=None, *, v_min=None, v_max=None))]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        tasks: &Bound<'py, PyAny>,
        method: &str,
        eps: Option<&Bound<'py, PyAny>>,
        v_min: Option<&Bound<'py, PyAny>>,
        v_max: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "PriorityVelocity";
        entry(arm.py(), NAME, || {
            let mut given = Given::new(NAME, arm)?;
            let (levels, options) = given.levels(NAME, tasks, method, [("eps", eps), ("v_min", v_min), ("v_max", v_max)])?;
            let spec = PriorityVelocitySpec::new(given.model(), levels, options)?;
            Ok(given.law(LawSpec::PriorityVelocity(spec)).add_subclass(PriorityVelocity))
        })
    }
}

/// Tasks in priority on a rigid arm: computed torque on prioritised accelerations.
///
/// `a` solves `J_i a = x_d,i'' + D_i (x_d,i' - J_i v) + K_i e_i - dJ_i/dt v`, the highest first, and `a = -c v` in the freedom
/// that is left; `tau = M a + C v + g`. Gains of tasks are in 1/s^2, their `damping` in 1/s.
///
/// Args:
///     arm, tasks, eps: as for `PriorityVelocity`.
///     method: "clamp" (default), "exact", "damped" or "chiaverini".
///     joint_damping: `c`, 1/s, >= 0 (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a name is unknown, a task has no target, the method is unknown.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4, 0.3])
/// >>> law = al.PriorityAcceleration(arm, [al.Task("link3", "xy", [0.6, 0.5], 100.0)])
/// >>> run = al.simulate(al.RigidArm(arm), law, [0.3, 0.8, 0.4], t_end=2.0, dt=2e-3)
/// >>> arm.position(run.q[-1], "link3").round(4)
/// array([0.6, 0.5, 0. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct PriorityAcceleration;

#[pymethods]
impl PriorityAcceleration {
    #[new]
    #[pyo3(signature = (arm, tasks, method="clamp", eps=None, *, joint_damping=None))]
    fn new<'py>(
        arm: &Bound<'py, PyAny>,
        tasks: &Bound<'py, PyAny>,
        method: &str,
        eps: Option<&Bound<'py, PyAny>>,
        joint_damping: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "PriorityAcceleration";
        entry(arm.py(), NAME, || {
            let mut given = Given::new(NAME, arm)?;
            let (levels, options) = given.levels(NAME, tasks, method, [("eps", eps), ("v_min", None), ("v_max", None)])?;
            let damping = optional_number(NAME, "joint_damping", joint_damping)?.unwrap_or(JOINT_DAMPING);
            if let Some(value) = joint_damping {
                given.plain("joint_damping", value);
            }
            let spec = PriorityAccelerationSpec::new(given.model(), levels, options, damping)?;
            Ok(given.law(LawSpec::PriorityAcceleration(spec)).add_subclass(PriorityAcceleration))
        })
    }
}

/// Damping of motions that no task sees, 1/s.
const JOINT_DAMPING: f64 = 5.0;
