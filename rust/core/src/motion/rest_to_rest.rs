//! Motions from rest to rest on a straight line in joint space, `q = q0 + (q1 - q0) s(t)`, with one of two timings over the duration `T`:
//!
//! - quintic, with zero end accelerations: `s = 10 x^3 - 15 x^4 + 6 x^5`, `x = t / T`;
//! - symmetric bang-bang: `s_ddot = 4 / T^2` for `T/2`, then its negative. The acceleration is right-continuous, and zero from `T` on.

use crate::error::{Error, Result, finite, positive};
use crate::scalar::Real;
use nalgebra::DVector;
use std::marker::PhantomData;

/// A timing `s(t)` from 0 to 1.
pub trait Timing {
    /// Return `s`, its rate and its acceleration at time `t`, for a motion that takes `duration`, s.
    fn at(t: f64, duration: f64) -> [f64; 3];
}

#[derive(Clone, Debug, PartialEq)]
pub struct QuinticTiming;

#[derive(Clone, Debug, PartialEq)]
pub struct BangBangTiming;

/// A motion with the quintic timing: zero velocity and acceleration at both ends.
pub type Quintic = RestToRest<QuinticTiming>;
/// A motion with constant acceleration for half of the duration, then constant deceleration.
pub type BangBang = RestToRest<BangBangTiming>;

/// A motion from rest at `q0` to rest at `q1` with the timing `P`.
#[derive(Clone, Debug, PartialEq)]
pub struct RestToRest<P> {
    q0: Vec<f64>,
    q1: Vec<f64>,
    duration: f64,
    timing: PhantomData<P>,
}

impl Timing for QuinticTiming {
    fn at(t: f64, duration: f64) -> [f64; 3] {
        let rate = 1.0 / duration;
        if t <= 0.0 {
            [0.0; 3]
        } else if t >= duration {
            [1.0, 0.0, 0.0]
        } else {
            let x = t * rate;
            let y = 1.0 - x;
            // With respect to x, the derivatives of s are 30 x^2 (1-x)^2 and 60 x (1-x)(1-2x). In this factored form they vanish exactly at
            // the ends.
            [x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * (x * y) * (x * y) * rate, 60.0 * x * y * (y - x) * rate * rate]
        }
    }
}

impl Timing for BangBangTiming {
    fn at(t: f64, duration: f64) -> [f64; 3] {
        let rate = 1.0 / duration;
        let (x, y) = (t * rate, (duration - t) * rate);
        if t < 0.0 {
            [0.0; 3]
        } else if t >= duration {
            [1.0, 0.0, 0.0]
        } else if t < 0.5 * duration {
            [2.0 * x * x, 4.0 * x * rate, 4.0 * rate * rate]
        } else {
            [1.0 - 2.0 * y * y, 4.0 * y * rate, -4.0 * rate * rate]
        }
    }
}

impl<P: Timing> RestToRest<P> {
    /// Create the motion from `q0` to `q1`, `(n,)` each, rad or m, in `duration` seconds.
    ///
    /// Errors: `Input` for empty positions, numbers that are not finite, or a duration that is not positive. `WrongShape` for unequal
    /// lengths.
    pub fn new(q0: impl Into<DVector<f64>>, q1: impl Into<DVector<f64>>, duration: f64) -> Result<Self> {
        let (q0, q1) = (Vec::from(q0.into().data), Vec::from(q1.into().data));
        finite("q0", &q0)?;
        finite("q1", &q1)?;
        if q0.is_empty() {
            return Err(Error::input("q0", "is empty: expected at least one joint, got 0"));
        }
        if q0.len() != q1.len() {
            return Err(Error::wrong_shape("q1", &[q0.len()], &[q1.len()]));
        }
        positive("duration", duration)?;
        Ok(RestToRest { q0, q1, duration, timing: PhantomData })
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.q0.len()
    }

    /// Duration, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    pub(super) fn ends(&self) -> (&[f64], &[f64]) {
        (&self.q0, &self.q1)
    }

    pub(super) fn sample<S: Real>(&self, t: f64, out: &mut [S]) {
        let ([s, ds, dds], n) = (P::at(t, self.duration), self.dof());
        for i in 0..n {
            let d = self.q1[i] - self.q0[i];
            out[i] = S::splat(if s == 1.0 { self.q1[i] } else { self.q0[i] + d * s });
            out[n + i] = S::splat(d * ds);
            out[2 * n + i] = S::splat(d * dds);
        }
    }
}
