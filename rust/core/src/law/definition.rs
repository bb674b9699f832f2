//! The declaration of a law. Most functions have a default.

use super::inertia_reduction::ReductionSpec;
use super::level::Level;
use super::terms::Term;
use crate::dynamics::Model;
use crate::kinematics::Coordinates;
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::PlantKind;

/// The desired positions of the joints.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{ComputedTorqueSpec, Gain, JointReference, LawSpec, PdGravitySpec};
/// use armlet_core::motion::{Motion, Quintic};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let held = LawSpec::from(PdGravitySpec::new(model.clone(), vec![0.5], gain(20.0)?, gain(4.0)?)?);
/// assert_eq!(held.joint_reference(), Some(JointReference::Target(vec![0.5])));
/// let motion = Motion::from(Quintic::new(vec![0.0], vec![0.5], 1.0)?);
/// let moving = LawSpec::from(ComputedTorqueSpec::new(model, motion, gain(100.0)?, gain(20.0)?)?);
/// assert_eq!(moving.joint_reference(), Some(JointReference::Motion));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum JointReference {
    /// The motion of the law: the first of [`Definition::motions`].
    Motion,
    /// A fixed position, `(n,)`, rad or m.
    Target(Vec<f64>),
}

impl JointReference {
    /// The reference of a law that follows `motion`, the first of its motions. A motion at rest is a fixed target.
    pub(super) fn of(motion: &Motion) -> Self {
        if motion.moves() {
            return JointReference::Motion;
        }
        let mut sample = vec![0.0; 3 * motion.dof()];
        motion.sample(0.0, &mut sample);
        sample.truncate(motion.dof());
        JointReference::Target(sample)
    }
}

/// A law with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, PidSpec};
/// use armlet_core::motion::Motion;
/// use armlet_core::plant::PlantKind;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// // A law of any kind has these functions.
/// let law = PidSpec::new(model, Motion::hold(vec![0.5])?, gain(20.0)?, Some(gain(3.0)?), gain(4.0)?)?;
/// let law = LawSpec::from(law);
/// assert_eq!((law.name(), law.plant(), law.model().n()), ("PID", PlantKind::Rigid, 1));
/// // The state of this law is its integral.
/// assert_eq!((law.motions(), law.initial_state()), (vec![&Motion::hold(vec![0.5])?], &[0.0][..]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Definition {
    /// The name of the class in Python.
    fn name(&self) -> &'static str;
    /// The kind of plant that the law controls.
    fn plant(&self) -> PlantKind;
    /// The model of the arm.
    fn model(&self) -> &Model;
    /// The desired motions, in the order in which [`Loop::desired`](super::Loop::desired) reads them.
    fn motions(&self) -> Vec<&Motion>;
    /// Named terms at the law's state `z` that are not part of an evaluation of the law.
    fn stored_terms(&self, _z: &[f64]) -> Vec<Term> {
        Vec::new()
    }

    /// The law's state at the start of a run, `(p,)`, before [`Equations::start_state`](super::Equations::start_state).
    fn initial_state(&self) -> &[f64] {
        &[]
    }

    /// Whether [`Equations::start_state`](super::Equations::start_state) sets a part of the law's state from the plant's state.
    fn restarts(&self) -> bool {
        false
    }

    /// The index of the first of `n` components of the law's state whose rates have the plant's input as a term; `None` without them. In a
    /// sampled loop, this term is the input that acts on the plant.
    fn torque_states(&self) -> Option<usize> {
        None
    }

    /// Whether the law changes permanently at one sample, as a reaction to contact does. Such a law requires a sampled loop.
    fn switches(&self) -> bool {
        false
    }

    /// Whether the law's equations at samples depend on the sample period.
    fn samples(&self) -> bool {
        false
    }

    /// How the law can be evaluated.
    fn route(&self) -> Route {
        Route::Straight
    }

    /// The joint reference of the law; `None` for a law without one.
    fn joint_reference(&self) -> Option<JointReference> {
        None
    }

    /// The frame and the axes that a Cartesian impedance law controls; `None` for other laws.
    fn coordinates(&self) -> Option<&Coordinates> {
        None
    }

    /// The priority levels of the law; empty for a law without tasks in priority.
    fn levels(&self) -> &[Level] {
        &[]
    }

    /// The motor-inertia reduction, if the law contains one.
    fn reduction(&self) -> Option<&ReductionSpec> {
        None
    }

    /// The joint stiffness in the law's model; `None` for a law without it.
    fn joint_stiffness(&self) -> Option<&Gain> {
        self.reduction().map(|reduction| &reduction.joint_stiffness)
    }

    /// The matrix `(I + Kt)^-1` of a law that regulates motors; `None` for other laws. `Kt` is the gain of the joint-torque feedback, zero
    /// without this feedback.
    fn torque_share(&self) -> Option<Gain> {
        None
    }

    /// The target positions of the links for a law that regulates motors, `(n,)`, rad or m; `None` for other laws.
    fn link_target(&self) -> Option<Vec<f64>> {
        None
    }

    /// The stiffness that [`LawSpec::with_stiffness`](super::LawSpec::with_stiffness) scales; `None` for a law without a spring.
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        None
    }
}

/// Implement name, plant, model and motions for a law with the field `model`, and with one motion in the named field.
macro_rules! facts {
    ($name:expr, $plant:ident, $motion:ident) => {
        fn name(&self) -> &'static str {
            $name
        }
        fn plant(&self) -> $crate::plant::PlantKind {
            $crate::plant::PlantKind::$plant
        }
        fn model(&self) -> &$crate::dynamics::Model {
            &self.model
        }
        fn motions(&self) -> Vec<&$crate::motion::Motion> {
            vec![&self.$motion]
        }
    };
}
pub(super) use facts;

/// Whether two laws of one kind have the same shape.
pub trait Shape {
    /// Whether the loops of both laws have the same operations, and differ only in their numbers. The caller has already compared their
    /// arms, coordinates and states.
    fn same_shape(&self, _: &Self) -> bool {
        true
    }
}

/// How a law can be evaluated.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{ExternalSpec, Gain, LawSpec, PdGravitySpec, Route};
/// use armlet_core::plant::PlantKind;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let function = LawSpec::from(ExternalSpec::idle(&model, PlantKind::Rigid));
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], gain(20.0)?, gain(4.0)?)?);
/// assert_eq!((law.route(), function.route()), (Route::Straight, Route::Outside));
/// assert!(law.route().is_recordable() && !function.route().is_recordable());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// The law executes the same operations for every state.
    Straight,
    /// The law is a formula with a decision near singularities ([`crate::trace::decision`]). It has derivatives away from them.
    Guarded,
    /// The law is a formula with a decision near singularities and at bounds. It has derivatives with the active set of each evaluation.
    Bounded,
    /// As `Bounded`, and the decision scales commands. It has no derivatives of runs.
    Deciding,
    /// The law is a function of the caller, evaluated only at samples.
    Outside,
}

impl Route {
    /// Whether the law has no derivatives for implicit methods.
    pub fn is_scalar(self) -> bool {
        self != Route::Straight
    }

    /// Whether the law can be recorded.
    pub fn is_recordable(self) -> bool {
        self != Route::Outside
    }

    /// Whether runs of the law have derivatives.
    pub fn is_differentiable(self) -> bool {
        matches!(self, Route::Straight | Route::Guarded | Route::Bounded)
    }
}
