//! A recorded function with its tangents. A *lane* is one element of a SIMD register, and holds the tangent along one direction. A *group* is
//! the directions of one register.

use super::functions::{Call, Function};
use super::mixture::Mixture;
use super::prepared::Prepared;

/// A recorded function with its tangent.
pub struct TangentCall {
    pub call: Call,
    /// The number of varying inputs: loop parameters, exogenous input, state and held input.
    moving: usize,
    /// The number of varying loop parameters.
    moved: usize,
    /// The number of varying exogenous inputs.
    driven: usize,
    answers: usize,
}

impl TangentCall {
    pub fn of(function: &Function, prepared: &Prepared) -> Self {
        let sizes = &prepared.functions.sizes;
        TangentCall {
            call: function.tangent(prepared.given()),
            moving: function.moving(),
            moved: sizes.moved,
            driven: sizes.driven(),
            answers: function.answers(),
        }
    }

    /// Set the tangents of the loop parameters for the directions from `first` on.
    pub fn set_up(&mut self, mixture: &Mixture, first: usize, groups: usize) {
        let lanes = self.call.lanes();
        for g in 0..groups {
            let rows = mixture.set_up.chunks_exact(mixture.count);
            let all = self.call.more(g * self.moving, self.moved).chunks_exact_mut(lanes).zip(rows);
            for (to, rates) in all {
                let own = &rates[(first + g * lanes).min(rates.len())..(first + (g + 1) * lanes).min(rates.len())];
                to.fill(0.0);
                to[..own.len()].copy_from_slice(own);
            }
        }
    }

    /// Set the tangents of the exogenous input for group `g` of directions. Return the memory for the tangents of the state and of the held
    /// input.
    pub fn rates_of(&mut self, g: usize, outside: &[f64], states: usize) -> (&mut [f64], &mut [f64]) {
        let (lanes, own) = (self.call.lanes(), self.moving - self.moved);
        let (driven, rest) = self.call.more(g * self.moving + self.moved, own).split_at_mut(self.driven * lanes);
        driven.copy_from_slice(outside);
        rest.split_at_mut(states * lanes)
    }

    /// The tangents of the results for group `g` of directions.
    pub fn answers(&self, g: usize) -> &[f64] {
        self.call.behind(g * self.answers, self.answers)
    }
}
