//! Motions from rest to rest on a straight line in joint space, `q = q0 + (q1 - q0) s(t)`, with one of two timings over the duration `T`:
//!
//! - quintic, with zero end accelerations: `s = 10 x^3 - 15 x^4 + 6 x^5`, `x = t / T`;
//! - symmetric bang-bang: `s_ddot = 4 / T^2` for `T/2`, then its negative. The acceleration is right-continuous, and zero from `T` on.

use super::polynomial::{constant, scaled};
use super::rows::put;
use crate::error::{Error, Result, finite, positive};
use crate::scalar::Real;
use nalgebra::DVector;
use std::marker::PhantomData;

/// A timing `s(t)` from 0 to 1.
pub trait Timing {
    /// The times at which the timing changes its formula, divided by the duration. The first is 0 and the last is 1.
    const BREAKS: &'static [f64];
    /// Return `s` and its derivatives with respect to `t / duration`, at time `t` after break number `piece`, for a motion that takes
    /// `duration`, s.
    fn at<S: Real>(piece: usize, t: S, duration: f64) -> [S; 5];
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
    const BREAKS: &'static [f64] = &[0.0, 1.0];

    #[inline(always)]
    fn at<S: Real>(_: usize, t: S, duration: f64) -> [S; 5] {
        let k = S::splat;
        let x = t * k(1.0 / duration);
        let y = k(1.0) - x;
        // The first two derivatives are 30 x^2 (1-x)^2 and 60 x (1-x)(1-2x). In this factored form they vanish exactly at the ends.
        [
            x * x * x * (k(10.0) + x * (k(6.0) * x - k(15.0))),
            k(30.0) * (x * y) * (x * y),
            k(60.0) * x * y * (y - x),
            k(60.0) * (k(1.0) - k(6.0) * x * y),
            k(360.0) * (x - y),
        ]
    }
}

impl Timing for BangBangTiming {
    const BREAKS: &'static [f64] = &[0.0, 0.5, 1.0];

    #[inline(always)]
    fn at<S: Real>(piece: usize, t: S, duration: f64) -> [S; 5] {
        let k = S::splat;
        if piece == 0 {
            let x = t * k(1.0 / duration);
            [k(2.0) * x * x, k(4.0) * x, k(4.0), k(0.0), k(0.0)]
        } else {
            let y = (k(duration) - t) * k(1.0 / duration);
            [k(1.0) - k(2.0) * y * y, k(4.0) * y, k(-4.0), k(0.0), k(0.0)]
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

    /// The times at which the motion changes its formula, s.
    pub(crate) fn breaks(&self) -> Vec<f64> {
        P::BREAKS.iter().map(|part| part * self.duration).collect()
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does.
    #[inline(never)]
    pub(crate) fn evaluate<const K: usize, const FROM: usize>(&self, t: f64, out: &mut [f64]) {
        // The comparisons are false for NaN, which gives a moving piece and so NaN.
        let mut piece = if t < 0.0 { 0 } else { 1 };
        for part in &P::BREAKS[1..] {
            piece += usize::from(t >= part * self.duration);
        }
        self.on_piece::<_, K, FROM>(piece, t, out);
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does, with the formula after `piece` of the breaks.
    #[inline(always)]
    pub(crate) fn on_piece<S: Real, const K: usize, const FROM: usize>(&self, piece: usize, t: S, out: &mut [S]) {
        let (n, one) = (self.dof(), S::splat(1.0));
        let timing = match piece {
            0 => [S::zero(); 5],
            piece if piece == P::BREAKS.len() => constant(one),
            piece => P::at(piece - 1, t, self.duration),
        };
        let timing = scaled(timing, S::splat(1.0 / self.duration));
        // Where the timing rounds to one, the position is exactly `q1`.
        let ended = (timing[0] - one).abs().lt(S::splat(f64::MIN_POSITIVE));
        for i in 0..n {
            let d = S::splat(self.q1[i] - self.q0[i]);
            let mut values = [S::zero(); K];
            values[0] = S::select(ended, S::splat(self.q1[i]), S::splat(self.q0[i]) + d * timing[0]);
            for k in 1..K {
                values[k] = d * timing[k];
            }
            put::<_, K, FROM>(n, out, i, values);
        }
    }
}
