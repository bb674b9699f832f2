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
use crate::trace::Sym;

/// The metric of the distance between an estimate and the true parameters.
enum EstimateMetric {
    /// The diagonal of the gain `Gamma`.
    Diagonal(Vec<Sym>),
    /// The inverse gain `Gamma^-1`.
    Full(AnyGain<Sym>),
    /// The gain `gamma` of each body, then of each parameter of a joint column.
    Natural(Vec<Sym>),
}

/// The Lyapunov function of a law in a control loop.
pub struct Lyapunov {
    lambda: AnyGain<Sym>,
    metric: EstimateMetric,
    /// The plant's values of the estimated parameters, `(p,)`.
    truth: Vec<Sym>,
    e: Vec<Sym>,
    s: Vec<Sym>,
    mass: Vec<Sym>,
    error: Vec<Sym>,
}

impl Lyapunov {
    /// The Lyapunov function of `law` on `plant`. `None` for a law without adaptation.
    pub fn new(law: &LawSpec, plant: &PlantSpec) -> Option<Self> {
        let law = law.adaptive()?;
        let metric = match &law.adaptation {
            Adaptation::Euclidean(gamma) if gamma.is_diagonal() => {
                EstimateMetric::Diagonal((0..gamma.n()).map(|i| Sym::varying(gamma.at(i, i))).collect())
            }
            Adaptation::Euclidean(gamma) => EstimateMetric::Full(AnyGain::new(&gamma.inverse())),
            Adaptation::Natural(gammas) => EstimateMetric::Natural(gammas.iter().map(|&gamma| Sym::varying(gamma)).collect()),
        };
        let truth: Vec<Sym> = law.truth(plant).into_iter().map(Sym::varying).collect();
        let n = law.model.n();
        let zeros = |k: usize| vec![Sym::zero(); k];
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
    pub fn value(&mut self, desired: &[Sym], links: &mut ArmAt<Sym>, q: &[Sym], v: &[Sym], estimate: &[Sym]) -> Sym {
        let n = self.e.len();
        for i in 0..n {
            self.e[i] = desired[i] - q[i];
        }
        self.lambda.multiply(&self.e, &mut self.s);
        for i in 0..n {
            self.s[i] = desired[n + i] - v[i] + self.s[i];
        }
        links.mass_matrix(&mut self.mass);
        let mut kinetic = Sym::zero();
        for i in 0..n {
            let mut row = Sym::zero();
            for j in 0..n {
                row = self.mass[n * i + j].mul_add(self.s[j], row);
            }
            kinetic = self.s[i].mul_add(row, kinetic);
        }
        for (error, (&a, &a_hat)) in self.error.iter_mut().zip(self.truth.iter().zip(estimate)) {
            *error = a - a_hat;
        }
        let half = Sym::splat(0.5);
        let rest = match &self.metric {
            EstimateMetric::Diagonal(gamma) => {
                let mut sum = Sym::zero();
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
fn natural(gamma: &[Sym], truth: &[Sym], error: &[Sym], estimate: &[Sym]) -> Sym {
    let bodies = (truth.len() - gamma.len()) / (PARAMETERS - 1);
    let ((pi, _), (pi_hat, _)) = (truth.as_chunks::<PARAMETERS>(), estimate.as_chunks::<PARAMETERS>());
    let pairs = pi.iter().zip(pi_hat).zip(&gamma[..bodies]);
    let sum = pairs.fold(Sym::zero(), |sum, ((pi, pi_hat), &gamma)| sum + divergence(pi, pi_hat) / gamma);
    let beside = error[PARAMETERS * bodies..].iter().zip(&gamma[bodies..]);
    beside.fold(sum, |sum, (&error, &gamma)| (Sym::splat(0.5) * error).mul_add(error / gamma, sum))
}
