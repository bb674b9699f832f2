//! Prioritised accelerations under computed torque, for rigid arms (`siciliano1991priority`, `nakanishi2008operational`):
//!
//! `a` solves `J_i a = x_d,i'' + D_i (x_d,i' - J_i v) + K_i e_i - dJ_i/dt v` in priority, and `a = -c v` in what freedom is
//! left, which stops motions that no task sees; `tau = M a + C v + g`. The map `sns` keeps `a` within bounds that follow from the
//! limits of the joints at every evaluation: see `joint_limits`.

use super::joint_limits::{GivenLimits, JointLimits};
use super::level::{Level, add_product, plain, require_levels, stack};
use super::{Definition, Instant, Law, Term};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::linalg::{AnyGain, dot};
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::priority::{Method, Options, PrioritySolver};
use crate::scalar::Real;

#[derive(Clone, Debug, PartialEq)]
pub struct PriorityAccelerationSpec {
    model: Model,
    pub levels: Vec<Level>,
    pub options: Options,
    /// `c`, 1/s.
    pub joint_damping: f64,
    /// Of the map `sns`.
    limits: Option<JointLimits>,
}

impl PriorityAccelerationSpec {
    /// For the map `sns` the limits given, the arm's own where there are none; `options` has no bounds.
    pub fn new(model: Model, levels: Vec<Level>, options: Options, joint_damping: f64, limits: &GivenLimits) -> Result<Self> {
        require_levels(&levels)?;
        model.tree("arm")?;
        if !(joint_damping >= 0.0 && joint_damping.is_finite()) {
            return Err(Error::input("joint_damping", format!("is not a damping: expected a finite number >= 0, got {joint_damping}")));
        }
        limits.require_sns(options.method)?;
        let limits = if options.method == Method::Sns { Some(JointLimits::new(&model, limits)?) } else { None };
        let mut options = limits.as_ref().map_or_else(|| options.clone(), |limits| limits.open(options.clone()));
        // The level below all tasks has the identity for its Jacobian, whose singular values are one or taken.
        if let Some(eps) = options.eps.as_mut().filter(|eps| eps.len() == levels.len() && eps.len() > 1) {
            eps.push(crate::priority::DEFAULT_EPS);
        }
        let spec = PriorityAccelerationSpec { model, levels, options, joint_damping, limits };
        spec.solver()?;
        Ok(spec)
    }

    /// Rows of each task.
    pub fn rows(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.function.rows()).collect()
    }

    fn solver(&self) -> Result<PrioritySolver> {
        let n = self.model.n();
        PrioritySolver::new(n, &[self.rows(), vec![n]].concat(), &self.options)
    }

    pub fn engine(&self) -> PriorityAcceleration {
        let (Ok(arm), Ok(solver)) = (self.model.tree("arm"), self.solver()) else { unreachable!("refused when the law was made") };
        let (n, total) = (self.model.n(), self.rows().iter().sum::<usize>());
        let model = AnyArm::from_lanes(|_| &self.model);
        PriorityAcceleration {
            stack: stack(arm, &self.levels),
            solver,
            workspace: model.workspace(),
            arm: model,
            gains: self.levels.iter().map(|level| AnyGain::from_lanes(|_| &level.gain)).collect(),
            dampings: self.levels.iter().map(Level::rate_gain).map(|gain| AnyGain::from_lanes(|_| &gain)).collect(),
            joint_damping: self.joint_damping,
            limits: self.limits.clone(),
            bounds: (vec![0.0; n], vec![0.0; n]),
            q: vec![0.0; n],
            v: vec![0.0; n],
            trig: vec![(0.0, 1.0); n],
            tau: vec![0.0; n],
            desired: vec![0.0; self.levels.iter().map(|level| 3 * level.function.target_size()).sum()],
            e: vec![0.0; total],
            e_dot: vec![0.0; total],
            rate: vec![0.0; total * n],
        }
    }
}

impl Definition for PriorityAccelerationSpec {
    const NAME: &'static str = "PriorityAcceleration";
    const PLANT: PlantKind = PlantKind::Rigid;
    type Lanes<S: Real> = PriorityAcceleration;

    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        self.levels.iter().map(|level| &level.target).collect()
    }

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> PriorityAcceleration {
        of(0).engine()
    }

    /// As of the velocity law, with `e_dot`, `J_dot` and the acceleration; residuals are of accelerations.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.model.n();
        let mut law = self.engine();
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
}

/// The law in a loop; its buffers stay warm between calls.
pub struct PriorityAcceleration {
    stack: TaskStack,
    solver: PrioritySolver,
    arm: AnyArm<f64>,
    workspace: Workspace<f64>,
    gains: Vec<AnyGain<f64>>,
    dampings: Vec<AnyGain<f64>>,
    joint_damping: f64,
    limits: Option<JointLimits>,
    bounds: (Vec<f64>, Vec<f64>),
    q: Vec<f64>,
    v: Vec<f64>,
    trig: Vec<(f64, f64)>,
    tau: Vec<f64>,
    desired: Vec<f64>,
    e: Vec<f64>,
    e_dot: Vec<f64>,
    /// `dJ/dt`, `(sum rows, n)`.
    rate: Vec<f64>,
}

impl PriorityAcceleration {
    /// The norms of the error and of the residual of each level as of the last evaluation, in turn: m or rad, m/s^2 or rad/s^2.
    pub fn norms(&self, out: &mut [f64]) {
        let mut at = 0;
        for (pair, m) in out.chunks_exact_mut(2).zip(self.stack.rows()) {
            let norm = |x: &[f64]| x[at..at + m].iter().map(|x| x * x).sum::<f64>().sqrt();
            (pair[0], pair[1]) = (norm(&self.e), norm(self.solver.residuals()));
            at += m;
        }
    }

    fn command(&mut self) -> Result<()> {
        let PriorityAcceleration {
            stack,
            solver,
            gains,
            dampings,
            limits,
            bounds: (lower, upper),
            q,
            v,
            desired,
            e,
            e_dot,
            rate,
            joint_damping,
            ..
        } = self;
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
                e_dot[i] -= dot(&jacobian[row.clone()], v);
                a[i] -= dot(&rate[row], v);
            }
            add_product(&dampings[k], e_dot, a);
            add_product(&gains[k], e, a);
            at += m;
            from += width;
        }
        let (identity, rest) = (&mut jacobian[total * n..], &mut command[total..]);
        identity.fill(0.0);
        for i in 0..n {
            identity[i * n + i] = 1.0;
            rest[i] = -*joint_damping * v[i];
        }
        if let Some(limits) = limits {
            limits.accelerations(q, v, lower, upper);
            solver.set_bounds(lower, upper)?;
        }
        solver.set_rounding(stack.rounding())?;
        solver.run().map(|_| ())
    }
}

impl<S: Real> Law<S> for PriorityAcceleration {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], _: &[S], tau: &mut [S], _: &mut [S]) {
        let n = self.q.len();
        plain(&mut self.q, &x[..n]);
        plain(&mut self.v, &x[n..2 * n]);
        plain(&mut self.desired, desired);
        for (to, from) in self.trig.iter_mut().zip(trig) {
            *to = (from.0.lane(0), from.1.lane(0));
        }
        self.stack.place_at(&self.q, trig);
        match self.command() {
            Ok(()) => {
                let PriorityAcceleration { arm, workspace, trig, q, v, solver, tau: torque, .. } = self;
                arm.inverse_dynamics(workspace, trig, q, v, solver.v(), torque);
                tau.iter_mut().zip(torque).for_each(|(tau, &mut torque)| *tau = S::splat(torque));
            }
            Err(_) => tau.fill(S::splat(f64::NAN)),
        }
    }
}
