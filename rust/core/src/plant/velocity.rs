//! An arm whose joint velocities are the input: `q' = u`, with the time derivative `q'`.

use super::equations::{PlantAt, PlantEquations, PlantRates, Power};
use super::{Definition, Parameters};
use crate::dynamics::Model;
use crate::scalar::Real;
use crate::trace::E;

/// A velocity-controlled arm, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::plant::{PlantSpec, VelocitySpec};
///
/// let spec = PlantSpec::from(VelocitySpec { model: Arm::pendulum(1.0, 5.0)?.into() });
/// let (dx, _) = spec.rates_at(&[0.3], &[2.0], &[0.0; 6], None);
/// assert_eq!(dx, [2.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct VelocitySpec {
    /// The model of the arm.
    pub model: Model,
}

impl Definition for VelocitySpec {
    fn model(&self) -> &Model {
        &self.model
    }

    fn initial_state(&self, q0: &[f64], _: &[f64], _: Option<&[f64]>, _: Option<&[f64]>) -> Vec<f64> {
        q0.to_vec()
    }
}

impl PlantEquations for VelocitySpec {
    fn parameters(&self) -> Parameters {
        Parameters::default()
    }

    fn equations(&self, at: &PlantAt) -> PlantRates {
        PlantRates { x_dot: at.tau.clone(), power: Power { input: E::zero(), outside: E::zero() }, friction: None }
    }
}
