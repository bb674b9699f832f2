//! The closed loop of any plant with any law, `x_dot = f(u, x)` with the exogenous input `u` and the state `x = [plant, law, integrals]`.
//! One evaluation of `f` calls the plant once, and the law once unless its output is held. The integrals are those of the monitors.

mod system;

use super::force::Wrench;
use super::monitors::{self, Flow};
use super::sampler::Sampler;
use super::world::{Exogenous, World};
use crate::law::{Law, Truth};
use crate::plant::{Mode, Plant, Touch};
use crate::scalar::Real;
use std::borrow::Cow;

/// Options of a loop.
pub struct Closing<'a> {
    /// The saturation of the input: the largest `|tau|` per joint, if there is one.
    pub tau_max: Option<Cow<'a, [f64]>>,
    /// Whether the law is evaluated at samples and its output held. If false, it is evaluated in every stage.
    pub held: bool,
    pub monitored: bool,
    /// Whether the monitored energy is the law's storage function.
    pub storage: bool,
}

impl Closing<'_> {
    /// Whether the integral of the law's dissipation is monitored. The dissipation is the rate at which the law's Lyapunov function
    /// decreases.
    pub fn watches_dissipation(&self) -> bool {
        self.monitored && !self.storage
    }
}

pub struct ClosedLoop<'a, S: Real> {
    plant: Box<dyn Plant<S> + Send>,
    law: Box<dyn Law<S> + Send>,
    world: World<'a>,
    closing: Closing<'a>,
    /// The saturation limits of the input. Empty if there is no saturation.
    limits: Vec<S>,
    /// The clock of a sampled controller, if it has one, see `assembly::sampler`.
    sampler: Option<Sampler<S>>,
    /// The size of the plant's state.
    states: usize,
    /// The size of the part of the plant's state that the law reads.
    seen: usize,
    /// For each joint, whether its position is an angle.
    angles: Vec<bool>,
    trig: Vec<(S, S)>,
    /// The plant's input: the saturated output of the law at its last evaluation, the output that the sampler selected, or the input of the
    /// caller.
    pub tau: Vec<S>,
    /// The other results of the law that belong to `tau`: the rate of its state, then its dissipation if that is monitored.
    dz: Vec<S>,
    /// The size of the law's state.
    p: usize,
    now: Exogenous<S>,
    /// Memory for the results of the law that the sampler selects: `tau` and `dz`.
    acting: (Vec<S>, Vec<S>),
    /// The true parameters of the plants, for the dissipation in the Lyapunov balance. `None` if the law alone determines it.
    truth: Option<Truth<S>>,
}

impl<'a, S: Real> ClosedLoop<'a, S> {
    pub fn new(
        plant: Box<dyn Plant<S> + Send>,
        law: Box<dyn Law<S> + Send>,
        world: World<'a>,
        closing: Closing<'a>,
        sampler: Option<Sampler<S>>,
        (states, seen, p, angles): (usize, usize, usize, Vec<bool>),
    ) -> Self {
        let n = angles.len();
        let trig = vec![(S::zero(), S::splat(1.0)); n];
        let now = world.instant();
        let answer = p + usize::from(closing.watches_dissipation());
        let limits = closing.tau_max.iter().flat_map(|limit| limit.iter());
        let limits = S::labelled("tau_max", 1, || limits.map(|&limit| S::varying(limit)).collect());
        ClosedLoop {
            plant,
            law,
            world,
            closing,
            limits,
            sampler,
            states,
            seen,
            angles,
            trig,
            tau: vec![S::zero(); n],
            dz: vec![S::zero(); answer],
            p,
            now,
            acting: (vec![S::zero(); n], vec![S::zero(); answer]),
            truth: None,
        }
    }

    /// Return the loop with a dissipation that is computed with the true parameters `truth` of the plants.
    pub fn judged_by(self, truth: Option<Truth<S>>) -> Self {
        ClosedLoop { truth, ..self }
    }

    /// Return the loop after passing the sample period and the limits of the input to the law.
    pub fn sampled_every(mut self, period: Option<f64>) -> Self {
        self.law.configure(period, &self.limits);
        self
    }

    /// Return the loop with owned copies of its motions, forces and limits.
    pub fn into_owned(self) -> ClosedLoop<'static, S> {
        let Closing { tau_max, held, monitored, storage } = self.closing;
        ClosedLoop {
            plant: self.plant,
            law: self.law,
            world: self.world.into_owned(),
            closing: Closing { tau_max: tau_max.map(|limit| Cow::Owned(limit.into_owned())), held, monitored, storage },
            limits: self.limits,
            sampler: self.sampler,
            states: self.states,
            seen: self.seen,
            angles: self.angles,
            trig: self.trig,
            tau: self.tau,
            dz: self.dz,
            p: self.p,
            now: self.now,
            acting: self.acting,
            truth: self.truth,
        }
    }

    /// The size of the integrated state: the states of plant and law, and the integrals of the monitors.
    pub fn size(&self) -> usize {
        self.states + self.p + monitors::integrals(self.closing.monitored).count()
    }

    /// The number of leading components whose error is controlled.
    pub fn controlled(&self) -> usize {
        self.states + self.p
    }

    /// The times at which the sampler takes samples and at which their outputs act, s; empty without a sampler.
    pub fn instants(&self, t_end: f64) -> Vec<f64> {
        self.sampler.as_ref().map_or(Vec::new(), |sampler| sampler.instants(t_end))
    }

    /// Return memory for the exogenous input at one instant.
    pub fn instant(&self) -> Exogenous<S> {
        self.world.instant()
    }

    /// Evaluate the law at the plant state `measured` and the law's state `z`, and apply the saturation.
    fn control(&mut self, desired: &[S], measured: &[S], z: &[S]) {
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

    /// Use `tau` as the plant's input from this call on, and keep the law's state constant. `None`: the law computes the input, and `held`
    /// selects whether it is held.
    pub fn take_over(&mut self, tau: Option<&[S]>, held: bool) {
        self.closing.held = held || tau.is_some();
        if let Some(tau) = tau {
            self.tau.copy_from_slice(tau);
            self.saturate();
            self.dz.fill(S::zero());
        }
    }

    /// Hold results of the law from this call on: the input `tau` and the other results `dz` ([`ClosedLoop::law_rate`]).
    pub fn hold_input(&mut self, tau: &[S], dz: &[S]) {
        self.closing.held = true;
        self.tau.copy_from_slice(tau);
        self.dz.copy_from_slice(dz);
    }

    /// The rate of the law's state that belongs to `tau`, followed by the law's dissipation if that is monitored.
    pub fn law_rate(&self) -> &[S] {
        &self.dz
    }

    /// Compute the sines and cosines of the joint angles at state `x`.
    pub fn turn_to(&mut self, x: &[S]) {
        for (i, trig) in self.trig.iter_mut().enumerate() {
            if self.angles[i] {
                *trig = x[i].sin_cos();
            }
        }
    }

    /// Compute the law's results at state `x`: the plant's input and the rate of the law's state. Requires [`ClosedLoop::turn_to`].
    pub fn answer(&mut self, u: &Exogenous<S>, x: &[S]) {
        let (measured, z) = x.split_at(self.states);
        self.control(&u.desired, measured, &z[..self.p]);
    }

    /// Compute the rates `dx` of state `x`. Requires [`ClosedLoop::turn_to`] at this state.
    pub fn rates(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
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
            let dissipated = self.dz.get(p).copied().unwrap_or_else(S::zero);
            monitors::rates(&Flow { power, dissipated, stored }, &mut dx[states + p..]);
        }
    }

    /// Whether the state rates have no explicit dependence on time between the jumps of the exogenous input.
    pub fn autonomous(&self) -> bool {
        (self.closing.held || self.world.has_targets()) && !self.world.has_smooth_force()
    }

    /// Compute the exogenous input at time `t` and its time derivative.
    pub fn drift(&mut self, t: f64, u: &mut Exogenous<S>, u_dot: &mut Exogenous<S>) {
        self.world.drift(t, u, u_dot);
    }

    /// Hold all contacts of the plant in the modes `contacts`.
    pub fn hold_contacts(&mut self, contacts: &[Touch]) {
        self.plant.hold(&mut contacts.iter().map(|&touch| Mode::from(touch)));
    }

    /// Hold all contacts of the plant in the modes that the numbers `modes` describe, two for each contact ([`Touch::numbers`]).
    pub fn hold_modes(&mut self, modes: &[S]) {
        self.plant.hold(&mut modes.as_chunks().0.iter().map(|&numbers| Mode::of(numbers)));
    }

    /// Return the depth `d`, m or rad, and the push `k d + c d_dot`, N or N m, of contact `i` of the plant at state `x`. `k` is the
    /// stiffness of the contact, and `c` its damping. Requires [`ClosedLoop::turn_to`] at this state.
    pub fn contact(&mut self, i: usize, x: &[S]) -> [S; 2] {
        self.plant.contact(i, &self.trig, &x[..self.states])
    }

    /// Apply `wrench` instead of the forces of the problem. `None` restores the forces.
    pub fn push(&mut self, wrench: Option<&Wrench>) {
        self.world.push(wrench);
    }

    /// Forget all samples, for a restart at `t = 0`.
    pub fn rewind(&mut self) {
        if let Some(sampler) = &mut self.sampler {
            sampler.forget();
        }
    }

    /// Forget the sample at time `t`, s. With `failed`, forget it only if its output is not finite.
    pub fn forget_sample(&mut self, t: f64, failed: bool) {
        if let Some(sampler) = &mut self.sampler {
            sampler.forget_at(t, failed);
        }
    }

    /// Evaluate the law at time `t` and state `x`, and store its output in `tau`.
    pub fn observe(&mut self, t: f64, x: &[S]) {
        let (measured, z) = x.split_at(self.states);
        self.evaluate_law(t, measured, &z[..self.p]);
    }

    fn evaluate_law(&mut self, t: f64, measured: &[S], z: &[S]) {
        self.with_input_at(t, |closed, now| {
            closed.turn_to(measured);
            closed.control(&now.desired, measured, z);
        });
    }

    /// Call `compute` with the exogenous input at time `t`.
    pub fn with_input_at(&mut self, t: f64, compute: impl FnOnce(&mut Self, &Exogenous<S>)) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [S::zero(); 6] });
        self.world.sample(t, &mut now);
        self.law.at(t);
        compute(self, &now);
        self.now = now;
    }

    /// Let `sampler` take a sample at time `t` and state `x`, if one is due. Use the output that acts at `t`.
    #[inline(never)]
    fn sample_by(&mut self, mut sampler: Sampler<S>, t: f64, x: &[S]) -> Sampler<S> {
        let (plant, z) = x.split_at(self.states);
        let (n, p) = (self.tau.len(), self.p);
        let (mut tau, mut dz) = (std::mem::take(&mut self.acting.0), std::mem::take(&mut self.acting.1));
        let law = |measured: &[S], tau: &mut [S], dz: &mut [S]| {
            self.evaluate_law(t, measured, &z[..p]);
            tau.copy_from_slice(&self.tau);
            dz.copy_from_slice(&self.dz);
        };
        sampler.run(t, plant, n, law, &mut tau, &mut dz);
        self.tau.copy_from_slice(&tau);
        self.dz.copy_from_slice(&dz);
        self.acting = (tau, dz);
        sampler
    }

    /// Compute the loads of the plant under the exogenous input `u` at state `x`, and write them to its friction model.
    pub fn load_friction(&mut self, u: &Exogenous<S>, x: &[S]) {
        self.turn_to(x);
        if !self.closing.held {
            self.answer(u, x);
        }
        self.plant.load_friction(&self.trig, &x[..self.states], &self.tau, &u.wrench);
    }

    /// The plant of the loop.
    pub fn plant_mut(&mut self) -> &mut dyn Plant<S> {
        self.plant.as_mut()
    }

    /// Call [`ClosedLoop::observe`] if the law is evaluated in every stage. A held input does not change.
    pub fn observe_unheld(&mut self, t: f64, x: &[S]) {
        if !self.closing.held {
            self.observe(t, x);
        }
    }
}
