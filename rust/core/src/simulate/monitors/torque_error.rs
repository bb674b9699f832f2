//! The error of an inner torque loop: the largest `|tau_J - u|` over the joints, N m or N. `tau_J` is the torque of the springs, and `u` is
//! the torque that the outer loop commands.

use super::{Moment, Monitor, MonitorKind, Scope};
use crate::law::Law;
use crate::scalar::Real;
use crate::trace::Sym;

pub struct TorqueError {
    law: Box<dyn Law + Send>,
    /// The stiffness of the springs, shape `(n, n)`.
    stiffness: Vec<Sym>,
    u: Vec<Sym>,
    /// The rate of the law's state.
    rate: Vec<Sym>,
}

impl TorqueError {
    /// Create the monitor for an elastic plant and a law with an inner loop. The motions of this law are the motions of its outer loop.
    fn new(scope: &Scope) -> Option<Self> {
        let (outer, stiffness) = (scope.law().outer()?, &scope.plant().elastic()?.stiffness);
        let n = scope.plant().n();
        Some(TorqueError {
            law: outer.build(),
            stiffness: (0..n * n).map(|k| Sym::varying(stiffness.at(k / n, k % n))).collect(),
            u: vec![Sym::zero(); n],
            rate: vec![Sym::zero(); outer.initial_state().len()],
        })
    }
}

/// The error of the inner loop as a monitor.
pub struct InnerLoop;

impl MonitorKind for InnerLoop {
    const NAMES: &'static [&'static str] = &["torque_error"];

    fn applies(scope: &Scope) -> bool {
        scope.law().reduction().is_some() && scope.law().outer().is_some()
    }

    fn build(scope: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(TorqueError::new(scope)?))
    }
}

impl Monitor for TorqueError {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
        let (trig, x) = (at.arm.trig(), at.x);
        let n = trig.len();
        self.law.evaluate(at.desired, trig, &x[..2 * n], at.z, &mut self.u, &mut self.rate);
        let mut worst = Sym::zero();
        for i in 0..n {
            let mut spring = Sym::zero();
            for j in 0..n {
                spring += self.stiffness[n * i + j] * (x[2 * n + j] - x[j]);
            }
            let error = (spring - self.u[i]).abs();
            // `max` would ignore an error that is NaN.
            worst = Sym::select(error.lt(worst), worst, error);
        }
        out[0] = worst;
    }
}
