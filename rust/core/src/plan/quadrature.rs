//! Integrals of smooth functions over [0, 1], with one quadrature node per SIMD lane.
//!
//! ```text
//! int f = sum over panels of the 21-point Kronrod rule; a panel is halved while this rule differs too much from the 10-point Gauss rule
//! ```
//!
//! The pair of rules is qk21 of QUADPACK. The 8-point Gauss rule is used where a few digits are sufficient.

use crate::scalar::Real;

/// Nodes on [0, 1] of the symmetric 21-point Kronrod rule on [-1, 1], the centre last (QUADPACK, qk21).
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
/// Weights of the 21-point Kronrod rule, in the order of `NODES`.
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
/// Weights of the embedded 10-point Gauss rule, at the Kronrod nodes with odd index.
const GAUSS: [f64; 5] = [
    0.066_671_344_308_688_137_593_568_809_893_332,
    0.149_451_349_150_580_593_145_863_396_957_658,
    0.219_086_362_515_982_043_995_534_934_228_163,
    0.269_266_719_309_996_355_091_226_921_569_469,
    0.295_524_224_714_752_870_173_815_619_188_769,
];
/// Nodes, then weights, of the 8-point Gauss rule on [0, 1].
const FEW: [[f64; 8]; 2] = {
    const NODES: [f64; 4] = [
        0.960_289_856_497_536_231_683_560_868_569_473,
        0.796_666_477_413_626_739_591_553_936_475_83,
        0.525_532_409_916_328_985_817_739_049_189_246,
        0.183_434_642_495_649_804_939_476_142_360_184,
    ];
    const WEIGHTS: [f64; 4] = [
        0.101_228_536_290_376_259_152_531_354_309_962,
        0.222_381_034_453_374_470_544_355_994_426_241,
        0.313_706_645_877_887_287_337_962_201_986_601,
        0.362_683_783_378_361_982_965_150_449_277_195,
    ];
    let mut rule = [[0.0; 8]; 2];
    let mut k = 0;
    while k < 4 {
        (rule[0][k], rule[0][7 - k]) = (0.5 - 0.5 * NODES[k], 0.5 + 0.5 * NODES[k]);
        (rule[1][k], rule[1][7 - k]) = (0.5 * WEIGHTS[k], 0.5 * WEIGHTS[k]);
        k += 1;
    }
    rule
};
const MAX_PANELS: usize = 600;
const MAX_DEPTH: usize = 60;

/// An integrand, evaluated at one place per SIMD lane.
pub(super) trait Integrand {
    fn at<S: Real>(&self, s: S) -> S;
}

/// The integrand after the substitution `s = from + extent t^2`, with `t` from 0 to 1.
pub(super) struct Graded<'a, F> {
    pub f: &'a F,
    pub from: f64,
    pub extent: f64,
}

impl<F: Integrand> Integrand for Graded<'_, F> {
    #[inline(always)]
    fn at<S: Real>(&self, t: S) -> S {
        let extent = S::splat(self.extent);
        S::splat(2.0) * extent.abs() * t * self.f.at(S::splat(self.from) + extent * (t * t))
    }
}

/// Number of nodes of a panel, padded to whole registers: the nodes of `NODES` with both signs, and the centre once.
const COUNT: usize = 24;
/// Nodes on [-1, 1], their Kronrod weights and their Gauss weights.
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
    let mut part: [f64; 8] = std::array::from_fn(|lane| if lane < S::LANES { x.lane(lane) } else { 0.0 });
    for half in [4, 2, 1] {
        for lane in 0..half {
            part[lane] += part[lane + half];
        }
    }
    part[0]
}

/// The integral over one panel, and an error estimate like that of QUADPACK.
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
    // The error of the 21-point rule is far smaller than its difference `d` from the 10-point rule. So QUADPACK estimates this error as
    // (200 d)^1.5.
    let scaled = 200.0 * difference;
    (half * kronrod, half * size * difference.min(scaled * scaled.sqrt()))
}

/// Compute an integral over [0, 1] by adaptive bisection. `other_part` is the value of another part of the same integral, or zero. `accuracy`
/// is relative to the value of a panel, or to a tenth of the integral so far if that is larger. The integral so far is `other_part` plus all
/// finished panels.
#[inline(always)]
pub(super) fn adaptive<S: Real>(f: &impl Integrand, accuracy: f64, other_part: f64) -> f64 {
    let mut stack = [(0.0, 0.0); MAX_DEPTH];
    let (mut sum, mut panels) = (0.0f64, 0);
    stack[0] = (0.0, 1.0);
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (a, b) = stack[top];
        let (value, error) = panel::<S>(f, a, b);
        panels += 1;
        let middle = 0.5 * (a + b);
        let exact = error <= accuracy * value.abs().max(0.1 * (other_part + sum).abs());
        if exact || top + 2 > MAX_DEPTH || panels > MAX_PANELS || middle <= a || middle >= b {
            sum += value;
        } else {
            stack[top] = (middle, b);
            stack[top + 1] = (a, middle);
            top += 2;
        }
    }
    sum
}

/// The integral over [0, 1] by the 8-point Gauss rule.
#[inline(always)]
pub(super) fn few<S: Real>(f: &impl Integrand) -> f64 {
    let mut total = S::zero();
    let mut k = 0;
    while k < FEW[0].len() {
        total += S::load(&FEW[1][k..]) * f.at(S::load(&FEW[0][k..]));
        k += S::LANES;
    }
    sum(total)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_polynomials() {
        // Kronrod 21 is exact to degree 31, and Gauss 10 to degree 19. So the tolerance covers rounding errors only.
        struct Power(i32);
        impl Integrand for Power {
            fn at<S: Real>(&self, s: S) -> S {
                S::from_lanes(|lane| s.lane(lane).powi(self.0))
            }
        }
        for degree in 0..32 {
            let (value, error) = panel::<f64>(&Power(degree), 0.0, 1.0);
            assert!((value * (degree + 1) as f64 - 1.0).abs() < 1e-14, "{degree}: {value}");
            assert!(degree > 19 || error < 1e-15, "{degree}: {error}");
            // Gauss 8 is exact to degree 15.
            assert!(degree > 15 || (few::<f64>(&Power(degree)) * (degree + 1) as f64 - 1.0).abs() < 1e-14, "{degree}");
        }
    }
}
