//! A guarded law in a control loop, with the equations of [`super::guarded`].

use super::definition::{Law, Shape};
use super::guarded::{GuardedSpec, Reaction};
use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::{Real, labelled_numbers, sign};
use crate::trace::Sym;

impl GuardedSpec {
    pub(super) fn build(&self) -> Guarded {
        let n = self.model.n();
        let arm = AnyArm::new(&self.model);
        let (stiffness, damping) = self.reaction.as_ref().map_or((None, None), Reaction::gains);
        let [viscous, coulomb] = &self.friction;
        let retreat = if let Some(Reaction::Retract(_, _, speed, duration)) = &self.reaction {
            Some([("reaction_speed", *speed), ("reaction_duration", *duration)])
        } else {
            None
        };
        Guarded {
            inner: self.inner.build(),
            own: self.inner.initial_state().len(),
            workspace: arm.workspace(),
            arm,
            gain: AnyGain::labelled("observer_gain", &self.gain),
            continuous_gain: self.gain.clone(),
            viscous: labelled_numbers("observer_damping", viscous),
            coulomb: labelled_numbers("observer_friction", coulomb),
            springs: self.joint_stiffness.as_ref().map(|stiffness| AnyGain::labelled("law_joint_stiffness", stiffness)),
            thresholds: if self.reacts() { labelled_numbers("threshold", &self.thresholds) } else { Vec::new() },
            stiffness: stiffness.map(|gain| AnyGain::labelled("reaction_stiffness", gain)),
            damping: damping.map(|gain| AnyGain::labelled("reaction_damping", gain)),
            retreat: retreat.map(|numbers| numbers.map(|(name, x)| Sym::labelled(name, 0, || Sym::varying(x)))),
            limits: Vec::new(),
            mass: vec![Sym::zero(); n * n],
            coriolis: vec![Sym::zero(); n * n],
            momentum: vec![Sym::zero(); n],
            gravity: vec![Sym::zero(); n],
            residual: vec![Sym::zero(); n],
            observed: vec![Sym::zero(); n],
            work: vec![Sym::zero(); n],
            push: vec![Sym::zero(); n],
            reaction: vec![Sym::zero(); n],
            reacting: Sym::zero(),
        }
    }
}

impl Shape for GuardedSpec {
    fn same_shape(&self, other: &Self) -> bool {
        let alike = match (&self.reaction, &other.reaction) {
            (Some(Reaction::Float(one)), Some(Reaction::Float(two))) => one.is_some() == two.is_some(),
            (Some(one), Some(two)) => std::mem::discriminant(one) == std::mem::discriminant(two),
            (one, two) => one.is_none() && two.is_none(),
        };
        alike && self.inner.same_shape(&other.inner) && self.model.same_geometry(&other.model)
    }
}

/// A guarded law in a control loop.
pub struct Guarded {
    inner: Box<dyn Law + Send>,
    /// Length of the state of the inner law.
    own: usize,
    arm: AnyArm<Sym>,
    workspace: Workspace<Sym>,
    /// Observer gain, 1/s: `K` in a continuous loop, `K_T = K (I + K T)^-1` in a sampled loop with the sample time `T`.
    gain: AnyGain<Sym>,
    /// Observer gain `K`, from which `gain` is computed.
    continuous_gain: Gain,
    viscous: Vec<Sym>,
    coulomb: Vec<Sym>,
    /// Joint stiffness `K_J` of an elastic arm, N m/rad or N/m; `None` for a rigid arm.
    springs: Option<AnyGain<Sym>>,
    /// Thresholds of contact, `(n,)`; empty without a reaction.
    thresholds: Vec<Sym>,
    stiffness: Option<AnyGain<Sym>>,
    damping: Option<AnyGain<Sym>>,
    /// Speed `V` (rad/s or m/s) and duration (s) of a retreat.
    retreat: Option<[Sym; 2]>,
    /// Limits of the plant's input, `(n,)`, N m or N; empty without limits.
    limits: Vec<Sym>,
    mass: Vec<Sym>,
    coriolis: Vec<Sym>,
    pub(super) momentum: Vec<Sym>,
    gravity: Vec<Sym>,
    pub(super) residual: Vec<Sym>,
    /// The torque that the observer uses as `tau`, `(n,)`, N m or N.
    observed: Vec<Sym>,
    work: Vec<Sym>,
    push: Vec<Sym>,
    reaction: Vec<Sym>,
    /// 1 from the sample of contact on, else 0.
    pub(super) reacting: Sym,
}

impl Guarded {
    /// Compute the momentum `p` and the gravity torque `g` at the plant's state `x`.
    fn look(&mut self, trig: &[(Sym, Sym)], x: &[Sym]) {
        let n = self.momentum.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        self.arm.mass_matrix(&mut self.workspace, trig, q, &mut self.mass);
        for (p, row) in self.momentum.iter_mut().zip(self.mass.chunks_exact(n)) {
            *p = row.iter().zip(v).fold(Sym::zero(), |sum, (&m, &v)| m.mul_add(v, sum));
        }
        self.arm.gravity(&mut self.workspace, trig, q, &mut self.gravity);
    }

    /// Detect contact, and compute the torque of the reaction. `z` and `dz` are the part of the law's state that starts with `c`, and its
    /// rate.
    fn react(&mut self, x: &[Sym], z: &[Sym], tau: &mut [Sym], dz: &mut [Sym]) {
        let n = tau.len();
        let at = if self.springs.is_some() { 2 * n } else { 0 };
        let (y, y_dot) = (&x[at..at + n], &x[at + n..at + 2 * n]);
        let (zero, one) = (Sym::zero(), Sym::splat(1.0));
        let level = self.residual.iter().zip(&self.thresholds).fold(zero, |most, (&r, &limit)| most.max(r.abs() / limit));
        let (count, elapsed) = (z[0], z[1]);
        let before = zero.lt(count);
        let first = Sym::select(before, zero, Sym::select(one.lt(level), one, zero));
        let hot = Sym::select(before, one, first);
        let reacting = zero.lt(hot);
        let whole = Sym::select(before, count, one);

        self.reaction.copy_from_slice(&self.gravity);
        for i in 0..n {
            self.work[i] = Sym::select(before, z[2 + i] / whole, y[i]) - y[i];
            self.push[i] = -y_dot[i];
        }
        if let Some([speed, duration]) = self.retreat {
            // At the sample of contact, `r_c` is the residual of this sample.
            let latched = |i: usize| Sym::select(before, z[2 + n + i], self.residual[i]);
            let most = (0..n).fold(zero, |most, i| most.max(latched(i).abs()));
            let most = Sym::select(zero.lt(most), most, one);
            let (travel, rate) = (speed * elapsed.min(duration), Sym::select(elapsed.lt(duration), speed, zero));
            for i in 0..n {
                let along = latched(i) / most;
                self.work[i] = travel.mul_add(along, self.work[i]);
                self.push[i] = rate.mul_add(along, self.push[i]);
            }
        }
        if let Some(stiffness) = &self.stiffness {
            stiffness.add_to(&self.work, &mut self.reaction);
        }
        if let Some(damping) = &self.damping {
            damping.add_to(&self.push, &mut self.reaction);
        }
        for i in 0..n {
            tau[i] = Sym::select(reacting, self.reaction[i], tau[i]);
            dz[2 + i] = first * y[i];
            dz[2 + n + i] = first * self.residual[i];
        }
        (dz[0], dz[1]) = (first, hot);
        self.reacting = hot;
    }
}

impl Law for Guarded {
    fn restart(&mut self, trig: &[(Sym, Sym)], x: &[Sym], z: &mut [Sym]) {
        let (inner, own) = z.split_at_mut(self.own);
        self.inner.restart(trig, x, inner);
        self.look(trig, x);
        own[..self.momentum.len()].copy_from_slice(&self.momentum);
    }

    fn configure(&mut self, period: Option<f64>, limits: &[Sym]) {
        self.inner.configure(period, limits);
        self.limits = limits.to_vec();
        if let Some(period) = period {
            self.gain = AnyGain::labelled("observer_gain", &implicit(&self.continuous_gain, period));
        }
    }

    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], z: &[Sym], tau: &mut [Sym], dz: &mut [Sym]) {
        let n = tau.len();
        let ((inner, own), (inner_rate, own_rate)) = (z.split_at(self.own), dz.split_at_mut(self.own));
        self.inner.evaluate(desired, trig, x, inner, tau, inner_rate);
        self.look(trig, x);
        let (q, v, w) = (&x[..n], &x[n..2 * n], &own[..n]);
        for i in 0..n {
            self.work[i] = self.momentum[i] - w[i];
        }
        self.gain.multiply(&self.work, &mut self.residual);

        if !self.thresholds.is_empty() {
            self.react(x, &own[2 * n..], tau, &mut own_rate[2 * n..]);
            let reacting = Sym::zero().lt(self.reacting);
            for rate in inner_rate {
                *rate = Sym::select(reacting, Sym::zero(), *rate);
            }
        }
        for (tau, &limit) in tau.iter_mut().zip(&self.limits) {
            *tau = tau.clamped(-limit, limit);
        }

        Sym::term("momentum", &[n], || self.momentum.clone());
        Sym::term("residual", &[n], || self.residual.clone());
        Sym::term("reacting", &[1], || vec![self.reacting]);
        // The observer: w_dot = tau - tau_f + C' v - g + r.
        match &self.springs {
            None => self.observed.copy_from_slice(tau),
            Some(springs) => {
                for i in 0..n {
                    self.work[i] = x[2 * n + i] - q[i];
                }
                springs.multiply(&self.work, &mut self.observed);
            }
        }
        self.arm.coriolis_matrix(&mut self.workspace, trig, q, v, &mut self.coriolis);
        for i in 0..n {
            let friction = self.coulomb[i].mul_add(sign(v[i]), self.viscous[i] * v[i]);
            let known = self.observed[i] - self.gravity[i] - friction + self.residual[i];
            own_rate[i] = (0..n).fold(known, |sum, k| self.coriolis[k * n + i].mul_add(v[k], sum));
            own_rate[n + i] = self.residual[i];
        }
    }
}

/// The sampled gain `K_T = K (I + K T)^-1` for the sample time `period`, s.
fn implicit(gain: &Gain, period: f64) -> Gain {
    let n = gain.n();
    if gain.is_diagonal() {
        return Gain::unchecked(n, (0..n).map(|i| gain.at(i, i) / gain.at(i, i).mul_add(period, 1.0)).collect());
    }
    let sum = (0..n * n).map(|k| gain.at(k / n, k % n).mul_add(period, f64::from(u8::from(k / n == k % n)))).collect();
    Gain::unchecked(n, sum).solve(gain)
}
