//! The bound of a state: `|q_i|, |v_i| <= limit` for the positions and velocities of a plant, links and motors alike.
//!
//! Coarse steps of a stiff loop make a state meaningless long before it stops being finite: it is far beyond any state of a robot.

use crate::scalar::Real;

/// rad, m, rad/s or m/s: a million, a hundred thousand turns.
pub const DEFAULT_STATE_LIMIT: f64 = 1e6;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Size of the plant's state, the first part of a loop's state.
    states: usize,
    /// The smallest number above the limit.
    beyond: f64,
}

impl Bound {
    pub fn new(states: usize, limit: f64) -> Self {
        Bound { states, beyond: limit.next_up() }
    }

    /// Whether every lane of `x` is finite and within the bound.
    pub fn holds<S: Real>(&self, x: &[S]) -> bool {
        let (mut zero, mut largest) = (S::zero(), S::zero());
        for (i, &value) in x.iter().enumerate() {
            zero = value.mul_add(S::zero(), zero);
            if i < self.states {
                largest = largest.max(value.abs());
            }
        }
        // Zero times a number is zero if the number is finite, and NaN otherwise. No comparison with NaN is true.
        S::all(zero.lt(S::splat(1.0))) && S::all(largest.lt(S::splat(self.beyond)))
    }

    /// Whether one lane is within the bound.
    pub fn holds_lane<S: Real>(&self, x: &[S], lane: usize) -> bool {
        x.iter().all(|x| x.lane(lane).is_finite()) && x.iter().take(self.states).all(|x| x.lane(lane).abs() < self.beyond)
    }
}
