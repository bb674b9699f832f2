//! The law of a loop. It is recorded with the loop. A law that the caller supplies is called as native code at its samples, and its loop is
//! recorded with a held input.

use super::sampler::Sampler;
use crate::scalar::Real;
use crate::simulate::adaptive::rates_loop::RatesLoop;
use crate::simulate::world::Exogenous;

impl RatesLoop<'_> {
    /// Evaluate the law at state `x`.
    fn evaluate_law(&mut self, u: &Exogenous<f64>, x: &[f64]) {
        let (mut tau, mut dz) = (std::mem::take(&mut self.tau), std::mem::take(&mut self.dz));
        let Some((law, seen)) = &self.law else {
            self.compute(|rates, _| rates.law(u, x, &mut tau, &mut dz));
            (self.tau, self.dz) = (tau, dz);
            return;
        };
        law.evaluate(u.t, &x[..*seen], &mut tau);
        dz.fill(0.0);
        (self.tau, self.dz) = (tau, dz);
        self.saturate();
    }

    /// Evaluate the law at time `t` and state `x`.
    pub(in crate::simulate) fn observe(&mut self, t: f64, x: &[f64]) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [0.0; 6] });
        self.world.sample(t, &mut now);
        self.evaluate_law(&now, x);
        self.now = now;
    }

    pub(in crate::simulate) fn saturate(&mut self) {
        for (tau, &limit) in self.tau.iter_mut().zip(&self.limits) {
            *tau = Real::clamped(*tau, -limit, limit);
        }
    }

    /// Let `sampler` take a sample at time `t` and state `x`, if one is due. Use the output that acts at `t`.
    pub(in crate::simulate) fn sample_by(&mut self, sampler: &mut Sampler<f64>, t: f64, x: &[f64]) {
        let states = self.states[0];
        let (mut tau, mut dz) = std::mem::take(&mut self.acting);
        let mut measured = std::mem::take(&mut self.measured);
        measured.copy_from_slice(x);
        let law = |seen: &[f64], tau: &mut [f64], dz: &mut [f64]| {
            measured[..states].copy_from_slice(seen);
            self.observe(t, &measured);
            tau.copy_from_slice(&self.tau);
            dz.copy_from_slice(&self.dz);
        };
        sampler.run(t, &x[..states], tau.len(), law, &mut tau, &mut dz);
        self.measured = measured;
        self.tau.copy_from_slice(&tau);
        self.dz.copy_from_slice(&dz);
        self.acting = (tau, dz);
    }
}
