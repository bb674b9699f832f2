//! The projection loss of an impedance law ([`super::NullSpaceSpec`]): the error of `L = (J W^-1 J')^-1` near singularities, because small
//! singular values are clamped.
//!
//! `loss = 1 - min(1, (sigma / eps)^2)`, where `sigma` is the smallest singular value of `S J W^-1/2`, with the row scales `S`. For a law
//! with two metrics `W`, the loss is the larger of two values. The loss is zero where `L` is exact, and one at a singularity.

use super::null_space::{NullProjection, NullSpaceProjector};
use super::{CartesianImpedanceSpec, LawSpec};
use crate::dynamics::ArmAt;
use crate::kinematics::Coordinates;
use crate::linalg::cholesky;
use crate::scalar::Real;
use crate::trace::Sym;

/// The projection loss of one law at the records of a run.
pub struct ProjectionLoss {
    coordinates: Coordinates,
    /// The arm of the law's model.
    arm: ArmAt<Sym>,
    floor: Sym,
    consistent: Option<NullSpaceProjector>,
    fixed: Option<NullSpaceProjector>,
    /// The mass matrix `M`, `(n, n)`.
    mass: Vec<Sym>,
    /// The Cholesky factor of the mass matrix `M`, `(n, n)`.
    factor: Vec<Sym>,
    /// Target and error of the rows, `(m,)`, and their Jacobian, `(m, n)`.
    target: Vec<Sym>,
    error: Vec<Sym>,
    jacobian: Vec<Sym>,
}

/// The Cartesian impedance law that `law` is or contains.
fn impedance(law: &LawSpec) -> Option<&CartesianImpedanceSpec> {
    law.impedance().or(law.storage().map(|law| &law.outer))
}

impl LawSpec {
    /// Whether the law has a null-space projector or a compensated coupling, whose inverse is clamped.
    pub fn has_projection_loss(&self) -> bool {
        impedance(self).is_some_and(|law| law.options().null_space.is_some() || law.options().compensate_coupling)
    }
}

impl ProjectionLoss {
    /// The projection loss of a law; `None` if `has_projection_loss` is false.
    pub fn new(law: &LawSpec) -> Option<Self> {
        let law = impedance(law).filter(|_| law.has_projection_loss())?;
        let (n, m) = (law.model.n(), law.coordinates.m());
        let options = law.options();
        let projection = options.null_space.as_ref().map(|null_space| null_space.projection);
        let consistent = projection == Some(NullProjection::Consistent) || options.compensate_coupling;
        let zeros = |k: usize| vec![Sym::zero(); k];
        Some(ProjectionLoss {
            coordinates: law.coordinates.clone(),
            arm: ArmAt::new(&law.model),
            floor: Sym::labelled("null_eps_squared", 0, || Sym::varying(options.eps * options.eps)),
            consistent: consistent.then(|| NullSpaceProjector::new(m, n)),
            fixed: (projection == Some(NullProjection::Static)).then(|| NullSpaceProjector::new(m, n)),
            mass: zeros(n * n),
            factor: zeros(n * n),
            target: zeros(m),
            error: zeros(m),
            jacobian: zeros(m * n),
        })
    }

    /// Compute the loss at the joint positions `q`, `(n,)`.
    pub fn evaluate(&mut self, q: &[Sym]) -> Sym {
        let n = q.len();
        let ProjectionLoss { coordinates, arm, floor, consistent, fixed, mass, factor, target, error, jacobian } = self;
        arm.move_to(q);
        arm.error_and_jacobian(coordinates, target, error, jacobian);
        let mut loss = Sym::zero();
        if let Some(projector) = consistent {
            arm.mass_matrix(mass);
            cholesky::factor_into(n, mass, factor);
            projector.spread.copy_from_slice(jacobian);
            projector.spread.chunks_exact_mut(n).for_each(|row| cholesky::solve_lower(n, factor, row));
            projector.prepare(&coordinates.rows, *floor);
            loss = projector.loss;
        }
        if let Some(projector) = fixed {
            projector.spread.copy_from_slice(jacobian);
            projector.prepare(&coordinates.rows, *floor);
            loss = loss.max(projector.loss);
        }
        loss
    }
}
