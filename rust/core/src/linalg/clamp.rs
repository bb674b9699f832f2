//! The spectral clamp `sigma -> sigma / max(sigma, eps)^2` of singular values. It equals the pseudo-inverse if `sigma >= eps`, is
//! continuous in the matrix, and is bounded by `1/eps`. In task priority, the clamp leaves the fraction `1 - min(1, (sigma/eps)^2)` of the
//! singular direction to lower levels.

/// Return the gain of the clamped inverse, in 1/unit of `sigma`. It is zero for `sigma = 0`, also if `eps = 0`.
#[inline]
pub fn clamp_gain(sigma: f64, eps: f64) -> f64 {
    if sigma <= 0.0 {
        0.0
    } else if sigma >= eps {
        1.0 / sigma
    } else {
        // Two divisions are used, because eps * eps underflows for tasks in tiny units.
        (sigma / eps) / eps
    }
}

/// Return `1 - sigma gain`, the fraction of the direction that remains free for lower levels, in `[0, 1]`.
#[inline]
pub fn clamp_remainder(sigma: f64, eps: f64) -> f64 {
    if sigma <= 0.0 {
        1.0
    } else if sigma >= eps {
        0.0
    } else {
        let x = sigma / eps;
        (1.0 - x) * (1.0 + x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn continuous_at_the_threshold_and_zero_at_zero() {
        let eps = 0.02f64;
        // One unit in the last place below eps, the gain differs only by rounding.
        let below = f64::from_bits(eps.to_bits() - 1);
        assert!((clamp_gain(below, eps) - clamp_gain(eps, eps)).abs() < 1e-13 * clamp_gain(eps, eps));
        assert_eq!(clamp_remainder(eps, eps), 0.0);
        assert!(clamp_remainder(below, eps) > 0.0 && clamp_remainder(below, eps) < 1e-15);
        assert_eq!((clamp_gain(0.0, eps), clamp_remainder(0.0, eps)), (0.0, 1.0));
        assert_eq!((clamp_gain(0.0, 0.0), clamp_remainder(0.0, 0.0)), (0.0, 1.0));
        // The product eps * eps would underflow. The tolerance covers three roundings.
        assert!((clamp_gain(1e-200, 1e-190) / 1e180 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn bounded_by_one_over_eps() {
        for i in 0..1000 {
            let sigma = 10f64.powf(-20.0 + 0.021 * i as f64);
            // The tolerance of the division is 2 ulp.
            assert!(clamp_gain(sigma, 0.02) <= 50.0 * (1.0 + 4e-16));
        }
    }
}
