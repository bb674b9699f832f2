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
}

impl Phase {
    #[inline]
    pub fn new(x: f64, push: f64, g: f64) -> Self {
        let (sin, cos) = sin_cos(x);
        Phase { x, push, g, sin, cos }
    }

    /// Net torque at the rest point; the phase moves forward iff positive.
    #[inline(always)]
    pub fn net(&self) -> f64 {
        self.push - self.g * self.sin
    }

    /// `w(y)` and the gradient factor `G cos(x + h) sinc(h)`.
    #[inline(always)]
    fn mean_net(&self, y: f64) -> (f64, f64) {
        let h = 0.5 * y;
        let (s, c) = sin_cos(h);
        let sinc = if h == 0.0 { 1.0 } else { s / h };
        let scaled = self.g * sinc;
        (self.push - scaled * (self.sin * c + self.cos * s), scaled * (self.cos * c - self.sin * s))
    }

    /// Kinetic energy after the stretch `y`.
    #[inline]
    pub fn energy(&self, y: f64) -> f64 {
        y * self.mean_net(y).0
    }

    /// The first stretch in `(0, length)` at which the kinetic energy has a local minimum. Later minima are not
    /// lower, since `K(y + 2 pi) = K(y) + 2 pi p`.
    #[inline]
    pub fn hump(&self, length: f64) -> Option<f64> {
        if self.g.abs() <= self.push {
            return None;
        }
        let angle = (self.push / self.g).asin();
        let least = if self.g > 0.0 { PI - angle } else { angle };
        let y = least - self.x;
        let y = y - TAU * (y / TAU).floor();
        (y > 0.0 && y < length).then_some(y)
    }

    /// `F(x, length)`: phase time over `sqrt(I/2)`.
    #[inline]
    pub fn time_factor(&self, length: f64) -> f64 {
        2.0 * length.sqrt() * self.integrate(length, ACCURACY, |w, _| 1.0 / w.sqrt())
    }

    /// `dF/dx` at fixed length, to the relative `accuracy`.
    #[inline]
    pub fn time_gradient(&self, length: f64, accuracy: f64) -> f64 {
        length.sqrt() * self.integrate(length, accuracy, |w, gradient| gradient / (w * w.sqrt()))
    }

    /// `w` and its gradient factor at the nodes `s` of `y = L s^2`. Stretches up to pi need no reduction of the angle:
    /// with q = y/4 <= pi/4, `sinc h = sinc q cos q` and `cos h = 1 - 2 sin^2 q`, in plain arrays that the compiler vectorises.
    #[inline(always)]
    fn at_nodes(&self, length: f64, s: &Nodes) -> (Nodes, Nodes) {
        let (mut w, mut gradient) = ([0.0; COUNT], [0.0; COUNT]);
        let floor = 1e-18 * (self.push.abs() + self.g.abs());
        if length <= PI {
            for k in 0..COUNT {
                let q = 0.25 * length * s[k] * s[k];
                let (sinc_q, cos_q) = sinc_cos_small(q);
                let (sinc, sin_q) = (sinc_q * cos_q, q * sinc_q);
                let (sin_h, cos_h) = (2.0 * q * sinc, 1.0 - 2.0 * sin_q * sin_q);
                let scaled = self.g * sinc;
                w[k] = (self.push - scaled * (self.sin * cos_h + self.cos * sin_h)).max(floor);
                gradient[k] = scaled * (self.cos * cos_h - self.sin * sin_h);
            }
        } else {
            for k in 0..COUNT {
                let (net, slope) = self.mean_net(length * s[k] * s[k]);
                (w[k], gradient[k]) = (net.max(floor), slope);
            }
        }
        (w, gradient)
    }

    /// `int_0^1 f(w(L s^2), ..) ds`, split at the hump.
    #[inline(always)]
    fn integrate(&self, length: f64, accuracy: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
        let values = |s: &Nodes| {
            let (w, gradient) = self.at_nodes(length, s);
            let mut value = [0.0; COUNT];
            for k in 0..COUNT {
                value[k] = f(w[k], gradient[k]);
            }
            value
        };
        match self.hump(length) {
            None => adaptive(&values, &[0.0, 1.0], accuracy),
            Some(y) => adaptive(&values, &[0.0, (y / length).sqrt(), 1.0], accuracy),
        }
    }
}

/// Nodes of a panel in order of `NODES` with both signs; the centre stands twice, with half its weight.
type Nodes = [f64; COUNT];
const COUNT: usize = 22;

/// Integral and error estimate (after QUADPACK) on one panel.
#[inline(always)]
fn panel(f: &impl Fn(&Nodes) -> Nodes, a: f64, b: f64) -> (f64, f64) {
    let (centre, half) = (0.5 * (a + b), 0.5 * (b - a));
    let mut s = [0.0; COUNT];
    for k in 0..11 {
        (s[k], s[k + 11]) = (centre - half * NODES[k], centre + half * NODES[k]);
    }
    let v = f(&s);
    let (mut kronrod, mut gauss, mut size) = (KRONROD[10] * v[10], 0.0, KRONROD[10] * v[10].abs());
    for k in 0..10 {
        kronrod += KRONROD[k] * (v[k] + v[k + 11]);
        size += KRONROD[k] * (v[k].abs() + v[k + 11].abs());
    }
    for k in 0..5 {
        gauss += GAUSS[k] * (v[2 * k + 1] + v[2 * k + 12]);
    }
    let difference = (kronrod - gauss).abs() / size;
    // The 21-point rule is far better than its difference from the 10-point one: QUADPACK's (200 d)^1.5.
    let scaled = 200.0 * difference;
    (half * kronrod, half * size * difference.min(scaled * scaled.sqrt()))
}

#[inline(always)]
fn adaptive(f: &impl Fn(&Nodes) -> Nodes, breaks: &[f64], accuracy: f64) -> f64 {
    let mut stack = [(0.0, 0.0); MAX_DEPTH];
    let (mut sum, mut panels) = (0.0f64, 0);
    for pair in breaks.windows(2) {
        stack[0] = (pair[0], pair[1]);
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (a, b) = stack[top];
            let (value, error) = panel(f, a, b);
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
        for degree in 0..32 {
            let (value, error) = panel(&|x: &Nodes| x.map(|x| x.powi(degree)), 0.0, 1.0);
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
