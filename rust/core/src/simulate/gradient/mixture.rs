//! Directions along which tangents are computed: the parameters themselves, or linear combinations of them, for the control of the errors
//! of the tangents.
//!
//! The tangent along `d_k = sum_j w_jk p_j` is `sum_j w_jk S_j`. If there are few parameters, `d_j` is parameter `j` in units of its
//! magnitude. Otherwise the weights of all magnitudes have random signs. The expected square of the error along such a direction is the sum
//! of the squares over all parameters. So a few random directions represent the errors of many parameters.

use super::parameters::Parameter;
use super::prepared::Prepared;
use crate::error::Result;
use crate::memory;
use crate::simulate::problem::sampling::gaussian;
use std::borrow::Cow;

/// The largest number of combinations.
const COMBINATIONS: usize = 7;
/// The finite differences that compute the derivatives of the loop parameters have steps of about this part of the parameter.
const DIFFERENCE_STEP: f64 = 1.0 / 1024.0;
/// The seed of the random signs.
const SEED: u64 = 0;

/// The tangents of the loop parameters and of the initial state along `count` directions.
pub struct Mixture<'a> {
    pub count: usize,
    /// The weights of the parameters, shape `(parameters, count)`. `None`: the directions are the parameters.
    weights: Option<Vec<f64>>,
    /// The tangents of the varying loop parameters, shape `(moved, count)`.
    pub set_up: Cow<'a, [f64]>,
    /// The tangents of the initial state, shape `(states, count)`.
    pub start: Cow<'a, [f64]>,
}

/// The magnitude of a parameter, in its unit. The weights of a finite difference are about the inverse of its step.
fn magnitude(parameter: &Parameter) -> f64 {
    let largest = parameter.iter().fold(0.0f64, |most, &(_, weight)| most.max(weight.abs()));
    if largest > 0.0 { 1.0 / (DIFFERENCE_STEP * largest) } else { 1.0 }
}

impl<'a> Mixture<'a> {
    /// One direction per parameter.
    pub fn parameters(prepared: &'a Prepared) -> Self {
        let directions = &prepared.directions;
        let (set_up, start) = (Cow::Borrowed(&directions.set_up[..]), Cow::Borrowed(&prepared.start[..]));
        Mixture { count: directions.count, weights: None, set_up, start }
    }

    /// A few combinations of the parameters, in units of their magnitudes. The last direction is not a combination. The tangents of the
    /// loop parameters along it are zero. The caller chooses the tangent of the state.
    pub fn combinations(prepared: &'a Prepared, parameters: &[Parameter]) -> Result<Self> {
        let (all, used) = (parameters.len(), parameters.len().min(COMBINATIONS));
        let count = used + 1;
        let mut weights = memory::zeros(all * count)?;
        for (j, (parameter, row)) in parameters.iter().zip(weights.chunks_exact_mut(count)).enumerate() {
            for (k, weight) in row[..used].iter_mut().enumerate() {
                let sign = gaussian(SEED, j as u64, k as u64).signum();
                *weight = magnitude(parameter) * if all > used { sign } else { f64::from(u8::from(j == k)) };
            }
        }
        let mixed = |rates: &[f64]| -> Result<Cow<'a, [f64]>> {
            let mut out = memory::zeros(rates.len() / all.max(1) * count)?;
            for (rates, out) in rates.chunks_exact(all.max(1)).zip(out.chunks_exact_mut(count)) {
                for (rate, weights) in rates.iter().zip(weights.chunks_exact(count)) {
                    out.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * rate);
                }
            }
            Ok(Cow::Owned(out))
        };
        let (set_up, start) = (mixed(&prepared.directions.set_up)?, mixed(&prepared.start)?);
        Ok(Mixture { count, weights: Some(weights), set_up, start })
    }

    /// The directions that contain parameter `p`, with its weights.
    pub fn parts(&self, p: usize) -> impl Iterator<Item = (usize, f64)> {
        let (first, weights) = match &self.weights {
            None => (p, &[1.0][..]),
            Some(all) => (0, &all[p * self.count..(p + 1) * self.count]),
        };
        weights.iter().enumerate().map(move |(i, &weight)| (first + i, weight))
    }
}
