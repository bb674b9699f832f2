//! The error that clamped singular values cause near a singularity, in a law with a null space or with compensated coupling:
//! see [`crate::law::ProjectionLoss`].

use super::{Moment, Monitor, MonitorKind, Scope};
use crate::scalar::Real;
use crate::trace::E;

/// The loss as a monitor. In a batch it is zero for a law without a projector and without compensated coupling.
pub struct Loss;

impl MonitorKind for Loss {
    const NAMES: &'static [&'static str] = &["loss"];

    fn applies(scope: &Scope) -> bool {
        scope.monitored.loss
    }

    fn build<'a>(_: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        Some(Box::new(Loss))
    }
}

impl Monitor for Loss {
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        out[0] = at.loss.unwrap_or_else(E::zero);
    }
}
