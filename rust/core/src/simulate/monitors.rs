//! The identities that theory promises of a run, at its recorded times:
//!
//! `V1 = s' M s / 2 + (a - a_hat)' Gamma^-1 (a - a_hat) / 2` never increases, and
//! `V1(0) - V1(t) - int s' Kd s = 0`; `dM/dt - 2 C` is skew; `E(t) - E(0) - int tau' v = 0` for the energy `E`.
//!
//! `M`, `a` and `E` are those of the true plant; `dM/dt` comes from dual numbers, so that it does not share
//! its formula with `C`.

use crate::dynamics::{Dynamics, PlanarPr};
use crate::law::{AdaptiveSpec, Gain, LawSpec};
use crate::linalg::cholesky;
use crate::scalar::{Dual, Real};

/// The names of a law's monitors, in the order of [`evaluate`].
pub fn names(law: &LawSpec) -> &'static [&'static str] {
    match law {
        LawSpec::Adaptive(_) => &["skewness", "energy", "energy_balance", "lyapunov", "lyapunov_balance"],
        LawSpec::ComputedTorque(_) => &["skewness", "energy", "energy_balance"],
    }
}

/// What the monitors of one run need besides the record.
pub struct Monitor<'a> {
    plant: &'a PlanarPr<f64>,
    law: &'a LawSpec,
    gamma_factor: Vec<f64>,
    /// `E` and `V1` at the first record, each with its integral there.
    start: Option<[f64; 2]>,
}

impl<'a> Monitor<'a> {
    pub fn new(plant: &'a PlanarPr<f64>, law: &'a LawSpec) -> Self {
        let gamma_factor = match law {
            LawSpec::Adaptive(law) => cholesky::factor(law.gamma.n(), &law.gamma.matrix()).unwrap_or_default(),
            LawSpec::ComputedTorque(_) => Vec::new(),
        };
        Monitor { plant, law, gamma_factor, start: None }
    }

    /// The monitors at time `t` and state `x = [q, v, z, int s' Kd s, int tau' v]` into `out`.
    pub fn evaluate(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        let (q, v) = (&x[..2], &x[2..4]);
        let trig = [Real::sin_cos(q[0]), Real::sin_cos(q[1])];
        let quadratures = &x[x.len() - 2..];
        let (kinetic, potential) = self.plant.energy(&mut (), &trig, q, v);
        let energy = kinetic + potential;
        let lyapunov = match self.law {
            LawSpec::Adaptive(law) => self.lyapunov(law, t, q, v, &x[4..x.len() - 2], &trig),
            LawSpec::ComputedTorque(_) => 0.0,
        };
        let start = *self.start.get_or_insert([energy - quadratures[1], lyapunov + quadratures[0]]);
        out[0] = self.skewness(q, v, &trig);
        out[1] = energy;
        out[2] = energy - quadratures[1] - start[0];
        if out.len() > 3 {
            out[3] = lyapunov;
            out[4] = start[1] - lyapunov - quadratures[0];
        }
    }

    /// The largest entry of `N + N'`, `N = dM/dt - 2 C`.
    fn skewness(&self, q: &[f64], v: &[f64], trig: &[(f64, f64)]) -> f64 {
        let arm = PlanarPr::<Dual>::from_lanes(|_| *self.plant);
        let moving: Vec<Dual> = q.iter().zip(v).map(|(&q, &v)| Dual::new(q, v)).collect();
        let moving_trig: Vec<(Dual, Dual)> = moving.iter().map(|q| q.sin_cos()).collect();
        let mut m = [Dual::default(); 4];
        arm.mass_matrix(&mut (), &moving_trig, &moving, &mut m);
        let mut c = [0.0; 4];
        self.plant.coriolis_matrix(&mut (), trig, q, v, &mut c);
        let n = |i: usize, j: usize| m[2 * i + j].rate - 2.0 * c[2 * i + j];
        let mut worst = 0.0f64;
        for i in 0..2 {
            for j in 0..2 {
                let sum = (n(i, j) + n(j, i)).abs();
                // `max` would swallow a NaN.
                worst = if sum <= worst { worst } else { sum };
            }
        }
        worst
    }

    fn lyapunov(&self, law: &AdaptiveSpec, t: f64, q: &[f64], v: &[f64], estimate: &[f64], trig: &[(f64, f64)]) -> f64 {
        let mut desired = [0.0; 6];
        self.law.motion().sample(t, &mut desired);
        let lambda = |gain: &Gain, i: usize, e: [f64; 2]| gain.at(i, 0) * e[0] + gain.at(i, 1) * e[1];
        let e = [desired[0] - q[0], desired[1] - q[1]];
        let s = [0, 1].map(|i| desired[2 + i] - v[i] + lambda(&law.lambda, i, e));
        let mut m = [0.0; 4];
        self.plant.mass_matrix(&mut (), trig, q, &mut m);
        let kinetic = 0.5 * (s[0] * (m[0] * s[0] + m[1] * s[1]) + s[1] * (m[2] * s[0] + m[3] * s[1]));
        let mut truth = [0.0; 3];
        self.plant.parameters(&mut truth);
        let error: Vec<f64> = truth.iter().zip(estimate).map(|(a, a_hat)| a - a_hat).collect();
        let mut weighted = error.clone();
        cholesky::solve(3, &self.gamma_factor, &mut weighted);
        kinetic + 0.5 * error.iter().zip(&weighted).map(|(a, b)| a * b).sum::<f64>()
    }
}
