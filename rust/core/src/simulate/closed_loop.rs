//! The recorded closed loop of any plant with any law, `x_dot = f(u, x)` with the exogenous input `u` and the state `x = [plant, law,
//! integrals]`.
//! One evaluation of `f` calls the plant once, and the law once unless its output is held. The integrals are those of the monitors.

use super::monitors::{self, Flow};
use super::world::Exogenous;
use crate::law::{Answer, Equations, LawSpec, RecordedLaw, Truth};
use crate::linalg::Pairs;
use crate::plant::{Mode, PlantRates, PlantSpec, RecordedPlant};
use crate::scalar::{Real, labelled_numbers};
use crate::trace::expression::{clamp, vector};
use crate::trace::{Sym, V, sym};
use std::ops::Range;

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

/// A loop of one plant and one law in a recording.
pub struct ClosedLoop<'a> {
    plant: RecordedPlant<'a>,
    law: RecordedLaw<'a>,
    closing: Closing,
    /// The saturation limits of the input. Empty if there is no saturation.
    limits: V,
    sizes: Sizes,
    /// The plant's input: the saturated output of the law at its last evaluation, or the held input.
    pub tau: Vec<Sym>,
    /// The other results of the law that belong to `tau`: the rate of its state, then its dissipation if that is monitored.
    dz: Vec<Sym>,
    /// The law's last answer; `None` while its output is held.
    answer: Option<Answer>,
    /// The true parameters of the plants, for the dissipation in the Lyapunov balance. `None` if the law alone determines it.
    truth: Option<Truth>,
}

/// The sizes of a loop.
struct Sizes {
    /// Number of joints.
    n: usize,
    /// Length of the plant's state.
    states: usize,
    /// Length of the part of the plant's state that the law reads.
    seen: usize,
    /// Length of the law's state.
    p: usize,
    /// Length of the desired motions at one instant.
    desired: usize,
}

/// The steps of the decision which joints with stick-slip friction stick ([`LoopStickSlip`](crate::plant::LoopStickSlip)). The modes are
/// numbers, followed by a number that is 1 if they are final, else 0.
pub struct DecidingModes {
    /// At the start of the decision.
    pub begun: Vec<Sym>,
    /// After a pivot.
    pub pivoted: Vec<Sym>,
    /// The modes and the speeds after a step.
    pub stopped: Vec<Sym>,
    pub speeds: Vec<Sym>,
}

impl<'a> ClosedLoop<'a> {
    /// Record the numbers of a loop. The wrench acts at `force_frame`. `tau_max` are the limits of the input, and `period` is the sample
    /// period, s. `truth` are the true parameters of the plants for the dissipation.
    pub fn new(
        (plant, force_frame): (&'a PlantSpec, Option<usize>),
        law: &'a LawSpec,
        closing: Closing,
        (tau_max, period): (Option<&[f64]>, Option<f64>),
    ) -> Self {
        let recorded_plant = RecordedPlant::new(plant, force_frame);
        let numbers = law.parameters(period);
        let limits = V::from_vec(labelled_numbers("tau_max", tau_max.unwrap_or_default()));
        let truth = law.adaptive().filter(|_| closing.watches_dissipation()).and_then(|law| Truth::new(law, plant));
        let sizes = Sizes {
            n: plant.n(),
            states: plant.states(),
            seen: plant.seen(),
            p: law.initial_state().len(),
            desired: law.motions().iter().map(|motion| 3 * motion.dof()).sum(),
        };
        let answer = sizes.p + usize::from(closing.watches_dissipation());
        ClosedLoop {
            plant: recorded_plant,
            law: RecordedLaw::with(law, numbers, limits.clone()),
            closing,
            limits,
            tau: vec![Sym::zero(); sizes.n],
            dz: vec![Sym::zero(); answer],
            answer: None,
            truth,
            sizes,
        }
    }

    /// The size of the desired motions at one instant.
    pub fn desired(&self) -> usize {
        self.sizes.desired
    }

    /// The size of the integrated state: the states of plant and law, and the integrals of the monitors.
    pub fn size(&self) -> usize {
        self.sizes.states + self.sizes.p + monitors::integrals(self.closing.monitored).count()
    }

    /// The range of the law's states in the state.
    pub fn law_states(&self) -> Range<usize> {
        self.sizes.states..self.sizes.states + self.sizes.p
    }

    /// Whether the input is held.
    pub fn is_held(&self) -> bool {
        self.closing.held
    }

    /// The pairs of positions and rates in the state.
    pub fn pairs(&self) -> Pairs {
        // The plant's state is [q, v], [q, v, theta, theta_dot], or [q] without rates. The bristle deflections, the states of the law and
        // the integrals of the monitors follow.
        let Sizes { n, states, p, .. } = self.sizes;
        Pairs { joints: n, count: states / (2 * n), quadratures: self.size() - states - p }
    }

    /// Hold results of the law from this call on: the input `tau` and the other results `dz` ([`ClosedLoop::law_rate`]).
    pub fn hold_input(&mut self, tau: &[Sym], dz: &[Sym]) {
        self.closing.held = true;
        self.answer = None;
        self.tau.copy_from_slice(tau);
        self.dz.copy_from_slice(dz);
    }

    /// The rate of the law's state that belongs to `tau`, followed by the law's dissipation if that is monitored.
    pub fn law_rate(&self) -> &[Sym] {
        &self.dz
    }

    /// Evaluate the law at state `x`, and apply the saturation.
    pub fn answer(&mut self, u: &Exogenous<Sym>, x: &[Sym]) {
        let Sizes { states, seen, p, .. } = self.sizes;
        let (measured, z) = (&x[..seen], &x[states..states + p]);
        let answer = self.law.answer(&u.desired, measured, z);
        self.tau.copy_from_slice(clamp(&answer.tau, &self.limits).as_slice());
        self.dz[..p].copy_from_slice(answer.z_dot.as_slice());
        self.answer = Some(answer);
        self.set_dissipation(None, x);
    }

    /// Set the monitored dissipation of the law. `friction` are the torques of stick-slip friction, if they are known.
    fn set_dissipation(&mut self, friction: Option<&V>, x: &[Sym]) {
        let Sizes { n, states, p, .. } = self.sizes;
        let (Some(dissipated), Some(answer)) = (self.dz.get_mut(p), &self.answer) else { return };
        *dissipated = match &self.truth {
            None => answer.dissipation,
            Some(truth) => sym::contract(|| truth.dissipation(answer, friction, &vector(&x[n..2 * n]), &x[states..states + p])),
        };
    }

    /// Compute the rates `dx` of state `x` under the exogenous input `u`.
    pub fn rhs(&mut self, u: &Exogenous<Sym>, x: &[Sym], dx: &mut [Sym]) {
        if !self.closing.held {
            self.answer(u, x);
        }
        let Sizes { states, p, .. } = self.sizes;
        let PlantRates { x_dot, power, friction } = self.plant.rates(&x[..states], &vector(&self.tau), &u.wrench);
        dx[..states].copy_from_slice(x_dot.as_slice());
        if self.plant.sticks() && self.truth.is_some() {
            // The torque of stick-slip friction is known only now.
            self.set_dissipation(friction.as_ref(), x);
        }
        dx[states..states + p].copy_from_slice(&self.dz[..p]);
        if self.closing.monitored {
            let released = self.answer.as_ref().map_or_else(Sym::zero, |answer| answer.dissipation);
            let stored = self.closing.storage.then(|| power.outside - released);
            let dissipated = self.dz.get(p).copied().unwrap_or_else(Sym::zero);
            monitors::rates(&Flow { power, dissipated, stored }, &mut dx[states + p..]);
        }
    }

    /// Hold all contacts of the plant in the modes that the numbers `modes` describe, two for each contact ([`Touch::numbers`]).
    pub fn hold_modes(&mut self, modes: &[Sym]) {
        self.plant.hold_contacts(modes.as_chunks().0.iter().map(|&numbers| Mode::of(numbers)));
    }

    /// Set the modes of all joints as numbers: 0 for a stuck joint, else the direction of sliding.
    pub fn hold_sides(&mut self, signs: &[Sym]) {
        self.plant.hold_joints(signs);
    }

    /// Return the depth `d`, m or rad, and the push `k d + c d_dot`, N or N m, of contact `i` of the plant at state `x`. `k` is the
    /// stiffness of the contact, and `c` its damping.
    pub fn contact(&self, i: usize, x: &[Sym]) -> [Sym; 2] {
        self.plant.contact(i, &x[..self.sizes.states])
    }

    /// The numbers of [`LoopStickSlip::loads`] and of [`LoopStickSlip::margins`], under the exogenous input `u` at state `x`.
    pub fn loads_and_margins(&mut self, u: &Exogenous<Sym>, x: &[Sym]) -> (Vec<Sym>, Vec<Sym>) {
        if !self.closing.held {
            self.answer(u, x);
        }
        let friction = self.plant.stick_slip(&x[..self.sizes.states], &vector(&self.tau), &u.wrench);
        friction.map_or_else(Default::default, |(mut friction, speeds)| (friction.loads(), friction.margins(speeds.as_slice()).to_vec()))
    }

    /// The steps of the decision which joints stick, under the exogenous input `u` at state `x`; `None` without stick-slip friction.
    pub fn deciding_modes(&mut self, u: &Exogenous<Sym>, x: &[Sym]) -> Option<DecidingModes> {
        if !self.closing.held {
            self.answer(u, x);
        }
        let (friction, speeds) = self.plant.stick_slip(&x[..self.sizes.states], &vector(&self.tau), &u.wrench)?;
        let [mut begun, mut pivoted, mut stopped] = [friction.clone(), friction.clone(), friction];
        begun.begin(speeds.as_slice());
        let settled = pivoted.pivot(speeds.as_slice(), None);
        let speeds = speeds.iter().enumerate().map(|(i, &v)| stopped.stop(i, v)).collect();
        Some(DecidingModes {
            begun: [begun.signs(), &[Sym::zero()]].concat(),
            pivoted: [pivoted.signs(), &[settled]].concat(),
            stopped: stopped.signs().to_vec(),
            speeds,
        })
    }
}
