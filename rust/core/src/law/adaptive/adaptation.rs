//! The parameters of an adaptation: which parameters are estimated, the metric, and composite and concurrent adaptation.
//!
//! - The law estimates all inertial parameters `pi`, or a base set `b` ([`Base`]). `b` is a linear map of `pi` with `Y pi = Y_b b`, where
//!   `Y` is the regressor and `Y_b` contains its independent columns.
//! - The metric is Euclidean, or natural (Lee, Kwon and Park 2018):
//!
//! ```text
//! Euclidean   pi_hat_dot = Gamma y,   y = Y' s
//! natural     P_hat_dot = gamma P_hat L P_hat   of each body,   with the symmetric L for which tr(P(pi) L) = pi . y for every pi
//!             V1 = s' M s / 2 + sum d(P || P_hat) / gamma,   d(P || Q) = log(|Q| / |P|) + tr(Q^-1 P) - 4
//! ```
//!
//! Here `pi_hat` is the estimate, `s` the sliding variable and `'` the transpose. `P(pi)` is the pseudo-inertia of a body with the ten
//! parameters `pi`, and `y` are the ten entries of `Y' s` that belong to this body. `V1` is the Lyapunov function, and `M` the mass matrix.
//! In continuous time, a physically possible `P_hat` remains physically possible. Each estimated rotor inertia or friction parameter `pi_k`
//! adds `(pi_k - pi_hat_k)^2 / (2 gamma_k)` to `V1`.

use crate::error::{Error, Result, finite};
use crate::law::sizes::require_size;
use crate::linalg::Gain;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::is_positive_definite;

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
    /// `gamma` of each body, 1/J, > 0. Then `gamma` of each rotor inertia or friction parameter, in the squared unit of the parameter per
    /// joule.
    Natural(Vec<f64>),
}

impl Adaptation {
    /// Refuse an invalid gain, and an estimate for which the natural metric is not defined. The last `joint_parameters` numbers belong to
    /// joint columns.
    pub(super) fn validate(&self, estimate: &[f64], joint_parameters: usize) -> Result<()> {
        match self {
            Adaptation::Euclidean(gamma) => require_size("gamma", gamma, estimate.len()),
            Adaptation::Natural(gamma) => {
                finite("gamma", gamma)?;
                let inertial = estimate.len() - joint_parameters;
                let wanted = inertial / PARAMETERS + joint_parameters;
                if gamma.len() != wanted || !inertial.is_multiple_of(PARAMETERS) {
                    let what = if joint_parameters == 0 { "one per body" } else { "one per body and then one per further parameter" };
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

/// A base set of `b` parameters (gautier1991numerical): the independent columns of the regressor, and the linear map from all `p` parameters to the base
/// parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::{JointTerms, Model};
/// # use armlet_core::motion::Motion;
/// use armlet_core::analysis::base_parameters::base_parameters;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Base, Gain};
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
///
/// // A pendulum has ten parameters, and three of them determine its motion.
/// let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// let found = base_parameters(&model, JointTerms::default())?.independent;
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

/// The filter and the weight of composite adaptation (SlotineLi1989). The file `composite` has the equations.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.3])?, Adaptation::Euclidean(gain(10, 2.0)?));
///
/// let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
/// // The filter has the rate 5 1/s.
/// let law = law.composite(5.0, gain(1, 0.5)?)?;
/// assert_eq!(law.composite.as_ref().map(|composite| composite.rate), Some(5.0));
/// // The state has the estimate, the filtered regressor and the filtered torque.
/// assert_eq!(LawSpec::from(law).initial_state().len(), 10 + 10 + 1);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Composite {
    /// Rate `lambda` of the filter, 1/s, > 0.
    pub rate: f64,
    /// Weight `R` of the error, of size `n`, 1/(N m s^3) for revolute joints, m/(N s^3) for prismatic joints.
    pub weight: Gain,
    /// `(n, p)`: for each entry of the filtered regressor, whether it can differ from zero for this arm.
    pub(super) present: Vec<bool>,
}

/// Stored samples of concurrent learning (ChowdharyJohnson2010), and their weighted sums. The file `concurrent` has the equations.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, Record};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let law = AdaptiveSpec::new(model.clone(), motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// // One sample: at q = 0 and a = 1 rad/s^2, the torque is 2 N m.
/// let stored = law.samples(Record { q: &[0.0], v: &[0.0], tau: &[2.0] }, &[1.0])?;
/// let law = LawSpec::from(law.concurrent(stored, &gain(1, 1.0)?)?);
/// let rate = |estimate: &[f64]| {
///     let terms = law.terms_at(0.0, &[0.0, 0.0], estimate);
///     terms.into_iter().find(|(name, ..)| *name == "estimate_rate").map_or(0.0, |(_, _, rate)| rate.iter().map(|x| x.abs()).sum::<f64>())
/// };
/// // At the target, only the stored sample changes the estimate. It agrees with the true parameters.
/// assert!(rate(&[0.0; 10]) > 1.0 && rate(&model.parameters()) < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Concurrent {
    /// Regressors `W_j` of all samples, `(N, n, p)`.
    pub(super) rows: Vec<f64>,
    /// Torques `tau_j` of all samples, `(N, n)`, N m or N. For samples of windows ([`super::Windows`]), integrals of torques, N m s or N s.
    pub(super) torques: Vec<f64>,
    /// The sum over the samples of `W_j' R W_j`, `(p, p)`.
    pub(super) gram: Vec<f64>,
    /// The sum over the samples of `W_j' R tau_j`, `(p,)`.
    pub(super) moment: Vec<f64>,
}
