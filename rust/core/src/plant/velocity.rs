//! An arm whose joint velocities are the input: `q' = u`.

use super::{Plant, Power};
use crate::dynamics::Model;
use crate::scalar::Real;

/// A velocity-controlled arm, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocitySpec {
    /// The arm.
    pub model: Model,
}

/// The plant in a loop.
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
