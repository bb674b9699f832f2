//! The limit of a state: `|x_i| <= limit` for all states of the plant, which are positions, velocities and bristle deflections.
//!
//! In a stiff loop with large steps, a state becomes meaningless long before it stops being finite. The limit detects this early.

use crate::scalar::Real;

/// The default limit, in the units of the states: rad, m, rad/s or m/s. A million rad are about 160 000 revolutions.
pub const DEFAULT_STATE_LIMIT: f64 = 1e6;

/// The limit of the absolute values of the plant's states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// The size of the plant's state, which is the first part of a loop's state.
    states: usize,
    /// The smallest number above the limit.
    beyond: f64,
}

impl Bound {
    pub fn new(states: usize, limit: f64) -> Self {
        Bound { states, beyond: limit.next_up() }
    }

    /// Whether every lane of `x` is finite and within the limit.
    pub fn holds<S: Real>(&self, x: &[S]) -> bool {
        let (mut zero, mut largest) = (S::zero(), S::zero());
        for (i, &value) in x.iter().enumerate() {
            zero += value * S::zero();
            if i < self.states {
                largest = largest.max(value.abs());
            }
        }
        // For a finite number, the product with zero is zero. Otherwise it is NaN, and `zero < 1` is false.
        S::all(zero.lt(S::splat(1.0))) && S::all(largest.lt(S::splat(self.beyond)))
    }

    /// Whether the limit permits the largest absolute value `largest` of the plant's states.
    pub fn permits(&self, largest: f64) -> bool {
        largest < self.beyond
    }

    /// Whether lane `lane` of `x` is finite and within the limit.
    pub fn holds_lane<S: Real>(&self, x: &[S], lane: usize) -> bool {
        x.iter().all(|x| x.lane(lane).is_finite()) && x.iter().take(self.states).all(|x| x.lane(lane).abs() < self.beyond)
    }
}
