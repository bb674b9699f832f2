//! A level of priority: a task, its target motion, and the gain of its error.

use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::kinematics::{TaskFunction, TaskStack};
use crate::linalg::gain::Gain;
use crate::motion::Motion;
use crate::priority::PriorityOptions;
use crate::scalar::Real;

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
        super::sizes::require_size("gain", &gain, function.rows())?;
        damping.iter().try_for_each(|damping| super::sizes::require_size("damping", damping, function.rows()))?;
        Ok(Level { function, target, gain, damping })
    }

    /// The gain `D` of the error's rate, `(rows, rows)`, 1/s.
    pub fn rate_gain(&self) -> Gain {
        self.damping.clone().unwrap_or_else(|| self.gain.square_root().scaled(2.0))
    }
}

/// Implement the common functions of laws with the fields `model`, `levels` and `options`.
macro_rules! prioritised {
    ($name:literal, $plant:ident) => {
        fn name(&self) -> &'static str {
            $name
        }
        fn plant(&self) -> PlantKind {
            PlantKind::$plant
        }
        fn model(&self) -> &Model {
            &self.model
        }
        fn motions(&self) -> Vec<&Motion> {
            self.levels.iter().map(|level| &level.target).collect()
        }
        fn route(&self) -> Route {
            if self.options.method.has_bounds() { Route::Deciding } else { Route::Guarded }
        }
        fn levels(&self) -> &[Level] {
            &self.levels
        }
    };
}
pub(super) use prioritised;

/// Create the tasks of `levels` for the arm.
pub(crate) fn stack<S: Real>(arm: &Arm, levels: &[Level]) -> TaskStack<S> {
    TaskStack::new(arm, levels.iter().map(|level| level.function.clone()).collect())
}

pub(crate) fn require_levels(levels: &[Level]) -> Result<()> {
    if levels.is_empty() { Err(Error::input("tasks", "is empty: expected at least one task, got 0")) } else { Ok(()) }
}

/// Write two norms per level to `out`: of the error `e`, and of the residual. `rows` has the number of rows of each level.
pub(super) fn norms<S: Real>(rows: &[usize], e: &[S], residuals: &[S], out: &mut [S]) {
    let mut at = 0;
    for (pair, m) in out.chunks_exact_mut(2).zip(rows) {
        let norm = |x: &[S]| x[at..at + m].iter().fold(S::zero(), |sum, &x| sum + x * x).sqrt();
        (pair[0], pair[1]) = (norm(e), norm(residuals));
        at += m;
    }
}

/// Whether both laws solve the same tasks with the same algorithm. Targets, gains and thresholds may differ.
pub(super) fn same_tasks((levels, options): (&[Level], &PriorityOptions), (others, other): (&[Level], &PriorityOptions)) -> bool {
    let given = |options: &PriorityOptions| (options.method, options.eps.is_some(), options.weight.is_some());
    levels.iter().map(|level| &level.function).eq(others.iter().map(|level| &level.function)) && given(options) == given(other)
}
