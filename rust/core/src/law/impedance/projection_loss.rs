//! The projection loss of an impedance law ([`super::NullSpaceSpec`]): the error of `L = (J W^-1 J')^-1` near singularities, because small
//! singular values are clamped.
//!
//! `loss = 1 - min(1, (sigma / eps)^2)`, where `sigma` is the smallest singular value of `S J W^-1/2`, with the row scales `S`. For a law
//! with two metrics `W`, the loss is the larger of two values. The loss is zero where `L` is exact, and one at a singularity.

use super::CartesianImpedanceSpec;
use super::null_space::{NullProjection, TaskInertia};
use crate::linalg::Cholesky;
use crate::plant::Parameters;
use crate::scalar::Real;
use crate::trace::expression::zeros;
use crate::trace::{E, V};

/// The projection loss of one law at the records of a run.
pub struct ProjectionLoss<'a> {
    law: &'a CartesianImpedanceSpec,
    numbers: Parameters,
}

impl<'a> ProjectionLoss<'a> {
    /// The projection loss of `law`.
    pub fn new(law: &'a CartesianImpedanceSpec) -> Self {
        let eps = law.options().eps;
        ProjectionLoss { law, numbers: Parameters::of_arm(&law.model).number("null_eps_squared", eps * eps) }
    }

    /// The loss at the joint positions `q`.
    pub fn evaluate(&self, q: &V) -> E {
        let (coordinates, options) = (&self.law.coordinates, self.law.options());
        let (rows, floor) = (&coordinates.rows, self.numbers.get_number("null_eps_squared"));
        let Some(arm) = self.numbers.arm_at(q) else { return E::zero() };
        let (_, j) = arm.error_and_jacobian(coordinates, &zeros(coordinates.m()));
        let projection = options.null_space.as_ref().map(|null_space| null_space.projection);
        let mut loss = E::zero();
        if projection == Some(NullProjection::Consistent) || options.compensate_coupling {
            loss = TaskInertia::consistent(&Cholesky::of(&arm.mass_matrix()), &j, rows, floor).loss;
        }
        if projection == Some(NullProjection::Static) {
            loss = loss.max(TaskInertia::new(j, rows, floor).loss);
        }
        loss
    }
}
