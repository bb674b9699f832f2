//! Adaptive tracking (Slotine and Li 1987):
//!
//! `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`,
//! `tau = Y(q, v, v_r, a_r) a_hat + Kp e + Kd e_dot = Y a_hat + Kd s`, `a_hat_dot = Gamma Y' s`.
//!
//! The regressor `Y` satisfies `Y a = M(q) a_r + C(q, v) v_r + g(q)` for the inertial parameters `a`. The prime is the transpose.
//!
//! Rotor inertias (armature) and friction may be among the estimated parameters `a` (`joint_columns`). If rotor inertias are not estimated,
//! they are known, and the torque `armature a_r` is added.

use super::adaptation::{Adaptation, AnyAdaptive, Base};
use super::composite::Composite;
use super::concurrent::Concurrent;
use super::definition::{Build, Definition, JointReference, Law, facts};
use super::joint_columns::{JointColumn, JointColumns, LaneColumns};
use super::projection::Projection;
use super::restraint::Restraint;
use super::sizes::{require_same_dof, require_size};
use super::terms::{Instant, Term};
use crate::dynamics::{Dynamics, Model};
use crate::error::{Error, Result, finite};
use crate::linalg::gain::{Gain, Multiply};
use crate::motion::Motion;
use crate::scalar::Real;

/// The adaptive law of an arm, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec};
/// use armlet_core::motion::{Motion, Sinusoid};
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (n, p) = (model.n(), model.parameter_count());
/// let motion = Motion::from(Sinusoid::new(vec![0.0; 2], 1, vec![0.5, 0.3], vec![2.0, 3.0], vec![0.0; 2])?);
/// let (kp, kd) = (Gain::scalar("kp", n, 50.0)?, Gain::scalar("kd", n, 10.0)?);
/// let adaptation = Adaptation::Euclidean(Gain::scalar("gamma", p, 2.0)?);
/// let law = LawSpec::from(AdaptiveSpec::new(model.clone(), motion, kp, kd, adaptation, None, None)?);
/// let plant = PlantSpec::from(RigidSpec::new(model));
/// let run = Problem::from_rest(&plant, &law, &dvector![0.0, 0.0], Options::fixed(1.0, 1e-3))?.run()?;
/// // The Lyapunov function V1 never increases.
/// let lyapunov = run.monitor("lyapunov").unwrap_or_default();
/// assert!(lyapunov.windows(2).all(|v| v[1] <= v[0] + 1e-9 * lyapunov[0]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AdaptiveSpec {
    pub(super) model: Model,
    /// Desired motion of the joints, `(n,)`, rad or m.
    pub motion: Motion,
    /// Position gain `Kp = Kd Lambda`, of size `n`, N m/rad or N/m.
    pub kp: Gain,
    /// Gain `Kd` of the sliding variable `s`, of size `n`, N m s/rad or N s/m.
    pub kd: Gain,
    /// Matrix `Lambda = Kd^-1 Kp` of the sliding variable, of size `n`, 1/s.
    pub lambda: Gain,
    /// The adaptation law of the estimate, with its gain.
    pub adaptation: Adaptation,
    /// The base set of parameters that is estimated; `None` if all parameters are estimated.
    pub base: Option<Base>,
    pub(super) estimate: Vec<f64>,
    /// The projection that keeps the estimate physically possible; `None` without a projection.
    pub projection: Option<Projection>,
    /// Rotor inertias and friction that are estimated. Their parameters follow the parameters of the bodies.
    pub columns: JointColumns,
    /// Leakage and dead zone of the adaptation.
    pub restraint: Restraint,
    /// Additional adaptation from the filtered dynamics.
    pub composite: Option<Composite>,
    /// Additional adaptation from stored samples.
    pub concurrent: Option<Concurrent>,
    /// The law's state at the start of a run from rest.
    pub(super) start: Vec<f64>,
}

impl AdaptiveSpec {
    /// Create the law. `kp` is in N m/rad or N/m, `kd` in N m s/rad or N s/m.
    ///
    /// `estimate`, `(p,)`, is the initial estimate. `None` starts from zero, which the natural metric does not permit.
    ///
    /// Errors: `WrongShape` for a wrong size. `Input` for numbers that are not finite, an invalid base set, or an estimate or a base set
    /// that the natural metric does not permit.
    pub fn new(
        model: Model,
        motion: Motion,
        kp: Gain,
        kd: Gain,
        adaptation: Adaptation,
        base: Option<Base>,
        estimate: Option<Vec<f64>>,
    ) -> Result<Self> {
        Self::with_columns(model, motion, [kp, kd], adaptation, base, JointColumns::default(), estimate)
    }

    /// Create the law with joint columns; `gains` are `[Kp, Kd]`.
    ///
    /// `estimate`, `(p,)`, has the parameters of the bodies, or of the base set, and then the parameters of the joint columns. Errors: as
    /// for [`AdaptiveSpec::new`].
    pub fn with_columns(
        model: Model,
        motion: Motion,
        [kp, kd]: [Gain; 2],
        adaptation: Adaptation,
        base: Option<Base>,
        columns: JointColumns,
        estimate: Option<Vec<f64>>,
    ) -> Result<Self> {
        let (n, all) = (model.n(), model.parameter_count());
        if let Some(base) = &base {
            base.validate(all)?;
        }
        let p = base.as_ref().map_or(all, |base| base.columns.len()) + columns.count();
        require_same_dof(n, &motion)?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        let estimate = estimate.unwrap_or_else(|| vec![0.0; p]);
        if estimate.len() != p {
            return Err(Error::wrong_shape("estimate", &[p], &[estimate.len()]));
        }
        finite("estimate", &estimate)?;
        if base.is_some() && matches!(adaptation, Adaptation::Natural(_)) {
            return Err(Error::input("base", "has no natural metric: expected all parameters for natural adaptation"));
        }
        adaptation.validate(&estimate, columns.count())?;
        let lambda = kd.solve(&kp);
        let restraint = Restraint::none();
        let start = estimate.clone();
        let (projection, composite, concurrent) = (None, None, None);
        Ok(AdaptiveSpec {
            model,
            motion,
            kp,
            kd,
            lambda,
            adaptation,
            base,
            estimate,
            projection,
            columns,
            restraint,
            composite,
            concurrent,
            start,
        })
    }

    /// Names of the estimated parameters: of the bodies or the base set, then of the joint columns.
    pub fn parameter_names(&self) -> Vec<String> {
        let all = self.model.column_names(false, false);
        let mut names = match &self.base {
            None => all,
            Some(base) => base.columns.iter().map(|&column| all[column].clone()).collect(),
        };
        names.extend(self.columns.names(&self.model));
        names
    }

    /// The number of joints `n`, and the number of estimated parameters `p`.
    pub fn parameter_sizes(&self) -> (usize, usize) {
        (self.model.n(), self.estimate.len())
    }

    /// The entries of the joint columns of the regressor `Y`.
    fn joint_entries(&self, v_r: &[f64], a_r: &[f64]) -> Vec<f64> {
        let mut entries = vec![0.0; self.columns.count()];
        LaneColumns::from_lanes(|_| &self.columns).fill(v_r, a_r, &mut entries);
        entries
    }

    /// Whether the law estimates the bodies alone, without restraint and without additional adaptation.
    pub(super) fn is_plain(&self) -> bool {
        self.columns.is_empty() && self.restraint.is_none() && self.composite.is_none() && self.concurrent.is_none()
    }
}

impl Definition for AdaptiveSpec {
    facts!("Adaptive", Rigid, motion);
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn restarts(&self) -> bool {
        self.composite.is_some()
    }

    /// The terms of the law: desired motion, errors `e` and `e_dot`, references `v_r` and `a_r`, sliding variable `s` and regressor `Y`.
    /// The torque and the rate of the estimate follow, then the terms of additional adaptation.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.model.n();
        let (p, z) = (self.estimate.len(), at.z);
        let (q, v, desired) = (&at.x[..n], &at.x[n..2 * n], at.desired);
        let e: Vec<f64> = (0..n).map(|i| desired[i] - q[i]).collect();
        let e_dot: Vec<f64> = (0..n).map(|i| desired[n + i] - v[i]).collect();
        let (le, le_dot) = (self.lambda.times(&e), self.lambda.times(&e_dot));
        let v_r: Vec<f64> = (0..n).map(|i| desired[n + i] + le[i]).collect();
        let a_r: Vec<f64> = (0..n).map(|i| desired[2 * n + i] + le_dot[i]).collect();
        let s: Vec<f64> = (0..n).map(|i| v_r[i] - v[i]).collect();
        let all = self.model.parameter_count();
        let mut full = vec![0.0; n * all];
        self.model.at(q).regressor(v, &v_r, &a_r, &mut full);
        let beside = self.joint_entries(&v_r, &a_r);
        let column = |i: usize, k: usize| if k % n == i { beside[k] } else { 0.0 };
        let y: Vec<f64> = (0..n)
            .flat_map(|i| {
                let row = &full[i * all..(i + 1) * all];
                let own: Vec<f64> = match &self.base {
                    None => row.to_vec(),
                    Some(base) => base.columns.iter().map(|&column| row[column]).collect(),
                };
                own.into_iter().chain((0..beside.len()).map(move |k| column(i, k)))
            })
            .collect();
        let known = if self.columns.has(JointColumn::Armature) { vec![0.0; n] } else { self.model.armature() };
        let (kd_s, armature) = (self.kd.times(&s), known);
        let tau: Vec<f64> = (0..n).map(|i| (0..p).map(|j| y[i * p + j] * z[j]).sum::<f64>() + kd_s[i] + armature[i] * a_r[i]).collect();
        let mut law = Self::build::<f64>(|_| self);
        let mut rate = vec![0.0; z.len()];
        law.evaluate(desired, at.trig, at.x, z, &mut vec![0.0; n], &mut rate);
        rate.truncate(p);
        let mut terms = vec![
            ("q_d", vec![n], desired[..n].to_vec()),
            ("v_d", vec![n], desired[n..2 * n].to_vec()),
            ("a_d", vec![n], desired[2 * n..].to_vec()),
            ("e", vec![n], e),
            ("e_dot", vec![n], e_dot),
            ("v_r", vec![n], v_r),
            ("a_r", vec![n], a_r),
            ("s", vec![n], s),
            ("Y", vec![n, p], y),
            ("tau", vec![n], tau),
            ("estimate_rate", vec![p], rate),
        ];
        if let Some([w, tau_w, e_w]) = self.filtered(at.trig, at.x, z) {
            terms.extend([("W", vec![n, p], w), ("tau_W", vec![n], tau_w), ("e_W", vec![n], e_w)]);
        }
        if let Some(errors) = self.stored_errors(&z[..p]) {
            terms.push(("e_stored", vec![errors.len() / n, n], errors));
        }
        terms
    }

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::Motion)
    }
}

impl Build for AdaptiveSpec {
    type Lanes<S: Real> = AnyAdaptive<S>;

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> AnyAdaptive<S> {
        AnyAdaptive::build(of)
    }

    /// Whether both laws estimate the same parameters in the same metric with the same options, so that they can run in lanes of one
    /// register.
    fn same_shape(&self, other: &Self) -> bool {
        let columns = |law: &AdaptiveSpec| law.base.as_ref().map(|base| base.columns.clone());
        std::mem::discriminant(&self.adaptation) == std::mem::discriminant(&other.adaptation)
            && columns(self) == columns(other)
            && self.projection.is_some() == other.projection.is_some()
            && self.columns.same_kinds(&other.columns)
            && self.restraint.same_shape(&other.restraint)
            && self.composite.is_some() == other.composite.is_some()
            && self.concurrent.is_some() == other.concurrent.is_some()
    }
}

/// The law in a control loop. `D` is the type of the arm, `J` and `G` are the types of joint gains and of `Gamma`. `B` is the type of joint
/// vectors, `P` the type of parameter vectors.
pub struct Adaptive<S, D: Dynamics<S>, J, G, B, P>
where
    S: Real,
{
    pub(super) arm: D,
    pub(super) workspace: D::Workspace,
    lambda: J,
    kd: J,
    pub(super) gamma: G,
    pub(super) s: B,
    e: B,
    e_dot: B,
    pub(super) v_r: B,
    pub(super) a_r: B,
    pub(super) yt_s: P,
}

impl<S: Real, D: Dynamics<S>, J, G, B: Clone, P> Adaptive<S, D, J, G, B, P> {
    /// Create the law with its buffers.
    pub fn new(arm: D, lambda: J, kd: J, gamma: G, joints: B, parameters: P) -> Self {
        let workspace = arm.workspace();
        let zero = || joints.clone();
        Adaptive { arm, workspace, lambda, kd, gamma, s: zero(), e: zero(), e_dot: zero(), v_r: zero(), a_r: zero(), yt_s: parameters }
    }
}

impl<S, D, J, G, B, P> Adaptive<S, D, J, G, B, P>
where
    S: Real,
    D: Dynamics<S>,
    J: Multiply<S>,
    B: Clone + AsRef<[S]> + AsMut<[S]>,
    P: AsRef<[S]> + AsMut<[S]>,
{
    /// Compute the torque `tau` for the parameters `pi`. The law stores the sliding variable `s`, the reference acceleration `a_r`, and the
    /// product `Y' s` with the regressor `Y`.
    pub(super) fn torque(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], pi: &[S], tau: &mut [S]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let (e, e_dot) = (self.e.as_mut(), self.e_dot.as_mut());
        let (s, v_r, a_r) = (self.s.as_mut(), self.v_r.as_mut(), self.a_r.as_mut());
        for i in 0..n {
            e[i] = desired[i] - q[i];
            e_dot[i] = desired[n + i] - v[i];
            (s[i], v_r[i], a_r[i]) = (e_dot[i], desired[n + i], desired[2 * n + i]);
        }
        // `Lambda e` is computed twice, because each product is fused with a sum.
        self.lambda.add_to(e, s);
        self.lambda.add_to(e, v_r);
        self.lambda.add_to(e_dot, a_r);
        self.kd.multiply(s, tau);
        self.arm.regressor_products(&mut self.workspace, trig, q, [v, v_r, a_r], (pi, tau), (s, self.yt_s.as_mut()));
    }
}

impl<S, D, J, G, B, P> Law<S> for Adaptive<S, D, J, G, B, P>
where
    S: Real,
    D: Dynamics<S>,
    J: Multiply<S>,
    G: Multiply<S>,
    B: Clone + AsRef<[S]> + AsMut<[S]>,
    P: AsRef<[S]> + AsMut<[S]>,
{
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        self.torque(desired, trig, x, z, tau);
        self.gamma.multiply(self.yt_s.as_ref(), dz);
    }

    /// The dissipation `s' Kd s`, W.
    fn dissipation(&self) -> S {
        self.kd.quadratic(self.s.as_ref())
    }
}
