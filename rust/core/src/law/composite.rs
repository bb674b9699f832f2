//! Composite adaptation (SlotineLi1989): the estimate also follows the error of the filtered dynamics. The filter makes measured
//! accelerations unnecessary.
//!
//! ```text
//! a_hat_dot = Gamma (Y' s + W' R e_W),   e_W = tau_W - W a_hat,   V1_dot = -s' Kd s - e_W' R e_W  where tau_W = W a
//! ```
//!
//! Here `Y` is the regressor, `s` the sliding variable, `a_hat` the estimate of the parameters `a`, `V1` the Lyapunov function, and `'` the
//! transpose. `W` and `tau_W` are the regressor and the torque of the dynamics after the filter `1/(d/dt + lambda)`. With
//! `M v = Y_M(q, v) a` and `g - C' v = Y_D(q, v) a`, the dynamics are `d/dt (M v) = tau + C' v - g`. Integration by parts of the filtered
//! derivative gives:
//!
//! ```text
//! W = Y_M + X,   X_dot = -lambda (Y_M + X) + Y_D,   X(0) = -Y_M(q_0, v_0)
//! ```
//!
//! So `W(0) = 0`. The joint columns of armature are part of `Y_M`, and the joint columns of friction are part of `Y_D`. Known rotor
//! inertias `B` change the torque: `tau_W = X_tau - B v`, `X_tau_dot = -lambda X_tau + tau + lambda B v`.
//!
//! `Y_M = Y(q, 0, 0, v) - Y_g` with `Y_g = Y(q, 0, 0, 0)`. Row `i` of `C' v` is `(Y(q, v, e_i, 0) - Y_g)' v`.
//!
//! Many entries of `Y_M` and `Y_D` are zero at every state. For example, the torque of a joint does not depend on the bodies between it and
//! the base. Where an entry of both `Y_M` and `Y_D` is always zero, `X` remains zero and is not computed.
//!
//! The law's state is the estimate, then `X`, then `X_tau`, `(n,)`. `X` begins with the entries of the `b` estimated parameters of bodies,
//! `(n, b)`. The entries of the joint columns follow.

use super::adaptation::Composite;
use super::adaptive::AdaptiveSpec;
use super::joint_columns::{JointColumn, LoopColumns};
use super::sizes::require_size;
use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::error::{Result, positive};
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::Real;

impl AdaptiveSpec {
    /// Add adaptation from the filtered dynamics. `rate` is the rate `lambda` of the filter, 1/s, and `weight` is the weight `R` of the
    /// error, of size `n`. Errors: `Input` for a rate that is not positive, `WrongShape` for a wrong size.
    pub fn composite(mut self, rate: f64, weight: Gain) -> Result<Self> {
        positive("composite_rate", rate)?;
        require_size("composite", &weight, self.model.n())?;
        self.composite = Some(Composite { rate, weight, present: self.present() });
        self.lengthen();
        Ok(self)
    }

    /// Find the entries of the regressors `Y_M` and `Y_D` that can differ from zero. Both regressors are analytic. So an entry that is zero
    /// at generic states is zero at every state.
    fn present(&self) -> Vec<bool> {
        const STATES: u32 = 3;
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let (n, mut composite) = (self.model.n(), LoopComposite::<f64>::new(self));
        let (arm, joints) = (AnyArm::new(&self.model), LoopColumns::new(&self.columns));
        let mut workspace = arm.workspace();
        let mut found = vec![false; n * composite.bodies];
        for state in 0..STATES {
            let x: Vec<f64> = (1..=2 * n as u32).map(|k| 0.3 + (f64::from(k + 2 * n as u32 * state) * GOLDEN).fract()).collect();
            let trig: Vec<(f64, f64)> = x[..n].iter().map(|q| q.sin_cos()).collect();
            composite.evaluate(&arm, &mut workspace, &joints, &trig, &x);
            for (found, (y_m, y_d)) in found.iter_mut().zip(composite.momentum_and_drift()) {
                *found |= y_m != 0.0 || y_d != 0.0;
            }
        }
        found
    }
}

/// Composite adaptation in a control loop.
pub(super) struct LoopComposite<S> {
    rate: S,
    weight: AnyGain<S>,
    /// Indices of the estimated columns of the regressor `Y`.
    columns: Vec<usize>,
    /// The number `b` of estimated parameters of bodies.
    bodies: usize,
    /// The number of joint columns of armature, which are part of the regressor `Y_M` of the momentum.
    rotors: usize,
    /// Known rotor inertias, `(n,)`; zeros if they are estimated.
    armature: Vec<S>,
    /// Whether each entry of the filtered regressor `W` of the bodies can differ from zero.
    present: Vec<bool>,
    /// The regressor `Y(q, 0, 0, v)` for all parameters.
    momentum: Vec<S>,
    /// The regressor `Y(q, 0, 0, 0)` of the gravity torque for all parameters.
    gravity: Vec<S>,
    /// The product `Y(q, v, e_i, 0)' v` for all parameters, with the unit vector `e_i` of one joint.
    row: Vec<S>,
    /// The estimated columns of the regressor `Y_M` of the momentum `M v`, `(n, b)`.
    y_m: Vec<S>,
    /// The estimated columns of the regressor `Y_D` of the drift `g - C' v`, `(n, b)`.
    y_d: Vec<S>,
    /// The entries of the joint columns in `Y_M` (armature) and `Y_D` (friction).
    entries: Vec<S>,
    /// The filtered regressor `W` of the bodies, `(n, b)`.
    w: Vec<S>,
    /// The entries of the joint columns of the filtered regressor `W`.
    beside: Vec<S>,
    /// The filtered torque `tau_W`, `(n,)`.
    tau: Vec<S>,
    /// The error `e_W = tau_W - W a_hat` of the filtered dynamics, `(n,)`.
    error: Vec<S>,
    /// The weighted error `R e_W`, `(n,)`.
    push: Vec<S>,
    zeros: Vec<S>,
    nothing: Vec<S>,
    unit: Vec<S>,
    unused: Vec<S>,
}

impl<S: Real> LoopComposite<S> {
    pub fn new(spec: &AdaptiveSpec) -> Self {
        let (n, all, beside) = (spec.model.n(), spec.model.parameter_count(), spec.columns.count());
        let bodies = spec.estimate.len() - beside;
        let zeros = |k: usize| vec![S::zero(); k];
        let idle = Composite { rate: f64::NAN, weight: Gain::unchecked(1, vec![1.0]), present: vec![true; n * bodies] };
        let own = spec.composite.as_ref().unwrap_or(&idle);
        let estimated = spec.columns.has(JointColumn::Armature);
        LoopComposite {
            rate: S::labelled("composite_rate", 0, || S::varying(own.rate)),
            weight: AnyGain::labelled("composite", &own.weight),
            columns: spec.base.as_ref().map_or((0..all).collect(), |base| base.columns.clone()),
            bodies,
            rotors: if estimated { n } else { 0 },
            present: own.present.clone(),
            armature: if estimated { zeros(n) } else { spec.model.armature().into_iter().map(S::fixed).collect() },
            momentum: zeros(n * all),
            gravity: zeros(n * all),
            row: zeros(all),
            y_m: zeros(n * bodies),
            y_d: zeros(n * bodies),
            entries: zeros(beside),
            w: zeros(n * bodies),
            beside: zeros(beside),
            tau: zeros(n),
            error: zeros(n),
            push: zeros(n),
            zeros: zeros(n),
            nothing: zeros(all),
            unit: zeros(n),
            unused: zeros(n),
        }
    }

    /// Compute the regressors `Y_M` of the momentum and `Y_D` of the drift, and the entries of the joint columns, at the plant's state `x`.
    pub fn evaluate(&mut self, arm: &AnyArm<S>, ws: &mut Workspace<S>, joints: &LoopColumns<S>, trig: &[(S, S)], x: &[S]) {
        let (n, all) = (self.zeros.len(), self.nothing.len());
        let (q, v, zero) = (&x[..n], &x[n..2 * n], &self.zeros);
        arm.regressor(ws, trig, q, [zero, zero, v], &mut self.momentum);
        arm.regressor(ws, trig, q, [zero; 3], &mut self.gravity);
        for i in 0..n {
            self.unit[i] = S::splat(1.0);
            arm.regressor_products(ws, trig, q, [v, &self.unit, zero], (&self.nothing, &mut self.unused), (v, &mut self.row));
            self.unit[i] = S::zero();
            for (k, &column) in self.columns.iter().enumerate() {
                if !self.present[i * self.bodies + k] {
                    continue;
                }
                let own = self.gravity[i * all + column];
                let weighed = (0..n).fold(S::zero(), |sum, j| v[j].mul_add(self.gravity[j * all + column], sum));
                self.y_m[i * self.bodies + k] = self.momentum[i * all + column] - own;
                self.y_d[i * self.bodies + k] = own - (self.row[column] - weighed);
            }
        }
        joints.fill(v, v, &mut self.entries);
    }

    /// Name the filtered regressor `W`, `(n, p)`, the filtered torque `tau_W`, `(n,)`, and the error `e_W = tau_W - W a_hat`, `(n,)`.
    pub fn name_terms(&self) {
        let (n, bodies) = (self.zeros.len(), self.bodies);
        S::term("W", &[n, bodies + self.beside.len()], || {
            let beside = |i: usize| self.beside.iter().enumerate().map(move |(k, &w)| if k % n == i { w } else { S::zero() });
            (0..n).flat_map(|i| self.w[i * bodies..(i + 1) * bodies].iter().copied().chain(beside(i))).collect()
        });
        S::term("tau_W", &[n], || self.tau.clone());
        S::term("e_W", &[n], || self.error.clone());
    }

    /// The entries of `Y_M` (momentum) and `Y_D` (drift) for the parameters of bodies, in pairs.
    pub fn momentum_and_drift(&self) -> impl Iterator<Item = (S, S)> {
        self.y_m.iter().copied().zip(self.y_d.iter().copied())
    }

    /// The entries of the joint columns in `Y_M` (armature) and `Y_D` (friction).
    pub fn entries(&self) -> &[S] {
        &self.entries
    }

    /// Set the filters `x` to their values at the start of a run, at the velocity `v`.
    pub fn begin(&self, v: &[S], x: &mut [S]) {
        let (of_bodies, rest) = x.split_at_mut(self.y_m.len());
        let (beside, of_tau) = rest.split_at_mut(self.entries.len());
        for (x, &y) in of_bodies.iter_mut().zip(&self.y_m) {
            *x = -y;
        }
        for (x, &entry) in beside[..self.rotors].iter_mut().zip(&self.entries) {
            *x = -entry;
        }
        for ((x, &b), &v) in of_tau.iter_mut().zip(&self.armature).zip(v) {
            *x = b * v;
        }
    }

    /// Compute the filtered regressor `W`, the filtered torque `tau_W` and the error `e_W`, from the estimate and the filters `x`.
    fn compare(&mut self, v: &[S], estimate: &[S], x: &[S]) {
        let (n, bodies) = (self.zeros.len(), self.bodies);
        let (of_bodies, rest) = x.split_at(self.y_m.len());
        let (beside, of_tau) = rest.split_at(self.entries.len());
        for (k, w) in self.w.iter_mut().enumerate() {
            *w = if self.present[k] { self.y_m[k] + of_bodies[k] } else { S::zero() };
        }
        self.beside.copy_from_slice(beside);
        for (w, &entry) in self.beside[..self.rotors].iter_mut().zip(&self.entries) {
            *w += entry;
        }
        for i in 0..n {
            // The product is rounded, as in `begin`, so that the filtered torque starts at exactly zero.
            self.tau[i] = of_tau[i] - self.armature[i] * v[i];
            let row = self.w[i * bodies..(i + 1) * bodies].iter().zip(estimate);
            self.error[i] = row.fold(self.tau[i], |left, (&w, &a)| w.neg_mul_add(a, left));
        }
        for (k, (&w, &a)) in self.beside.iter().zip(&estimate[bodies..]).enumerate() {
            self.error[k % n] = w.neg_mul_add(a, self.error[k % n]);
        }
    }

    /// Add the adaptation from the filtered dynamics, `W' R e_W`, to `w`, and subtract it from `back`. Write the rate of the filters under
    /// the torque `tau` to `dx`. Call [`Self::look`] first, at the same state.
    pub fn push(&mut self, v: &[S], tau: &[S], [estimate, x]: [&[S]; 2], [w, back, dx]: [&mut [S]; 3]) {
        let (n, bodies) = (self.zeros.len(), self.bodies);
        self.compare(v, estimate, x);
        self.weight.multiply(&self.error, &mut self.push);
        for k in 0..estimate.len() {
            let more = if k < bodies {
                (0..n).fold(S::zero(), |sum, i| self.w[i * bodies + k].mul_add(self.push[i], sum))
            } else {
                self.beside[k - bodies] * self.push[(k - bodies) % n]
            };
            w[k] += more;
            back[k] -= more;
        }
        let (of_bodies, rest) = dx.split_at_mut(self.w.len());
        let (beside, of_tau) = rest.split_at_mut(self.beside.len());
        for (k, dx) in of_bodies.iter_mut().enumerate() {
            *dx = if self.present[k] { self.rate.neg_mul_add(self.w[k], self.y_d[k]) } else { S::zero() };
        }
        for (k, dx) in beside.iter_mut().enumerate() {
            let drift = if k < self.rotors { S::zero() } else { self.entries[k] };
            *dx = self.rate.neg_mul_add(self.beside[k], drift);
        }
        for (i, dx) in of_tau.iter_mut().enumerate() {
            *dx = self.rate.neg_mul_add(self.tau[i], tau[i]);
        }
    }
}
