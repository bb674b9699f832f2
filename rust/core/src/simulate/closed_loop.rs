//! Any plant under any law: `x = [plant, law, quadratures]`, two calls per evaluation.
//!
//! The quadratures are the two integrals that the identities need: the power that the law dissipates, and the power put into the stored
//! energy. A law with a storage function replaces the first by its part of the external power, and the second by the rate of its function.

use super::force::Wrench;
use super::sampler::Sampler;
use super::world::{Exogenous, World};
use crate::integrate::{DualSystem, System};
use crate::law::{Law, Truth};
use crate::linalg::Pairs;
use crate::plant::{Plant, Touch};
use crate::scalar::{Duals, Real};
use std::borrow::Cow;

/// How the loop is closed.
pub struct Closing<'a> {
    /// Largest |tau| per joint, where the input saturates.
    pub tau_max: Option<Cow<'a, [f64]>>,
    /// The law is evaluated at samples and its output held; else in every stage.
    pub held: bool,
    pub monitored: bool,
    /// The monitored energy is the law's storage function.
    pub storage: bool,
}

impl Closing<'_> {
    /// Whether the integral of the law's dissipation is monitored.
    pub fn watches_dissipation(&self) -> bool {
        self.monitored && !self.storage
    }
}

pub struct ClosedLoop<'a, S: Real> {
    plant: Box<dyn Plant<S> + Send>,
    law: Box<dyn Law<S> + Send>,
    world: World<'a>,
    closing: Closing<'a>,
    /// The limits of the input; empty without any.
    limits: Vec<S>,
    /// The sampler of a controller with delay, jitter, noise or resolution; `None` for an ideal one.
    sampler: Option<Sampler<S>>,
    /// Size of the plant's state and of the part that the law reads, and which joints are angles.
    states: usize,
    seen: usize,
    angles: Vec<bool>,
    trig: Vec<(S, S)>,
    /// The plant's input as of the last evaluation.
    pub tau: Vec<S>,
    /// The rate of the law's state, followed by its dissipation if that is monitored: all outputs beside `tau`.
    dz: Vec<S>,
    /// Size of the law's state.
    p: usize,
    /// One as long as every result of the law since the last reset was valid, else zero.
    pub stands: S,
    now: Exogenous<S>,
    /// Buffer for the present output while the next one is computed.
    acting: (Vec<S>, Vec<S>),
    /// The plants that determine the dissipation in the Lyapunov balance; `None` if the law alone determines it.
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
        let limits = S::labelled("tau_max", 1, || limits.map(|&limit| S::from_lanes(|_| limit)).collect());
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
            stands: S::splat(1.0),
            now,
            acting: (vec![S::zero(); n], vec![S::zero(); answer]),
            truth: None,
        }
    }

    /// The same loop, whose dissipation is computed with these plants.
    pub fn judged_by(self, truth: Option<Truth<S>>) -> Self {
        ClosedLoop { truth, ..self }
    }

    /// The same loop, whose law knows the limits of its input and its sample time.
    pub fn asked_every(mut self, period: Option<f64>) -> Self {
        self.law.configure(period, &self.limits);
        self
    }

    /// The same loop with other motions, forces and limits.
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
            stands: self.stands,
            now: self.now,
            acting: self.acting,
            truth: self.truth,
        }
    }

    /// Size of the state with the quadratures.
    pub fn size(&self) -> usize {
        self.states + self.p + if self.closing.monitored { 2 } else { 0 }
    }

    /// Components whose error is controlled.
    pub fn controlled(&self) -> usize {
        self.states + self.p
    }

    /// The instants of a controller with a separate clock.
    pub fn instants(&self, t_end: f64) -> Vec<f64> {
        self.sampler.as_ref().map_or(Vec::new(), |sampler| sampler.instants(t_end))
    }

    /// Buffer for the exogenous input of one instant.
    pub fn instant(&self) -> Exogenous<S> {
        self.world.instant()
    }

    /// The law's output and rate at the plant state `measured` and its own state `z`, within the limits of the input.
    fn control(&mut self, desired: &[S], measured: &[S], z: &[S]) {
        let measured = &measured[..self.seen];
        let (rate, dissipated) = self.dz.split_at_mut(self.p);
        self.law.evaluate(desired, &self.trig, measured, z, &mut self.tau, rate);
        if let [dissipated] = dissipated {
            *dissipated = match &self.truth {
                None => self.law.dissipation(),
                Some(truth) => self.law.dissipation_of(truth, measured, z),
            };
        }
        if let Some(stands) = self.law.stands() {
            self.stands = self.stands.min(stands);
        }
        self.saturate();
    }

    fn saturate(&mut self) {
        for (tau, &limit) in self.tau.iter_mut().zip(&self.limits) {
            *tau = tau.clamped(-limit, limit);
        }
    }

    /// The input is `tau` from now on, and the law's state is constant. With `None` the law computes the input again.
    pub fn take_over(&mut self, tau: Option<&[S]>, held: bool) {
        self.closing.held = held || tau.is_some();
        if let Some(tau) = tau {
            self.tau.copy_from_slice(tau);
            self.saturate();
            self.dz.fill(S::zero());
        }
    }

    /// Hold the results of the law from now on: the input `tau`, and the rate from [`ClosedLoop::law_rate`].
    pub fn hold_input(&mut self, tau: &[S], dz: &[S]) {
        self.closing.held = true;
        self.tau.copy_from_slice(tau);
        self.dz.copy_from_slice(dz);
    }

    /// The rate of the law's state at the last evaluation, followed by its dissipation if that is monitored.
    pub fn law_rate(&self) -> &[S] {
        &self.dz
    }

    /// The sines and cosines of the joints at state `x`.
    pub fn turn_to(&mut self, x: &[S]) {
        for (i, trig) in self.trig.iter_mut().enumerate() {
            if self.angles[i] {
                *trig = x[i].sin_cos();
            }
        }
    }

    /// The law's input `tau` and rate at state `x`, if the sines and cosines are already computed.
    pub fn answer(&mut self, u: &Exogenous<S>, x: &[S]) {
        let (measured, z) = x.split_at(self.states);
        self.control(&u.desired, measured, &z[..self.p]);
    }

    /// The rates `dx` of state `x`, if the sines and cosines are already computed.
    pub fn rates(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
        if !self.closing.held {
            self.answer(u, x);
        }
        let states = self.states;
        let power = self.plant.rates(&self.trig, &x[..states], &self.tau, &u.wrench, &mut dx[..states]);
        let p = self.p;
        dx[states..states + p].copy_from_slice(&self.dz[..p]);
        if self.closing.monitored {
            (dx[states + p], dx[states + p + 1]) = if self.closing.storage {
                let stored = self.law.storage_rate(&x[..self.seen], power.outside);
                (power.outside - stored, stored)
            } else {
                (self.dz[p], power.input + power.outside)
            };
        }
    }

    /// Whether the exogenous input is constant.
    pub fn autonomous(&self) -> bool {
        (self.closing.held || self.world.has_targets()) && !self.world.has_smooth_force()
    }

    /// The exogenous input at `t`, and its derivative.
    pub fn drift(&mut self, t: f64, u: &mut Exogenous<S>, u_dot: &mut Exogenous<S>) {
        self.world.drift(t, u, u_dot);
    }

    /// Hold every contact of the plant in these states.
    pub fn hold_contacts(&mut self, contacts: &[Touch]) {
        self.plant.hold(contacts);
    }

    /// Penetration depth and force of a contact of the plant at state `x`, after [`ClosedLoop::turn_to`].
    pub fn contact(&mut self, i: usize, x: &[S]) -> [S; 2] {
        self.plant.contact(i, &self.trig, &x[..self.states])
    }

    /// Apply this wrench instead of the forces of the problem; `None` restores them.
    pub fn push(&mut self, wrench: Option<&Wrench>) {
        self.world.push(wrench);
    }

    /// Restart at `t = 0`.
    pub fn rewind(&mut self) {
        if let Some(sampler) = &mut self.sampler {
            sampler.forget();
        }
    }

    /// Evaluate the law at state `x` and time `t`, into `self.tau`: the held input of a sampled loop, or the input to record.
    pub fn observe(&mut self, t: f64, x: &[S]) {
        let (measured, z) = x.split_at(self.states);
        self.evaluate_law(t, measured, &z[..self.p]);
    }

    fn evaluate_law(&mut self, t: f64, measured: &[S], z: &[S]) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [S::zero(); 6] });
        self.world.sample(t, &mut now);
        self.turn_to(measured);
        self.law.at(t);
        self.control(&now.desired, measured, z);
        self.now = now;
    }

    /// Take a sample of a controller with a separate clock.
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

    /// Whether the input is held.
    pub fn is_held(&self) -> bool {
        self.closing.held
    }

    /// The forces at time `t` and the sines and cosines of state `x`, for [`ClosedLoop::load_plant`].
    pub fn look(&mut self, t: f64, x: &[S]) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [S::zero(); 6] });
        self.world.sample(t, &mut now);
        self.turn_to(x);
        self.now = now;
    }

    /// Write the loads of the plant at state `x` into its friction model, with the forces of the last `look`.
    pub fn load_plant(&mut self, x: &[S]) {
        self.plant.load_friction(&self.trig, &x[..self.states], &self.tau, &self.now.wrench);
    }

    /// The plant.
    pub fn plant_mut(&mut self) -> &mut dyn Plant<S> {
        self.plant.as_mut()
    }

    /// The same as [`ClosedLoop::observe`] if the law is evaluated in every stage. A held input does not change.
    pub fn observe_unheld(&mut self, t: f64, x: &[S]) {
        if !self.closing.held {
            self.observe(t, x);
        }
    }
}

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
        // [q, v] or [q, v, theta, theta_dot]; [q] alone has no rates.
        let n = self.tau.len();
        Pairs { joints: n, count: self.states / (2 * n) }
    }

    fn rhs(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
        self.turn_to(x);
        self.rates(u, x, dx);
    }
}

impl<V: Real> DualSystem<V> for ClosedLoop<'_, Duals<V>> {
    fn moving_input(&mut self, t: f64, u: &mut Exogenous<Duals<V>>) {
        let mut moving = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [Duals::default(); 6] });
        self.drift(t, u, &mut moving);
        let along = |rate: f64| V::from_lanes(|lane| if lane == 0 { rate } else { 0.0 });
        for (u, rate) in u.desired.iter_mut().zip(&moving.desired).chain(u.wrench.iter_mut().zip(&moving.wrench)) {
            u.rates = along(rate.lane(0));
        }
        self.now = moving;
    }

    fn hold(&mut self, input: &[V::One], rate: &[V::One]) {
        for (to, &from) in self.tau.iter_mut().zip(input).chain(self.dz.iter_mut().zip(rate)) {
            *to = Duals::new(from, V::zero());
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
