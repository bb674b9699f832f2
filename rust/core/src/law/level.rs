//! A level of priority: a task, its target motion, and the gain of its error.

use super::sizes::require_size;
use crate::error::{Error, Result};
use crate::kinematics::TaskFunction;
use crate::linalg::Gain;
use crate::motion::Motion;

/// A task with its priority. It commands the task velocity `x_d_dot + K e`, with the error `e`. In a law of accelerations, it commands the
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
    /// Lower and upper bounds of the coordinates, measured from the target, `(rows,)` each. `None` for a task that moves to its target.
    pub bounds: Option<[Vec<f64>; 2]>,
    /// Whether the task shares the level of the previous task.
    pub joins: bool,
    /// The weight of the task's squared errors within its level.
    pub weight: f64,
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
        Ok(Level { function, target, gain, damping, bounds: None, joins: false, weight: 1.0 })
    }

    /// Replace the motion to the target by bounds of the coordinates `x`, measured from the target. The velocity of a row is then at least
    /// `x_d_dot + K (lower - x)` and at most `x_d_dot + K (upper - x)`.
    ///
    /// Errors: `WrongShape` for a wrong length. `Input` for bounds out of order, and for a gain that is not diagonal and positive.
    pub fn within(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Result<Self> {
        let rows = self.function.rows();
        for (name, bound) in [("lower", &lower), ("upper", &upper)] {
            if bound.len() != rows {
                return Err(Error::wrong_shape(name, &[rows], &[bound.len()]));
            }
        }
        let ordered = |i: &usize| lower[*i] <= upper[*i] && lower[*i] < f64::INFINITY && upper[*i] > f64::NEG_INFINITY;
        if let Some(i) = (0..rows).find(|i| !ordered(i)) {
            let problem = format!("is out of order: expected lower <= upper, got {} and {}", lower[i], upper[i]);
            return Err(Error::input("lower", problem).at([i]));
        }
        for (name, gain) in [("gain", Some(&self.gain)), ("damping", self.damping.as_ref())] {
            if let Some(gain) = gain
                && (!gain.is_diagonal() || (name == "gain" && (0..rows).any(|i| !(gain.at(i, i) > 0.0))))
            {
                let problem = "is not positive for each row: expected a number or one per row, > 0, for a task with bounds";
                return Err(Error::input(name, problem));
            }
        }
        self.bounds = Some([lower, upper]);
        Ok(self)
    }

    /// Whether the task has the same rows as `other`, which differ only in numbers.
    pub(super) fn same_rows(&self, other: &Self) -> bool {
        let rows = |level: &Self| (level.bounds.is_some(), level.joins, level.weight);
        self.function == other.function && rows(self) == rows(other)
    }

    /// The gain `D` of the error's rate, `(rows, rows)`, 1/s.
    pub fn rate_gain(&self) -> Gain {
        self.damping.clone().unwrap_or_else(|| self.gain.square_root().scaled(2.0))
    }
}

/// The number of rows of each level of priority.
pub(crate) fn level_rows(tasks: &[Level]) -> Vec<usize> {
    let mut rows: Vec<usize> = Vec::with_capacity(tasks.len());
    for task in tasks {
        match rows.last_mut() {
            Some(last) if task.joins => *last += task.function.rows(),
            _ => rows.push(task.function.rows()),
        }
    }
    rows
}
