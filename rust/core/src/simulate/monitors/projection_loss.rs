//! The error that clamped singular values cause near a singularity, in a law with a null space or with compensated coupling:
//! see [`crate::law::ProjectionLoss`].

use super::{Moment, Monitor, MonitorKind, Scope};
use crate::scalar::Real;

/// The loss as a monitor. In a batch it is zero for a law without a projector and without compensated coupling.
pub struct Loss;

impl MonitorKind for Loss {
    const NAMES: &'static [&'static str] = &["loss"];

    fn applies(scope: &Scope) -> bool {
        scope.monitored.loss
    }

    fn build<S: Real>(_: &Scope) -> Option<Box<dyn Monitor<S> + Send>> {
        Some(Box::new(Loss))
    }
}

impl<S: Real> Monitor<S> for Loss {
    fn evaluate(&mut self, at: &mut Moment<S>, out: &mut [S]) {
        out[0] = at.loss.unwrap_or_else(S::zero);
    }
}
