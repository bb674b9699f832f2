//! The error that clamped singular values cause near a singularity, in a law with a null space or with compensated coupling:
//! see [`crate::law::ProjectionLoss`].

use super::{Moment, Monitor, MonitorKind, Scope};
use crate::scalar::Real;
use crate::trace::Sym;

/// The loss as a monitor. In a batch it is zero for a law without a projector and without compensated coupling.
pub struct Loss;

impl MonitorKind for Loss {
    const NAMES: &'static [&'static str] = &["loss"];

    fn applies(scope: &Scope) -> bool {
        scope.monitored.loss
    }

    fn build(_: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(Loss))
    }
}

impl Monitor for Loss {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
        out[0] = at.loss.unwrap_or_else(Sym::zero);
    }
}
