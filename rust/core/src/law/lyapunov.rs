//! The Lyapunov function of the adaptive laws. It uses the true parameters `a` of the plant:
//!
//! `V1 = s' M s / 2 + (a - a_hat)' Gamma^-1 (a - a_hat) / 2`, or in the natural metric `s' M s / 2 + sum d(P || P_hat) / gamma` plus
//! `(a_k - a_hat_k)^2 / (2 gamma_k)` of each parameter `a_k` of a joint column. `s` is the sliding variable, `M` the mass matrix, `a_hat`
//! the estimate, `P` the pseudo-inertia of a body and `d` a divergence.

use super::{Adaptation, LawSpec};
use crate::dynamics::ArmAt;
use crate::linalg::gain::AnyGain;
use crate::plant::PlantSpec;
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::divergence;

/// The metric of the distance between an estimate and the true parameters.
enum EstimateMetric<S> {
    /// The diagonal of the gain `Gamma`.
    Diagonal(Vec<S>),
    /// The inverse gain `Gamma^-1`.
    Full(AnyGain<S>),
    /// The gain `gamma` of each body, then of each parameter of a joint column.
    Natural(Vec<S>),
}

/// The Lyapunov function of a law in a control loop.
pub struct Lyapunov<S: Real> {
    lambda: AnyGain<S>,
    metric: EstimateMetric<S>,
    /// The plant's values of the estimated parameters, `(p,)`.
    truth: Vec<S>,
    e: Vec<S>,
    s: Vec<S>,
    mass: Vec<S>,
    error: Vec<S>,
}

impl<S: Real> Lyapunov<S> {
    /// The Lyapunov function of `law` on `plant`. `None` for a law without adaptation.
    pub fn new(law: &LawSpec, plant: &PlantSpec) -> Option<Self> {
        let law = law.adaptive()?;
        let metric = match &law.adaptation {
            Adaptation::Euclidean(gamma) if gamma.is_diagonal() => {
                EstimateMetric::Diagonal((0..gamma.n()).map(|i| S::varying(gamma.at(i, i))).collect())
            }
            Adaptation::Euclidean(gamma) => EstimateMetric::Full(AnyGain::new(&gamma.inverse())),
            Adaptation::Natural(gammas) => EstimateMetric::Natural(gammas.iter().map(|&gamma| S::varying(gamma)).collect()),
        };
        let truth: Vec<S> = law.truth(plant).into_iter().map(S::varying).collect();
        let n = law.model.n();
        let zeros = |k: usize| vec![S::zero(); k];
        Some(Lyapunov {
            lambda: AnyGain::new(&law.lambda),
            metric,
            e: zeros(n),
            s: zeros(n),
            mass: zeros(n * n),
            error: zeros(truth.len()),
            truth,
        })
    }

    /// Compute the Lyapunov function `V1`, J, for the desired motion, at `q`, `v` and the estimate. The arm `links` must already be at `q`.
    pub fn value(&mut self, desired: &[S], links: &mut ArmAt<S>, q: &[S], v: &[S], estimate: &[S]) -> S {
        let n = self.e.len();
        for i in 0..n {
            self.e[i] = desired[i] - q[i];
        }
        self.lambda.multiply(&self.e, &mut self.s);
        for i in 0..n {
            self.s[i] = desired[n + i] - v[i] + self.s[i];
        }
        links.mass_matrix(&mut self.mass);
        let mut kinetic = S::zero();
        for i in 0..n {
            let mut row = S::zero();
            for j in 0..n {
                row = self.mass[n * i + j].mul_add(self.s[j], row);
            }
            kinetic = self.s[i].mul_add(row, kinetic);
        }
        for (error, (&a, &a_hat)) in self.error.iter_mut().zip(self.truth.iter().zip(estimate)) {
            *error = a - a_hat;
        }
        let half = S::splat(0.5);
        let rest = match &self.metric {
            EstimateMetric::Diagonal(gamma) => {
                let mut sum = S::zero();
                for (&error, &gamma) in self.error.iter().zip(gamma) {
                    sum = error.mul_add(error / gamma, sum);
                }
                half * sum
            }
            EstimateMetric::Full(inverse) => half * inverse.quadratic(&self.error),
            EstimateMetric::Natural(gamma) => natural(gamma, &self.truth, &self.error, estimate),
        };
        half.mul_add(kinetic, rest)
    }
}

/// The sum over the bodies of `d(P || P_hat) / gamma`, plus the sum over the other parameters of `(a_k - a_hat_k)^2 / (2 gamma_k)`.
fn natural<S: Real>(gamma: &[S], truth: &[S], error: &[S], estimate: &[S]) -> S {
    let bodies = (truth.len() - gamma.len()) / (PARAMETERS - 1);
    let ((pi, _), (pi_hat, _)) = (truth.as_chunks::<PARAMETERS>(), estimate.as_chunks::<PARAMETERS>());
    let pairs = pi.iter().zip(pi_hat).zip(&gamma[..bodies]);
    let sum = pairs.fold(S::zero(), |sum, ((pi, pi_hat), &gamma)| sum + divergence(pi, pi_hat) / gamma);
    let beside = error[PARAMETERS * bodies..].iter().zip(&gamma[bodies..]);
    beside.fold(sum, |sum, (&error, &gamma)| (S::splat(0.5) * error).mul_add(error / gamma, sum))
}
