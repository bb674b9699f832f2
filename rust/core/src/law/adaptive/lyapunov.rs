//! The Lyapunov function of the adaptive laws. It uses the true parameters `pi` of the plant:
//!
//! `V1 = s' M s / 2 + (pi - pi_hat)' Gamma^-1 (pi - pi_hat) / 2`, or in the natural metric `s' M s / 2 + sum d(P || P_hat) / gamma` plus
//! `(pi_k - pi_hat_k)^2 / (2 gamma_k)` of each parameter `pi_k` of a joint column. `s` is the sliding variable, `M` the mass matrix,
//! `pi_hat` the estimate, `P` the pseudo-inertia of a body and `d` a divergence.

use super::{Adaptation, AdaptiveSpec};
use crate::dynamics::At;
use crate::law::equations::Sample;
use crate::plant::{Parameters, PlantSpec, PlantState};
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::divergence;
use crate::trace::expression::constant;
use crate::trace::{E, V};

/// The Lyapunov function of a law in a control loop.
pub struct Lyapunov<'a> {
    adaptation: &'a Adaptation,
    numbers: Parameters,
}

impl<'a> Lyapunov<'a> {
    /// The Lyapunov function of an adaptive law in a loop with `plant`.
    pub fn new(law: &'a AdaptiveSpec, plant: &PlantSpec) -> Self {
        let numbers = Parameters::default().gain("lambda", &law.lambda).numbers("plant", &law.truth(plant));
        let numbers = match &law.adaptation {
            Adaptation::Euclidean(gamma) if gamma.is_diagonal() => numbers.numbers("gamma", gamma.to_matrix().diagonal().as_slice()),
            Adaptation::Euclidean(gamma) => numbers.gain("inverse_gamma", &gamma.inverse()),
            Adaptation::Natural(gamma) => numbers.numbers("gamma", gamma),
        };
        Lyapunov { adaptation: &law.adaptation, numbers }
    }

    /// The function `V1`, J, at the law's state `pi_hat`, which begins with the estimate.
    pub fn value(&self, [q_d, v_d, _]: &Sample, arm: &At<E>, x: &PlantState, pi_hat: &V) -> E {
        let s = v_d - &x.v + self.numbers.get_gain("lambda") * &(q_d - &x.q);
        let pi = self.numbers.get_numbers("plant");
        let pi_hat = &pi_hat.rows(0, pi.len()).into_owned();
        let error = pi - pi_hat;
        let kinetic = s.dot(&(arm.mass_matrix() * &s));
        let half = constant(0.5);
        let distance = match self.adaptation {
            Adaptation::Euclidean(gamma) if gamma.is_diagonal() => {
                half * error.dot(&error.component_div(self.numbers.get_numbers("gamma")))
            }
            Adaptation::Euclidean(_) => half * error.dot(&(self.numbers.get_gain("inverse_gamma") * &error)),
            Adaptation::Natural(_) => natural(self.numbers.get_numbers("gamma"), pi, &error, pi_hat),
        };
        half * kinetic + distance
    }
}

/// The distance between estimate and true parameters in the natural metric.
fn natural(gamma: &V, pi: &V, error: &V, pi_hat: &V) -> E {
    let bodies = (pi.len() - gamma.len()) / (PARAMETERS - 1);
    let block = |x: &V, i: usize| -> [E; PARAMETERS] { std::array::from_fn(|k| x[PARAMETERS * i + k]) };
    let of_bodies = (0..bodies).fold(E::zero(), |sum, i| sum + divergence(&block(pi, i), &block(pi_hat, i)) / gamma[i]);
    let (errors, gamma) = (error.rows_range(PARAMETERS * bodies..), gamma.rows_range(bodies..));
    errors.iter().zip(&gamma).fold(of_bodies, |sum, (&error, &gamma)| sum + constant(0.5) * error * (error / gamma))
}
