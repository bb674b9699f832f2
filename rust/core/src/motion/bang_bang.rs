//! Symmetric bang-bang acceleration: `+A` for `T/2`, then `-A`, with `A = 4 (q1 - q0) / T^2`.
//! The acceleration is right-continuous at the switch and zero from `T` on.

use super::{require_rest_to_rest, straight};
use crate::error::Result;
use crate::scalar::Real;

#[derive(Clone, Debug, PartialEq)]
pub struct BangBang {
    q0: Vec<f64>,
    q1: Vec<f64>,
    duration: f64,
}

impl BangBang {
    pub fn new(q0: Vec<f64>, q1: Vec<f64>, duration: f64) -> Result<Self> {
        require_rest_to_rest(&q0, &q1, duration)?;
        Ok(BangBang { q0, q1, duration })
    }

    pub fn dof(&self) -> usize {
        self.q0.len()
    }

    pub fn duration(&self) -> f64 {
        self.duration
    }

    #[inline(always)]
    pub(super) fn sample<S: Real>(&self, t: f64, out: &mut [S]) {
        let rate = 1.0 / self.duration;
        let (x, y) = (t * rate, (self.duration - t) * rate);
        let path = if t < 0.0 {
            [0.0; 3]
        } else if t >= self.duration {
            [1.0, 0.0, 0.0]
        } else if t < 0.5 * self.duration {
            [2.0 * x * x, 4.0 * x * rate, 4.0 * rate * rate]
        } else {
            [1.0 - 2.0 * y * y, 4.0 * y * rate, -4.0 * rate * rate]
        };
        straight(&self.q0, &self.q1, path, out);
    }
}
