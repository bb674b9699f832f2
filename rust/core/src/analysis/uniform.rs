//! Random numbers in [0, 1) from a state (SplitMix64, `steele2014splittable`), and random joint positions.

use std::f64::consts::PI;

/// The next number in [0, 1).
pub(super) fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 53) as f64
}

/// Uniform positions within the limits. A revolute joint without limits has a range of one revolution. A prismatic joint without limits has
/// a range of one metre on both sides of `q0`.
pub(super) fn within(bounds: &[(f64, f64)], angles: &[bool], q0: &[f64], state: &mut u64, q: &mut [f64]) {
    for (i, (to, &bounds)) in q.iter_mut().zip(bounds).enumerate() {
        let (low, high) = range(bounds, angles[i], q0[i]);
        *to = low + (high - low) * uniform(state);
    }
}

/// Mirror `q` about the middle of the ranges of [`within`].
pub(super) fn mirror(bounds: &[(f64, f64)], angles: &[bool], q0: &[f64], q: &mut [f64]) {
    for (i, (to, &bounds)) in q.iter_mut().zip(bounds).enumerate() {
        let (low, high) = range(bounds, angles[i], q0[i]);
        *to = low + high - *to;
    }
}

/// The range of a joint: its limits, or default limits for missing ones.
fn range((lower, upper): (f64, f64), angle: bool, q0: f64) -> (f64, f64) {
    let (around, half) = if angle { (0.0, PI) } else { (q0, 1.0) };
    let low = if lower.is_finite() { lower } else { (around - half).min(upper - 2.0 * half) };
    let high = if upper.is_finite() { upper } else { low + 2.0 * half };
    (low, high)
}
