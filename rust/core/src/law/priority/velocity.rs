//! Prioritised joint velocities with feedback of the task errors (CLIK, `siciliano1990kinematic`):
//!
//! `u` solves `J_i u = x_d,i' + K_i e_i` for the tasks `i` in order of priority, by one of the methods of `priority`. The prime is the time
//! derivative, `e_i` the error of a task and `J_i` its Jacobian. The plant is `q' = u`.
//!
//! With limits, `u` is within bounds that hold above all levels. `joint_limits` computes them from the joint limits at every evaluation.
//!
//! The solver decides numerical ranks. For this, it assumes a relative error of `DEFAULT_ROUNDING (1 + sum|q|)` in the entries of the
//! Jacobians. Away from singularities and bounds, the solution is a formula without branches. Elsewhere, native code decides the ranks and
//! replaces its result (`priority::StackFormula`).

use super::joint_limits::{LimitOverrides, MotionLimits};
use super::tasks::*;
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::law::definition::{Definition, Route, Shape};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::level::{Level, level_rows};
use crate::motion::Motion;
use crate::plant::{Parameters, PlantKind};
use crate::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackFormula};
use crate::scalar::Real;
use crate::trace::E;
use crate::trace::expression::{constant, vector};

/// Joint velocities for tasks in order of priority, with validated parameters.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, kinematics::TaskFunction, motion::Motion, priority::PriorityOptions};
/// use armlet_core::law::{Gain, LawSpec, Level, LimitOverrides, PriorityVelocitySpec};
/// # let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
///
/// let tip = TaskFunction::frame(&arm, "link2", "xy")?;
/// let levels = vec![Level::new(tip, Motion::hold(vec![0.6, 0.3])?, Gain::scalar("gain", 2, 5.0)?, None)?];
/// let law = LawSpec::from(PriorityVelocitySpec::new(Model::from(arm), levels, PriorityOptions::default(), &LimitOverrides::default())?);
/// assert_eq!(law.level_rows(), [2]);
/// let terms = law.terms_at(0.0, &[0.3, 0.9], &[]);
/// let term = |name: &str| terms.iter().find(|term| term.0 == name).map_or(vec![], |term| term.2.clone());
/// // The velocity of the tip is 5 1/s times its error.
/// let (e, j, v) = (term("e"), term("J"), term("tau"));
/// assert!((0..2).all(|i| (j[2 * i] * v[0] + j[2 * i + 1] * v[1] - 5.0 * e[i]).abs() < 1e-12));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PriorityVelocitySpec {
    model: Model,
    /// Tasks, the highest priority first.
    pub levels: Vec<Level>,
    /// Options of the priority method.
    pub options: PriorityOptions,
    /// Joint limits that hold above all levels.
    limits: Option<MotionLimits>,
}

impl PriorityVelocitySpec {
    /// Create the law. `limits`: joint limits above all levels. With limits, bounds of the joint velocities in `options` are ignored.
    ///
    /// Errors: `Input` for no level, or the planar PR arm. Also as for [`LimitOverrides::resolve`] and [`PrioritySolver::new`].
    pub fn new(model: Model, levels: Vec<Level>, options: PriorityOptions, limits: &LimitOverrides) -> Result<Self> {
        require_levels(&levels)?;
        if let Some(i) = levels.iter().position(|level| level.damping.is_some()) {
            let problem = "takes effect only with PriorityAcceleration: expected None for a law of velocities";
            return Err(Error::input(format!("tasks[{i}].damping"), problem));
        }
        model.tree("arm")?;
        let given = limits;
        let limits = given.resolve(&model, options.method)?;
        if limits.as_ref().is_some_and(|limits| !limits.have_positions()) {
            for (name, given) in [("a_max", given.a_max.is_some()), ("horizon", given.horizon.is_some())] {
                if given {
                    let problem = "takes effect only with position limits: expected q_min or q_max, or an arm with limits";
                    return Err(Error::input(name, problem));
                }
            }
        }
        let mut options = limits.as_ref().map_or_else(|| options.clone(), |limits| limits.open(options.clone()));
        options.intervals = intervals(&levels);
        let spec = PriorityVelocitySpec { model, levels, options, limits };
        spec.solver()?;
        Ok(spec)
    }

    /// Number of rows of each level.
    pub fn rows(&self) -> Vec<usize> {
        level_rows(&self.levels)
    }

    /// Number of rows of each level of limits above the tasks: none.
    pub fn limit_rows(&self) -> Vec<usize> {
        Vec::new()
    }

    fn solver(&self) -> Result<PrioritySolver> {
        PrioritySolver::new(self.model.n(), &self.rows(), &self.options)
    }
}

/// Set `v_max` in `options` to the arm's velocity limits. This applies only to the method `Sns` without velocity bounds, and to an arm with
/// a finite velocity limit. Errors: `Input` for the planar PR arm.
pub fn with_limits(model: &Model, mut options: PriorityOptions) -> Result<PriorityOptions> {
    let arm = model.tree("arm")?;
    if options.method == PriorityMethod::Sns && options.v_min.is_none() && options.v_max.is_none() {
        // A limit of zero would freeze the joint.
        let limit = |velocity: f64| if velocity == 0.0 { f64::INFINITY } else { velocity };
        let limits: Vec<f64> = arm.independent().map(|joint| limit(joint.limits.velocity)).collect();
        if limits.iter().any(|limit| limit.is_finite()) {
            options.v_max = Some(limits);
        }
    }
    Ok(options)
}

impl Definition for PriorityVelocitySpec {
    prioritised!("PriorityVelocity", Velocity);
}

impl Shape for PriorityVelocitySpec {
    fn same_shape(&self, other: &Self) -> bool {
        same_tasks((&self.levels, &self.options), (&other.levels, &other.options)) && self.limits.is_some() == other.limits.is_some()
    }
}

impl Equations for PriorityVelocitySpec {
    fn parameters(&self, period: Option<f64>) -> Parameters {
        let (Ok(arm), Ok(solver)) = (self.model.tree("arm"), self.solver()) else { unreachable!("refused when the law was made") };
        Parameters::default()
            .made("tasks", stack::<E>(arm, &self.levels))
            .made("solution", StackFormula::of(&solver))
            .gains("gain", self.levels.iter().map(|level| &level.gain))
            .option(bound_numbers(&self.levels), with_bounds)
            .option(self.limits.as_ref(), |numbers, limits| numbers.made("limits", limits.lift::<E>(period)))
    }

    fn equations(&self, at: &Loop) -> Answer {
        let (rows, tasks_rows, numbers) = (self.rows(), rows_of_tasks(&self.levels), at.numbers());
        let tasks = Tasks::of(numbers.get_made("tasks"), at, false);
        let command = &tasks.e_dot + gained(numbers.get_gains("gain"), &tasks_rows, &tasks.e);
        let (e, distances) = bounded_errors(&self.levels, numbers, &tasks_rows, &tasks.e);
        let bounds = self.limits.is_some().then(|| numbers.get_made::<MotionLimits<E>>("limits").velocities(&at.q));
        let stack = Rows { j: tasks.j.clone(), command: command.clone(), distances };
        let (solution, residuals) = solution(at, numbers.get_made("solution"), (&self.levels, tasks.rounding, 0), stack, bounds);

        E::term("rows", &[rows.len()], || rows.iter().map(|&rows| constant(rows as f64)).collect());
        at.term("e", e);
        at.matrix_term("J", tasks.j);
        at.term("command", command);
        at.term("residuals", residuals);
        at.term("ranks", vector(solution.ranks()));
        Answer::new(at.term("v", vector(solution.v())))
    }
}
