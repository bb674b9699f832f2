//! One sample of a momentum observer, on any number type:
//!
//! ```text
//! p = M v of the links, or p = B v of the motors;   drift = C' v - g - tau_f, so that p_dot = tau + tau_ext + drift
//! r <- (I + K dt)^-1 (r + K (p - p_last - (tau + drift_last) dt))                  the residual, an estimate of the external torque
//! ```

use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::linalg::cholesky::solve;
use crate::linalg::{AnyGain, Gain};
use crate::scalar::{Real, sign};

/// The momentum of the links or of the motors, with its buffers.
pub struct Momentum<S: Real> {
    arm: AnyArm<S>,
    ws: Workspace<S>,
    trig: Vec<(S, S)>,
    /// Motor inertia `B` if the motors are observed; `None` for the links.
    motors: Option<AnyGain<S>>,
    /// Known viscous friction, N m s/rad or N s/m, and Coulomb friction, N m or N, `(n,)` each.
    friction: [Vec<S>; 2],
    mass: Vec<S>,
    coriolis: Vec<S>,
}

impl<S: Real> Momentum<S> {
    /// Create the momentum of the links of `model`, or of motors with the inertia `motors`. `friction` is the known friction.
    pub fn new(model: &Model, motors: Option<&Gain>, friction: &[Vec<f64>; 2]) -> Self {
        let n = model.n();
        let rows = |values: &Vec<f64>| values.iter().map(|&x| S::varying(x)).collect();
        let arm = AnyArm::new(model);
        Momentum {
            ws: arm.workspace(),
            arm,
            trig: vec![(S::zero(), S::splat(1.0)); n],
            motors: motors.map(AnyGain::new),
            friction: friction.each_ref().map(rows),
            mass: vec![S::zero(); n * n],
            coriolis: vec![S::zero(); n * n],
        }
    }

    /// Write the geometric Jacobian of a frame at `q`, `(6, n)`, to `j`.
    pub fn jacobian(&mut self, q: &[S], frame: usize, j: &mut [S]) {
        let Momentum { arm, ws, trig, .. } = self;
        trig.iter_mut().zip(q).for_each(|(trig, q)| *trig = q.sin_cos());
        arm.jacobian(ws, trig, q, frame, j);
    }

    /// Compute the momentum `p` and the drift `C' v - g - tau_f` at `q` and `v`, `(n,)` each. For motors, `drift` does not change.
    pub fn momentum_and_drift(&mut self, q: &[S], v: &[S], momentum: &mut [S], drift: &mut [S]) {
        if let Some(inertia) = &self.motors {
            return inertia.multiply(v, momentum);
        }
        let Momentum { arm, ws, trig, .. } = self;
        trig.iter_mut().zip(q).for_each(|(trig, q)| *trig = q.sin_cos());
        arm.mass_matrix(ws, trig, q, &mut self.mass);
        for (p, row) in momentum.iter_mut().zip(self.mass.chunks_exact(v.len())) {
            *p = row.iter().zip(v).map(|(&m, &v)| m * v).reduce(|sum, product| sum + product).unwrap_or(S::zero());
        }
        arm.gravity(ws, trig, q, drift);
        let [viscous, coulomb] = &self.friction;
        for (i, drift) in drift.iter_mut().enumerate() {
            *drift = -*drift - viscous[i] * v[i] - coulomb[i] * sign(v[i]);
        }
        arm.coriolis_matrix(ws, trig, q, v, &mut self.coriolis);
        for (row, &v) in self.coriolis.chunks_exact(v.len()).zip(v) {
            for (drift, &c) in drift.iter_mut().zip(row) {
                *drift += v * c;
            }
        }
    }
}

/// The momentum and the drift at the last sample, and the momentum at the present sample.
pub struct Gained<'a, S> {
    /// Momentum `p` at the last sample, `(n,)`, kg m^2/s or kg m/s.
    pub momentum: &'a [S],
    /// Drift `C' v - g - tau_f` at the last sample, `(n,)`, N m or N.
    pub drift: &'a [S],
    /// Momentum `p` at the present sample, `(n,)`, kg m^2/s or kg m/s.
    pub now: &'a [S],
}

impl<S: Real> Gained<'_, S> {
    /// Update the residual from the last sample to this one, `dt` later. The correction is the change of momentum that `tau` and the drift
    /// do not explain.
    ///
    /// `factor` is the diagonal of `I + K dt`, or its Cholesky factor. `work` has `n` numbers.
    pub fn correct(&self, (gain, factor): (&AnyGain<S>, &[S]), (tau, dt): (&[S], S), work: &mut [S], residual: &mut [S]) {
        for (i, gained) in work.iter_mut().enumerate() {
            *gained = self.now[i] - self.momentum[i] - (tau[i] + self.drift[i]) * dt;
        }
        gain.add_to(work, residual);
        match gain {
            AnyGain::Diagonal(_) => residual.iter_mut().zip(factor).for_each(|(r, &f)| *r = *r / f),
            AnyGain::Full(_) => solve(residual.len(), factor, residual),
        }
    }
}
