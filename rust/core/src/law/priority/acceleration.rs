//! Prioritised accelerations under computed torque, for rigid arms (`siciliano1991priority`, `nakanishi2008operational`):
//!
//! `a` solves `J_i a = x_d,i'' + D_i (x_d,i' - J_i v) + K_i e_i - dJ_i/dt v` for the tasks `i` in order of priority. The prime is the time
//! derivative, `e_i` the error of a task and `J_i` its Jacobian. In the remaining freedom `a = -c v`, which stops motions that change no
//! task. Then `tau = M a + C v + g`. With limits, `a` is within bounds that hold above all levels. `joint_limits` computes them from the joint
//! limits at every evaluation. Torque limits are rows `-tau_max <= M a + C v + g <= tau_max`, which rank above these bounds.

use super::joint_limits::{LimitOverrides, MotionLimits};
use super::tasks::*;
use super::torque_limits::TorqueLimits;
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::law::definition::{Definition, Route, Shape};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::level::{Level, level_rows};
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::{Parameters, PlantKind};
use crate::priority::{PriorityOptions, PrioritySolver, StackFormula};
use crate::scalar::Real;
use crate::trace::E;
use crate::trace::expression::{constant, stacked, vector, zeros};

/// Joint accelerations for tasks in order of priority, with validated parameters.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, kinematics::TaskFunction, motion::Motion, priority::PriorityOptions};
/// # use armlet_core::plant::{PlantSpec, RigidSpec};
/// # use armlet_core::simulate::{Options, Problem};
/// # use nalgebra::dvector;
/// use armlet_core::law::{Gain, LawSpec, Level, LimitOverrides, PriorityAccelerationSpec};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// let tip = TaskFunction::frame(&arm, "link2", "xy")?;
/// // K = 25 1/s^2 with critical damping: the error decays as (1 + 5 t) exp(-5 t).
/// let levels = vec![Level::new(tip, Motion::hold(vec![0.6, 0.3])?, Gain::scalar("gain", 2, 25.0)?, None)?];
/// let model = Model::from(arm);
/// let law = PriorityAccelerationSpec::new(model.clone(), levels, PriorityOptions::default(), 1.0, &LimitOverrides::default())?;
/// let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model)));
/// let run = Problem::from_rest(&plant, &law, &dvector![0.3, 0.9], Options::fixed(0.4, 1e-2))?.run()?;
/// let error = |k: usize| { let (a, b) = (run.q[2 * k], run.q[2 * k] + run.q[2 * k + 1]); 0.6 - 0.5 * a.cos() - 0.4 * b.cos() };
/// assert!((error(40) / error(0) - 3.0 * (-2.0f64).exp()).abs() < 1e-4);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PriorityAccelerationSpec {
    model: Model,
    /// Tasks, the highest priority first.
    pub levels: Vec<Level>,
    /// Options of the priority method.
    pub options: PriorityOptions,
    /// Joint damping `c`, 1/s.
    pub joint_damping: f64,
    /// Joint limits that hold above all levels.
    limits: Option<MotionLimits>,
    /// Torque limits that hold above the joint limits.
    torques: Option<TorqueLimits>,
}

impl PriorityAccelerationSpec {
    /// Create the law. `joint_damping`: `c`, 1/s. `limits`: joint limits above all levels. With limits, bounds in `options` are ignored.
    ///
    /// Errors: `Input` for no level, the planar PR arm, or a negative damping. Also as for [`LimitOverrides::resolve`] and
    /// [`PrioritySolver::new`].
    pub fn new(model: Model, levels: Vec<Level>, options: PriorityOptions, joint_damping: f64, limits: &LimitOverrides) -> Result<Self> {
        require_levels(&levels)?;
        model.tree("arm")?;
        if !(joint_damping >= 0.0 && joint_damping.is_finite()) {
            return Err(Error::input("joint_damping", format!("is not a damping: expected a finite number >= 0, got {joint_damping}")));
        }
        let limits = limits.resolve(&model, options.method)?;
        let mut options = limits.as_ref().map_or_else(|| options.clone(), |limits| limits.open(options.clone()));
        // The joint damping is one more level below all tasks. Its Jacobian is the identity. If `eps` has one threshold for each
        // of several tasks, the default threshold is appended for this level. A single threshold applies to all levels.
        if let Some(eps) = options.eps.as_mut().filter(|eps| eps.len() == level_rows(&levels).len() && eps.len() > 1) {
            eps.push(crate::priority::DEFAULT_EPS);
        }
        options.intervals = intervals(&levels);
        if !options.intervals.is_empty() {
            options.intervals.push(false);
        }
        let spec = PriorityAccelerationSpec { model, levels, options, joint_damping, limits, torques: None };
        spec.solver()?;
        Ok(spec)
    }

    /// Add torque limits `tau_max`, `(n,)`, N m or N, which hold above all other limits. Infinite entries are allowed.
    ///
    /// Errors: `WrongShape` for a wrong length. `Input` for a limit that is not positive, or a method that accepts no bounds.
    pub fn with_torque_limits(mut self, tau_max: Vec<f64>) -> Result<Self> {
        let torques = TorqueLimits::new(tau_max, self.model.n(), self.limits.is_some(), self.options.method)?;
        torques.add_levels(&mut self.options, level_rows(&self.levels).len() + 1);
        self.torques = Some(torques);
        self.solver()?;
        Ok(self)
    }

    /// Number of rows of each task.
    pub fn rows(&self) -> Vec<usize> {
        level_rows(&self.levels)
    }

    /// Number of rows of each level above the tasks: the torque limits, and the joint limits that they can contradict.
    pub fn limit_rows(&self) -> Vec<usize> {
        self.torques.as_ref().map_or_else(Vec::new, |torques| torques.rows())
    }

    fn solver(&self) -> Result<PrioritySolver> {
        let n = self.model.n();
        PrioritySolver::new(n, &[self.limit_rows(), self.rows(), vec![n]].concat(), &self.options)
    }
}

impl Definition for PriorityAccelerationSpec {
    prioritised!("PriorityAcceleration", Rigid);
}

impl Shape for PriorityAccelerationSpec {
    fn same_shape(&self, other: &Self) -> bool {
        same_tasks((&self.levels, &self.options), (&other.levels, &other.options))
            && self.limits.is_some() == other.limits.is_some()
            && self.torques.is_some() == other.torques.is_some()
    }
}

impl Equations for PriorityAccelerationSpec {
    fn parameters(&self, period: Option<f64>) -> Parameters {
        let (Ok(arm), Ok(solver)) = (self.model.tree("arm"), self.solver()) else { unreachable!("refused when the law was made") };
        let dampings: Vec<Gain> = self.levels.iter().map(Level::rate_gain).collect();
        let tasks = stack::<E>(arm, &self.levels);
        let formula = StackFormula::of(&solver);
        Parameters::of_arm(&self.model)
            .made("tasks", tasks)
            .made("solution", formula)
            .gains("gain", self.levels.iter().map(|level| &level.gain))
            .gains("rate_gain", &dampings)
            .number("joint_damping", self.joint_damping)
            .option(bound_numbers(&self.levels), with_bounds)
            .option(self.limits.as_ref(), |numbers, limits| numbers.made("limits", limits.lift::<E>(period)))
            .option(self.torques.as_ref(), |numbers, torques| numbers.numbers("tau_max", torques.tau_max()))
    }

    fn equations(&self, at: &Loop) -> Answer {
        let (n, rows, tasks_rows, numbers) = (at.q.len(), self.rows(), rows_of_tasks(&self.levels), at.numbers());
        let tasks = Tasks::of(numbers.get_made("tasks"), at, true);
        let e_dot = &tasks.e_dot - &tasks.j * &at.v;
        let a_d = &tasks.acceleration - &tasks.j_dot * &at.v;
        let command =
            a_d + gained(numbers.get_gains("rate_gain"), &tasks_rows, &e_dot) + gained(numbers.get_gains("gain"), &tasks_rows, &tasks.e);
        let (e, distances) = bounded_errors(&self.levels, numbers, &tasks_rows, &tasks.e);

        // The last level stops motions that change no task.
        let (total, slow) = (command.len(), &at.v * -at.number("joint_damping"));
        let mut j = tasks.j.clone().insert_rows(total, n, E::zero());
        j.rows_mut(total, n).fill_with_identity();
        let bounds = self.limits.is_some().then(|| numbers.get_made::<MotionLimits<E>>("limits").accelerations(&at.q, &at.v));
        let below = distances.map(|distance| if distance.is_empty() { distance } else { stacked([&distance, &zeros(n)]) });
        let own = Rows { j, command: stacked([&command, &slow]), distances: below };
        let (limits, stack, bounds) = match &self.torques {
            Some(torques) => torques.above(at, own, bounds),
            None => (0, own, bounds),
        };
        let (solution, residuals) = solution(at, numbers.get_made("solution"), (&self.levels, tasks.rounding, limits), stack, bounds);
        let levels_above = self.limit_rows().len();

        E::term("rows", &[rows.len()], || rows.iter().map(|&rows| constant(rows as f64)).collect());
        at.term("e", e);
        at.term("e_dot", e_dot);
        at.matrix_term("J", tasks.j);
        at.matrix_term("J_dot", tasks.j_dot);
        at.term("command", command);
        if limits > n {
            // A joint limit is violated only if the torque limits contradict it.
            at.term("limit_violations", -residuals.rows(n, n).into_owned());
        }
        at.term("residuals", residuals.rows(limits, total).into_owned());
        at.term("ranks", vector(&solution.ranks()[levels_above..levels_above + rows.len()]));
        let a = at.term("a", vector(solution.v()));
        Answer::new(at.arm().inverse_dynamics(&at.v, &a))
    }
}
