//! An arm whose joint velocities are the input: `q' = u`.

use super::{Build, Definition, Plant, Power};
use crate::dynamics::Model;
use crate::scalar::Real;

/// A velocity-controlled arm, with validated parameters.
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

impl Build for VelocitySpec {
    type Lanes<S: Real> = Velocity;

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self, _: Option<usize>) -> Velocity {
        Velocity { n: of(0).model.n() }
    }
}

/// A velocity-controlled arm in a control loop.
pub struct Velocity {
    /// Number of joints.
    pub n: usize,
}

impl<S: Real> Plant<S> for Velocity {
    fn rates(&mut self, _: &[(S, S)], _: &[S], u: &[S], _: &[S], dx: &mut [S]) -> Power<S> {
        dx[..self.n].copy_from_slice(&u[..self.n]);
        Power { input: S::zero(), outside: S::zero() }
    }
}
