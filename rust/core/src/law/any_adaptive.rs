//! Adaptive tracking of any arm, with joint columns, restraint, projection, and composite or concurrent adaptation.

use super::adaptation::Adaptation;
use super::adaptive::AdaptiveSpec;
use super::adaptive_tracking::Adaptive;
use super::composite::LoopComposite;
use super::concurrent::LoopConcurrent;
use super::definition::{Definition, JointReference, Law, Shape, facts};
use super::joint_columns::{JointColumn, LoopColumns};
use super::projection::Projector;
use super::restraint::LoopRestraint;
use super::terms::Term;
use super::truth::Truth;
use crate::dynamics::{AnyArm, Dynamics};
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::natural_rate;
use crate::trace::Sym;

impl Definition for AdaptiveSpec {
    facts!("Adaptive", Rigid, motion);
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn restarts(&self) -> bool {
        self.composite.is_some()
    }

    /// The errors of the stored samples of concurrent adaptation.
    fn stored_terms(&self, z: &[f64]) -> Vec<Term> {
        let n = self.model.n();
        self.stored_errors(&z[..self.estimate.len()]).map_or(Vec::new(), |errors| vec![("e_stored", vec![errors.len() / n, n], errors)])
    }

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::Motion)
    }
}

impl Shape for AdaptiveSpec {
    /// Whether both laws estimate the same parameters in the same metric with the same options.
    fn same_shape(&self, other: &Self) -> bool {
        let columns = |law: &AdaptiveSpec| law.base.as_ref().map(|base| base.columns.clone());
        std::mem::discriminant(&self.adaptation) == std::mem::discriminant(&other.adaptation)
            && columns(self) == columns(other)
            && self.projection.is_some() == other.projection.is_some()
            && self.columns.same_kinds(&other.columns)
            && self.restraint.same_shape(&other.restraint)
            && self.composite.is_some() == other.composite.is_some()
            && self.concurrent.is_some() == other.concurrent.is_some()
    }
}

/// The adaptive law in a control loop, for any arm.
pub struct AnyAdaptive {
    law: Adaptive,
    /// Known rotor inertias, `(n,)`; empty if there are none.
    armature: Vec<Sym>,
    columns: Vec<usize>,
    /// The gain `gamma` of each body, then of each parameter of a joint column; empty in the Euclidean metric.
    natural: Vec<Sym>,
    /// All inertial parameters: the estimate in the entries of the base set, and zero in the other entries. Empty without a base set.
    full: Vec<Sym>,
    /// The entries of the base set in `Y' s`, the product of the transposed regressor and the sliding variable.
    kept: Vec<Sym>,
    projector: Option<Projector<Sym>>,
    /// The buffers of joint columns, restraint, and composite or concurrent adaptation; `None` for the plain adaptation.
    more: Option<More>,
}

/// The optional parts of an adaptive law: joint columns, restraint (leakage and dead zone), and composite or concurrent adaptation.
struct More {
    joints: LoopColumns<Sym>,
    restraint: LoopRestraint,
    composite: Option<LoopComposite<Sym>>,
    concurrent: Option<LoopConcurrent>,
    /// The entries of the joint columns of the regressor `Y`.
    entries: Vec<Sym>,
    /// The product `y = Y' s` of the transposed regressor and the sliding variable, `(p,)`.
    y: Vec<Sym>,
    /// The vector `w` that replaces `y` in the rate of the estimate, `(p,)`. It is empty without restraint, composite and concurrent
    /// adaptation.
    w: Vec<Sym>,
    /// The difference `y - w`, `(p,)`; empty if `w` is empty.
    back: Vec<Sym>,
}

impl More {
    fn new(spec: &AdaptiveSpec) -> Self {
        let zeros = |k: usize| vec![Sym::zero(); k];
        let p = spec.estimate.len();
        let restraint = LoopRestraint::new(&spec.restraint);
        let composite = spec.composite.is_some().then(|| LoopComposite::new(spec));
        let concurrent = spec.concurrent.as_ref().map(LoopConcurrent::new);
        let held = if restraint.is_none() && composite.is_none() && concurrent.is_none() { 0 } else { p };
        More {
            joints: LoopColumns::new(&spec.columns),
            restraint,
            composite,
            concurrent,
            entries: zeros(spec.columns.count()),
            y: zeros(p),
            w: zeros(held),
            back: zeros(held),
        }
    }
}

impl AdaptiveSpec {
    pub(super) fn build(&self) -> AnyAdaptive {
        let zeros = |k: usize| vec![Sym::zero(); k];
        let (gamma, natural) = match &self.adaptation {
            Adaptation::Euclidean(gamma) => (gamma, Vec::new()),
            Adaptation::Natural(gammas) => (&Gain::unchecked(1, vec![1.0]), gammas.iter().map(|&gamma| Sym::varying(gamma)).collect()),
        };
        let armature = self.model.armature();
        let known = !self.columns.has(JointColumn::Armature) && armature.iter().any(|&a| a != 0.0);
        let columns = self.base.as_ref().map_or(Vec::new(), |base| base.columns.clone());
        AnyAdaptive {
            law: Adaptive::new(
                AnyArm::new(&self.model),
                AnyGain::labelled("lambda", &self.lambda),
                AnyGain::labelled("kd", &self.kd),
                AnyGain::labelled("gamma", gamma),
            ),
            armature: if known { armature.into_iter().map(Sym::fixed).collect() } else { Vec::new() },
            full: zeros(if columns.is_empty() { 0 } else { self.model.parameter_count() }),
            kept: zeros(columns.len()),
            projector: self.projection.as_ref().map(|projection| Projector::new(projection, self.estimate.len())),
            columns,
            natural,
            more: (!self.is_plain()).then(|| More::new(self)),
        }
    }
}

impl AnyAdaptive {
    /// Compute the torque for the estimate `z` of the bodies, plus the torque of known rotors. The law stores `Y' s`, the product of the
    /// transposed regressor and the sliding variable.
    fn torque(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], z: &[Sym], tau: &mut [Sym]) {
        if self.columns.is_empty() {
            self.law.torque(desired, trig, x, z, tau);
        } else {
            for (&column, &estimate) in self.columns.iter().zip(z) {
                self.full[column] = estimate;
            }
            self.law.torque(desired, trig, x, &self.full, tau);
        }
        for (i, &armature) in self.armature.iter().enumerate() {
            tau[i] = armature.mul_add(self.law.a_r[i], tau[i]);
        }
    }

    /// Compute the torque, and the rate of the estimate, with the options in `more`.
    fn evaluate_more(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], z: &[Sym], tau: &mut [Sym], dz: &mut [Sym]) {
        let Some(mut more) = self.more.take() else { return };
        let n = tau.len();
        let (z, filters) = z.split_at(more.y.len());
        let (dz, filter_rates) = dz.split_at_mut(more.y.len());
        let inertial = z.len() - more.entries.len();
        self.torque(desired, trig, x, &z[..inertial], tau);
        more.joints.fill(&self.law.v_r, &self.law.a_r, &mut more.entries);
        if self.columns.is_empty() {
            more.y[..inertial].copy_from_slice(&self.law.yt_s);
        } else {
            for (to, &column) in more.y.iter_mut().zip(&self.columns) {
                *to = self.law.yt_s[column];
            }
        }
        for (k, &entry) in more.entries.iter().enumerate() {
            tau[k % n] = entry.mul_add(z[inertial + k], tau[k % n]);
            more.y[inertial + k] = entry * self.law.s[k % n];
        }
        let free = more.w.is_empty();
        if !free {
            more.restraint.leak(&self.law.s, z, &more.y, &mut more.w, &mut more.back);
        }
        if let Some(composite) = &mut more.composite {
            composite.evaluate(&self.law.arm, &mut self.law.workspace, &more.joints, trig, x);
            composite.push(&x[n..2 * n], tau, [z, filters], [&mut more.w, &mut more.back, filter_rates]);
        }
        if let Some(concurrent) = &more.concurrent {
            concurrent.push(z, &mut more.w, &mut more.back);
        }
        let w = if free { &more.y } else { &more.w };
        if self.natural.is_empty() {
            self.law.gamma.multiply(w, dz);
            if let Some(projector) = &mut self.projector {
                projector.correct(&self.law.gamma, z, w, dz);
            }
        } else {
            self.natural_rates(z, w, dz);
        }
        more.restraint.rest(&self.law.s, &more.y, dz, &mut more.back);
        self.more = Some(more);
    }

    /// Name the desired motion, the errors `e` and `e_dot`, the references `v_r` and `a_r`, the sliding variable `s` and the regressor `Y`.
    /// The rate of the estimate and the terms of composite adaptation follow.
    fn name_terms(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], dz: &[Sym]) {
        let AnyAdaptive { law, columns, more, .. } = self;
        let (n, all) = (law.s.len(), law.yt_s.len());
        let entries = more.as_ref().map_or(&[][..], |more| &more.entries);
        let own = |row: &[Sym], i: usize, entries: &[Sym]| -> Vec<Sym> {
            let bodies: Vec<Sym> = if columns.is_empty() { row.to_vec() } else { columns.iter().map(|&column| row[column]).collect() };
            bodies.into_iter().chain(entries.iter().enumerate().map(|(k, &entry)| if k % n == i { entry } else { Sym::zero() })).collect()
        };
        let p = entries.len() + if columns.is_empty() { all } else { columns.len() };
        Sym::term("q_d", &[n], || desired[..n].to_vec());
        Sym::term("v_d", &[n], || desired[n..2 * n].to_vec());
        Sym::term("a_d", &[n], || desired[2 * n..].to_vec());
        for (name, values) in [("e", &law.e), ("e_dot", &law.e_dot), ("v_r", &law.v_r), ("a_r", &law.a_r), ("s", &law.s)] {
            Sym::term(name, &[n], || values.clone());
        }
        Sym::term("Y", &[n, p], || {
            let mut full = vec![Sym::zero(); n * all];
            law.arm.regressor(&mut law.workspace, trig, &x[..n], [&x[n..2 * n], &law.v_r, &law.a_r], &mut full);
            full.chunks_exact(all).enumerate().flat_map(|(i, row)| own(row, i, entries)).collect()
        });
        Sym::term("estimate_rate", &[p], || dz[..p].to_vec());
        if let Some(composite) = more.as_ref().and_then(|more| more.composite.as_ref()) {
            composite.name_terms();
        }
    }

    /// Compute the rates of the estimate in the natural metric: of each body, then of each parameter of a joint column.
    fn natural_rates(&self, z: &[Sym], w: &[Sym], dz: &mut [Sym]) {
        let bodies = (z.len() - self.natural.len()) / (PARAMETERS - 1);
        let (of_bodies, beside) = dz.split_at_mut(PARAMETERS * bodies);
        let ((estimates, _), (pushes, _), (rates, _)) =
            (z.as_chunks::<PARAMETERS>(), w.as_chunks::<PARAMETERS>(), of_bodies.as_chunks_mut::<PARAMETERS>());
        for (k, rate) in rates.iter_mut().enumerate() {
            *rate = natural_rate(&estimates[k], &pushes[k], self.natural[k]);
        }
        for (k, rate) in beside.iter_mut().enumerate() {
            *rate = self.natural[bodies + k] * w[PARAMETERS * bodies + k];
        }
    }
}

impl Law for AnyAdaptive {
    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], z: &[Sym], tau: &mut [Sym], dz: &mut [Sym]) {
        if self.more.is_some() {
            self.evaluate_more(desired, trig, x, z, tau, dz);
            return self.name_terms(desired, trig, x, dz);
        }
        self.torque(desired, trig, x, z, tau);
        let yt_s = &self.law.yt_s;
        if !self.natural.is_empty() {
            self.natural_rates(z, yt_s, dz);
        } else if self.columns.is_empty() {
            self.law.gamma.multiply(yt_s, dz);
            if let Some(projector) = &mut self.projector {
                projector.correct(&self.law.gamma, z, yt_s, dz);
            }
        } else {
            for (to, &column) in self.kept.iter_mut().zip(&self.columns) {
                *to = yt_s[column];
            }
            self.law.gamma.multiply(&self.kept, dz);
        }
        self.name_terms(desired, trig, x, dz);
    }

    fn restart(&mut self, trig: &[(Sym, Sym)], x: &[Sym], z: &mut [Sym]) {
        let n = self.law.s.len();
        if let Some(More { composite: Some(composite), joints, y, .. }) = &mut self.more {
            composite.evaluate(&self.law.arm, &mut self.law.workspace, joints, trig, x);
            composite.begin(&x[n..2 * n], &mut z[y.len()..]);
        }
    }

    fn dissipation(&self) -> Sym {
        self.law.dissipation()
    }

    fn dissipation_of(&self, truth: &Truth, friction: Option<&[Sym]>, x: &[Sym], z: &[Sym]) -> Sym {
        let Some(more) = &self.more else { return self.dissipation() };
        let n = self.law.s.len();
        self.dissipation() - truth.added([&self.law.s, &x[n..2 * n], &self.law.a_r], friction, &more.entries, z, &more.back)
    }
}
