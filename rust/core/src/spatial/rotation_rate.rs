//! The angular velocity of a rotation `exp(r)` whose rotation vector `r` changes, and the derivative of this velocity.
//!
//! From the left Jacobian, `w = r_dot + b r x r_dot + c r x (r x r_dot)`, with `b = (1 - cos t) / t^2`, `c = (t - sin t) / t^3` and
//! `t = |r|`. See Chirikjian, Stochastic Models, Information Theory, and Lie Groups, volume 2, 10.86.

use super::{Vector, Vector3};
use crate::scalar::Real;

/// The number of terms of the series for angles below 1 rad. The next term is at most `1 / 18!`.
const TERMS: usize = 8;

/// Return `sum (-s)^k / (2 k + first)!` and its derivative with respect to `s`.
fn series<S: Real>(s: S, first: usize) -> (S, S) {
    let mut factorial: f64 = (1..=first).map(|k| k as f64).product();
    let mut coefficients = [0.0; TERMS];
    for (k, coefficient) in coefficients.iter_mut().enumerate() {
        *coefficient = if k % 2 == 0 { 1.0 / factorial } else { -1.0 / factorial };
        let next = 2 * k + first;
        factorial *= ((next + 1) * (next + 2)) as f64;
    }
    let value = coefficients.iter().rev().fold(S::zero(), |sum, &c| sum.mul_add(s, S::splat(c)));
    let slope = (1..TERMS).rev().fold(S::zero(), |sum, k| sum.mul_add(s, S::splat(k as f64 * coefficients[k])));
    (value, slope)
}

/// Return angular velocity, rad/s, and angular acceleration, rad/s^2, of `exp(r)` in world axes. Arguments: the rotation vector `r`, rad,
/// and its time derivatives `rate`, rad/s, and `acceleration`, rad/s^2.
pub fn rotation_rate<S: Real>(r: Vector3<S>, rate: Vector3<S>, acceleration: Vector3<S>) -> (Vector3<S>, Vector3<S>) {
    let (one, two) = (S::splat(1.0), S::splat(2.0));
    let square = r.dot(r);
    let small = square.lt(one);
    // The square root of zero has no derivative. If the series is selected, the root of another number is computed, and its value is not
    // used.
    let s = S::select(small, one, square);
    let angle = s.sqrt();
    let (sin, cos) = angle.sin_cos();
    let a = sin / angle;
    let (far_b, far_c) = ((one - cos) / s, (one - a) / s);
    let (far_b_slope, far_c_slope) = ((a / two - far_b) / s, ((a - cos) / (two * s) - far_c) / s);
    let ((near_b, near_b_slope), (near_c, near_c_slope)) = (series(square, 2), series(square, 3));
    let (b, c) = (S::select(small, near_b, far_b), S::select(small, near_c, far_c));
    let change = two * r.dot(rate);
    let b_rate = change * S::select(small, near_b_slope, far_b_slope);
    let c_rate = change * S::select(small, near_c_slope, far_c_slope);
    let across = r.cross(rate);
    let twice = r.cross(across);
    let across_rate = r.cross(acceleration);
    let velocity = rate + across.scale(b) + twice.scale(c);
    let turning = acceleration + across.scale(b_rate) + across_rate.scale(b) + twice.scale(c_rate);
    (velocity, turning + (rate.cross(across) + r.cross(across_rate)).scale(c))
}
