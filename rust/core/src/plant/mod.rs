//! Plants: they compute the motion that results from a law's output.
//!
//! The state `x` of a rigid plant is `[q, v]`, of an elastic plant `[q, v, theta, theta_dot]`, and of a velocity-controlled plant `[q]`.
//! Deflections `z` of friction bristles come last. An external wrench `W = [f; m]` (world axes) acts at one frame. Its joint torque is
//! `J' W`, with the transposed Jacobian `J'` of the frame. A wall pushes a frame that enters it.
//!
//! The folder is flat, because each plant and each model of friction, contacts or sensors has one file.

mod contact;
mod definition;
mod elastic;
mod equations;
mod evaluation;
mod friction;
mod friction_curve;
mod friction_torque;
mod lugre;
mod parameters;
mod recorded;
mod rigid;
pub mod sensors;
mod stick_slip;
mod stops;
mod stored;
pub mod unilateral;
mod velocity;

pub(crate) use contact::LoopWall;
pub use contact::Wall;
pub use definition::Definition;
pub use elastic::ElasticSpec;
pub use equations::{PlantAt, PlantEquations, PlantRates, PlantState, Power};
pub use friction::JointFriction;
pub use friction_curve::FrictionCurve;
pub(crate) use friction_torque::{FrictionTorque, Rubbed};
pub use lugre::LuGre;
pub use parameters::{K, Parameters};
pub use recorded::RecordedPlant;
pub use rigid::RigidSpec;
pub use stick_slip::{LoopStickSlip, StickSlip};
pub use stops::{Stop, Stops};
pub(crate) use stored::Stored;
pub use unilateral::{Mode, Touch};
pub use velocity::VelocitySpec;

use crate::error::Result;
use std::ops::Deref;

/// Declare the kinds of plants: enums, names and parts of the state, and the construction for a loop. Each plant has one file and one entry
/// here.
macro_rules! plants {
    ($($(#[$doc:meta])* $kind:ident($definition:ty) $name:literal [$($part:literal)*],)*) => {
        /// The kind of plant that a law controls.
        ///
        /// ```
        /// use armlet_core::plant::PlantKind;
        ///
        /// assert_eq!(PlantKind::Elastic.parts(), ["q", "v", "theta", "theta_dot"]);
        /// assert_eq!((PlantKind::Elastic.states(7), PlantKind::Velocity.states(7)), (28, 7));
        /// assert!(PlantKind::Elastic.has_motors() && !PlantKind::Velocity.has_speeds());
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum PlantKind {
            $($(#[$doc])* $kind,)*
        }

        /// A plant of any kind. It also has the functions of [`Definition`].
        ///
        /// ```
        /// use armlet_core::arm::Arm;
        /// use armlet_core::plant::{PlantKind, PlantSpec, RigidSpec, Stops, VelocitySpec};
        ///
        /// let arm = Arm::pendulum(1.0, 5.0)?;
        /// let stops = Stops::new(vec![-1.0], vec![1.0], vec![1e3], vec![10.0])?;
        /// let rigid = PlantSpec::from(RigidSpec { stops: Some(stops), ..RigidSpec::new(arm.clone().into()) });
        /// let velocity = PlantSpec::from(VelocitySpec { model: arm.into() });
        /// assert_eq!((rigid.kind(), rigid.states(), velocity.states()), (PlantKind::Rigid, 2, 1));
        /// assert!(!rigid.is_free() && velocity.is_free() && !rigid.same_shape(&velocity));
        /// # Ok::<(), armlet_core::error::Error>(())
        /// ```
        #[derive(Clone, Debug, PartialEq)]
        pub enum PlantSpec {
            $($(#[$doc])* $kind($definition),)*
        }

        $(impl From<$definition> for PlantSpec {
            fn from(plant: $definition) -> Self {
                PlantSpec::$kind(plant)
            }
        })*

        impl PlantKind {
            /// Name of the class in Python.
            pub fn name(self) -> &'static str {
                match self {
                    $(PlantKind::$kind => $name,)*
                }
            }

            /// Names of the parts of the state, `n` numbers each.
            pub fn parts(self) -> &'static [&'static str] {
                match self {
                    $(PlantKind::$kind => &[$($part),*],)*
                }
            }
        }

        impl Deref for PlantSpec {
            type Target = dyn Definition;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(PlantSpec::$kind(plant) => plant,)*
                }
            }
        }

        impl PlantSpec {
            /// The kind of the plant.
            pub fn kind(&self) -> PlantKind {
                match self {
                    $(PlantSpec::$kind(_) => PlantKind::$kind,)*
                }
            }

            /// The plant with its parameters and its equations.
            fn equations_of(&self) -> &dyn PlantEquations {
                match self {
                    $(PlantSpec::$kind(plant) => plant,)*
                }
            }
        }
    };
}

plants! {
    /// Rigid joints driven by torques.
    Rigid(RigidSpec) "RigidArm" ["q" "v"],
    /// Elastic joints driven by motors.
    Elastic(ElasticSpec) "ElasticArm" ["q" "v" "theta" "theta_dot"],
    /// Joints that follow a velocity exactly.
    Velocity(VelocitySpec) "VelocityArm" ["q"],
}

impl PlantKind {
    /// Length of the state of a plant with `n` joints, without bristles.
    pub fn states(self, n: usize) -> usize {
        self.parts().len() * n
    }

    /// Whether velocities are among the states.
    pub fn has_speeds(self) -> bool {
        self.parts().contains(&"v")
    }

    /// Whether positions and velocities of motors are among the states.
    pub fn has_motors(self) -> bool {
        self.parts().contains(&"theta")
    }
}

impl PlantSpec {
    /// The numbers that differ between runs.
    pub fn parameters(&self) -> Parameters {
        self.equations_of().parameters()
    }

    /// Number of joints without mimic joints, which is also the number of inputs.
    pub fn n(&self) -> usize {
        self.model().n()
    }

    /// Length of the state `x`.
    pub fn states(&self) -> usize {
        self.seen() + self.bristles()
    }

    /// Length of the part of the state that a law reads: all except the bristles.
    pub fn seen(&self) -> usize {
        self.kind().states(self.n())
    }

    /// Number of bristles of friction in the state.
    pub fn bristles(&self) -> usize {
        self.friction().and_then(JointFriction::bristles).map_or(0, |_| self.n())
    }

    /// Whether the loops of both plants have the same operations, and differ only in their numbers.
    pub fn same_shape(&self, other: &PlantSpec) -> bool {
        self.kind() == other.kind()
            && self.model().same_geometry(other.model())
            && self.wall().map(|wall| wall.frame) == other.wall().map(|wall| wall.frame)
            && self.stops().into_iter().flat_map(Stops::all).eq(other.stops().into_iter().flat_map(Stops::all))
            && self.has_friction() == other.has_friction()
            && self.friction().map(std::mem::discriminant) == other.friction().map(std::mem::discriminant)
    }

    /// The elastic plant; `None` for other plants.
    pub fn elastic(&self) -> Option<&ElasticSpec> {
        if let PlantSpec::Elastic(plant) = self { Some(plant) } else { None }
    }

    /// Whether the plant has Coulomb friction whose torque jumps where a velocity changes its sign.
    pub fn jumps(&self) -> bool {
        matches!(self, PlantSpec::Rigid(plant) if plant.jumps())
    }

    /// Return this plant with the friction of its model as stick-slip friction. Errors: see [`RigidSpec::with_sticking_friction`].
    pub fn sticking(&self) -> Result<Self> {
        match self {
            PlantSpec::Rigid(plant) if plant.friction && !plant.sticks => Ok(plant.clone().with_sticking_friction()?.into()),
            other => Ok(other.clone()),
        }
    }

    /// Whether joints or motors have stick-slip friction.
    pub fn sticks(&self) -> bool {
        self.friction().is_some_and(|friction| friction.stick_slip().is_some())
    }

    /// Return the stick-slip friction, and the index of the first speed on which it acts; `None` for another friction.
    pub(crate) fn sticking_friction(&self) -> Option<(LoopStickSlip<f64>, usize)> {
        let friction = rigid::loop_stick_slip(self.friction(), !self.kind().has_motors())?;
        Some((friction, self.first_sliding_speed()))
    }

    /// The index in the state of the first speed on which stick-slip friction would act.
    pub(crate) fn first_sliding_speed(&self) -> usize {
        if self.kind().has_motors() { 3 * self.n() } else { self.n() }
    }

    /// The number of joints or motors with stick-slip friction.
    pub fn sticking_joints(&self) -> usize {
        if self.sticks() { self.n() } else { 0 }
    }

    /// The number of contacts: the wall, and the stops of the joints.
    pub fn contacts(&self) -> usize {
        usize::from(self.wall().is_some()) + self.stops().map_or(0, |stops| stops.all().count())
    }

    /// Whether the plant has neither a wall nor stops.
    pub fn is_free(&self) -> bool {
        self.wall().is_none() && self.stops().is_none()
    }
}
