//! Time of a phase of constant torque that starts (or, run backwards, ends) at rest.
//!
//! ```text
//! from rest at x under constant torque p:   K(y) = p y - G (cos x - cos(x + y)) = y w(y)
//! w(y) = p - G sin(x + h) sinc(h),  h = y/2                        (mean net torque over the stretch, no cancellation at y -> 0)
//! F(x, L) = int_0^L dy / sqrt(K) = 2 sqrt(L) int_0^1 ds / sqrt(w(L s^2)),   time = sqrt(I/2) F
//! dF/dx  = sqrt(L) int_0^1 G cos(x + h) sinc(h) w^(-3/2) ds,       dF/dL = 1/sqrt(K(L))
//! ```
//!
//! The substitution `y = L s^2` removes the inverse square root at the rest point. What remains is smooth unless
//! `w` comes near zero (a hump barely cleared): adaptive bisection with the 10-21 point Gauss-Kronrod pair then
//! gains a digit per few panels, since the integrand is analytic up to the near pole. A phase that brakes to rest
//! at x is the same phase from `-x` run backwards, with the braking torque as push.

use super::sine::{sin_cos, sinc_cos_small};
use crate::scalar::{Real, Task, run_lanes};
use std::f64::consts::{PI, TAU};

/// Nodes on (0, 1] of the symmetric 21-point Kronrod rule on [-1, 1] (the centre last), and its weights (QUADPACK, qk21).
const NODES: [f64; 11] = [
    0.995_657_163_025_808_080_735_527_280_689_003,
    0.973_906_528_517_171_720_077_964_012_084_452,
    0.930_157_491_355_708_226_001_207_180_059_508,
    0.865_063_366_688_984_510_732_096_688_423_493,
    0.780_817_726_586_416_897_063_717_578_345_042,
    0.679_409_568_299_024_406_234_327_365_114_874,
    0.562_757_134_668_604_683_339_000_099_272_694,
    0.433_395_394_129_247_190_799_265_943_165_784,
    0.294_392_862_701_460_198_131_126_603_103_866,
    0.148_874_338_981_631_210_884_826_001_129_72,
    0.0,
];
const KRONROD: [f64; 11] = [
    0.011_694_638_867_371_874_278_064_396_062_192,
    0.032_558_162_307_964_727_478_818_972_459_39,
    0.054_755_896_574_351_996_031_381_300_244_58,
    0.075_039_674_810_919_952_767_043_140_916_19,
    0.093_125_454_583_697_605_535_065_465_083_366,
    0.109_387_158_802_297_641_899_210_590_325_805,
    0.123_491_976_262_065_851_077_958_109_585_166,
    0.134_709_217_311_473_325_928_054_001_771_707,
    0.142_775_938_577_060_080_797_094_273_138_717,
    0.147_739_104_901_338_491_374_841_515_972_068,
    0.149_445_554_002_916_905_664_936_468_389_821,
];
/// Weights of the embedded 10-point Gauss rule, at the odd Kronrod nodes.
const GAUSS: [f64; 5] = [
    0.066_671_344_308_688_137_593_568_809_893_332,
    0.149_451_349_150_580_593_145_863_396_957_658,
    0.219_086_362_515_982_043_995_534_934_228_163,
    0.269_266_719_309_996_355_091_226_921_569_469,
    0.295_524_224_714_752_870_173_815_619_188_769,
];
/// Panels after which the quadrature stops refining: moves of a hundred turns stay below it.
const MAX_PANELS: usize = 600;
/// Relative accuracy of a time, of each panel.
const ACCURACY: f64 = 3e-14;
const MAX_DEPTH: usize = 60;

/// Constant net push `p` from rest at `x` against `g sin`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Phase {
    pub x: f64,
    pub push: f64,
    pub g: f64,
    sin: f64,
    cos: f64,
    /// An angle at which the kinetic energy has a local minimum; NaN if the push is ahead of gravity everywhere.
    least: f64,
}

impl Phase {
    #[inline]
    pub fn new(x: f64, push: f64, g: f64) -> Self {
        let (sin, cos) = sin_cos(x);
        let least = if g.abs() <= push {
            f64::NAN
        } else if g > 0.0 {
            PI - (push / g).asin()
        } else {
            (push / g).asin()
        };
        Phase { x, push, g, sin, cos, least }
    }

    /// The same push from rest at another place.
    #[inline]
    pub fn moved(&self, x: f64) -> Self {
        let (sin, cos) = sin_cos(x);
        Phase { x, sin, cos, ..*self }
    }

    /// Net torque at the rest point; the phase moves forward iff positive.
    #[inline(always)]
    pub fn net(&self) -> f64 {
        self.push - self.g * self.sin
    }

    /// Kinetic energy after the stretch `y`.
    #[inline]
    pub fn energy(&self, y: f64) -> f64 {
        let h = 0.5 * y;
        let (s, c) = sin_cos(h);
        let sinc = if h == 0.0 { 1.0 } else { s / h };
        y * (self.push - self.g * sinc * (self.sin * c + self.cos * s))
    }

    /// The first stretch in `(0, length)` at which the kinetic energy has a local minimum. Later minima are not
    /// lower, since `K(y + 2 pi) = K(y) + 2 pi p`.
    #[inline]
    pub fn hump(&self, length: f64) -> Option<f64> {
        let y = self.least - self.x;
        let y = y - TAU * (y / TAU).floor();
        (y > 0.0 && y < length).then_some(y)
    }

    /// `F(x, length)`: phase time over `sqrt(I/2)`.
    pub fn time_factor(&self, length: f64) -> f64 {
        2.0 * length.sqrt() * run_lanes(Integral::<false> { phase: *self, length, accuracy: ACCURACY })
    }

    /// `dF/dx` at fixed length, to the relative `accuracy`.
    pub fn time_gradient(&self, length: f64, accuracy: f64) -> f64 {
        length.sqrt() * run_lanes(Integral::<true> { phase: *self, length, accuracy })
    }
}

/// `int_0^1 1/sqrt(w) ds` at `y = L s^2`, or with `GRADIENT` `int_0^1 G cos(x + h) sinc(h) w^(-3/2) ds`.
struct Integral<const GRADIENT: bool> {
    phase: Phase,
    length: f64,
    accuracy: f64,
}

impl<const GRADIENT: bool> Task for Integral<GRADIENT> {
    type Output = f64;
    #[inline(always)]
    fn run<S: Real>(self) -> f64 {
        // Split at the hump, where w is least.
        match self.phase.hump(self.length) {
            None => adaptive::<S>(&self, &[0.0, 1.0], self.accuracy),
            Some(y) => adaptive::<S>(&self, &[0.0, (y / self.length).sqrt(), 1.0], self.accuracy),
        }
    }
}

/// What is integrated, at several places.
trait Integrand {
    fn at<S: Real>(&self, s: S) -> S;
}

impl<const GRADIENT: bool> Integrand for Integral<GRADIENT> {
    #[inline(always)]
    fn at<S: Real>(&self, s: S) -> S {
        let Integral { phase: Phase { push, g, sin, cos, .. }, length, .. } = *self;
        let k = S::splat;
        let y = k(length) * s * s;
        // Stretches up to pi need no reduction of the angle: with q = y/4 <= pi/4, sinc h = sinc q cos q and cos h = 1 - 2 sin^2 q.
        let (sinc, sin_h, cos_h) = if length <= PI {
            let q = k(0.25) * y;
            let (sinc_q, cos_q) = sinc_cos_small(q);
            let (sinc, sin_q) = (sinc_q * cos_q, q * sinc_q);
            (sinc, k(2.0) * q * sinc, k(1.0) - k(2.0) * sin_q * sin_q)
        } else {
            let h = k(0.5) * y;
            let (sin_h, cos_h) = h.sin_cos();
            let some = S::zero().lt(h);
            (S::select(some, sin_h / S::select(some, h, k(1.0)), k(1.0)), sin_h, cos_h)
        };
        let scaled = k(g) * sinc;
        let w = (k(push) - scaled * (k(sin) * cos_h + k(cos) * sin_h)).max(k(1e-18 * (push.abs() + g.abs())));
        if GRADIENT { scaled * (k(cos) * cos_h - k(sin) * sin_h) / (w * w.sqrt()) } else { k(1.0) / w.sqrt() }
    }
}

/// Places of a panel, padded to whole lanes: the nodes of `NODES` with either sign, the centre once.
const COUNT: usize = 24;
/// Nodes on [-1, 1], Kronrod weights and Gauss weights.
const RULE: [[f64; COUNT]; 3] = {
    let mut rule = [[0.0; COUNT]; 3];
    let mut k = 0;
    while k < 11 {
        (rule[0][k], rule[1][k]) = (NODES[k], KRONROD[k]);
        if k < 10 {
            (rule[0][k + 11], rule[1][k + 11]) = (-NODES[k], KRONROD[k]);
        }
        if k % 2 == 1 && k < 10 {
            (rule[2][k], rule[2][k + 11]) = (GAUSS[k / 2], GAUSS[k / 2]);
        }
        k += 1;
    }
    rule
};

#[inline(always)]
fn sum<S: Real>(x: S) -> f64 {
    let mut sum = 0.0;
    for lane in 0..S::LANES {
        sum += x.lane(lane);
    }
    sum
}

/// Integral and error estimate (after QUADPACK) on one panel.
#[inline(always)]
fn panel<S: Real>(f: &impl Integrand, a: f64, b: f64) -> (f64, f64) {
    let (centre, half) = (S::splat(0.5 * (a + b)), S::splat(0.5 * (b - a)));
    let (mut kronrod, mut gauss, mut size) = (S::zero(), S::zero(), S::zero());
    let mut k = 0;
    while k < COUNT {
        let value = f.at(centre + half * S::load(&RULE[0][k..]));
        let part = S::load(&RULE[1][k..]) * value;
        kronrod += part;
        size += part.abs();
        gauss += S::load(&RULE[2][k..]) * value;
        k += S::LANES;
    }
    let (kronrod, gauss, size, half) = (sum(kronrod), sum(gauss), sum(size), 0.5 * (b - a));
    let difference = (kronrod - gauss).abs() / size;
    // The 21-point rule is far better than its difference from the 10-point one: QUADPACK's (200 d)^1.5.
    let scaled = 200.0 * difference;
    (half * kronrod, half * size * difference.min(scaled * scaled.sqrt()))
}

#[inline(always)]
fn adaptive<S: Real>(f: &impl Integrand, breaks: &[f64], accuracy: f64) -> f64 {
    let mut stack = [(0.0, 0.0); MAX_DEPTH];
    let (mut sum, mut panels) = (0.0f64, 0);
    for pair in breaks.windows(2) {
        stack[0] = (pair[0], pair[1]);
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (a, b) = stack[top];
            let (value, error) = panel::<S>(f, a, b);
            panels += 1;
            let middle = 0.5 * (a + b);
            let exact = error <= accuracy * value.abs().max(0.1 * sum.abs());
            if exact || top + 2 > MAX_DEPTH || panels > MAX_PANELS || middle <= a || middle >= b {
                sum += value;
            } else {
                stack[top] = (middle, b);
                stack[top + 1] = (a, middle);
                top += 2;
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_polynomials() {
        // Kronrod 21 is exact to degree 31, Gauss 10 to degree 19: rounding only.
        struct Power(i32);
        impl Integrand for Power {
            fn at<S: Real>(&self, s: S) -> S {
                s.map(|s| s.powi(self.0))
            }
        }
        for degree in 0..32 {
            let (value, error) = panel::<f64>(&Power(degree), 0.0, 1.0);
            assert!((value * (degree + 1) as f64 - 1.0).abs() < 1e-14, "{degree}: {value}");
            assert!(degree > 19 || error < 1e-15, "{degree}: {error}");
        }
    }

    #[test]
    fn gradient_is_the_derivative() {
        let h = 1e-5;
        for (x, push, g, length) in [(0.3, 1.0, 0.8, 2.0), (2.0, 1.2, 1.0, 4.0), (-3.0, 2.0, 2.5, 0.4), (1.0, 1.0, -0.9, 12.0)] {
            let f = |x: f64| Phase::new(x, push, g).time_factor(length);
            let difference = (f(x + h) - f(x - h)) / (2.0 * h);
            let exact = Phase::new(x, push, g).time_gradient(length, 1e-12);
            assert!((difference - exact).abs() < 1e-8 * (1.0 + exact.abs()), "{difference} {exact}");
        }
    }
}
