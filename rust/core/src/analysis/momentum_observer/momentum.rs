//! A sample of an observer on any number: momentum, what of its rate is known, and the correction of the residual.

use crate::dynamics::{ArmAt, Model};
use crate::linalg::cholesky::solve;
use crate::linalg::gain::Multiply;
use crate::linalg::{AnyGain, Gain};
use crate::scalar::{Real, sign};

/// The momentum of the links, or of the motors.
pub struct Momentum<S: Real> {
    pub arm: ArmAt<S>,
    /// The inertia of the motors, where they are observed.
    motors: Option<AnyGain<S>>,
    /// Viscous and Coulomb friction that is known.
    friction: [Vec<S>; 2],
    mass: Vec<S>,
    coriolis: Vec<S>,
}

impl<S: Real> Momentum<S> {
    pub fn new(model: &Model, motors: Option<&Gain>, friction: &[Vec<f64>; 2]) -> Self {
        let n = model.n();
        let rows = |values: &Vec<f64>| values.iter().map(|&x| S::from_lanes(|_| x)).collect();
        Momentum {
            arm: ArmAt::of_lanes(|_| model),
            motors: motors.map(|inertia| AnyGain::from_lanes(|_| inertia)),
            friction: friction.each_ref().map(rows),
            mass: vec![S::zero(); n * n],
            coriolis: vec![S::zero(); n * n],
        }
    }

    /// `p` and `C' v - g - tau_f` at `q` and `v`; the latter stays as it is for motors.
    pub fn look(&mut self, q: &[S], v: &[S], momentum: &mut [S], drift: &mut [S]) {
        if let Some(inertia) = &self.motors {
            return inertia.multiply(v, momentum);
        }
        self.arm.move_to(q);
        self.arm.mass_matrix(&mut self.mass);
        for (p, row) in momentum.iter_mut().zip(self.mass.chunks_exact(v.len())) {
            *p = row.iter().zip(v).map(|(&m, &v)| m * v).reduce(|sum, product| sum + product).unwrap_or(S::zero());
        }
        self.arm.gravity(drift);
        let [viscous, coulomb] = &self.friction;
        for (i, drift) in drift.iter_mut().enumerate() {
            *drift = -*drift - viscous[i] * v[i] - coulomb[i] * sign(v[i]);
        }
        self.arm.coriolis_matrix(v, &mut self.coriolis);
        for (row, &v) in self.coriolis.chunks_exact(v.len()).zip(v) {
            for (drift, &c) in drift.iter_mut().zip(row) {
                *drift += v * c;
            }
        }
    }
}

/// The known quantities of a momentum: `p` and `C' v - g - tau_f` at the last sample, and `p` at the present one.
pub struct Gained<'a, S> {
    pub momentum: &'a [S],
    pub drift: &'a [S],
    pub now: &'a [S],
}

impl<S: Real> Gained<'_, S> {
    /// From the residual of the last sample to this one, by the gain of momentum in `dt` that the known torques do not explain.
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
