//! A level of priority: a task, its target motion, and the gain of its error.

use super::sizes::require_size;
use crate::error::{Error, Result};
use crate::kinematics::TaskFunction;
use crate::linalg::Gain;
use crate::motion::Motion;

/// One level of priority. It commands the task velocity `x_d_dot + K e`, with the error `e`. In a law of accelerations, it commands the
/// task acceleration `x_d_ddot + D e_dot + K e`.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::kinematics::TaskFunction;
/// use armlet_core::law::{ArmSolver, Gain, LawSpec, Level, LimitOverrides, PriorityAccelerationSpec};
/// use armlet_core::motion::Motion;
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::priority::PriorityOptions;
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let arm = Arm::planar(&[0.5, 0.4, 0.3], None, None, None, [0.0, -9.81])?;
/// let (tip, posture) = (TaskFunction::frame(&arm, "link3", "xy")?, TaskFunction::posture(&arm, None)?);
/// let q0 = dvector![0.3, 0.4, 0.5];
/// // Joint velocities for the task of the tip alone, at one configuration.
/// let mut solver = ArmSolver::new(&arm, vec![tip.clone()], &PriorityOptions::default())?;
/// assert_eq!(solver.solve(q0.as_slice(), &[0.1, 0.0])?.ranks(), [2]);
/// // The same task as the first level of a law of accelerations.
/// let levels = vec![
///     Level::new(tip, Motion::hold(dvector![0.7, 0.6])?, Gain::scalar("gain", 2, 25.0)?, None)?,
///     Level::new(posture, Motion::hold(q0.clone())?, Gain::scalar("gain", 3, 4.0)?, None)?,
/// ];
/// let model = Model::from(arm);
/// let law = PriorityAccelerationSpec::new(model.clone(), levels, PriorityOptions::default(), 1.0, &LimitOverrides::default())?;
/// let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model)));
/// let run = Problem::from_rest(&plant, &law, &q0, Options::fixed(0.1, 1e-3))?.run()?;
/// assert_eq!(run.inputs().shape(), (3, 101));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The task function.
    pub function: TaskFunction,
    /// The desired motion. A constant target is a motion at rest. A task without a target has a motion of size zero.
    pub target: Motion,
    /// Gain `K`, `(rows, rows)`: 1/s, or 1/s^2 in a law of accelerations.
    pub gain: Gain,
    /// Gain `D` of the error's rate, `(rows, rows)`, 1/s, in a law of accelerations. `None` means critical damping, `2 K^(1/2)`.
    pub damping: Option<Gain>,
}

impl Level {
    /// Create a level. `damping = None` means critical damping. Errors: `WrongShape` for a wrong size, `Input` for an invalid constant
    /// target.
    pub fn new(function: TaskFunction, target: Motion, gain: Gain, damping: Option<Gain>) -> Result<Self> {
        match &target {
            Motion::Hold(target) => function.require_target(target)?,
            moving if moving.dof() != function.target_size() => {
                let (expected, got) = (function.target_size(), moving.dof());
                return Err(Error::wrong_shape("target", &[expected], &[got]));
            }
            _ => {}
        }
        require_size("gain", &gain, function.rows())?;
        damping.iter().try_for_each(|damping| require_size("damping", damping, function.rows()))?;
        Ok(Level { function, target, gain, damping })
    }

    /// The gain `D` of the error's rate, `(rows, rows)`, 1/s.
    pub fn rate_gain(&self) -> Gain {
        self.damping.clone().unwrap_or_else(|| self.gain.square_root().scaled(2.0))
    }
}
