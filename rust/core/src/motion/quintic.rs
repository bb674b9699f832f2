//! Rest to rest with zero end accelerations: `s = 10 x^3 - 15 x^4 + 6 x^5`, `x = t / T`.

use super::{require_rest_to_rest, straight};
use crate::error::Result;
use crate::scalar::Real;

#[derive(Clone, Debug, PartialEq)]
pub struct Quintic {
    q0: Vec<f64>,
    q1: Vec<f64>,
    duration: f64,
}

impl Quintic {
    pub fn new(q0: Vec<f64>, q1: Vec<f64>, duration: f64) -> Result<Self> {
        require_rest_to_rest(&q0, &q1, duration)?;
        Ok(Quintic { q0, q1, duration })
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
        let path = if t <= 0.0 {
            [0.0; 3]
        } else if t >= self.duration {
            [1.0, 0.0, 0.0]
        } else {
            let x = t * rate;
            let y = 1.0 - x;
            // s' = 30 x^2 (1-x)^2 and s'' = 60 x (1-x)(1-2x): factored, they vanish exactly at the ends.
            [x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * (x * y) * (x * y) * rate, 60.0 * x * y * (y - x) * rate * rate]
        };
        straight(&self.q0, &self.q1, path, out);
    }
}
