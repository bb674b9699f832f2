//! The error of an inner torque loop: the largest `|tau_J - u|` over the joints, N m or N. `tau_J` is the torque of the springs, and `u` is
//! the torque that the outer loop commands.

use super::{Moment, Monitor, MonitorKind, Scope};
use crate::plant::Parameters;
use crate::scalar::Real;
use crate::trace::E;
use crate::trace::expression::magnitudes;

/// The error of the inner torque loop.
pub struct InnerLoop {
    plant: Parameters,
}

impl MonitorKind for InnerLoop {
    const NAMES: &'static [&'static str] = &["torque_error"];

    fn applies(scope: &Scope) -> bool {
        scope.law().reduction().is_some() && scope.law().outer().is_some()
    }

    fn build<'a>(scope: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        let stiffness = &scope.plant().elastic()?.stiffness;
        Some(Box::new(InnerLoop { plant: Parameters::default().matrix("joint_stiffness", stiffness.n(), &stiffness.matrix()) }))
    }
}

impl Monitor for InnerLoop {
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        let x = &at.at.plant;
        let tau_j = self.plant.get_matrix("joint_stiffness") * (&x.theta - &x.q);
        let errors = magnitudes(&(tau_j - at.term("u")));
        // `max` would ignore an error that is NaN.
        out[0] = errors.iter().fold(E::zero(), |worst, &error| E::select(error.lt(worst), worst, error));
    }
}
