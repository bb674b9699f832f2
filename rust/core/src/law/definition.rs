//! The functions of a law that the core calls. Most of them have a default.

use super::{AdaptiveSpec, CartesianImpedanceSpec, ElasticImpedanceSpec, JointReference, Law, LawSpec, Level, ReductionSpec};
use crate::dynamics::Model;
use crate::kinematics::Coordinates;
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::Real;

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
    /// The desired motions, in the order in which [`Law::evaluate`] reads them.
    fn motions(&self) -> Vec<&Motion>;
    /// The named terms of the law at one instant.
    fn terms(&self, at: &Instant) -> Vec<Term>;

    /// The law's state at the start of a run, `(p,)`, before [`Law::restart`].
    fn initial_state(&self) -> &[f64] {
        &[]
    }

    /// Whether [`Law::restart`] sets a part of the law's state from the plant's state.
    fn restarts(&self) -> bool {
        false
    }

    /// Whether the law changes permanently at a sample, and therefore requires a sampled loop.
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

    /// The adaptive law that this law is or contains; `None` for other laws.
    fn adaptive(&self) -> Option<&AdaptiveSpec> {
        None
    }

    /// This law, if it is the Cartesian impedance law of a rigid arm; `None` for other laws.
    fn impedance(&self) -> Option<&CartesianImpedanceSpec> {
        None
    }

    /// This law, if it is the Cartesian impedance law of an elastic arm; `None` for other laws. It has a storage function on the plants of
    /// `ElasticImpedanceSpec::has_storage`.
    fn storage(&self) -> Option<&ElasticImpedanceSpec> {
        None
    }

    /// The motor-inertia reduction, if the law contains one.
    fn reduction(&self) -> Option<&ReductionSpec> {
        None
    }

    /// The joint stiffness in the law's model; `None` for a law without it.
    fn joint_stiffness(&self) -> Option<&Gain> {
        self.reduction().map(|reduction| &reduction.joint_stiffness)
    }

    /// The matrix `(I + Kt)^-1` of a law that regulates motors, where `Kt` is the gain of the joint torque or zero; `None` for other laws.
    fn torque_share(&self) -> Option<Gain> {
        None
    }

    /// The target positions of the links for a law that regulates motors, `(n,)`, rad or m; `None` for other laws.
    fn link_target(&self) -> Option<Vec<f64>> {
        None
    }

    /// The law that commands the joint torque; `None` for other laws. It is the outer loop of an elastic arm, or a law of a rigid arm with
    /// a spring.
    fn outer(&self) -> Option<LawSpec> {
        None
    }

    /// The stiffness of the spring in [`Self::outer`].
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

/// A law that can be built for loops on any number type.
pub trait Build: Definition {
    /// The type of the law in a control loop on the number type `S`.
    type Lanes<S: Real>: Law<S> + Send + 'static;

    /// Build one law for all lanes. The laws of the lanes must have the same shape.
    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> Self::Lanes<S>
    where
        Self: 'a;

    /// Whether both laws can run in lanes of one register. The caller has already compared their arms, coordinates and states.
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
    /// The law executes the same operations for every state. Such a law can be recorded, and evaluated on dual numbers.
    Straight,
    /// The law branches on plain numbers. The recorded law has no branch, and reports where it is not valid.
    Guarded,
    /// The law branches on plain numbers. Such a law cannot be recorded.
    Deciding,
    /// The law is a function of the caller, evaluated only at samples.
    Outside,
}

impl Route {
    /// Whether the law requires plain numbers, unless it is recorded. Such a law accepts neither registers nor dual numbers.
    pub fn is_scalar(self) -> bool {
        self != Route::Straight
    }

    /// Whether the law can be recorded.
    pub fn is_recordable(self) -> bool {
        match self {
            Route::Straight | Route::Guarded => true,
            Route::Deciding | Route::Outside => false,
        }
    }
}

/// The arguments of a law at one instant.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, Instant, LawSpec, PdGravitySpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], gain(20.0)?, gain(4.0)?)?);
/// let (q, v): (f64, f64) = (0.3, 0.1);
/// let at = Instant { t: 0.0, desired: &law.desired::<f64>(0.0), trig: &[q.sin_cos()], x: &[q, v], z: &[] };
/// let terms = law.terms(&at);
/// assert_eq!(terms.iter().map(|(name, ..)| *name).collect::<Vec<_>>(), ["q_d", "e", "g", "tau"]);
/// assert!((terms[3].2[0] - (20.0 * 0.2 - 4.0 * v + 5.0 * q.sin())).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Instant<'a> {
    /// Time, s.
    pub t: f64,
    /// Samples `[x_d, x_d', x_d'']` of the desired motions, with time derivatives `'`, one motion after another.
    pub desired: &'a [f64],
    /// (sin, cos) of each joint position, `n` pairs.
    pub trig: &'a [(f64, f64)],
    /// State of the plant: joint positions (rad or m), and velocities (rad/s or m/s) unless they are the plant's input. If there are
    /// motors, their positions and velocities follow.
    pub x: &'a [f64],
    /// State of the law, for example an estimate or an integral; empty for a law without a state.
    pub z: &'a [f64],
}

/// A named term of a law: its name, shape, and values in row-major order.
pub type Term = (&'static str, Vec<usize>, Vec<f64>);
