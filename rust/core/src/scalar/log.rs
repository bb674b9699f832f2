//! The natural logarithm, without a library call and without a branch. The bits depend only on whether multiply-add operations are fused
//! ([`fuses`](super::fuses)).
//!
//! The argument is `x = 2^e m` with `m` in `[sqrt(1/2), sqrt 2)`. Comparisons with powers of two determine `e`. Then fdlibm's polynomial
//! gives `log m = 2 atanh(s)` with `s = (m - 1) / (m + 1)`.

use super::Real;

const LOG: [f64; 7] = [
    6.666_666_666_666_735_130e-1,
    3.999_999_999_940_941_908e-1,
    2.857_142_874_366_239_149e-1,
    2.222_219_843_214_978_396e-1,
    1.818_357_216_161_805_012e-1,
    1.531_383_769_920_937_332e-1,
    1.479_819_860_511_658_591e-1,
];

/// The first 32 bits of `log 2`, and the rest.
const LN_2: [f64; 2] = [6.931_471_803_691_238_164_90e-1, 1.908_214_929_270_587_700_02e-10];

/// Return `log x` to 1 ulp for a positive normal number `x`. For other numbers, the result is undefined.
#[inline(always)]
pub fn ln<S: Real>(x: S) -> S {
    let k = S::splat;
    let (mut m, mut e) = (x, S::zero());
    for power in [512, 256, 128, 64, 32, 16, 8, 4, 2, 1] {
        let (up, count) = (2f64.powi(power), k(f64::from(power)));
        let small = m.lt(k(2.0 / up));
        (m, e) = (S::select(small, m * k(up), m), S::select(small, e - count, e));
        let below = m.lt(k(up));
        (m, e) = (S::select(below, m, m * k(1.0 / up)), S::select(below, e, e + count));
    }
    let centred = m.lt(k(std::f64::consts::SQRT_2));
    (m, e) = (S::select(centred, m, k(0.5) * m), S::select(centred, e, e + k(1.0)));
    let f = m - k(1.0);
    let s = f / (k(2.0) + f);
    let z = s * s;
    let w = z * z;
    let even = [5, 3, 1].into_iter().fold(S::zero(), |sum, i| sum.mul_add(w, k(LOG[i]))) * w;
    let odd = [6, 4, 2, 0].into_iter().fold(S::zero(), |sum, i| sum.mul_add(w, k(LOG[i]))) * z;
    let half = k(0.5) * f * f;
    let rest = s * (half + (even + odd)) + e * k(LN_2[1]);
    e * k(LN_2[0]) - ((half - rest) - f)
}

#[cfg(test)]
mod tests {
    use super::ln;
    use crate::scalar::{Array8, Real};

    #[test]
    fn logarithms_are_right_to_a_unit() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut most = 0.0f64;
        for _ in 0..20_000 {
            let (power, near) = (10f64.powf(600.0 * random() - 300.0), 10f64.powf(-16.0 * random()));
            for x in [power, 1.0 + near, 1.0 - 0.9 * near, 2f64.sqrt() * (1.0 + 1e-15 * (random() - 0.5)), f64::MIN_POSITIVE, f64::MAX] {
                let (got, expected) = (ln(x), x.ln());
                let lanes = ln(Array8::splat(x)).lane(5);
                for got in [got, lanes] {
                    let units = (got - expected).abs() / (expected.abs().next_up() - expected.abs());
                    assert!(units <= 1.0, "log({x:e}) = {got:e} is off by {units} units");
                    most = most.max(units);
                }
            }
        }
        assert!(most > 0.0, "it is not the library function that is tested");
        assert_eq!(ln(1.0), 0.0);
    }
}
