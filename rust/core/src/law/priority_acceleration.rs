//! Prioritised accelerations under computed torque, for rigid arms (`siciliano1991priority`, `nakanishi2008operational`):
//!
//! `a` solves `J_i a = x_d,i'' + D_i (x_d,i' - J_i v) + K_i e_i - dJ_i/dt v` for the tasks `i` in order of priority. The prime is the time
//! derivative, `e_i` the error of a task and `J_i` its Jacobian. In the remaining freedom `a = -c v`, which stops motions that change no
//! task. Then `tau = M a + C v + g`. The method `sns` keeps `a` within bounds. `joint_limits` computes these bounds from the joint limits
//! at every evaluation.

use super::decided::{Decided, RecordedSolver, Solve};
use super::definition::{Definition, Law, Route, Shape};
use super::joint_limits::{LimitOverrides, MotionLimits};
use super::level::{self, Level, desired_size, require_levels, same_tasks, stack};
use super::terms::{Instant, Term};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::linalg::AnyGain;
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::priority::{PriorityMethod, PriorityOptions, PrioritySolver};
use crate::scalar::Real;

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
    /// Joint limits for the method `sns`; `None` for other methods.
    limits: Option<MotionLimits>,
}

impl PriorityAccelerationSpec {
    /// Create the law. `joint_damping`: `c`, 1/s. `limits`: joint limits for the method `Sns`; a limit that is not given is the arm's.
    /// With `Sns`, bounds in `options` are ignored.
    ///
    /// Errors: `Input` for no level, the planar PR arm, a negative damping, or limits with another method than `Sns`. Also as for
    /// [`MotionLimits::new`] and [`PrioritySolver::new`].
    pub fn new(model: Model, levels: Vec<Level>, options: PriorityOptions, joint_damping: f64, limits: &LimitOverrides) -> Result<Self> {
        require_levels(&levels)?;
        model.tree("arm")?;
        if !(joint_damping >= 0.0 && joint_damping.is_finite()) {
            return Err(Error::input("joint_damping", format!("is not a damping: expected a finite number >= 0, got {joint_damping}")));
        }
        limits.require_sns(options.method)?;
        let limits = if options.method == PriorityMethod::Sns {
            Some(MotionLimits::new(&model, limits).map_err(|error| model.name_limit(error))?)
        } else {
            None
        };
        let mut options = limits.as_ref().map_or_else(|| options.clone(), |limits| limits.open(options.clone()));
        // The joint damping is one more level below all tasks. Its Jacobian is the identity. If `eps` has one threshold for each
        // of several tasks, the default threshold is appended for this level. A single threshold applies to all levels.
        if let Some(eps) = options.eps.as_mut().filter(|eps| eps.len() == levels.len() && eps.len() > 1) {
            eps.push(crate::priority::DEFAULT_EPS);
        }
        let spec = PriorityAccelerationSpec { model, levels, options, joint_damping, limits };
        spec.solver()?;
        Ok(spec)
    }

    /// Number of rows of each task.
    pub fn rows(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.function.rows()).collect()
    }

    fn solver(&self) -> Result<PrioritySolver> {
        let n = self.model.n();
        PrioritySolver::new(n, &[self.rows(), vec![n]].concat(), &self.options)
    }

    /// Create the law with a solver of the kind `P`; `None` if this kind does not support the law's method.
    pub(crate) fn engine<P: Solve>(&self) -> Option<PriorityAcceleration<P>> {
        P::of(self.solver().ok()?).map(|solver| self.with(solver))
    }

    /// Create the law on `f64`.
    fn plain(&self) -> PriorityAcceleration {
        let Some(law) = self.engine() else { unreachable!("refused when the law was made") };
        law
    }

    fn with<P: Solve>(&self, solver: P) -> PriorityAcceleration<P> {
        let Ok(arm) = self.model.tree("arm") else { unreachable!("refused when the law was made") };
        let (n, total) = (self.model.n(), self.rows().iter().sum::<usize>());
        let model = AnyArm::new(&self.model);
        let zeros = |k: usize| vec![P::Number::zero(); k];
        PriorityAcceleration {
            stack: stack(arm, &self.levels),
            solver,
            workspace: model.workspace(),
            arm: model,
            gains: self.levels.iter().map(|level| AnyGain::labelled("gain", &level.gain)).collect(),
            dampings: self.levels.iter().map(Level::rate_gain).map(|gain| AnyGain::labelled("rate_gain", &gain)).collect(),
            joint_damping: P::Number::labelled("joint_damping", 0, || P::Number::varying(self.joint_damping)),
            limits: self.limits.clone(),
            bounds: (vec![0.0; n], vec![0.0; n]),
            e: zeros(total),
            e_dot: zeros(total),
            rate: zeros(total * n),
        }
    }
}

impl Definition for PriorityAccelerationSpec {
    fn name(&self) -> &'static str {
        "PriorityAcceleration"
    }
    fn plant(&self) -> PlantKind {
        PlantKind::Rigid
    }
    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        self.levels.iter().map(|level| &level.target).collect()
    }

    /// The terms of the law: errors `e` and `e_dot`, Jacobians `J` and `J_dot`, commands and residuals of all levels, one level after
    /// another. Commands and residuals are accelerations. `rows` has the number of rows of each level. The ranks, the joint acceleration
    /// `a` and the torque follow.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.model.n();
        let mut law = self.plain();
        let mut tau = vec![0.0; n];
        law.evaluate(at.desired, at.trig, at.x, &[], &mut tau, &mut []);
        let total = law.e.len();
        let (jacobian, command) = law.solver.inputs();
        let (jacobian, command) = (jacobian[..total * n].to_vec(), command[..total].to_vec());
        let numbers = |counts: &[usize]| counts.iter().map(|&k| k as f64).collect::<Vec<f64>>();
        let levels = self.levels.len();
        vec![
            ("rows", vec![levels], numbers(&self.rows())),
            ("e", vec![total], law.e.clone()),
            ("e_dot", vec![total], law.e_dot.clone()),
            ("J", vec![total, n], jacobian),
            ("J_dot", vec![total, n], law.rate.clone()),
            ("command", vec![total], command),
            ("residuals", vec![total], law.solver.residuals()[..total].to_vec()),
            ("ranks", vec![levels], numbers(&law.solver.ranks()[..levels])),
            ("a", vec![n], law.solver.v().to_vec()),
            ("tau", vec![n], tau),
        ]
    }

    fn route(&self) -> Route {
        if self.options.method.has_bounds() { Route::Deciding } else { Route::Guarded }
    }
    fn levels(&self) -> &[Level] {
        &self.levels
    }
}

impl PriorityAccelerationSpec {
    pub(super) fn build<S: Real>(&self) -> Decided<PriorityAcceleration, PriorityAcceleration<RecordedSolver>> {
        let n = self.model.n();
        Decided::new::<S>([desired_size(&self.levels), n, 2 * n], || self.plain(), || self.engine())
    }
}

impl Shape for PriorityAccelerationSpec {
    fn same_shape(&self, other: &Self) -> bool {
        same_tasks((&self.levels, &self.options), (&other.levels, &other.options))
    }
}

/// The law in a control loop. Its buffers are kept between calls.
pub struct PriorityAcceleration<P: Solve = PrioritySolver> {
    stack: TaskStack<P::Number>,
    solver: P,
    arm: AnyArm<P::Number>,
    workspace: Workspace<P::Number>,
    gains: Vec<AnyGain<P::Number>>,
    dampings: Vec<AnyGain<P::Number>>,
    joint_damping: P::Number,
    limits: Option<MotionLimits>,
    bounds: (Vec<f64>, Vec<f64>),
    e: Vec<P::Number>,
    e_dot: Vec<P::Number>,
    /// Rate of the Jacobians, `dJ/dt`, `(sum rows, n)`.
    rate: Vec<P::Number>,
}

impl<P: Solve> PriorityAcceleration<P> {
    /// Write two norms per level at the last evaluation: of the error (m or rad), and of the residual (m/s^2 or rad/s^2).
    pub fn norms(&self, out: &mut [P::Number]) {
        level::norms(self.stack.rows(), &self.e, self.solver.residuals(), out);
    }

    fn command(&mut self, desired: &[P::Number], q: &[P::Number], v: &[P::Number]) -> Result<()> {
        let PriorityAcceleration { stack, solver, gains, dampings, limits, bounds: (lower, upper), e, e_dot, rate, joint_damping, .. } =
            self;
        let (n, total) = (v.len(), e.len());
        stack.set_moving(v);
        stack.jacobians_dot(rate);
        let (jacobian, command) = solver.inputs();
        stack.jacobians(&mut jacobian[..total * n]);
        let (mut at, mut from) = (0, 0);
        for k in 0..gains.len() {
            let (m, width) = (stack.rows()[k], 3 * stack.functions()[k].target_size());
            let (e, e_dot, a) = (&mut e[at..at + m], &mut e_dot[at..at + m], &mut command[at..at + m]);
            stack.error(k, &desired[from..from + width], e, e_dot, Some(a));
            for i in 0..m {
                let row = (at + i) * n..(at + i + 1) * n;
                e_dot[i] -= product(&jacobian[row.clone()], v);
                a[i] -= product(&rate[row], v);
            }
            dampings[k].add_to(e_dot, a);
            gains[k].add_to(e, a);
            at += m;
            from += width;
        }
        let (identity, rest) = (&mut jacobian[total * n..], &mut command[total..]);
        identity.fill(P::Number::zero());
        for i in 0..n {
            identity[i * n + i] = P::Number::splat(1.0);
            rest[i] = -*joint_damping * v[i];
        }
        solver.solve(stack.rounding(), |solver| match limits {
            Some(limits) => {
                limits.accelerations(|i| q[i].lane(0), |i| v[i].lane(0), lower, upper);
                solver.set_bounds(lower, upper)
            }
            None => Ok(()),
        })
    }
}

fn product<S: Real>(x: &[S], y: &[S]) -> S {
    x.iter().zip(y).fold(S::zero(), |sum, (&x, &y)| sum + x * y)
}

impl<P: Solve> Law<P::Number> for PriorityAcceleration<P> {
    fn evaluate(
        &mut self,
        desired: &[P::Number],
        trig: &[(P::Number, P::Number)],
        x: &[P::Number],
        _: &[P::Number],
        tau: &mut [P::Number],
        _: &mut [P::Number],
    ) {
        let (q, v) = x.split_at(tau.len());
        self.stack.place_at(q, trig);
        match self.command(desired, q, v) {
            Ok(()) => {
                let PriorityAcceleration { arm, workspace, solver, .. } = self;
                arm.inverse_dynamics(workspace, trig, q, v, solver.v(), tau);
            }
            Err(_) => tau.fill(P::Number::splat(f64::NAN)),
        }
    }

    fn stands(&self) -> Option<P::Number> {
        self.solver.stands()
    }
}
