//! The sine, and the extremes of the sine on an interval, in closed form.
//!
//! ```text
//! x = n pi/2 + r, |r| <= pi/4:   sin x = +-sin r (n even), +-cos r (n odd)
//! max over [a, b] of sin = 1 iff a point pi/2 + 2 pi k is in [a, b], else max(sin a, sin b)
//! ```
//!
//! The reduction of the angle also counts the quarter turns. So the decision whether an interval contains an extreme always agrees with the
//! sines at its ends. The angle is reduced with pi/2 in three parts, as by Cody and Waite. The kernels are Taylor series, whose first
//! dropped term is below 6e-17 at pi/4. No operation is fused, so a SIMD lane has the same bits as a single number.

use crate::scalar::Real;
use crate::scalar::trig::{PIO2, ROUND, TWO_OVER_PI};

/// The largest angle for the reduction in three parts. Beyond it the parts lose digits, and the standard library computes the sine.
const REDUCTION_LIMIT: f64 = 8.0e5;

/// Return `a` if `flag` is 1 and `b` if `flag` is 0, without a branch.
#[inline(always)]
pub(super) fn select(flag: u64, a: f64, b: f64) -> f64 {
    let mask = flag.wrapping_neg();
    f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// The sine of an angle, and the quarter of the circle that contains the angle.
#[derive(Debug, Clone, Copy)]
pub struct Sine<S = f64> {
    /// The sine.
    pub sin: S,
    /// The number of the quarter, `floor(x / (pi/2))`.
    quarter: S,
}

/// Taylor coefficients, the highest first: of `sin r / r` up to r^14 and of `cos r` up to r^16, without the leading terms.
const SINE: [f64; 6] =
    [-1.0 / 1_307_674_368_000.0, 1.0 / 6_227_020_800.0, -1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0];
const COSINE: [f64; 6] =
    [1.0 / 20_922_789_888_000.0, -1.0 / 87_178_291_200.0, 1.0 / 479_001_600.0, -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0];

/// Compute `(sin r / r - 1) / z` and `cos r` with `z = r^2`, for `|r| <= pi/4`.
#[inline(always)]
fn kernels<S: Real>(z: S) -> (S, S) {
    let k = S::splat;
    let (mut s, mut c) = (k(SINE[0]), k(COSINE[0]));
    for i in 1..6 {
        s = k(SINE[i]) + z * s;
        c = k(COSINE[i]) + z * c;
    }
    (k(-1.0 / 6.0) + z * s, k(1.0) - (k(0.5) * z - z * z * (k(1.0 / 24.0) + z * c)))
}

/// Compute `sin r` and `cos r` for `|r| <= pi/4`.
#[inline(always)]
fn sin_cos_small<S: Real>(r: S) -> (S, S) {
    let z = r * r;
    let (s, c) = kernels(z);
    (r + r * z * s, c)
}

/// Compute `sin r / r` and `cos r` for `|r| <= pi/4`.
#[inline(always)]
pub(super) fn sinc_cos_small<S: Real>(r: S) -> (S, S) {
    let z = r * r;
    let (s, c) = kernels(z);
    (S::splat(1.0) + z * s, c)
}

/// Reduce the angle `x = n pi/2 + r` to `r` and `n`, for `|x| <= REDUCTION_LIMIT`.
#[inline(always)]
fn reduce(x: f64) -> (f64, i64) {
    let shifted = x * TWO_OVER_PI + ROUND;
    let n = shifted - ROUND;
    (((x - n * PIO2[0]) - n * PIO2[1]) - n * PIO2[2], (shifted.to_bits() as i64).wrapping_sub(ROUND.to_bits() as i64))
}

/// `sin x` and `cos x` of a finite angle, to about two units in the last place of 1.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if x.abs() > REDUCTION_LIMIT {
        return x.sin_cos();
    }
    let (r, n) = reduce(x);
    let (s, c) = sin_cos_small(r);
    let (s, c) = if n & 1 == 0 { (s, c) } else { (c, -s) };
    if n & 2 == 0 { (s, c) } else { (-s, -c) }
}

/// The nearest integer of a number below 2^51. If two integers are equally near, the result is the even one.
#[inline(always)]
fn round<S: Real>(x: S) -> S {
    (x + S::splat(ROUND)) - S::splat(ROUND)
}

#[inline(always)]
fn odd<S: Real>(n: S) -> S::Mask {
    let half = S::splat(0.5) * n;
    S::splat(0.25).lt((half - round(half)).abs())
}

/// The sine of a finite angle, and the quarter of the circle that contains the angle.
#[inline(always)]
pub fn sine<S: Real>(x: S) -> Sine<S> {
    let k = S::splat;
    let n = round(x * k(TWO_OVER_PI));
    let r = ((x - n * k(PIO2[0])) - n * k(PIO2[1])) - n * k(PIO2[2]);
    let (s, c) = sin_cos_small(r);
    let size = S::select(odd(n), c, s);
    // The sine (or the cosine that replaces it) is negative in the last two of four quarters.
    let half = round(k(0.5) * n - k(0.25));
    let near = Sine { sin: S::select(odd(half), -size, size), quarter: n - S::select(r.lt(S::zero()), k(1.0), S::zero()) };
    let far = k(REDUCTION_LIMIT).lt(x.abs());
    if !S::any(far) {
        return near;
    }
    let each = |f: fn(f64) -> f64| S::from_lanes(|lane| f(x.lane(lane)));
    Sine { sin: S::select(far, each(f64::sin), near.sin), quarter: S::select(far, each(|x| (x * TWO_OVER_PI).floor()), near.quarter) }
}

/// Whether `floor((quarter + shift) / 4)` is larger at `b` than at `a`.
#[inline(always)]
fn passes<S: Real>(a: &Sine<S>, b: &Sine<S>, shift: f64) -> S::Mask {
    // For an integer n, floor(n/4) is the integer nearest to n/4 - 3/8, and there is never a tie. Here n is quarter + shift.
    let (quarter, shift, below) = (S::splat(0.25), S::splat(shift), S::splat(0.375));
    round(quarter * (a.quarter + shift) - below).lt(round(quarter * (b.quarter + shift) - below))
}

/// Whether the sine reaches 1 strictly inside `[a, b]`.
#[inline(always)]
pub fn crest_inside<S: Real>(a: &Sine<S>, b: &Sine<S>) -> S::Mask {
    passes(a, b, -1.0)
}

/// Whether the sine reaches -1 strictly inside `[a, b]`.
#[inline(always)]
pub fn trough_inside<S: Real>(a: &Sine<S>, b: &Sine<S>) -> S::Mask {
    passes(a, b, 1.0)
}

/// The smallest and the largest value of `G sin` between two angles.
#[inline(always)]
pub(super) fn gravity_range<S: Real>(g: S, a: &Sine<S>, b: &Sine<S>) -> (S, S) {
    // An extreme outside the interval is replaced by 2 or -2, which no sine reaches. min and max account for the sign of g.
    let (one, two) = (S::splat(1.0), S::splat(2.0));
    let low = a.sin.min(b.sin).min(S::select(trough_inside(a, b), -one, two));
    let high = a.sin.max(b.sin).max(S::select(crest_inside(a, b), one, -two));
    ((g * low).min(g * high), (g * low).max(g * high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn agrees_with_the_library() {
        // The tolerance is two units in the last place of 1: one for the kernel, one for the reduction.
        for k in -40_000..40_000 {
            for x in [k as f64 * 1.1e-3, k as f64 * 7.3, k as f64 * PI / 8.0] {
                let (s, c) = sin_cos(x);
                assert!((s - x.sin()).abs() < 4.5e-16 && (c - x.cos()).abs() < 4.5e-16, "{x}: {s} {c}");
                assert_eq!(sine(x).sin, s);
                // `n pi/2` is the multiple of pi/2 nearest to `x`. `beyond` is sin(x - n pi/2) by the standard library, so it is negative
                // if `x` is below this multiple.
                let n = (x * TWO_OVER_PI).round();
                let beyond = [x.sin(), -x.cos(), -x.sin(), x.cos()][(n as i64).rem_euclid(4) as usize];
                assert_eq!(sine(x).quarter, if beyond < 0.0 { n - 1.0 } else { n }, "{x}");
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
        // Three adjacent intervals around the maximum at pi/2 + 2 pi k: 3 rad before it, 2e-6 rad across it, and 3.2 rad after it. The last
        // interval contains a minimum.
        for k in -5..5 {
            let crest = PI / 2.0 + 2.0 * PI * k as f64;
            let (a, b, c, d) = (sine(crest - 3.0), sine(crest - 1e-6), sine(crest + 1e-6), sine(crest + 3.2));
            assert!(!crest_inside(&a, &b) && crest_inside(&b, &c) && !crest_inside(&c, &d), "{k}");
            assert!(!trough_inside(&a, &b) && !trough_inside(&b, &c) && trough_inside(&c, &d), "{k}");
        }
    }
}
