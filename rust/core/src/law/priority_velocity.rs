//! Prioritised joint velocities with feedback of the task errors (CLIK, `siciliano1990kinematic`):
//!
//! `u` solves `J_i u = x_d,i' + K_i e_i` for the tasks `i` in order of priority, by one of the methods of `priority`. The prime is the time
//! derivative, `e_i` the error of a task and `J_i` its Jacobian. The plant is `q' = u`.
//!
//! The method `sns` keeps `u` within bounds. `joint_limits` computes these bounds from the joint limits at every evaluation.
//!
//! The solver decides numerical ranks. For this, it assumes a relative error of `DEFAULT_ROUNDING (1 + sum|q|)` in the entries of the
//! Jacobians. Away from singularities and bounds, the solution is a formula without branches. Elsewhere, native code decides the ranks and
//! replaces its result (`priority::StackFormula`).

use super::definition::{Definition, Law, Route, Shape};
use super::joint_limits::{LimitOverrides, MotionLimits};
use super::level::{self, Level, prioritised, require_levels, same_tasks, stack};
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::linalg::AnyGain;
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackFormula};
use crate::scalar::Real;
use crate::trace::Sym;

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
    /// Joint limits for the method `sns`; `None` for other methods.
    limits: Option<MotionLimits>,
}

impl PriorityVelocitySpec {
    /// Create the law. `limits`: joint limits for the method `Sns`; a limit that is not given is the arm's. With `Sns`, bounds in `options`
    /// are ignored.
    ///
    /// Errors: `Input` for no level, the planar PR arm, or limits with another method than `Sns`. Also as for [`MotionLimits::new`] and
    /// [`PrioritySolver::new`].
    pub fn new(model: Model, levels: Vec<Level>, options: PriorityOptions, limits: &LimitOverrides) -> Result<Self> {
        require_levels(&levels)?;
        if let Some(i) = levels.iter().position(|level| level.damping.is_some()) {
            let problem = "takes effect only with PriorityAcceleration: expected None for a law of velocities";
            return Err(Error::input(format!("tasks[{i}].damping"), problem));
        }
        model.tree("arm")?;
        limits.require_sns(options.method)?;
        let given = limits;
        let limits = if options.method == PriorityMethod::Sns {
            Some(MotionLimits::new(&model, given).map_err(|error| model.name_limit(error))?)
        } else {
            None
        };
        if limits.as_ref().is_some_and(|limits| !limits.have_positions()) {
            for (name, given) in [("a_max", given.a_max.is_some()), ("horizon", given.horizon.is_some())] {
                if given {
                    let problem = "takes effect only with position limits: expected q_min or q_max, or an arm with limits";
                    return Err(Error::input(name, problem));
                }
            }
        }
        let options = limits.as_ref().map_or_else(|| options.clone(), |limits| limits.open(options.clone()));
        let spec = PriorityVelocitySpec { model, levels, options, limits };
        spec.solver()?;
        Ok(spec)
    }

    /// Number of rows of each level.
    pub fn rows(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.function.rows()).collect()
    }

    fn solver(&self) -> Result<PrioritySolver> {
        PrioritySolver::new(self.model.n(), &self.rows(), &self.options)
    }

    /// Create the law for a control loop on the number type `S`.
    pub(crate) fn build(&self) -> PriorityVelocity {
        let (Ok(arm), Ok(solver)) = (self.model.tree("arm"), self.solver()) else { unreachable!("refused when the law was made") };
        let total: usize = self.rows().iter().sum();
        let zeros = |k: usize| vec![Sym::zero(); k];
        PriorityVelocity {
            stack: stack(arm, &self.levels),
            solution: StackFormula::of(&solver),
            gains: self.levels.iter().map(|level| AnyGain::labelled("gain", &level.gain)).collect(),
            limits: self.limits.as_ref().map(MotionLimits::lift),
            e: zeros(total),
            jacobian: zeros(total * self.model.n()),
            command: zeros(total),
        }
    }
}

/// Set `v_max` in `options` to the arm's velocity limits. This applies only to the method `Sns` without velocity bounds, and to an arm with
/// a finite velocity limit. Errors: `Input` for the planar PR arm.
pub fn with_limits(model: &Model, mut options: PriorityOptions) -> Result<PriorityOptions> {
    let arm = model.tree("arm")?;
    if options.method == PriorityMethod::Sns && options.v_min.is_none() && options.v_max.is_none() {
        let limits: Vec<f64> = arm.independent().map(|joint| joint.limits.velocity).collect();
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
        same_tasks((&self.levels, &self.options), (&other.levels, &other.options))
    }
}

/// The law in a control loop.
pub struct PriorityVelocity {
    stack: TaskStack<Sym>,
    solution: StackFormula,
    gains: Vec<AnyGain<Sym>>,
    limits: Option<MotionLimits<Sym>>,
    e: Vec<Sym>,
    jacobian: Vec<Sym>,
    command: Vec<Sym>,
}

impl PriorityVelocity {
    /// Write two norms per level at the last evaluation: `|e_i|` (m or rad) and `|v_i - J_i u|` (m/s or rad/s).
    pub fn norms(&self, out: &mut [Sym]) {
        level::norms(self.stack.rows(), &self.e, self.solution.residuals(), out);
    }
}

impl Law for PriorityVelocity {
    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], q: &[Sym], _: &[Sym], tau: &mut [Sym], _: &mut [Sym]) {
        let PriorityVelocity { stack, solution, gains, limits, e, jacobian, command } = self;
        stack.place_at(q, trig);
        stack.jacobians(jacobian);
        let (mut at, mut from) = (0, 0);
        for (k, gain) in gains.iter().enumerate() {
            let (m, width) = (stack.rows()[k], 3 * stack.functions()[k].target_size());
            let (e, w) = (&mut e[at..at + m], &mut command[at..at + m]);
            stack.error(k, &desired[from..from + width], e, w, None);
            gain.add_to(e, w);
            at += m;
            from += width;
        }
        if let Some(limits) = limits {
            let [lower, upper] = solution.bounds_mut();
            limits.velocities(|i| q[i], lower, upper);
        }
        solution.solve(stack.rounding(), jacobian, command);
        tau.copy_from_slice(solution.v());
        let (levels, total, n) = (gains.len(), e.len(), q.len());
        Sym::term("rows", &[levels], || stack.rows().iter().map(|&rows| Sym::splat(rows as f64)).collect());
        Sym::term("e", &[total], || e.clone());
        Sym::term("J", &[total, n], || jacobian.clone());
        Sym::term("command", &[total], || command.clone());
        Sym::term("residuals", &[total], || solution.residuals().to_vec());
        Sym::term("ranks", &[levels], || solution.ranks().to_vec());
        Sym::term("v", &[n], || tau.to_vec());
    }
}
