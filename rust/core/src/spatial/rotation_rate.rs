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

#[cfg(test)]
mod tests {
    use super::super::{Matrix, rotation_exp};
    use super::*;
    use crate::scalar::Dual;

    /// The velocity is compared with dual numbers of `exp`, and the acceleration with dual numbers of the velocity, on both sides of the
    /// threshold.
    #[test]
    fn it_is_the_rate_of_the_rotation() {
        let (axis, rate, acceleration) = ([2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0], [0.3, -0.2, 0.5], [-1.0, 0.4, 0.7]);
        for angle in [0.0, 1e-9, 1e-4, 0.1, 0.99999, 1.00001, 2.0, 3.0, 3.2, 6.0] {
            let r = Vector3::from(axis.map(|a| a * angle));
            let (w, w_dot) = rotation_rate(r, Vector3::from(rate), Vector3::from(acceleration));
            let turned = rotation_exp(std::array::from_fn(|k| Dual::new(r[k], rate[k])));
            let plain = rotation_exp(r.array());
            for column in 0..3 {
                let expected = w.cross(plain.axis(column));
                for k in 0..3 {
                    // The derivatives of `exp` have an error of at most t^4 below its threshold of 1e-4, and of at most 1e-16 / t^2 above
                    // it.
                    assert!((turned[(k, column)].rate - expected[k]).abs() < 2e-8, "{angle}");
                }
            }
            let moving = |value: [f64; 3], rate: [f64; 3]| Vector3::from(std::array::from_fn(|k| Dual::new(value[k], rate[k])));
            let (again, _) = rotation_rate(moving(r.array(), rate), moving(rate, acceleration), Vector3::zero());
            for k in 0..3 {
                assert!((again[k].value - w[k]).abs() < 1e-15 && (again[k].rate - w_dot[k]).abs() < 1e-14, "{angle}: {again:?}, {w_dot:?}");
            }
        }
    }
}
