//! The declaration of a plant. Most functions have a default.

use super::contact::Wall;
use super::friction::JointFriction;
use super::stops::Stops;
use crate::dynamics::Model;

/// A plant with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::Gain;
/// use armlet_core::plant::{Definition, ElasticSpec};
///
/// let model = Model::from(Arm::pendulum(1.0, 5.0)?);
/// let plant = ElasticSpec::new(model, Gain::scalar("stiffness", 1, 100.0)?, Gain::scalar("inertia", 1, 0.1)?, None, None, None)?;
/// // In the state `[q, v, theta, theta_dot]`, the spring carries the gravity load at the start, and the motor moves with the link.
/// let x = plant.initial_state(&[0.3], &[2.0], None, None);
/// assert_eq!((x[0], x[1], x[3]), (0.3, 2.0, 2.0));
/// assert!((x[2] - (0.3 + 0.05 * 0.3f64.sin())).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Definition {
    /// The model of the arm.
    fn model(&self) -> &Model;

    /// Return the initial state `x`. `theta0` and `theta_dot0` are for elastic joints. If `theta0` is `None`, the springs carry the gravity
    /// load. If `theta_dot0` is `None`, the motors move with the links.
    fn initial_state(&self, q0: &[f64], v0: &[f64], _theta0: Option<&[f64]>, _theta_dot0: Option<&[f64]>) -> Vec<f64> {
        [q0, v0].concat()
    }

    /// The wall that a frame may touch; `None` without a wall.
    fn wall(&self) -> Option<&Wall> {
        None
    }

    /// The joint stops; `None` without stops.
    fn stops(&self) -> Option<&Stops> {
        None
    }

    /// Whether the plant is a rigid arm with the viscous and Coulomb friction of the model's joints.
    fn has_friction(&self) -> bool {
        false
    }

    /// The dry friction of the joints, or of the motors of an elastic arm; `None` without dry friction.
    fn friction(&self) -> Option<&JointFriction> {
        None
    }
}

/// Implement the functions of a plant with the fields `model`, `wall`, `stops` and `dry`.
macro_rules! fields {
    () => {
        fn model(&self) -> &Model {
            &self.model
        }

        fn wall(&self) -> Option<&Wall> {
            self.wall.as_ref()
        }

        fn stops(&self) -> Option<&Stops> {
            self.stops.as_ref()
        }

        fn friction(&self) -> Option<&JointFriction> {
            self.dry.as_ref()
        }
    };
}
pub(super) use fields;
