//! The functions of a plant that the core calls. Most of them have a default that suits most plants.

use super::{ElasticSpec, JointFriction, Plant, Stops, Wall};
use crate::dynamics::Model;
use crate::scalar::Real;

/// A plant as the user states it, validated.
pub trait Definition {
    /// The arm.
    fn model(&self) -> &Model;

    /// The initial state. With `theta0 = None` the springs carry gravity, with `theta_dot0 = None` the motors move with the links.
    fn initial_state(&self, q0: &[f64], v0: &[f64], _theta0: Option<&[f64]>, _theta_dot0: Option<&[f64]>) -> Vec<f64> {
        [q0, v0].concat()
    }

    /// The wall that a frame may touch.
    fn wall(&self) -> Option<&Wall> {
        None
    }

    /// The joint stops.
    fn stops(&self) -> Option<&Stops> {
        None
    }

    /// Whether the friction of a rigid arm's joints acts.
    fn has_friction(&self) -> bool {
        false
    }

    /// The dry friction of its joints, or of its motors.
    fn friction(&self) -> Option<&JointFriction> {
        None
    }

    /// The plant itself, if its joints are elastic.
    fn elastic(&self) -> Option<&ElasticSpec> {
        None
    }
}

/// A plant that can be built into loops, for any number type.
pub trait Build: Definition {
    /// The plant in a loop, on the number `S`.
    type Lanes<S: Real>: Plant<S> + Send + 'static;

    /// The plants of the lanes as one, with the wrench acting at `force_frame`; all have the same shape.
    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self, force_frame: Option<usize>) -> Self::Lanes<S>
    where
        Self: 'a;
}

/// The functions of a definition with the fields `model`, `wall`, `stops` and `dry`.
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
