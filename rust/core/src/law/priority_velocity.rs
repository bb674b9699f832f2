//! Prioritised joint velocities with feedback of the task errors (CLIK, `siciliano1990kinematic`):
//!
//! `u` solves `J_i u = x_d,i' + K_i e_i` for the tasks `i` in order of priority, by one of the methods of `priority`. The prime is the time
//! derivative, `e_i` the error of a task and `J_i` its Jacobian. The plant is `q' = u`.
//!
//! The method `sns` keeps `u` within bounds. `joint_limits` computes these bounds from the joint limits at every evaluation.
//!
//! The solver decides numerical ranks. For this, it assumes a relative error of `DEFAULT_ROUNDING (1 + sum|q|)` in the entries of the
//! Jacobians. The methods branch on singular values, so direct evaluation requires `f64`. A recorded law uses an algorithm without
//! branches, and reports whether its result is valid. A law with the method `sns` cannot be recorded.

use super::decided::{Decided, RecordedSolver, Solve};
use super::definition::{Definition, Law, Route, Shape};
use super::joint_limits::{LimitOverrides, MotionLimits};
use super::level::{self, Level, desired_size, require_levels, same_tasks, stack};
use super::terms::{Instant, Term};
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::linalg::AnyGain;
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::priority::{PriorityMethod, PriorityOptions, PrioritySolver};
use crate::scalar::Real;

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

    /// Create the law with a solver of the kind `P`; `None` if this kind does not support the law's method.
    pub(crate) fn engine<P: Solve>(&self) -> Option<PriorityVelocity<P>> {
        P::of(self.solver().ok()?).map(|solver| self.with(solver))
    }

    /// Create the law on `f64`.
    fn plain(&self) -> PriorityVelocity {
        let Some(law) = self.engine() else { unreachable!("refused when the law was made") };
        law
    }

    fn with<P: Solve>(&self, solver: P) -> PriorityVelocity<P> {
        let Ok(arm) = self.model.tree("arm") else { unreachable!("refused when the law was made") };
        let (n, total) = (self.model.n(), self.rows().iter().sum());
        PriorityVelocity {
            stack: stack(arm, &self.levels),
            solver,
            gains: self.levels.iter().map(|level| AnyGain::labelled("gain", &level.gain)).collect(),
            limits: self.limits.clone(),
            bounds: (vec![0.0; n], vec![0.0; n]),
            e: vec![P::Number::zero(); total],
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
    fn name(&self) -> &'static str {
        "PriorityVelocity"
    }
    fn plant(&self) -> PlantKind {
        PlantKind::Velocity
    }
    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        self.levels.iter().map(|level| &level.target).collect()
    }

    /// The terms of the law: errors `e`, Jacobians `J`, commands and residuals of all levels, one level after another. `rows` has the
    /// number of rows of each level. The ranks and the joint velocity follow.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.model.n();
        let mut law = self.plain();
        let mut v = vec![0.0; n];
        law.evaluate(at.desired, at.trig, at.x, &[], &mut v, &mut []);
        let (jacobian, command) = law.solver.inputs();
        let (total, jacobian, command) = (command.len(), jacobian.to_vec(), command.to_vec());
        let numbers = |counts: &[usize]| counts.iter().map(|&k| k as f64).collect::<Vec<f64>>();
        vec![
            ("rows", vec![self.levels.len()], numbers(&self.rows())),
            ("e", vec![total], law.e.clone()),
            ("J", vec![total, n], jacobian),
            ("command", vec![total], command),
            ("residuals", vec![total], law.solver.residuals().to_vec()),
            ("ranks", vec![self.levels.len()], numbers(law.solver.ranks())),
            ("v", vec![n], v.clone()),
            ("tau", vec![n], v),
        ]
    }

    fn route(&self) -> Route {
        if self.options.method.has_bounds() { Route::Deciding } else { Route::Guarded }
    }
    fn levels(&self) -> &[Level] {
        &self.levels
    }
}

impl PriorityVelocitySpec {
    pub(super) fn build<S: Real>(&self) -> Decided<PriorityVelocity, PriorityVelocity<RecordedSolver>> {
        let n = self.model.n();
        Decided::new::<S>([desired_size(&self.levels), n, n], || self.plain(), || self.engine())
    }
}

impl Shape for PriorityVelocitySpec {
    fn same_shape(&self, other: &Self) -> bool {
        same_tasks((&self.levels, &self.options), (&other.levels, &other.options))
    }
}

/// The law in a control loop. Its buffers are kept between calls.
pub struct PriorityVelocity<P: Solve = PrioritySolver> {
    stack: TaskStack<P::Number>,
    solver: P,
    gains: Vec<AnyGain<P::Number>>,
    limits: Option<MotionLimits>,
    bounds: (Vec<f64>, Vec<f64>),
    e: Vec<P::Number>,
}

impl<P: Solve> PriorityVelocity<P> {
    /// Write two norms per level at the last evaluation: `|e_i|` (m or rad) and `|v_i - J_i u|` (m/s or rad/s).
    pub fn norms(&self, out: &mut [P::Number]) {
        level::norms(self.stack.rows(), &self.e, self.solver.residuals(), out);
    }

    fn command(&mut self, desired: &[P::Number], q: &[P::Number]) -> Result<()> {
        let PriorityVelocity { stack, solver, gains, limits, bounds: (lower, upper), e } = self;
        let (jacobian, command) = solver.inputs();
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
        solver.solve(stack.rounding(), |solver| match limits {
            Some(limits) => {
                limits.velocities(|i| q[i].lane(0), lower, upper);
                solver.set_bounds(lower, upper)
            }
            None => Ok(()),
        })
    }
}

impl<P: Solve> Law<P::Number> for PriorityVelocity<P> {
    fn evaluate(
        &mut self,
        desired: &[P::Number],
        trig: &[(P::Number, P::Number)],
        x: &[P::Number],
        _: &[P::Number],
        tau: &mut [P::Number],
        _: &mut [P::Number],
    ) {
        self.stack.place_at(x, trig);
        match self.command(desired, x) {
            Ok(()) => tau.copy_from_slice(self.solver.v()),
            // NaN ends the run with the status `Diverged`.
            Err(_) => tau.fill(P::Number::splat(f64::NAN)),
        }
    }

    fn stands(&self) -> Option<P::Number> {
        self.solver.stands()
    }
}
