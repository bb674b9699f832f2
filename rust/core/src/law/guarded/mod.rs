//! A law with a momentum observer (`DeLuca2006`), which detects contact and starts a reaction (`Haddadin2017`).
//!
//! ```text
//! r = K (p - w),   w_dot = tau - tau_f + C' v - g + r,   w(0) = p(0),   p = M v        =>        r_dot = K (tau_ext - r)
//! sampled: K_T = K (I + K T)^-1 replaces K, and w_dot is constant:   r_k = (I + K T)^-1 (r_(k-1) + K (p_k - p_(k-1) - (..)_(k-1) T))
//! ```
//!
//! Here `p` is the momentum, `r` the residual, `K` the gain, `tau_f` the known friction, `tau_ext` the external torque, and `'` the
//! transpose. In the last line, `(..) = tau - tau_f + C' v - g`, and `T` is the sample time. Contact is the first sample at which some
//! `|r_i|` exceeds its threshold. From that sample on, this reaction replaces the law:
//!
//! ```text
//! tau = g(q) + K_c (y_c - y) + D_c (y_c_dot - y_dot),   y = q, or the motors' theta of elastic joints
//! stop: y_c the position at contact      float: K_c = 0      retract: y_c_dot = V r_c / max |r_c| for a time, r_c the residual at contact
//! ```
//!
//! For elastic joints, `tau` of the observer is the torque of the joints, `K_J (theta - q)`.
//!
//! The law's state is the state of the inner law, then `w`, then the integral `R` of `r`. A reaction adds a number `c`, the time `s` since
//! contact, and the products `y_c c` and `r_c c`. From the sample of contact on, `s` has the rate 1. At the sample of contact, `c`, `y_c c`
//! and `r_c c` have the rates 1, `y` and `r`. At all other samples, these rates are zero. A rate acts until the next sample. So `y_c c`
//! and `r_c c`, divided by `c`, are the values `y_c` and `r_c` at contact.

mod equations;
mod isolation;

pub use isolation::{parents, touched};

use super::LawSpec;
use super::definition::{Definition, JointReference, Route};
use super::inertia_reduction::ReductionSpec;
use super::level::Level;
use super::sizes::{require_rows, require_size};
use crate::dynamics::Model;
use crate::error::{Error, Result, positive};
use crate::kinematics::Coordinates;
use crate::linalg::gain::Gain;
use crate::motion::Motion;
use crate::plant::PlantKind;

/// The reaction of the law after contact.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, GuardedSpec, LawSpec, PdGravitySpec, Reaction};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
/// # let inner = LawSpec::from(PdGravitySpec::new(model.clone(), vec![0.5], gain(20.0)?, gain(4.0)?)?);
///
/// let guarded = |thresholds, reaction| {
///     let observer = (model.clone(), gain(50.0)?, [vec![0.0], vec![0.0]]);
///     GuardedSpec::new(inner.clone(), observer, thresholds, reaction, None)
/// };
/// let float = || Some(Reaction::Float(None));
/// assert!(guarded(Some(vec![1.0]), float())?.reacts());
/// // Without a reaction, the law only observes. A reaction requires thresholds.
/// assert!(!guarded(Some(vec![1.0]), None)?.reacts() && guarded(None, float()).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Reaction {
    /// Hold the position at contact, with a stiffness and a damping of size `n`.
    Stop(Gain, Gain),
    /// Compensate gravity, with an optional damping of size `n`.
    Float(Option<Gain>),
    /// Move away in the direction of the external torque: stiffness, damping, speed `V` of the fastest joint (rad/s or m/s), and duration
    /// (s).
    Retract(Gain, Gain, f64, f64),
}

impl Reaction {
    /// The stiffness and the damping of the reaction; `None` for a reaction without this gain.
    fn gains(&self) -> (Option<&Gain>, Option<&Gain>) {
        match self {
            Reaction::Stop(stiffness, damping) | Reaction::Retract(stiffness, damping, ..) => (Some(stiffness), Some(damping)),
            Reaction::Float(damping) => (None, damping.as_ref()),
        }
    }
}

/// A law with its observer, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::plant::{PlantSpec, RigidSpec};
/// # use armlet_core::simulate::{Force, Options, Problem, Sampling};
/// # use nalgebra::dvector;
/// use armlet_core::law::{Gain, GuardedSpec, LawSpec, PdGravitySpec, Reaction};
/// # let model = Model::from(Arm::planar(&[0.5], None, None, None, [0.0, 0.0])?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
/// # let tip = model.tree("arm")?.frame_index("link1")?;
///
/// let inner = LawSpec::from(PdGravitySpec::new(model.clone(), vec![0.0], gain(20.0)?, gain(4.0)?)?);
/// let observer = (model, gain(100.0)?, [vec![0.0], vec![0.0]]);
/// let law = LawSpec::from(GuardedSpec::new(inner, observer, Some(vec![1.0]), Some(Reaction::Float(Some(gain(1.0)?))), None)?);
/// // From 0.1 s on, a force of 20 N acts on the tip. After contact, the arm floats away instead of returning.
/// let force = Force::steps(vec![0.1], vec![[0.0, 20.0, 0.0, 0.0, 0.0, 0.0]])?;
/// let options = Options { sampling: Some(Sampling::every(1e-3)), ..Options::fixed(0.5, 1e-3) };
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![0.0], options)?;
/// (problem.forces, problem.force_frame) = (vec![&force], Some(tip));
/// assert!(problem.run()?.q[500] > 1.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct GuardedSpec {
    /// The law before contact.
    pub inner: Box<LawSpec>,
    /// The model of the observer. The reaction compensates the gravity of this model.
    model: Model,
    gain: Gain,
    friction: [Vec<f64>; 2],
    thresholds: Vec<f64>,
    reaction: Option<Reaction>,
    joint_stiffness: Option<Gain>,
    start: Vec<f64>,
}

impl GuardedSpec {
    /// Whether both laws guard the same kind of law, and both or neither have thresholds.
    pub fn same_kind(&self, other: &Self) -> bool {
        std::mem::discriminant(&*self.inner) == std::mem::discriminant(&*other.inner)
            && self.thresholds.is_empty() == other.thresholds.is_empty()
    }

    /// Add an observer with `model` to the law `inner`. `gain` is `K`, of size `n`, 1/s. `friction` is the known viscous friction, N m
    /// s/rad or N s/m, and Coulomb friction, N m or N, `(n,)` each.
    ///
    /// A reaction requires `thresholds`, `(n,)`, N m or N. `joint_stiffness`, N m/rad or N/m, is required if `inner` controls an elastic
    /// arm but has no joint stiffness itself.
    pub fn new(
        inner: LawSpec,
        (model, gain, friction): (Model, Gain, [Vec<f64>; 2]),
        thresholds: Option<Vec<f64>>,
        reaction: Option<Reaction>,
        joint_stiffness: Option<Gain>,
    ) -> Result<Self> {
        let n = inner.model().n();
        let refused = |got: &str| Err(Error::input("law", format!("cannot be guarded: expected a law of torques, got {got}")));
        match (inner.plant(), inner.route()) {
            (PlantKind::Velocity, _) => return refused("one of velocities"),
            (_, Route::Outside) => return refused("a function in Python"),
            (PlantKind::Rigid | PlantKind::Elastic, _) => {}
        }
        if matches!(inner, LawSpec::Guarded(_)) {
            return refused("one that is guarded");
        }
        require_rows("observer", n, model.n())?;
        require_size("observer", &gain, n)?;
        if reaction.is_some() && thresholds.is_none() {
            return Err(Error::input("observer", "has no threshold: expected one with threshold= or after calibrate()"));
        }
        let (stiffness, damping) = reaction.as_ref().map_or((None, None), Reaction::gains);
        stiffness.map_or(Ok(()), |gain| require_size("stiffness", gain, n))?;
        damping.map_or(Ok(()), |gain| require_size("damping", gain, n))?;
        if let Some(Reaction::Retract(_, _, speed, duration)) = &reaction {
            positive("speed", *speed)?;
            positive("duration", *duration)?;
        }
        let joint_stiffness = match (inner.plant().has_motors(), joint_stiffness) {
            (true, given) => match given.or_else(|| inner.joint_stiffness().cloned()) {
                Some(stiffness) => {
                    require_size("joint_stiffness", &stiffness, n)?;
                    Some(stiffness)
                }
                None => {
                    return Err(Error::input("joint_stiffness", "is missing: expected that of the joints, which the law does not know"));
                }
            },
            (false, None) => None,
            (false, Some(_)) => return Err(Error::input("joint_stiffness", "is not used: expected None for a law of rigid arms")),
        };
        let mut start = inner.initial_state().to_vec();
        start.resize(start.len() + 2 * n + if reaction.is_some() { 2 + 2 * n } else { 0 }, 0.0);
        let thresholds = thresholds.unwrap_or_default();
        Ok(GuardedSpec { inner: Box::new(inner), model, gain, friction, thresholds, reaction, joint_stiffness, start })
    }

    /// Whether the law changes at contact.
    pub fn reacts(&self) -> bool {
        self.reaction.is_some()
    }

    /// Thresholds of contact, `(n,)`, N m or N; empty without thresholds.
    pub fn thresholds(&self) -> &[f64] {
        &self.thresholds
    }

    /// Gain `K` of the observer, of size `n`, 1/s.
    pub fn gain(&self) -> &Gain {
        &self.gain
    }

    /// The model of the observer.
    pub fn observed(&self) -> &Model {
        &self.model
    }
}

impl Definition for GuardedSpec {
    fn name(&self) -> &'static str {
        "Guarded"
    }
    fn plant(&self) -> PlantKind {
        self.inner.plant()
    }
    fn model(&self) -> &Model {
        self.inner.model()
    }
    fn motions(&self) -> Vec<&Motion> {
        self.inner.motions()
    }
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn restarts(&self) -> bool {
        true
    }
    fn route(&self) -> Route {
        self.inner.route()
    }
    fn torque_states(&self) -> Option<usize> {
        self.joint_stiffness.is_none().then(|| self.inner.initial_state().len())
    }
    fn switches(&self) -> bool {
        self.reacts()
    }
    fn samples(&self) -> bool {
        true
    }

    fn joint_reference(&self) -> Option<JointReference> {
        self.inner.joint_reference()
    }
    fn coordinates(&self) -> Option<&Coordinates> {
        self.inner.coordinates()
    }
    fn levels(&self) -> &[Level] {
        self.inner.levels()
    }
    fn reduction(&self) -> Option<&ReductionSpec> {
        self.inner.reduction()
    }
    fn joint_stiffness(&self) -> Option<&Gain> {
        self.joint_stiffness.as_ref()
    }
}
