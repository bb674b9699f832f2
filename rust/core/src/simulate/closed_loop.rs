//! Any plant under any law: `x = [plant, law, quadratures]`, two calls per evaluation.
//!
//! The quadratures are the two integrals that the identities need: what the law dissipates, and the power put into the
//! stored energy (the law's own storage function where it has one).

use super::force::Force;
use crate::integrate::System;
use crate::law::Law;
use crate::motion::{Motion, sample_apart};
use crate::plant::Plant;
use crate::scalar::Real;
use crate::scalar::trig::{Angle, rotate};

/// What the world tells the loop at one instant.
#[derive(Clone)]
pub struct Exogenous<S> {
    pub t: f64,
    /// The desired motions one after another, `[x_d, x_d', x_d'']` each.
    pub desired: Vec<S>,
    pub wrench: [S; 6],
}

/// Where it comes from: per desired motion one for all lanes, or one per lane; the same of forces.
pub struct World<'a> {
    motions: Vec<Vec<&'a Motion>>,
    forces: Vec<&'a Force>,
    /// A sample per lane, of the widest motion.
    rows: Vec<f64>,
    lanes: usize,
    width: usize,
}

impl<'a> World<'a> {
    /// `motions(lane)` and `force(lane)` of each lane.
    pub fn new(lanes: usize, motions: impl Fn(usize) -> Vec<&'a Motion>, force: impl Fn(usize) -> Option<&'a Force>) -> Self {
        let per_lane: Vec<Vec<&Motion>> = (0..lanes).map(motions).collect();
        let gather = |k: usize| {
            let column: Vec<&Motion> = per_lane.iter().map(|motions| motions[k]).collect();
            if column.iter().all(|&m| std::ptr::eq(m, column[0])) { vec![column[0]] } else { column }
        };
        let motions: Vec<Vec<&Motion>> = (0..per_lane[0].len()).map(gather).collect();
        let mut forces: Vec<&Force> = (0..lanes).filter_map(force).collect();
        if forces.iter().all(|&f| std::ptr::eq(f, forces[0])) {
            forces.truncate(1);
        }
        let width = motions.iter().map(|motions| 3 * motions[0].dof()).sum();
        let widest = motions.iter().map(|motions| 3 * motions[0].dof()).max().unwrap_or(0);
        World { motions, forces, rows: vec![0.0; widest * lanes], lanes, width }
    }

    /// Room for one instant.
    pub fn instant<S: Real>(&self) -> Exogenous<S> {
        Exogenous { t: f64::NAN, desired: vec![S::zero(); self.width], wrench: [S::zero(); 6] }
    }

    #[inline(never)]
    fn sample<S: Real>(&mut self, t: f64, u: &mut Exogenous<S>) {
        u.t = t;
        let mut at = 0;
        for motions in &self.motions {
            let width = 3 * motions[0].dof();
            let out = &mut u.desired[at..at + width];
            if motions.len() == 1 {
                sample_apart(motions[0], t, out);
            } else {
                for (motion, row) in motions.iter().zip(self.rows.chunks_exact_mut(width)) {
                    sample_apart(motion, t, row);
                }
                for (k, out) in out.iter_mut().enumerate() {
                    *out = S::from_lanes(|lane| self.rows[lane * width + k]);
                }
            }
            at += width;
        }
        match self.forces.as_slice() {
            [] => {}
            [force] => u.wrench = force.at(t).map(S::splat),
            forces => {
                for (lane, force) in forces.iter().enumerate().take(self.lanes) {
                    self.rows_of_wrench(lane, force.at(t), u);
                }
            }
        }
    }

    fn rows_of_wrench<S: Real>(&self, lane: usize, wrench: [f64; 6], u: &mut Exogenous<S>) {
        for (to, from) in u.wrench.iter_mut().zip(wrench) {
            let before = *to;
            *to = S::from_lanes(|i| if i == lane { from } else { before.lane(i) });
        }
    }
}

/// How the loop is closed.
pub struct Closing<'a> {
    /// Largest |tau| per joint, where the input saturates.
    pub tau_max: Option<&'a [f64]>,
    /// The law is asked at samples and its answer held; else in every stage.
    pub held: bool,
    pub monitored: bool,
    /// The law's own storage function is the energy watched.
    pub storage: bool,
}

pub struct ClosedLoop<'a, S: Real> {
    plant: Box<dyn Plant<S> + Send>,
    law: Box<dyn Law<S> + Send>,
    world: World<'a>,
    closing: Closing<'a>,
    /// Size of the plant's state, and which joints are angles.
    states: usize,
    angles: Vec<bool>,
    anchors: Vec<Angle<S>>,
    trig: Vec<(S, S)>,
    /// The plant's input as of the last evaluation.
    pub tau: Vec<S>,
    dz: Vec<S>,
    now: Exogenous<S>,
}

impl<'a, S: Real> ClosedLoop<'a, S> {
    pub fn new(
        plant: Box<dyn Plant<S> + Send>,
        law: Box<dyn Law<S> + Send>,
        world: World<'a>,
        closing: Closing<'a>,
        (states, p, angles): (usize, usize, Vec<bool>),
    ) -> Self {
        let n = angles.len();
        let (anchors, trig) = (vec![Angle::default(); n], vec![(S::zero(), S::splat(1.0)); n]);
        let now = world.instant();
        ClosedLoop { plant, law, world, closing, states, angles, anchors, trig, tau: vec![S::zero(); n], dz: vec![S::zero(); p], now }
    }

    /// Size of the state with the quadratures.
    pub fn size(&self) -> usize {
        self.states + self.dz.len() + if self.closing.monitored { 2 } else { 0 }
    }

    /// Components whose error is controlled.
    pub fn controlled(&self) -> usize {
        self.states + self.dz.len()
    }

    /// Room for the exogenous input of one instant.
    pub fn instant(&self) -> Exogenous<S> {
        self.world.instant()
    }

    #[inline(always)]
    fn control(&mut self, desired: &[S], x: &[S]) {
        let (plant, z) = (&x[..self.states], &x[self.states..self.states + self.dz.len()]);
        self.law.evaluate(desired, &self.trig, plant, z, &mut self.tau, &mut self.dz);
        if let Some(limit) = self.closing.tau_max {
            for (tau, &limit) in self.tau.iter_mut().zip(limit) {
                // A NaN passes, as it must: min and max would hide it.
                let (high, low) = (S::splat(limit), S::splat(-limit));
                *tau = S::select(high.lt(*tau), high, S::select(tau.lt(low), low, *tau));
            }
        }
    }

    /// Evaluate the law at state `x` and time `t`, into `self.tau`: the held input of a sampled loop, or the input to record.
    #[inline(always)]
    pub fn observe(&mut self, t: f64, x: &[S]) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [S::zero(); 6] });
        self.world.sample(t, &mut now);
        self.anchor(x);
        for (trig, anchor) in self.trig.iter_mut().zip(&self.anchors) {
            *trig = (anchor.sin, anchor.cos);
        }
        self.control(&now.desired, x);
        self.now = now;
    }

    /// As [`ClosedLoop::observe`] where the law is asked in every stage; a held input stays.
    #[inline(always)]
    pub fn observe_unheld(&mut self, t: f64, x: &[S]) {
        if !self.closing.held {
            self.observe(t, x);
        }
    }
}

impl<S: Real> System<S> for ClosedLoop<'_, S> {
    type Input = Exogenous<S>;

    #[inline(always)]
    fn input(&mut self, t: f64, u: &mut Exogenous<S>) {
        self.world.sample(t, u);
    }

    #[inline(always)]
    fn sample(&mut self, t: f64, x: &[S]) {
        if self.closing.held {
            self.observe(t, x);
        }
    }

    #[inline(always)]
    fn anchor(&mut self, x: &[S]) {
        for (i, anchor) in self.anchors.iter_mut().enumerate() {
            if self.angles[i] {
                anchor.move_to(x[i]);
            }
        }
    }

    #[inline(always)]
    fn rhs(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
        for (i, trig) in self.trig.iter_mut().enumerate() {
            if self.angles[i] {
                *trig = rotate(&self.anchors[i], x[i]);
            }
        }
        if !self.closing.held {
            self.control(&u.desired, x);
        }
        let states = self.states;
        let power = self.plant.rates(&self.trig, &x[..states], &self.tau, &u.wrench, &mut dx[..states]);
        let p = self.dz.len();
        dx[states..states + p].copy_from_slice(&self.dz);
        if self.closing.monitored {
            dx[states + p] = self.law.dissipation();
            dx[states + p + 1] =
                if self.closing.storage { self.law.storage_rate(&x[..states], power.outside) } else { power.input + power.outside };
        }
    }
}
