//! The recorded closed loop of any plant with any law, `x_dot = f(u, x)` with the exogenous input `u` and the state `x = [plant, law,
//! integrals]`.
//! One evaluation of `f` calls the plant once, and the law once unless its output is held. The integrals are those of the monitors.

use super::monitors::{self, Flow};
use super::world::Exogenous;
use crate::law::{Law, Truth};
use crate::linalg::Pairs;
use crate::plant::{Mode, Plant};
use crate::scalar::Real;
use crate::trace::Sym;

/// Options of a loop.
pub struct Closing {
    /// Whether the law is evaluated at samples and its output held. If false, it is evaluated in every stage.
    pub held: bool,
    pub monitored: bool,
    /// Whether the monitored energy is the law's storage function.
    pub storage: bool,
}

impl Closing {
    /// Whether the integral of the law's dissipation is monitored. The dissipation is the rate at which the law's Lyapunov function
    /// decreases.
    pub fn watches_dissipation(&self) -> bool {
        self.monitored && !self.storage
    }
}

pub struct ClosedLoop {
    plant: Box<dyn Plant + Send>,
    law: Box<dyn Law + Send>,
    closing: Closing,
    /// The saturation limits of the input. Empty if there is no saturation.
    limits: Vec<Sym>,
    /// The size of the plant's state.
    states: usize,
    /// The size of the part of the plant's state that the law reads.
    seen: usize,
    /// The size of the desired motions at one instant.
    pub desired: usize,
    /// For each joint, whether its position is an angle.
    angles: Vec<bool>,
    trig: Vec<(Sym, Sym)>,
    /// The plant's input: the saturated output of the law at its last evaluation, or the held input.
    pub tau: Vec<Sym>,
    /// The other results of the law that belong to `tau`: the rate of its state, then its dissipation if that is monitored.
    dz: Vec<Sym>,
    /// The size of the law's state.
    p: usize,
    /// The true parameters of the plants, for the dissipation in the Lyapunov balance. `None` if the law alone determines it.
    truth: Option<Truth>,
}

impl ClosedLoop {
    pub fn new(
        plant: Box<dyn Plant + Send>,
        law: Box<dyn Law + Send>,
        tau_max: Option<&[f64]>,
        closing: Closing,
        (states, seen, p, desired, angles): (usize, usize, usize, usize, Vec<bool>),
    ) -> Self {
        let n = angles.len();
        let answer = p + usize::from(closing.watches_dissipation());
        let limits = Sym::labelled("tau_max", 1, || tau_max.into_iter().flatten().map(|&limit| Sym::varying(limit)).collect());
        ClosedLoop {
            plant,
            law,
            closing,
            limits,
            states,
            seen,
            desired,
            angles,
            trig: vec![(Sym::zero(), Sym::splat(1.0)); n],
            tau: vec![Sym::zero(); n],
            dz: vec![Sym::zero(); answer],
            p,
            truth: None,
        }
    }

    /// Return the loop with a dissipation that is computed with the true parameters `truth` of the plants.
    pub fn judged_by(self, truth: Option<Truth>) -> Self {
        ClosedLoop { truth, ..self }
    }

    /// Return the loop after passing the sample period and the limits of the input to the law.
    pub fn sampled_every(mut self, period: Option<f64>) -> Self {
        self.law.configure(period, &self.limits);
        self
    }

    /// The size of the integrated state: the states of plant and law, and the integrals of the monitors.
    pub fn size(&self) -> usize {
        self.states + self.p + monitors::integrals(self.closing.monitored).count()
    }

    /// Whether the input is held.
    pub fn is_held(&self) -> bool {
        self.closing.held
    }

    /// The pairs of positions and rates in the state.
    pub fn pairs(&self) -> Pairs {
        // The plant's state is [q, v], [q, v, theta, theta_dot], or [q] without rates. The bristle deflections, the states of the law and
        // the integrals of the monitors follow.
        let n = self.tau.len();
        Pairs { joints: n, count: self.states / (2 * n), quadratures: self.size() - self.states - self.p }
    }

    /// Evaluate the law at the plant state `measured` and the law's state `z`, and apply the saturation.
    fn control(&mut self, desired: &[Sym], measured: &[Sym], z: &[Sym]) {
        let measured = &measured[..self.seen];
        let (rate, dissipated) = self.dz.split_at_mut(self.p);
        self.law.evaluate(desired, &self.trig, measured, z, &mut self.tau, rate);
        if let [dissipated] = dissipated {
            *dissipated = match &self.truth {
                None => self.law.dissipation(),
                Some(truth) => self.law.dissipation_of(truth, None, measured, z),
            };
        }
        self.saturate();
    }

    fn saturate(&mut self) {
        for (tau, &limit) in self.tau.iter_mut().zip(&self.limits) {
            *tau = tau.clamped(-limit, limit);
        }
    }

    /// Hold results of the law from this call on: the input `tau` and the other results `dz` ([`ClosedLoop::law_rate`]).
    pub fn hold_input(&mut self, tau: &[Sym], dz: &[Sym]) {
        self.closing.held = true;
        self.tau.copy_from_slice(tau);
        self.dz.copy_from_slice(dz);
    }

    /// The rate of the law's state that belongs to `tau`, followed by the law's dissipation if that is monitored.
    pub fn law_rate(&self) -> &[Sym] {
        &self.dz
    }

    /// Compute the sines and cosines of the joint angles at state `x`.
    pub fn turn_to(&mut self, x: &[Sym]) {
        for (i, trig) in self.trig.iter_mut().enumerate() {
            if self.angles[i] {
                *trig = x[i].sin_cos();
            }
        }
    }

    /// Compute the law's results at state `x`: the plant's input and the rate of the law's state. Requires [`ClosedLoop::turn_to`].
    pub fn answer(&mut self, u: &Exogenous<Sym>, x: &[Sym]) {
        let (measured, z) = x.split_at(self.states);
        self.control(&u.desired, measured, &z[..self.p]);
    }

    /// Compute the rates `dx` of state `x` under the exogenous input `u`.
    pub fn rhs(&mut self, u: &Exogenous<Sym>, x: &[Sym], dx: &mut [Sym]) {
        self.turn_to(x);
        self.rates(u, x, dx);
    }

    /// Compute the rates `dx` of state `x`. Requires [`ClosedLoop::turn_to`] at this state.
    pub fn rates(&mut self, u: &Exogenous<Sym>, x: &[Sym], dx: &mut [Sym]) {
        if !self.closing.held {
            self.answer(u, x);
        }
        let states = self.states;
        let power = self.plant.rates(&self.trig, &x[..states], &self.tau, &u.wrench, &mut dx[..states]);
        let p = self.p;
        // The torque of stick-slip friction is known only now.
        if let (Some(truth), false, Some((friction, _)), Some(dissipated)) =
            (&self.truth, self.closing.held, self.plant.stick_slip(), self.dz.get_mut(p))
        {
            *dissipated = self.law.dissipation_of(truth, Some(friction.torque()), &x[..self.seen], &x[states..states + p]);
        }
        dx[states..states + p].copy_from_slice(&self.dz[..p]);
        if self.closing.monitored {
            let stored = self.closing.storage.then(|| self.law.storage_rate(&x[..self.seen], power.outside));
            let dissipated = self.dz.get(p).copied().unwrap_or_else(Sym::zero);
            monitors::rates(&Flow { power, dissipated, stored }, &mut dx[states + p..]);
        }
    }

    /// Hold all contacts of the plant in the modes that the numbers `modes` describe, two for each contact ([`Touch::numbers`]).
    pub fn hold_modes(&mut self, modes: &[Sym]) {
        self.plant.hold(&mut modes.as_chunks().0.iter().map(|&numbers| Mode::of(numbers)));
    }

    /// Return the depth `d`, m or rad, and the push `k d + c d_dot`, N or N m, of contact `i` of the plant at state `x`. `k` is the
    /// stiffness of the contact, and `c` its damping. Requires [`ClosedLoop::turn_to`] at this state.
    pub fn contact(&mut self, i: usize, x: &[Sym]) -> [Sym; 2] {
        self.plant.contact(i, &self.trig, &x[..self.states])
    }

    /// Compute the loads of the plant under the exogenous input `u` at state `x`, and write them to its friction model.
    pub fn load_friction(&mut self, u: &Exogenous<Sym>, x: &[Sym]) {
        self.turn_to(x);
        if !self.closing.held {
            self.answer(u, x);
        }
        self.plant.load_friction(&self.trig, &x[..self.states], &self.tau, &u.wrench);
    }

    /// The plant of the loop.
    pub fn plant_mut(&mut self) -> &mut dyn Plant {
        self.plant.as_mut()
    }
}
