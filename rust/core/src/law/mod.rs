//! Control laws: they compute the plant's input from the desired motion and the measured state.
//!
//! A law is declared once ([`Definition`], with all laws in [`LawSpec`]). Its parameters and its equations ([`Equations`]) are recorded.
//!
//! Terms of this folder:
//! - `n` is the number of joints without mimic joints, and `m` the number of rows of a task.
//! - `p` is the length of the law's state `z`, or the number of estimated parameters.
//! - Two laws have the *same shape* if they are of one kind, with equal sizes, arms of equal geometry, and the same options. Their numbers
//!   may differ.
//! - A *program* is a recorded and compiled computation (`trace`), here of a law. Its results have the same bits as a direct evaluation.
//! - *Joint columns* are the columns of the regressor for armature (rotor inertia) and friction, after the columns of the bodies.

mod adaptive;
mod aims;
mod computed_torque;
mod definition;
mod elastic;
mod equations;
mod evaluator;
mod external;
mod guarded;
mod impedance;
mod inertia_reduction;
mod level;
mod pd_gravity;
mod pid;
mod printed;
mod priority;
mod recorded;
mod sizes;
mod terms;

pub use crate::linalg::gain::Gain;
pub(crate) use adaptive::Lyapunov;
pub use adaptive::{
    Adaptation, AdaptiveSpec, Base, Composite, Concurrent, JointColumn, JointColumns, LeakageForm, Projection, Record, Restraint,
    StoredRows, Truth, Windows,
};
pub use aims::Aim;
pub use computed_torque::ComputedTorqueSpec;
use definition::Shape;
pub use definition::{Definition, JointReference, Route};
pub(crate) use elastic::Storage;
pub use elastic::*;
pub use equations::{Adapting, Answer, Equations, Loop, Sample};
pub use evaluator::LawEvaluator;
pub use external::{Call, ExternalSpec};
pub use guarded::{GuardedSpec, Reaction, parents, touched};
pub use impedance::{CartesianImpedanceSpec, ImpedanceOptions, NULL_SPACE_EPS, NullProjection, NullSpaceSpec};
pub(crate) use impedance::{ProjectionLoss, turn_rates};
pub use inertia_reduction::ReductionSpec;
pub use level::Level;
pub use pd_gravity::PdGravitySpec;
pub use pid::{PidOptions, PidSpec};
pub use printed::CLoop;
pub(crate) use priority::norms;
pub use priority::{
    ArmBatch, ArmSolver, HORIZON, LimitOverrides, MotionLimits, PriorityAccelerationSpec, PriorityVelocitySpec, with_limits,
};
pub use recorded::{RecordedLaw, Terms};
pub use terms::Term;

use crate::motion::sample_all;
use crate::plant::Parameters;
use crate::scalar::Real;
use crate::trace::expression::vector;
use crate::trace::{Sym, V};
use std::ops::{Deref, DerefMut};

/// Declare the kinds of laws: the enum, its conversions, and the construction for a loop. Each law has one entry in this list.
macro_rules! laws {
    ($($(#[$doc:meta])* $law:ident($definition:ty),)*) => {
        /// A law of any kind, with the interface [`Definition`].
        ///
        /// ```
        /// # use armlet_core::{arm::Arm, dynamics::Model, law::Gain};
        /// use armlet_core::law::{LawSpec, PdGravitySpec};
        /// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
        ///
        /// let law = PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?;
        /// let law = LawSpec::from(law);
        /// assert_eq!(law.name(), "PDGravity");
        /// // At q = 0, the spring of 20 N m/rad has a torque of 10 N m. With three times the stiffness, it has 30 N m.
        /// let torque = |law: &LawSpec| law.terms_at(0.0, &[0.0, 0.0], &[]).pop().map(|(_, _, tau)| tau);
        /// assert_eq!((torque(&law), law.with_stiffness(3.0).and_then(|law| torque(&law))), (Some(vec![10.0]), Some(vec![30.0])));
        /// # Ok::<(), armlet_core::error::Error>(())
        /// ```
        #[derive(Clone, Debug, PartialEq)]
        pub enum LawSpec {
            $($(#[$doc])* $law($definition),)*
        }

        $(impl From<$definition> for LawSpec {
            fn from(law: $definition) -> Self {
                LawSpec::$law(law)
            }
        })*

        impl Deref for LawSpec {
            type Target = dyn Definition;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(LawSpec::$law(law) => law,)*
                }
            }
        }

        impl DerefMut for LawSpec {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(LawSpec::$law(law) => law,)*
                }
            }
        }

        impl LawSpec {
            /// The law with its parameters and its equations.
            fn equations_of(&self) -> &dyn Equations {
                match self {
                    $(LawSpec::$law(law) => law,)*
                }
            }

            /// Whether the loops of both laws have the same operations, and differ only in their numbers.
            pub fn same_shape(&self, other: &LawSpec) -> bool {
                self.model().same_geometry(other.model())
                    && self.coordinates() == other.coordinates()
                    && self.initial_state().len() == other.initial_state().len()
                    && match (self, other) {
                        $((LawSpec::$law(law), LawSpec::$law(other)) => law.same_shape(other),)*
                        _ => false,
                    }
            }
        }
    };
}

laws! {
    /// Slotine-Li adaptive control.
    Adaptive(AdaptiveSpec),
    /// Computed torque.
    ComputedTorque(ComputedTorqueSpec),
    /// PD with gravity compensation.
    PdGravity(PdGravitySpec),
    /// PID with gravity compensation.
    Pid(PidSpec),
    /// Cartesian impedance of a rigid arm.
    CartesianImpedance(CartesianImpedanceSpec),
    /// Cartesian impedance of an elastic arm.
    ElasticImpedance(ElasticImpedanceSpec),
    /// Joint impedance of an elastic arm.
    JointImpedance(JointImpedanceSpec),
    /// Tracking of a joint motion with an elastic arm.
    JointTracking(JointTrackingSpec),
    /// PD on motors with gravity compensation.
    MotorPd(MotorPdSpec),
    /// Full state feedback of an elastic arm.
    StateFeedback(StateFeedbackSpec),
    /// Joint velocities for tasks in order of priority.
    PriorityVelocity(PriorityVelocitySpec),
    /// Joint accelerations for tasks in order of priority, by computed torque.
    PriorityAcceleration(PriorityAccelerationSpec),
    /// A law that commands torques, with a momentum observer and, if requested, a reaction to contact.
    Guarded(GuardedSpec),
    /// A law that is a function of the caller, evaluated at samples.
    External(ExternalSpec),
}

impl Equations for LawSpec {
    fn parameters(&self, period: Option<f64>) -> Parameters {
        self.equations_of().parameters(period)
    }

    fn equations(&self, at: &Loop) -> Answer {
        self.equations_of().equations(at)
    }

    fn start_state(&self, at: &Loop) -> V {
        self.equations_of().start_state(at)
    }
}

impl LawSpec {
    /// Times, s, at which a derivative of a desired motion jumps, so that integrators restart. They are in ascending order and may repeat.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks: Vec<f64> = self.motions().iter().flat_map(|motion| motion.breaks()).collect();
        breaks.sort_by(f64::total_cmp);
        breaks
    }

    /// The samples of the law's motions at time `t`, in the order of [`Loop::desired`].
    pub fn desired<S: Real>(&self, t: f64) -> Vec<S> {
        let motions = self.motions();
        let mut desired = vec![0.0; motions.iter().map(|motion| 3 * motion.dof()).sum()];
        sample_all(motions, t, &mut desired);
        desired.into_iter().map(S::splat).collect()
    }

    /// The samples of the law's motions, from their numbers one after another.
    pub(crate) fn split_samples(&self, desired: &[Sym]) -> Vec<Sample> {
        let mut left = desired;
        let mut part = |n: usize| vector(left.split_off(..n).unwrap_or_default());
        self.motions().iter().map(|motion| [0; 3].map(|_| part(motion.dof()))).collect()
    }

    /// A copy of the law whose spring is `kappa` times as stiff; `None` for a law without a spring. The spring has the stiffness `K_m` of a
    /// Cartesian impedance, or `Kp` of a PD law of links.
    pub fn with_stiffness(&self, kappa: f64) -> Option<LawSpec> {
        let mut law = self.clone();
        let stiffness = law.outer_stiffness()?;
        *stiffness = stiffness.scaled(kappa);
        Some(law)
    }

    /// The adaptive law; `None` for other laws.
    pub fn adaptive(&self) -> Option<&AdaptiveSpec> {
        if let LawSpec::Adaptive(law) = self { Some(law) } else { None }
    }

    /// The Cartesian impedance law of a rigid arm; `None` for other laws.
    pub fn impedance(&self) -> Option<&CartesianImpedanceSpec> {
        if let LawSpec::CartesianImpedance(law) = self { Some(law) } else { None }
    }

    /// The Cartesian impedance law of an elastic arm; `None` for other laws. [`ElasticImpedanceSpec::has_storage`] decides whether it has a
    /// storage function on a plant.
    pub fn storage(&self) -> Option<&ElasticImpedanceSpec> {
        if let LawSpec::ElasticImpedance(law) = self { Some(law) } else { None }
    }

    /// The impedance law with a null space or a compensated coupling, which has a projection loss: the law itself, or its outer loop.
    /// `None` for other laws.
    pub(crate) fn projecting(&self) -> Option<&CartesianImpedanceSpec> {
        let law = self.impedance().or(self.storage().map(|law| &law.outer))?;
        (law.options().null_space.is_some() || law.options().compensate_coupling).then_some(law)
    }

    /// Whether the law has a projection loss: it has a null space, or compensates the coupling.
    pub fn has_projection_loss(&self) -> bool {
        self.projecting().is_some()
    }

    /// The impedance or PD law that commands the joint torque: the law itself for a rigid arm, or the outer loop for an elastic arm. `None`
    /// for other laws.
    pub fn outer(&self) -> Option<LawSpec> {
        match self {
            LawSpec::PdGravity(_) | LawSpec::CartesianImpedance(_) => Some(self.clone()),
            LawSpec::JointImpedance(law) => Some(law.outer.clone().into()),
            LawSpec::ElasticImpedance(law) => Some(law.outer.clone().without_torque_limits().into()),
            _ => None,
        }
    }

    /// The number of rows of each level of limits above the tasks of a law of accelerations with torque limits; otherwise empty.
    pub fn limit_rows(&self) -> Vec<usize> {
        if let LawSpec::PriorityAcceleration(law) = self { law.limit_rows() } else { Vec::new() }
    }

    /// The number of rows of each priority level; empty for a law without levels.
    pub fn level_rows(&self) -> Vec<usize> {
        level::level_rows(self.levels())
    }
}
