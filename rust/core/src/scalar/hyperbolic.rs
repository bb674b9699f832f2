//! The hyperbolic tangent and the decaying exponential, without a library call and without a branch. The bits depend only on whether
//! multiply-add operations are fused ([`fuses`](super::fuses)).
//!
//! `tanh r = r / (1 + r^2 / (3 + r^2 / (5 + ..)))` for `|r| <= 20/64`, where the last denominator is 13. Six doublings
//! `tanh 2r = 2 tanh r / (1 + tanh^2 r)` follow. For the exponential, `1 - exp(-r) = 2 t / (1 + t)` with `t = tanh(r/2)`. Six doublings
//! `1 - exp(-2r) = u (2 - u)` with `u = 1 - exp(-r)` follow.

use super::Real;

/// The argument is divided by `2^6`, and six doublings restore it.
const SHARE: f64 = 1.0 / 64.0;
const DOUBLINGS: usize = 6;

/// Return `tanh r` for `|r| <= 20/64`. The relative truncation error is below 1e-18.
#[inline]
fn near_zero<S: Real>(r: S) -> S {
    let k = S::splat;
    let z = r * r;
    let up = (z + k(378.0)).mul_add(z, k(17_325.0)).mul_add(z, k(135_135.0));
    let down = k(28.0).mul_add(z, k(3150.0)).mul_add(z, k(62_370.0)).mul_add(z, k(135_135.0));
    r * up / down
}

/// Return `tanh x` to a few units in the last place. The function is odd, one at infinity, and NaN for NaN.
#[inline]
pub fn tanh<S: Real>(x: S) -> S {
    let one = S::splat(1.0);
    // For arguments beyond 20, the hyperbolic tangent rounds to one.
    let mut t = near_zero(x.clamped(S::splat(-20.0), S::splat(20.0)) * S::splat(SHARE));
    for _ in 0..DOUBLINGS {
        t = (t + t) / t.mul_add(t, one);
    }
    t
}

/// Return `exp(-x)` for `x >= 0`, with an absolute error of 2e-15. The result is constant for `x >= 40`.
#[inline]
pub fn decay<S: Real>(x: S) -> S {
    let (one, two) = (S::splat(1.0), S::splat(2.0));
    let t = near_zero(x.clamped(S::zero(), S::splat(40.0)) * S::splat(0.5 * SHARE));
    let mut u = (t + t) / (one + t);
    for _ in 0..DOUBLINGS {
        u = u * (two - u);
    }
    one - u
}

#[cfg(test)]
mod tests {
    use super::{decay, tanh};
    use crate::scalar::{Array8, Real};

    /// Return arguments from 1e-12 to 1e3 with both signs, zero, and infinities.
    fn arguments() -> impl Iterator<Item = f64> {
        let sizes = (0..3000).map(|k| 10f64.powf(-12.0 + 15.0 * f64::from(k) / 3000.0));
        sizes.flat_map(|x| [x, -x]).chain([0.0, 20.0, -20.0, f64::INFINITY, f64::NEG_INFINITY])
    }

    #[test]
    fn they_are_those_of_the_library() {
        for x in arguments() {
            let (got, want) = (tanh(x), x.tanh());
            // Each of the seven quotients has about two roundings.
            assert!((got - want).abs() <= 3e-15 * want.abs(), "tanh {x}: {got} {want}");
            assert_eq!(got, -tanh(-x));
            let (got, want) = (decay(x.abs()), (-x.abs()).exp());
            assert!((got - want).abs() <= 2e-15, "exp -{x}: {got} {want}");
            assert_eq!(got, decay(Array8::from_lanes(|_| x.abs())).lane(3));
        }
        assert!(tanh(f64::NAN).is_nan() && decay(f64::NAN).is_nan());
    }
}
