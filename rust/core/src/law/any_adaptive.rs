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
use super::terms::{Instant, Term};
use super::truth::Truth;
use crate::dynamics::AnyArm;
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::natural_rate;

impl AdaptiveSpec {
    /// The entries of the joint columns of the regressor `Y`.
    fn joint_entries(&self, v_r: &[f64], a_r: &[f64]) -> Vec<f64> {
        let mut entries = vec![0.0; self.columns.count()];
        LoopColumns::new(&self.columns).fill(v_r, a_r, &mut entries);
        entries
    }
}

impl Definition for AdaptiveSpec {
    facts!("Adaptive", Rigid, motion);
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn restarts(&self) -> bool {
        self.composite.is_some()
    }

    /// The terms of the law: desired motion, errors `e` and `e_dot`, references `v_r` and `a_r`, sliding variable `s` and regressor `Y`.
    /// The torque and the rate of the estimate follow, then the terms of composite and concurrent adaptation.
    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.model.n();
        let (p, z) = (self.estimate.len(), at.z);
        let (q, v, desired) = (&at.x[..n], &at.x[n..2 * n], at.desired);
        let e: Vec<f64> = (0..n).map(|i| desired[i] - q[i]).collect();
        let e_dot: Vec<f64> = (0..n).map(|i| desired[n + i] - v[i]).collect();
        let (le, le_dot) = (self.lambda.times(&e), self.lambda.times(&e_dot));
        let v_r: Vec<f64> = (0..n).map(|i| desired[n + i] + le[i]).collect();
        let a_r: Vec<f64> = (0..n).map(|i| desired[2 * n + i] + le_dot[i]).collect();
        let s: Vec<f64> = (0..n).map(|i| v_r[i] - v[i]).collect();
        let all = self.model.parameter_count();
        let mut full = vec![0.0; n * all];
        self.model.at(q).regressor(v, &v_r, &a_r, &mut full);
        let beside = self.joint_entries(&v_r, &a_r);
        let column = |i: usize, k: usize| if k % n == i { beside[k] } else { 0.0 };
        let y: Vec<f64> = (0..n)
            .flat_map(|i| {
                let row = &full[i * all..(i + 1) * all];
                let own: Vec<f64> = match &self.base {
                    None => row.to_vec(),
                    Some(base) => base.columns.iter().map(|&column| row[column]).collect(),
                };
                own.into_iter().chain((0..beside.len()).map(move |k| column(i, k)))
            })
            .collect();
        let known = if self.columns.has(JointColumn::Armature) { vec![0.0; n] } else { self.model.armature() };
        let (kd_s, armature) = (self.kd.times(&s), known);
        let tau: Vec<f64> = (0..n).map(|i| (0..p).map(|j| y[i * p + j] * z[j]).sum::<f64>() + kd_s[i] + armature[i] * a_r[i]).collect();
        let mut law = self.build::<f64>();
        let mut rate = vec![0.0; z.len()];
        law.evaluate(desired, at.trig, at.x, z, &mut vec![0.0; n], &mut rate);
        rate.truncate(p);
        let mut terms = vec![
            ("q_d", vec![n], desired[..n].to_vec()),
            ("v_d", vec![n], desired[n..2 * n].to_vec()),
            ("a_d", vec![n], desired[2 * n..].to_vec()),
            ("e", vec![n], e),
            ("e_dot", vec![n], e_dot),
            ("v_r", vec![n], v_r),
            ("a_r", vec![n], a_r),
            ("s", vec![n], s),
            ("Y", vec![n, p], y),
            ("tau", vec![n], tau),
            ("estimate_rate", vec![p], rate),
        ];
        if let Some([w, tau_w, e_w]) = self.filtered(at.trig, at.x, z) {
            terms.extend([("W", vec![n, p], w), ("tau_W", vec![n], tau_w), ("e_W", vec![n], e_w)]);
        }
        if let Some(errors) = self.stored_errors(&z[..p]) {
            terms.push(("e_stored", vec![errors.len() / n, n], errors));
        }
        terms
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
pub struct AnyAdaptive<S: Real> {
    law: Adaptive<S>,
    /// Known rotor inertias, `(n,)`; empty if there are none.
    armature: Vec<S>,
    columns: Vec<usize>,
    /// The gain `gamma` of each body, then of each parameter of a joint column; empty in the Euclidean metric.
    natural: Vec<S>,
    /// All inertial parameters: the estimate in the entries of the base set, and zero in the other entries. Empty without a base set.
    full: Vec<S>,
    /// The entries of the base set in `Y' s`, the product of the transposed regressor and the sliding variable.
    kept: Vec<S>,
    projector: Option<Projector<S>>,
    /// The buffers of joint columns, restraint, and composite or concurrent adaptation; `None` for the plain adaptation.
    more: Option<More<S>>,
}

/// The optional parts of an adaptive law: joint columns, restraint (leakage and dead zone), and composite or concurrent adaptation.
struct More<S> {
    joints: LoopColumns<S>,
    restraint: LoopRestraint<S>,
    composite: Option<LoopComposite<S>>,
    concurrent: Option<LoopConcurrent<S>>,
    /// The entries of the joint columns of the regressor `Y`.
    entries: Vec<S>,
    /// The product `y = Y' s` of the transposed regressor and the sliding variable, `(p,)`.
    y: Vec<S>,
    /// The vector `w` that replaces `y` in the rate of the estimate, `(p,)`. It is empty without restraint, composite and concurrent
    /// adaptation.
    w: Vec<S>,
    /// The difference `y - w`, `(p,)`; empty if `w` is empty.
    back: Vec<S>,
}

impl<S: Real> More<S> {
    fn new(spec: &AdaptiveSpec) -> Self {
        let zeros = |k: usize| vec![S::zero(); k];
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
    pub(super) fn build<S: Real>(&self) -> AnyAdaptive<S> {
        let zeros = |k: usize| vec![S::zero(); k];
        let (gamma, natural) = match &self.adaptation {
            Adaptation::Euclidean(gamma) => (gamma, Vec::new()),
            Adaptation::Natural(gammas) => (&Gain::unchecked(1, vec![1.0]), gammas.iter().map(|&gamma| S::varying(gamma)).collect()),
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
            armature: if known { armature.into_iter().map(S::fixed).collect() } else { Vec::new() },
            full: zeros(if columns.is_empty() { 0 } else { self.model.parameter_count() }),
            kept: zeros(columns.len()),
            projector: self.projection.as_ref().map(|projection| Projector::new(projection, self.estimate.len())),
            columns,
            natural,
            more: (!self.is_plain()).then(|| More::new(self)),
        }
    }
}

impl<S: Real> AnyAdaptive<S> {
    /// Compute the torque for the estimate `z` of the bodies, plus the torque of known rotors. The law stores `Y' s`, the product of the
    /// transposed regressor and the sliding variable.
    fn torque(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S]) {
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
    fn evaluate_more(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
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

    /// Compute the rates of the estimate in the natural metric: of each body, then of each parameter of a joint column.
    fn natural_rates(&self, z: &[S], w: &[S], dz: &mut [S]) {
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

impl<S: Real> Law<S> for AnyAdaptive<S> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        if self.more.is_some() {
            return self.evaluate_more(desired, trig, x, z, tau, dz);
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
    }

    fn restart(&mut self, trig: &[(S, S)], x: &[S], z: &mut [S]) {
        let n = self.law.s.len();
        if let Some(More { composite: Some(composite), joints, y, .. }) = &mut self.more {
            composite.evaluate(&self.law.arm, &mut self.law.workspace, joints, trig, x);
            composite.begin(&x[n..2 * n], &mut z[y.len()..]);
        }
    }

    fn dissipation(&self) -> S {
        self.law.dissipation()
    }

    fn dissipation_of(&self, truth: &Truth<S>, friction: Option<&[S]>, x: &[S], z: &[S]) -> S {
        let Some(more) = &self.more else { return self.dissipation() };
        let n = self.law.s.len();
        self.dissipation() - truth.added([&self.law.s, &x[n..2 * n], &self.law.a_r], friction, &more.entries, z, &more.back)
    }
}
