//! The law of a loop. It is recorded with the loop. A law that the caller supplies is called as native code at its samples, and its loop is
//! recorded with a held input.

use super::rates_loop::RatesLoop;
use crate::simulate::sampled::control::saturate;
use crate::simulate::world::Exogenous;

impl RatesLoop<'_> {
    /// Evaluate the law at state `x`.
    pub(in crate::simulate) fn evaluate_law(&mut self, u: &Exogenous<f64>, x: &[f64]) {
        let (mut tau, mut dz) = (std::mem::take(&mut self.control.tau), std::mem::take(&mut self.control.dz));
        let Some((law, seen)) = &self.law else {
            self.compute(|rates, _| rates.law(u, x, &mut tau, &mut dz));
            (self.control.tau, self.control.dz) = (tau, dz);
            return;
        };
        law.evaluate(u.t, &x[..*seen], &mut tau);
        dz.fill(0.0);
        (self.control.tau, self.control.dz) = (tau, dz);
        saturate(&mut self.control.tau, &self.limits);
    }
}
