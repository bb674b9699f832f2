//! Adaptive tracking of any arm: the choice of estimated parameters, and the metric of their adaptation.
//!
//! - The law estimates all inertial parameters `pi`, or a base set `b`, a linear map of `pi` ([`Base`]). Then `Y pi = Y_b b`, where `Y` is
//!   the regressor and `Y_b` has some of its columns.
//! - The metric is Euclidean, `a_hat_dot = Gamma Y' s`, or natural (Lee, Kwon and Park 2018). Here `a_hat` is the estimate, `s` the sliding
//!   variable and `'` the transpose. In the natural metric, the estimate of the pseudo-inertia `P` of each body has the rate
//!   `P_hat_dot = gamma P_hat L P_hat`. It remains physically possible in continuous time. `L` is a matrix of the body's part of `Y' s`.
//!   The Lyapunov function is then `s' M s / 2 + sum d(P || P_hat) / gamma`, with the mass matrix `M` and the divergence `d`. Each
//!   parameter `a_k` of a joint column adds `(a_k - a_hat_k)^2 / (2 gamma_k)`.

use super::adaptive::{Adaptive, AdaptiveSpec};
use super::composite::LaneComposite;
use super::concurrent::LaneConcurrent;
use super::definition::Law;
use super::joint_columns::{JointColumn, LaneColumns};
use super::projection::{Projection, Projector};
use super::restraint::LaneRestraint;
use super::sizes::require_size;
use super::truth::Truth;
use crate::dynamics::AnyArm;
use crate::error::{Error, Result, finite};
use crate::linalg::gain::Multiply;
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::{is_positive_definite, natural_rate};

/// The adaptation law of the estimate, with its gain.
///
/// ```
/// # use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain};
/// # let model = Model::from(Arm::from_urdf(example_urdf("planar_2r")?, "planar_2r", STANDARD_GRAVITY, None, None)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
///
/// let law = |adaptation, estimate| {
///     let motion = Motion::hold(vec![0.3, 0.4])?;
///     AdaptiveSpec::new(model.clone(), motion, gain(2, 50.0)?, gain(2, 10.0)?, adaptation, None, estimate)
/// };
/// let p = model.parameter_count();
/// assert!(law(Adaptation::Euclidean(gain(p, 2.0)?), None).is_ok());
/// // The natural metric has one gain per body, and requires an estimate that is physically possible.
/// assert!(law(Adaptation::Natural(vec![0.1; 2]), Some(model.parameters())).is_ok());
/// assert!(law(Adaptation::Natural(vec![0.1; 2]), None).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Adaptation {
    /// `Gamma`, of the size `p` of the estimate. Entry `i, j` has the units of parameter `i` times parameter `j` per joule.
    Euclidean(Gain),
    /// `gamma` of each body, 1/J, > 0; then `gamma` of each parameter of a joint column, in its squared unit per joule.
    Natural(Vec<f64>),
}

impl Adaptation {
    /// Refuse an invalid gain, and an estimate for which the natural metric is not defined. The last `beside` parameters belong to joint
    /// columns.
    pub(super) fn validate(&self, estimate: &[f64], beside: usize) -> Result<()> {
        match self {
            Adaptation::Euclidean(gamma) => require_size("gamma", gamma, estimate.len()),
            Adaptation::Natural(gamma) => {
                finite("gamma", gamma)?;
                let inertial = estimate.len() - beside;
                let wanted = inertial / PARAMETERS + beside;
                if gamma.len() != wanted || !inertial.is_multiple_of(PARAMETERS) {
                    let what = if beside == 0 { "one per body" } else { "one per body and then one per further parameter" };
                    return Err(Error::wrong("gamma", "size", format!("{wanted}, {what}"), gamma.len()));
                }
                if let Some(i) = gamma.iter().position(|&g| g <= 0.0) {
                    return Err(Error::input("gamma", format!("is not positive: expected > 0, got {}", gamma[i])).at([i]));
                }
                let (bodies, _) = estimate[..inertial].as_chunks::<PARAMETERS>();
                match bodies.iter().position(|pi| !is_positive_definite(pi)) {
                    None => Ok(()),
                    Some(i) => Err(Error::input(
                        "estimate",
                        format!(
                            "is not physically possible: expected a positive definite pseudo-inertia for natural adaptation (first bad body {i})"
                        ),
                    )),
                }
            }
        }
    }
}

impl AdaptiveSpec {
    /// Add a projection, which keeps the estimates physically possible. An initial estimate outside of the lower bounds of `projection` is
    /// replaced by the nearest one within them.
    ///
    /// Errors: `Input` for natural adaptation, or a base set.
    pub fn projected(mut self, projection: Projection) -> Result<Self> {
        if matches!(self.adaptation, Adaptation::Natural(_)) {
            return Err(Error::input("projection", "has nothing to do: expected None for natural adaptation, which stays consistent"));
        }
        if self.base.is_some() {
            return Err(Error::input("projection", "needs whole bodies: expected all parameters, got a base set"));
        }
        projection.start(&mut self.estimate);
        self.projection = Some(projection);
        self.lengthen();
        Ok(self)
    }
}

/// A base set of `b` parameters: the independent columns of the regressor, and the linear map from all `p` parameters to the base
/// parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::analysis::base_parameters::base_parameters;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Base, Gain};
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
///
/// // A pendulum has ten parameters, and three of them determine its motion.
/// let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// let found = base_parameters(&model, false, false)?.independent;
/// let base = Base { columns: found.columns, projection: found.projection };
/// assert_eq!(base.project(&model.parameters()).len(), 3);
/// let adaptation = Adaptation::Euclidean(gain(3, 2.0)?);
/// let law = AdaptiveSpec::new(model, Motion::hold(vec![0.3])?, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, Some(base), None)?;
/// assert_eq!(law.parameter_sizes(), (1, 3));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// Indices of the estimated parameters, `(b,)`.
    pub columns: Vec<usize>,
    /// The matrix of the linear map, `(b, p)`, row-major.
    pub projection: Vec<f64>,
}

impl Base {
    pub(super) fn validate(&self, p: usize) -> Result<()> {
        let b = self.columns.len();
        if let Some(i) = self.columns.iter().position(|&column| column >= p) {
            return Err(Error::input("base", format!("has an unknown column: expected below {p}, got {}", self.columns[i])).at([i]));
        }
        if b == 0 || self.projection.len() != b * p {
            return Err(Error::wrong("base", "shape", format!("projection ({b}, {p})"), format!("{} entries", self.projection.len())));
        }
        finite("base", &self.projection)
    }

    /// Compute the base parameters, `(b,)`, from all parameters `pi`, `(p,)`.
    pub fn project(&self, pi: &[f64]) -> Vec<f64> {
        self.projection.chunks_exact(pi.len()).map(|row| row.iter().zip(pi).map(|(p, x)| p * x).sum()).collect()
    }
}

/// The adaptive law on vectors of any size.
type OnHeap<S> = Adaptive<S, AnyArm<S>, AnyGain<S>, AnyGain<S>, Vec<S>, Vec<S>>;

/// The adaptive law in a control loop, for any arm.
pub struct AnyAdaptive<S: Real> {
    law: OnHeap<S>,
    /// Known rotor inertias, `(n,)`; empty if there are none.
    armature: Vec<S>,
    columns: Vec<usize>,
    /// The gain `gamma` of each body, then of each parameter of a joint column; empty in the Euclidean metric.
    natural: Vec<S>,
    /// The estimated base parameters at the places of their columns among all parameters, and zeros elsewhere; empty without a base set.
    full: Vec<S>,
    /// The entries of the base set in `Y' s`, the product of the transposed regressor and the sliding variable.
    kept: Vec<S>,
    projector: Option<Projector<S>>,
    /// The buffers of joint columns, restraint and additional adaptation; `None` for the plain adaptation.
    more: Option<More<S>>,
}

/// Joint columns, restraint (leakage and dead zone), and additional adaptation.
struct More<S> {
    joints: LaneColumns<S>,
    restraint: LaneRestraint<S>,
    composite: Option<LaneComposite<S>>,
    concurrent: Option<LaneConcurrent<S>>,
    /// The entries of the joint columns of the regressor `Y`.
    entries: Vec<S>,
    /// The product `y = Y' s` of the transposed regressor and the sliding variable, `(p,)`.
    y: Vec<S>,
    /// The vector `w` that replaces `y` in the rate of the estimate, `(p,)`; empty without restraint and without additional adaptation.
    w: Vec<S>,
    /// The difference `y - w`, `(p,)`; empty if `w` is empty.
    back: Vec<S>,
}

impl<S: Real> More<S> {
    fn from_lanes<'a>(of: impl Fn(usize) -> &'a AdaptiveSpec) -> Self {
        let (first, zeros) = (of(0), |k: usize| vec![S::zero(); k]);
        let p = first.estimate.len();
        let restraint = LaneRestraint::from_lanes(|i| &of(i).restraint);
        let composite = first.composite.is_some().then(|| LaneComposite::from_lanes(&of));
        let concurrent = LaneConcurrent::from_lanes(|i| of(i).concurrent.as_ref());
        let held = if restraint.is_none() && composite.is_none() && concurrent.is_none() { 0 } else { p };
        More {
            joints: LaneColumns::from_lanes(|i| &of(i).columns),
            restraint,
            composite,
            concurrent,
            entries: zeros(first.columns.count()),
            y: zeros(p),
            w: zeros(held),
            back: zeros(held),
        }
    }
}

impl<S: Real> AnyAdaptive<S> {
    pub(super) fn build<'a>(of: impl Fn(usize) -> &'a AdaptiveSpec) -> Self {
        let first = of(0);
        let (n, p) = (first.model.n(), first.model.parameter_count());
        let zeros = |k: usize| vec![S::zero(); k];
        let unit = Gain::unchecked(1, vec![1.0]);
        let euclidean = |i: usize| match &of(i).adaptation {
            Adaptation::Euclidean(gamma) => gamma,
            Adaptation::Natural(_) => &unit,
        };
        let natural = match &first.adaptation {
            Adaptation::Euclidean(_) => Vec::new(),
            Adaptation::Natural(gammas) => (0..gammas.len())
                .map(|k| {
                    S::from_lanes(|i| match &of(i).adaptation {
                        Adaptation::Natural(gamma) => gamma[k],
                        Adaptation::Euclidean(_) => f64::NAN,
                    })
                })
                .collect(),
        };
        let armature = first.model.armature();
        let known = !first.columns.has(JointColumn::Armature) && armature.iter().any(|&a| a != 0.0);
        let columns = first.base.as_ref().map_or(Vec::new(), |base| base.columns.clone());
        let size = first.estimate.len();
        AnyAdaptive {
            law: Adaptive::new(
                AnyArm::from_lanes(|i| &of(i).model),
                AnyGain::labelled("lambda", |i| &of(i).lambda),
                AnyGain::labelled("kd", |i| &of(i).kd),
                AnyGain::labelled("gamma", euclidean),
                zeros(n),
                zeros(p),
            ),
            armature: if known { armature.into_iter().map(S::fixed).collect() } else { Vec::new() },
            full: zeros(if columns.is_empty() { 0 } else { p }),
            kept: zeros(columns.len()),
            projector: first.projection.as_ref().map(|own| Projector::from_lanes(|i| of(i).projection.as_ref().unwrap_or(own), size)),
            columns,
            natural,
            more: (!first.is_plain()).then(|| More::from_lanes(of)),
        }
    }

    /// Compute the torque for the estimate `z` of the bodies, plus the torque of known rotors. The law stores `Y' s`, the product of the
    /// transposed regressor and the sliding variable.
    fn torque(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S]) {
        if self.columns.is_empty() {
            self.law.torque(desired, trig, x, z, tau);
        } else {
            for (&column, &estimate) in self.columns.iter().zip(z) {
                self.full[column] = estimate;
            }
            self.law.torque(desired, trig, x, &self.full, tau);
        }
        for (i, &armature) in self.armature.iter().enumerate() {
            tau[i] = armature.mul_add(self.law.a_r[i], tau[i]);
        }
    }

    /// Compute the torque, and the rate of the estimate, with the options in `more`.
    fn evaluate_more(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        let Some(mut more) = self.more.take() else { return };
        let n = tau.len();
        let (z, filters) = z.split_at(more.y.len());
        let (dz, filter_rates) = dz.split_at_mut(more.y.len());
        let inertial = z.len() - more.entries.len();
        self.torque(desired, trig, x, &z[..inertial], tau);
        more.joints.fill(&self.law.v_r, &self.law.a_r, &mut more.entries);
        if self.columns.is_empty() {
            more.y[..inertial].copy_from_slice(&self.law.yt_s);
        } else {
            for (to, &column) in more.y.iter_mut().zip(&self.columns) {
                *to = self.law.yt_s[column];
            }
        }
        for (k, &entry) in more.entries.iter().enumerate() {
            tau[k % n] = entry.mul_add(z[inertial + k], tau[k % n]);
            more.y[inertial + k] = entry * self.law.s[k % n];
        }
        let free = more.w.is_empty();
        if !free {
            more.restraint.leak(&self.law.s, z, &more.y, &mut more.w, &mut more.back);
        }
        if let Some(composite) = &mut more.composite {
            composite.look(&self.law.arm, &mut self.law.workspace, &more.joints, trig, x);
            composite.push(&x[n..2 * n], tau, [z, filters], [&mut more.w, &mut more.back, filter_rates]);
        }
        if let Some(concurrent) = &more.concurrent {
            concurrent.push(z, &mut more.w, &mut more.back);
        }
        let w = if free { &more.y } else { &more.w };
        if self.natural.is_empty() {
            self.law.gamma.multiply(w, dz);
            if let Some(projector) = &mut self.projector {
                projector.correct(&self.law.gamma, z, w, dz);
            }
        } else {
            self.natural_rates(z, w, dz);
        }
        more.restraint.rest(&self.law.s, &more.y, dz, &mut more.back);
        self.more = Some(more);
    }

    /// Compute the rates of the estimate in the natural metric: of each body, then of each parameter of a joint column.
    fn natural_rates(&self, z: &[S], w: &[S], dz: &mut [S]) {
        let bodies = (z.len() - self.natural.len()) / (PARAMETERS - 1);
        let (of_bodies, beside) = dz.split_at_mut(PARAMETERS * bodies);
        let ((estimates, _), (pushes, _), (rates, _)) =
            (z.as_chunks::<PARAMETERS>(), w.as_chunks::<PARAMETERS>(), of_bodies.as_chunks_mut::<PARAMETERS>());
        for (k, rate) in rates.iter_mut().enumerate() {
            *rate = natural_rate(&estimates[k], &pushes[k], self.natural[k]);
        }
        for (k, rate) in beside.iter_mut().enumerate() {
            *rate = self.natural[bodies + k] * w[PARAMETERS * bodies + k];
        }
    }
}

impl<S: Real> Law<S> for AnyAdaptive<S> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        if self.more.is_some() {
            return self.evaluate_more(desired, trig, x, z, tau, dz);
        }
        self.torque(desired, trig, x, z, tau);
        let yt_s = &self.law.yt_s;
        if !self.natural.is_empty() {
            self.natural_rates(z, yt_s, dz);
        } else if self.columns.is_empty() {
            self.law.gamma.multiply(yt_s, dz);
            if let Some(projector) = &mut self.projector {
                projector.correct(&self.law.gamma, z, yt_s, dz);
            }
        } else {
            for (to, &column) in self.kept.iter_mut().zip(&self.columns) {
                *to = yt_s[column];
            }
            self.law.gamma.multiply(&self.kept, dz);
        }
    }

    fn restart(&mut self, trig: &[(S, S)], x: &[S], z: &mut [S]) {
        let n = self.law.s.len();
        if let Some(More { composite: Some(composite), joints, y, .. }) = &mut self.more {
            composite.look(&self.law.arm, &mut self.law.workspace, joints, trig, x);
            composite.begin(&x[n..2 * n], &mut z[y.len()..]);
        }
    }

    fn dissipation(&self) -> S {
        self.law.dissipation()
    }

    fn dissipation_of(&self, truth: &Truth<S>, x: &[S], z: &[S]) -> S {
        let Some(more) = &self.more else { return self.dissipation() };
        let n = self.law.s.len();
        self.dissipation() - truth.added([&self.law.s, &x[n..2 * n], &self.law.a_r], &more.entries, z, &more.back)
    }
}
