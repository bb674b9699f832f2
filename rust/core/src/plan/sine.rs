//! `sin` and the extremes of `sin` on an interval, in closed form.
//!
//! ```text
//! x = n pi/2 + r, |r| <= pi/4:   sin x = +-sin r (n even), +-cos r (n odd)
//! max over [a, b] of sin = 1 iff a point pi/2 + 2 pi k lies in [a, b], else max(sin a, sin b)
//! ```
//!
//! The quarter turns are counted as integers from the same reduction that gives the sine, so "does the
//! interval hold an extreme" never disagrees with the values at its ends. Reduction in three parts after
//! Cody and Waite; the kernels are the Taylor series, whose first dropped term is below 5e-17 at pi/4.

use std::f64::consts::FRAC_2_PI;

// pi/2 in parts of 33 significant bits: n times the first two is exact for |n| < 2^20.
const PART_1: f64 = 1.570_796_326_734_125_6;
const PART_2: f64 = 6.077_100_506_303_965_976_6e-11;
const PART_3: f64 = 2.022_266_248_795_950_6e-21;
/// Beyond this the three parts lose digits and the library's reduction takes over.
const REDUCTION_LIMIT: f64 = 8.0e5;
/// Adding and subtracting 1.5 * 2^52 rounds to the nearest integer and leaves it in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// `a` if `flag` is 1, `b` if it is 0, without a branch: the quarter of a random angle cannot be predicted.
#[inline(always)]
pub(super) fn select(flag: u64, a: f64, b: f64) -> f64 {
    let mask = flag.wrapping_neg();
    f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// An angle with its sine and its place on the circle.
#[derive(Debug, Clone, Copy)]
pub struct Sine {
    pub sin: f64,
    /// floor(x / (pi/2)).
    quarter: i64,
}

/// Taylor coefficients from the highest down: of `sin r / r` to r^14 and of `cos r` to r^16, less the leading terms.
const SINE: [f64; 6] =
    [-1.0 / 1_307_674_368_000.0, 1.0 / 6_227_020_800.0, -1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0];
const COSINE: [f64; 6] =
    [1.0 / 20_922_789_888_000.0, -1.0 / 87_178_291_200.0, 1.0 / 479_001_600.0, -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0];

#[inline(always)]
fn kernels(r: f64) -> (f64, f64) {
    let z = r * r;
    let mut s = SINE[0];
    let mut c = COSINE[0];
    for k in 1..6 {
        s = SINE[k] + z * s;
        c = COSINE[k] + z * c;
    }
    (r + r * z * (-1.0 / 6.0 + z * s), 1.0 - (0.5 * z - z * z * (1.0 / 24.0 + z * c)))
}

/// `sin r / r` and `cos r` for `|r| <= pi/4`.
#[inline(always)]
pub(super) fn sinc_cos_small(r: f64) -> (f64, f64) {
    let z = r * r;
    let mut s = SINE[0];
    let mut c = COSINE[0];
    for k in 1..6 {
        s = SINE[k] + z * s;
        c = COSINE[k] + z * c;
    }
    (1.0 + z * (-1.0 / 6.0 + z * s), 1.0 - (0.5 * z - z * z * (1.0 / 24.0 + z * c)))
}

/// `r` and `n` of `x = n pi/2 + r`, for `|x| <= REDUCTION_LIMIT`.
#[inline(always)]
fn reduce(x: f64) -> (f64, i64) {
    let shifted = x * FRAC_2_PI + ROUND;
    let n = shifted - ROUND;
    (((x - n * PART_1) - n * PART_2) - n * PART_3, (shifted.to_bits() as i64).wrapping_sub(ROUND.to_bits() as i64))
}

/// `sin x` and `cos x` of a finite angle, to about one unit in the last place.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if x.abs() > REDUCTION_LIMIT {
        return x.sin_cos();
    }
    let (r, n) = reduce(x);
    let (s, c) = kernels(r);
    let (s, c) = if n & 1 == 0 { (s, c) } else { (c, -s) };
    if n & 2 == 0 { (s, c) } else { (-s, -c) }
}

/// The sine of a finite angle with the quarter it lies in.
#[inline(always)]
pub fn sine(x: f64) -> Sine {
    if x.abs() > REDUCTION_LIMIT {
        return Sine { sin: x.sin(), quarter: (x * FRAC_2_PI).floor() as i64 };
    }
    let (r, n) = reduce(x);
    let (s, c) = kernels(r);
    let magnitude = select(n as u64 & 1, c, s);
    let sign = ((n as u64) & 2) << 62;
    Sine { sin: f64::from_bits(magnitude.to_bits() ^ sign), quarter: n - i64::from(r < 0.0) }
}

/// Four sines at once, in arrays that the compiler keeps in vector registers.
#[inline(always)]
pub(super) fn sines(x: [f64; 4]) -> [Sine; 4] {
    if x[0].abs().max(x[1].abs()).max(x[2].abs()).max(x[3].abs()) > REDUCTION_LIMIT {
        return x.map(sine);
    }
    let (mut r, mut z, mut n) = ([0.0; 4], [0.0; 4], [0u64; 4]);
    for k in 0..4 {
        let shifted = x[k] * FRAC_2_PI + ROUND;
        let turns = shifted - ROUND;
        n[k] = shifted.to_bits().wrapping_sub(ROUND.to_bits());
        r[k] = ((x[k] - turns * PART_1) - turns * PART_2) - turns * PART_3;
        z[k] = r[k] * r[k];
    }
    let (mut s, mut c) = ([SINE[0]; 4], [COSINE[0]; 4]);
    for j in 1..6 {
        for k in 0..4 {
            s[k] = SINE[j] + z[k] * s[k];
            c[k] = COSINE[j] + z[k] * c[k];
        }
    }
    let mut sin = [0.0; 4];
    for k in 0..4 {
        let odd = 1.0 - (0.5 * z[k] - z[k] * z[k] * (1.0 / 24.0 + z[k] * c[k]));
        let even = r[k] + r[k] * z[k] * (-1.0 / 6.0 + z[k] * s[k]);
        let mask = (n[k] & 1).wrapping_neg();
        sin[k] = f64::from_bits(((odd.to_bits() & mask) | (even.to_bits() & !mask)) ^ ((n[k] & 2) << 62));
    }
    let quarter = |k: usize| n[k] as i64 - i64::from(r[k] < 0.0);
    [0, 1, 2, 3].map(|k| Sine { sin: sin[k], quarter: quarter(k) })
}

/// Largest value of `sin` on `[a, b]`; `1` if a crest lies strictly inside.
#[inline(always)]
pub fn crest_inside(a: &Sine, b: &Sine) -> bool {
    ((a.quarter - 1) >> 2) < ((b.quarter - 1) >> 2)
}

/// Whether `sin = -1` is reached strictly inside `[a, b]`.
#[inline(always)]
pub fn trough_inside(a: &Sine, b: &Sine) -> bool {
    ((a.quarter + 1) >> 2) < ((b.quarter + 1) >> 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn agrees_with_the_library() {
        // Two units in the last place of 1: one from the kernel, one from the reduction.
        for k in -40_000..40_000 {
            for x in [k as f64 * 1.1e-3, k as f64 * 7.3, k as f64 * PI / 8.0] {
                let (s, c) = sin_cos(x);
                assert!((s - x.sin()).abs() < 4.5e-16 && (c - x.cos()).abs() < 4.5e-16, "{x}: {s} {c}");
                assert_eq!(sine(x).sin, s);
                let four = sines([x, -x, 0.0, x]);
                assert_eq!((four[0].sin, four[0].quarter, four[1].sin), (s, sine(x).quarter, -s));
            }
        }
        for x in [1e6, -3e9, 1e300] {
            assert_eq!(sin_cos(x), x.sin_cos());
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert_eq!(sin_cos(1e-300).0, 1e-300);
    }

    #[test]
    fn extremes_inside_are_counted() {
        // Half a turn on either side of the crest at pi/2 + 2 pi k and the trough opposite, k of either sign.
        for k in -5..5 {
            let crest = PI / 2.0 + 2.0 * PI * k as f64;
            let (a, b, c, d) = (sine(crest - 3.0), sine(crest - 1e-6), sine(crest + 1e-6), sine(crest + 3.2));
            assert!(!crest_inside(&a, &b) && crest_inside(&b, &c) && !crest_inside(&c, &d), "{k}");
            assert!(!trough_inside(&a, &b) && !trough_inside(&b, &c) && trough_inside(&c, &d), "{k}");
        }
    }
}
