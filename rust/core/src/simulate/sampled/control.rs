//! The input of a loop: the output of the law at its last evaluation, or the output that a sampled controller holds.

use crate::scalar::Real;

/// Limit each entry of `tau` to its limit. Without limits, nothing happens.
pub fn saturate(tau: &mut [f64], limits: &[f64]) {
    for (tau, &limit) in tau.iter_mut().zip(limits) {
        *tau = Real::clamped(*tau, -limit, limit);
    }
}

/// The plant's input and the other results of the law.
pub struct Control {
    /// Whether the input is held.
    pub held: bool,
    /// The plant's input: the saturated output of the law, the output that the sampler selected, or the input of the caller.
    pub tau: Vec<f64>,
    /// The other results of the law that belong to `tau`: the rate of its state, then its dissipation if that is monitored.
    pub dz: Vec<f64>,
}

impl Control {
    /// Return the control of a loop with `n` inputs and `p` other results of the law.
    pub fn new(held: bool, [n, p]: [usize; 2]) -> Self {
        Control { held, tau: vec![0.0; n], dz: vec![0.0; p] }
    }
}
