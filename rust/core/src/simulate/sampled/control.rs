//! The input of a loop: the output of the law at its last evaluation, or the output that a sampled controller holds.

use super::sampler::Sampler;
use crate::scalar::Real;

/// The plant's input and the other results of the law, with the clock of a sampled controller.
pub struct Control<S> {
    /// The clock of a controller that does more than hold the law's output. `None` for other controllers.
    pub sampler: Option<Sampler<S>>,
    /// Whether the input is held.
    pub held: bool,
    /// The plant's input: the saturated output of the law, the output that the sampler selected, or the input of the caller.
    pub tau: Vec<S>,
    /// The other results of the law that belong to `tau`: the rate of its state, then its dissipation if that is monitored.
    pub dz: Vec<S>,
    /// Memory for the results of the law that the sampler selects, and for the state that the controller measures.
    pub acting: (Vec<S>, Vec<S>),
    pub measured: Vec<S>,
    /// The number of states of the plant.
    pub states: usize,
}

impl<S: Real> Control<S> {
    /// Return the control of a loop with `n` inputs and `p` other results of the law. The plant has `states` of the `width` states.
    pub fn new(sampler: Option<Sampler<S>>, held: bool, [n, p]: [usize; 2], [states, width]: [usize; 2]) -> Self {
        let zeros = |count| vec![S::zero(); count];
        Control { sampler, held, tau: zeros(n), dz: zeros(p), acting: (zeros(n), zeros(p)), measured: zeros(width), states }
    }
}
