//! The angle of a point, without a library call and without a branch. The bits depend only on whether multiply-add operations are fused
//! ([`fuses`](super::fuses)).
//!
//! The quotient `t = min(|x|, |y|) / max(|x|, |y|)` is reduced below 7/16 by `atan t = atan c + atan((t - c) / (1 + c t))`. `c` is 0, 1/2
//! or 1. The three cases share one division. Then fdlibm's polynomial is evaluated.

use super::Real;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

const ATAN: [f64; 11] = [
    3.333_333_333_333_293_180_27e-1,
    -1.999_999_999_987_648_324_76e-1,
    1.428_571_427_250_346_637_11e-1,
    -1.111_111_040_546_235_578_80e-1,
    9.090_887_133_436_506_561_96e-2,
    -7.691_876_205_044_829_994_95e-2,
    6.661_073_137_387_531_206_69e-2,
    -5.833_570_133_790_573_486_45e-2,
    4.976_877_994_615_932_360_17e-2,
    -3.653_157_274_421_691_552_70e-2,
    1.628_582_011_536_578_236_23e-2,
];

/// `atan(1/2)` and `atan(1)`, then `pi/2` and `pi`. Each is a number and its rounding error.
const HALF: [f64; 2] = [4.636_476_090_008_060_935_15e-1, 2.269_877_745_296_168_709_24e-17];
const ONE: [f64; 2] = [FRAC_PI_4, 3.061_616_997_868_383_017_93e-17];
const RIGHT: [f64; 2] = [FRAC_PI_2, 6.123_233_995_736_766_035_87e-17];
const STRAIGHT: [f64; 2] = [PI, 1.224_646_799_147_353_177_2e-16];

/// The scale `2^100` for small numbers.
const UP: f64 = 1_267_650_600_228_229_401_496_703_205_376.0;

/// Return -1 if the sign bit of `x` is set, otherwise 1. Zeros have a sign too. The result is 1 for NaN.
#[inline(always)]
fn sign_of<S: Real>(x: S) -> S {
    let (zero, one) = (S::zero(), S::splat(1.0));
    S::select(x.lt(zero), -one, S::select((one / x).lt(zero), -one, one))
}

/// Return the angle of the point `(x, y)`, rad, to 2 ulp, with the conventions of IEEE 754 for zeros and infinities.
#[inline(always)]
pub(super) fn atan2<S: Real>(y: S, x: S) -> S {
    let k = S::splat;
    let (width, height) = (x.abs(), y.abs());
    let steep = width.lt(height);
    let (small, large) = (S::select(steep, width, height), S::select(steep, height, width));
    // Two infinities become equal numbers, and two zeros have the quotient zero. Comparisons with NaN are false, and NaN remains.
    let most = k(f64::MAX);
    let boundless = most.lt(small);
    let (small, large) = (S::select(boundless, most, small), S::select(boundless, large.min(most), large));
    let large = S::select(large.lt(k(f64::from_bits(1))), k(1.0), large);
    // The numbers are scaled, so that no sum overflows and small fractions keep all digits.
    let scale = S::select(k(1e300).lt(large), k(0.25), S::select(large.lt(k(1e-270)), k(UP), k(1.0)));
    let (small, large) = (small * scale, large * scale);
    let (low, middle) = (small.lt(k(0.4375) * large), small.lt(k(0.6875) * large));
    let choose = |a: S, b: S, c: S| S::select(low, a, S::select(middle, b, c));
    // The differences in `numerator` have no rounding error.
    let numerator = choose(small, k(2.0).mul_add(small, -large), small - large);
    let denominator = choose(large, k(2.0).mul_add(large, small), small + large);
    let t = numerator / denominator;
    let z = t * t;
    let w = z * z;
    let even = [10, 8, 6, 4, 2, 0].into_iter().fold(S::zero(), |sum, i| sum.mul_add(w, k(ATAN[i]))) * z;
    let odd = [9, 7, 5, 3, 1].into_iter().fold(S::zero(), |sum, i| sum.mul_add(w, k(ATAN[i]))) * w;
    let rest = t.neg_mul_add(even + odd, t);
    let angle = choose(S::zero(), k(HALF[0]), k(ONE[0])) + (choose(S::zero(), k(HALF[1]), k(ONE[1])) + rest);
    // In the other octants, the angle is measured from another axis.
    let (along, up) = (sign_of(x), S::select(steep, k(-1.0), k(1.0)));
    let back = along.lt(S::zero());
    let axis = |i: usize| S::select(steep, k(RIGHT[i]), S::select(back, k(STRAIGHT[i]), S::zero()));
    let angle = axis(0) + (along * up).mul_add(angle, axis(1));
    angle * sign_of(y)
}

#[cfg(test)]
mod tests {
    use crate::scalar::{Array8, Real};

    /// Return the distance to the correct result, in units in the last place.
    fn distance(y: f64, x: f64, got: f64) -> f64 {
        let expected = f64::atan2(y, x);
        if got.to_bits() == expected.to_bits() || (got.is_nan() && expected.is_nan()) {
            return 0.0;
        }
        (got - expected).abs() / (expected.abs().next_up() - expected.abs())
    }

    fn worst(y: f64, x: f64) -> f64 {
        let lanes = Real::atan2(Array8::splat(y), Array8::splat(x));
        let all = [Real::atan2(y, x), lanes.lane(0), lanes.lane(7)];
        all.into_iter().map(|got| distance(y, x, got)).fold(0.0, |worst, d| if d <= worst { worst } else { d })
    }

    #[test]
    fn angles_of_all_quadrants_are_right_to_two_units() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut most = 0.0f64;
        for i in 0..40_000 {
            let (angle, length) = (std::f64::consts::TAU * random(), 10f64.powf(600.0 * random() - 300.0));
            // These angles are close to the axes, the diagonals and the limits of the reduction.
            let seam = [0.0, 0.4375f64.atan(), 0.6875f64.atan(), std::f64::consts::FRAC_PI_4][i % 4];
            let near = seam + f64::from((i % 8) as u32) * std::f64::consts::FRAC_PI_4 + 1e-15 * (random() - 0.5);
            let ratio = 10f64.powf(40.0 * random() - 20.0);
            for (y, x) in [(angle.sin(), angle.cos()), (near.sin(), near.cos()), (ratio, 1.0), (-1.0, -ratio)] {
                let d = worst(y * length, x * length);
                assert!(d <= 2.0, "atan2({}, {}) is off by {d} units", y * length, x * length);
                most = most.max(d);
            }
        }
        assert!(most > 0.0, "it is not the library function that is tested");
    }

    #[test]
    fn zeros_infinities_and_nan_are_those_of_the_library() {
        let tiny = f64::from_bits(1);
        let all = [0.0, 1.0, 0.4375, 0.6875, tiny, 3.0 * tiny, f64::MIN_POSITIVE, 1e-300, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
        for y in all.into_iter().flat_map(|y| [y, -y]) {
            for x in all.into_iter().flat_map(|x| [x, -x]) {
                let exact = [x, y].iter().any(|x| *x == 0.0 || !x.is_finite());
                assert!(worst(y, x) <= if exact { 0.0 } else { 1.0 }, "atan2({y:e}, {x:e}): {:e}", Real::atan2(y, x));
            }
        }
    }
}
