//! A law asked instant by instant: what `law(t, q, v)` costs from Python.

use super::{Law, LawSpec};
use crate::motion::{Motion, sample_all};
use crate::scalar::trig::sin_cos_apart;
use crate::scalar::{Fused, Real, fuses};

enum Route {
    Baseline(Engine<f64>),
    Fused(Engine<Fused>),
}

struct Engine<S> {
    law: Box<dyn Law<S> + Send>,
    motions: Vec<Motion>,
    desired: Vec<S>,
    trig: Vec<(S, S)>,
    x: Vec<S>,
    z: Vec<S>,
    initial: Vec<f64>,
    tau: Vec<S>,
    dz: Vec<S>,
}

/// Buffers of one law, kept between calls: a call allocates nothing.
pub struct LawEvaluator(Route);

impl LawEvaluator {
    pub fn new(spec: &LawSpec) -> Self {
        LawEvaluator(if fuses() { Route::Fused(Engine::new(spec)) } else { Route::Baseline(Engine::new(spec)) })
    }

    /// The plant's input `(n,)` at time `t`, the parts of the plant's state one after another, and the law's state `z`; `None`: as
    /// at the start of a run.
    pub fn input(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>, tau: &mut [f64]) {
        match &mut self.0 {
            Route::Baseline(engine) => engine.input(t, parts, z, tau),
            Route::Fused(engine) => engine.input(t, parts, z, tau),
        }
    }
}

impl<S: Real> Engine<S> {
    fn new(spec: &LawSpec) -> Self {
        let n = spec.model().n();
        let width = spec.motions().iter().map(|motion| 3 * motion.dof()).sum();
        let zeros = |k: usize| vec![S::zero(); k];
        let p = spec.initial_state().len();
        Engine {
            law: LawSpec::build(|_| spec),
            motions: spec.motions().into_iter().cloned().collect(),
            desired: zeros(width),
            trig: vec![(S::zero(), S::zero()); n],
            x: zeros(spec.plant().states(n)),
            z: zeros(p),
            initial: spec.initial_state().to_vec(),
            tau: zeros(n),
            dz: zeros(p),
        }
    }

    fn input(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>, tau: &mut [f64]) {
        for (to, &from) in self.x.iter_mut().zip(parts.iter().copied().flatten()) {
            *to = S::splat(from);
        }
        for (to, &from) in self.z.iter_mut().zip(z.unwrap_or(&self.initial)) {
            *to = S::splat(from);
        }
        for (trig, &q) in self.trig.iter_mut().zip(&self.x) {
            *trig = sin_cos_apart(q);
        }
        sample_all(&self.motions, t, &mut self.desired);
        self.law.at(t);
        self.law.evaluate(&self.desired, &self.trig, &self.x, &self.z, &mut self.tau, &mut self.dz);
        for (to, from) in tau.iter_mut().zip(&self.tau) {
            *to = from.lane(0);
        }
    }
}
