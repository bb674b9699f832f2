//! Recorded functions of a plant: of its state, its input and the wrench.

use super::PlantSpec;
use crate::scalar::Real;
use crate::trace::Sym;
use crate::trace::function::{Recorded, recorded};

/// The arguments of [`Plant::rates`](super::Plant::rates) in a recording.
pub(super) struct Arguments<'a> {
    pub trig: Vec<(Sym, Sym)>,
    pub x: &'a [Sym],
    pub tau: &'a [Sym],
    pub wrench: &'a [Sym],
}

/// Record a function of the state, the input and the wrench of the plant `spec`, which are the inputs in this order.
pub(super) fn function_of<T>(spec: &PlantSpec, set_up: impl FnOnce() -> T, answer: impl FnOnce(T, &Arguments) -> Vec<Sym>) -> Recorded {
    let (n, states) = (spec.n(), spec.states());
    let recorded = recorded(states + n + 6, set_up, |made, inputs| {
        let (x, outside) = inputs.split_at(states);
        let (tau, wrench) = outside.split_at(n);
        answer(made, &Arguments { trig: x[..n].iter().map(|q| q.sin_cos()).collect(), x, tau, wrench })
    });
    let Some(recorded) = recorded else { unreachable!("no plant reads the value of a recorded number") };
    recorded
}
