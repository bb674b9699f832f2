//! The closed loop as a system for the integration methods, on plain numbers and on dual numbers.

use super::ClosedLoop;
use crate::integrate::{DualSystem, System};
use crate::linalg::Pairs;
use crate::scalar::{Dual, Real};
use crate::simulate::world::Exogenous;

impl<S: Real> System<S> for ClosedLoop<'_, S> {
    type Input = Exogenous<S>;

    fn input(&mut self, t: f64, u: &mut Exogenous<S>) {
        self.world.sample(t, u);
    }

    fn sample(&mut self, t: f64, x: &[S]) {
        if let Some(sampler) = self.sampler.take() {
            self.sampler = Some(self.sample_by(sampler, t, x));
        } else if self.closing.held {
            self.observe(t, x);
        }
    }

    fn enter_step(&mut self, t: f64, x: &[S]) -> bool {
        self.settle(t, x, None)
    }
    fn leave_step(&mut self, x: &mut [S]) -> bool {
        self.arrest(x)
    }
    fn still(&mut self, x: &mut [S]) {
        ClosedLoop::still(self, x);
    }
    fn sides(&mut self) -> &[i8] {
        ClosedLoop::sides(self)
    }
    fn held(&self) -> Option<(&[S], &[S])> {
        self.closing.held.then_some((&self.tau, &self.dz))
    }
    fn pairs(&self) -> Pairs {
        // The plant's state is [q, v], [q, v, theta, theta_dot], or [q] without rates. The bristle deflections, the states of the law and
        // the integrals of the monitors follow.
        let n = self.tau.len();
        Pairs { joints: n, count: self.states / (2 * n), quadratures: self.size() - self.controlled() }
    }

    fn rhs(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
        self.turn_to(x);
        self.rates(u, x, dx);
    }
}

impl DualSystem<f64> for ClosedLoop<'_, Dual> {
    fn moving_input(&mut self, t: f64, u: &mut Exogenous<Dual>) {
        let mut moving = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [Dual::default(); 6] });
        self.drift(t, u, &mut moving);
        for (u, rate) in u.desired.iter_mut().zip(&moving.desired).chain(u.wrench.iter_mut().zip(&moving.wrench)) {
            u.rate = rate.value;
        }
        self.now = moving;
    }

    fn hold(&mut self, input: &[f64], rate: &[f64]) {
        for (to, &from) in self.tau.iter_mut().zip(input).chain(self.dz.iter_mut().zip(rate)) {
            *to = Dual::splat(from);
        }
    }

    fn follow(&mut self, sides: &[i8]) {
        ClosedLoop::follow(self, sides);
    }

    fn autonomous(&self) -> bool {
        ClosedLoop::autonomous(self)
    }

    fn leading(&self, _: usize) -> usize {
        self.controlled()
    }
}
