//! Prioritised accelerations under computed torque, for rigid arms (`siciliano1991priority`, `nakanishi2008operational`):
//!
//! `a` solves `J_i a = x_d,i'' + D_i (x_d,i' - J_i v) + K_i e_i - dJ_i/dt v` for the tasks `i` in order of priority. The prime is the time
//! derivative, `e_i` the error of a task and `J_i` its Jacobian. In the remaining freedom `a = -c v`, which stops motions that change no
//! task. Then `tau = M a + C v + g`. The method `sns` keeps `a` within bounds. `joint_limits` computes these bounds from the joint limits
//! at every evaluation.

use super::definition::{Definition, Law, Route, Shape};
use super::joint_limits::{LimitOverrides, MotionLimits};
use super::level::{self, Level, prioritised, require_levels, same_tasks, stack};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::linalg::AnyGain;
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackFormula};
use crate::scalar::Real;
use crate::trace::Sym;

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

    /// Create the law for a control loop on the number type `S`.
    pub(crate) fn build(&self) -> PriorityAcceleration {
        let (Ok(arm), Ok(solver)) = (self.model.tree("arm"), self.solver()) else { unreachable!("refused when the law was made") };
        let (n, total) = (self.model.n(), self.rows().iter().sum::<usize>());
        let model = AnyArm::new(&self.model);
        let zeros = |k: usize| vec![Sym::zero(); k];
        PriorityAcceleration {
            stack: stack(arm, &self.levels),
            solution: StackFormula::of(&solver),
            workspace: model.workspace(),
            arm: model,
            gains: self.levels.iter().map(|level| AnyGain::labelled("gain", &level.gain)).collect(),
            dampings: self.levels.iter().map(Level::rate_gain).map(|gain| AnyGain::labelled("rate_gain", &gain)).collect(),
            joint_damping: Sym::labelled("joint_damping", 0, || Sym::varying(self.joint_damping)),
            limits: self.limits.as_ref().map(MotionLimits::lift),
            e: zeros(total),
            e_dot: zeros(total),
            rate: zeros(total * n),
            jacobian: zeros((total + n) * n),
            command: zeros(total + n),
        }
    }
}

impl Definition for PriorityAccelerationSpec {
    prioritised!("PriorityAcceleration", Rigid);
}

impl Shape for PriorityAccelerationSpec {
    fn same_shape(&self, other: &Self) -> bool {
        same_tasks((&self.levels, &self.options), (&other.levels, &other.options))
    }
}

/// The law in a control loop.
pub struct PriorityAcceleration {
    stack: TaskStack<Sym>,
    solution: StackFormula,
    arm: AnyArm<Sym>,
    workspace: Workspace<Sym>,
    gains: Vec<AnyGain<Sym>>,
    dampings: Vec<AnyGain<Sym>>,
    joint_damping: Sym,
    limits: Option<MotionLimits<Sym>>,
    e: Vec<Sym>,
    e_dot: Vec<Sym>,
    /// Rate of the Jacobians, `dJ/dt`, `(sum rows, n)`.
    rate: Vec<Sym>,
    /// The Jacobians of the tasks and of the joint damping.
    jacobian: Vec<Sym>,
    command: Vec<Sym>,
}

impl PriorityAcceleration {
    /// Write two norms per level at the last evaluation: of the error (m or rad), and of the residual (m/s^2 or rad/s^2).
    pub fn norms(&self, out: &mut [Sym]) {
        level::norms(self.stack.rows(), &self.e, self.solution.residuals(), out);
    }

    /// Compute the joint accelerations.
    fn command(&mut self, desired: &[Sym], q: &[Sym], v: &[Sym]) {
        let PriorityAcceleration { stack, solution, gains, dampings, limits, e, e_dot, rate, joint_damping, jacobian, command, .. } = self;
        let (n, total) = (v.len(), e.len());
        stack.set_moving(v);
        stack.jacobians_dot(rate);
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
        identity.fill(Sym::zero());
        for i in 0..n {
            identity[i * n + i] = Sym::splat(1.0);
            rest[i] = -*joint_damping * v[i];
        }
        if let Some(limits) = limits {
            let [lower, upper] = solution.bounds_mut();
            limits.accelerations(|i| q[i], |i| v[i], lower, upper);
        }
        solution.solve(stack.rounding(), jacobian, command);
        let levels = gains.len();
        Sym::term("rows", &[levels], || stack.rows().iter().map(|&rows| Sym::splat(rows as f64)).collect());
        Sym::term("e", &[total], || e.clone());
        Sym::term("e_dot", &[total], || e_dot.clone());
        Sym::term("J", &[total, n], || jacobian[..total * n].to_vec());
        Sym::term("J_dot", &[total, n], || rate.clone());
        Sym::term("command", &[total], || command[..total].to_vec());
        Sym::term("residuals", &[total], || solution.residuals()[..total].to_vec());
        Sym::term("ranks", &[levels], || solution.ranks()[..levels].to_vec());
        Sym::term("a", &[n], || solution.v().to_vec());
    }
}

fn product(x: &[Sym], y: &[Sym]) -> Sym {
    x.iter().zip(y).fold(Sym::zero(), |sum, (&x, &y)| sum + x * y)
}

impl Law for PriorityAcceleration {
    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], _: &[Sym], tau: &mut [Sym], _: &mut [Sym]) {
        let (q, v) = x.split_at(tau.len());
        self.stack.place_at(q, trig);
        self.command(desired, q, v);
        self.arm.inverse_dynamics(&mut self.workspace, trig, q, v, self.solution.v(), tau);
    }
}
