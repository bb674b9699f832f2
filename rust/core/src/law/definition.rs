//! The functions of a law that the core calls. Most of them have a default that suits most laws.

use super::{AdaptiveSpec, CartesianImpedanceSpec, ElasticImpedanceSpec, JointReference, Law, LawSpec, Level, ReductionSpec};
use crate::dynamics::Model;
use crate::kinematics::Coordinates;
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::Real;

/// A law as the user states it, validated.
pub trait Definition {
    /// The name of the class in Python.
    fn name(&self) -> &'static str;
    /// The plants that the law is made for.
    fn plant(&self) -> PlantKind;
    /// The arm that the law was made for.
    fn model(&self) -> &Model;
    /// The desired motions, in the order in which [`Law::evaluate`] reads them.
    fn motions(&self) -> Vec<&Motion>;
    /// The named parts of the law at one instant.
    fn terms(&self, at: &Instant) -> Vec<Term>;

    /// The law's state at the start of a run, `(p,)`.
    fn initial_state(&self) -> &[f64] {
        &[]
    }

    /// Whether a part of the law's state starts from the plant's state, by [`Law::restart`].
    fn restarts(&self) -> bool {
        false
    }

    /// Whether the law changes permanently at a sample, and therefore requires a sampled loop.
    fn switches(&self) -> bool {
        false
    }

    /// Whether its equations at samples depend on the period.
    fn samples(&self) -> bool {
        false
    }

    /// How the law can be evaluated.
    fn route(&self) -> Route {
        Route::Straight
    }

    /// The joint reference of the law; `None` for a law of tasks.
    fn joint_reference(&self) -> Option<JointReference> {
        None
    }

    /// The frame and axes in which the law takes an external force; `None` for a law of joints alone.
    fn coordinates(&self) -> Option<&Coordinates> {
        None
    }

    /// The levels of a law of tasks in priority; none for any other.
    fn levels(&self) -> &[Level] {
        &[]
    }

    /// The adaptation of a law that has one.
    fn adaptive(&self) -> Option<&AdaptiveSpec> {
        None
    }

    /// The law itself, if it is a spring of a frame on a rigid arm.
    fn impedance(&self) -> Option<&CartesianImpedanceSpec> {
        None
    }

    /// The law itself, if it has a storage function.
    fn storage(&self) -> Option<&ElasticImpedanceSpec> {
        None
    }

    /// The motor-inertia reduction inside, for a law that has one.
    fn reduction(&self) -> Option<&ReductionSpec> {
        None
    }

    /// The stiffness of the joints in the law's model, for a law that reads their torques.
    fn joint_stiffness(&self) -> Option<&Gain> {
        self.reduction().map(|reduction| &reduction.joint_stiffness)
    }

    /// `(I + Kt)^-1` of a law of motors. Multiplied by it, the output at rest is the derivative of a potential.
    fn torque_share(&self) -> Option<Gain> {
        None
    }

    /// The target of the links of a law of motors, `(n,)`.
    fn link_target(&self) -> Option<Vec<f64>> {
        None
    }

    /// The law of the links that commands the joint torque: the outer loop, or a law of rigid arms with a spring.
    fn outer(&self) -> Option<LawSpec> {
        None
    }

    /// The stiffness of that spring.
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        None
    }
}

/// Name, plant, model and motion of a law with the field `model`, and the named field for its only motion.
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

/// A law that can be built into loops, for any number type.
pub trait Build: Definition {
    /// The law in a loop, on the number `S`.
    type Lanes<S: Real>: Law<S> + Send + 'static;

    /// The laws of the lanes as one; all have the same shape.
    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> Self::Lanes<S>
    where
        Self: 'a;

    /// Whether both can run side by side in lanes: their arms, coordinates and states have the same shape.
    fn same_shape(&self, _: &Self) -> bool {
        true
    }
}

/// How a law can be evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// The same operations for every state: it can be recorded and has derivatives.
    Straight,
    /// By decisions on plain numbers. Recorded, it has a route without a branch that reports where it is not valid.
    Guarded,
    /// Only by decisions on plain numbers.
    Deciding,
    /// By a function of the caller, only at samples.
    Outside,
}

impl Route {
    /// Whether the law requires plain numbers, and accepts neither lanes nor dual numbers.
    pub fn is_scalar(self) -> bool {
        self != Route::Straight
    }

    /// Whether the law can be recorded.
    pub fn is_recordable(self) -> bool {
        matches!(self, Route::Straight | Route::Guarded)
    }
}

/// The arguments of a law.
pub struct Instant<'a> {
    /// The time.
    pub t: f64,
    /// Samples of the desired motions.
    pub desired: &'a [f64],
    /// (sin, cos) of the joints.
    pub trig: &'a [(f64, f64)],
    /// State of the plant.
    pub x: &'a [f64],
    /// State of the law.
    pub z: &'a [f64],
}

/// A named part of a law: its values, row-major, in its shape.
pub type Term = (&'static str, Vec<usize>, Vec<f64>);
