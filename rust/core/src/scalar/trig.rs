//! Sine and cosine for `|x|` below [`REDUCTION_LIMIT`], without a library call, so that they vectorise. Below this limit, the bits depend
//! only on whether multiply-add operations are fused ([`fuses`](super::fuses)).
//!
//! The argument is `x = k pi/2 + r`, where pi/2 is the sum of three parts with at most 33, 33 and 53 bits (Cody and Waite, fdlibm's parts).
//! The product of `k` and each of the first two parts is exact for `|k| < 2^20`. Minimax polynomials for `|r| <= pi/4` follow (fdlibm's
//! coefficients). A lane with NaN or with `|x| >= REDUCTION_LIMIT` calls the library function.

/// Below this `|x|`, rad, sine and cosine have an error of at most 1.5 units in the last place.
pub const REDUCTION_LIMIT: f64 = 1.0e6;

pub(crate) const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
/// 1.5 * 2^52. Adding this number rounds to an integer, which is then in the low bits of the sum.
pub const ROUND: f64 = 6_755_399_441_055_744.0;
pub(crate) const PIO2: [f64; 3] = [1.570_796_326_734_125_614_17, 6.077_100_506_303_965_976_60e-11, 2.022_266_248_795_950_631_54e-21];
pub(crate) const SIN: [f64; 6] = [
    1.589_690_995_211_550_102_21e-10,
    -2.505_076_025_340_686_341_95e-8,
    2.755_731_370_707_006_767_89e-6,
    -1.984_126_982_985_794_931_34e-4,
    8.333_333_333_322_489_461_24e-3,
    -1.666_666_666_666_663_243_48e-1,
];
pub(crate) const COS: [f64; 6] = [
    -1.135_964_755_778_819_482_65e-11,
    2.087_572_321_298_174_827_90e-9,
    -2.755_731_435_139_066_330_35e-7,
    2.480_158_728_947_672_941_78e-5,
    -1.388_888_888_887_410_957_49e-3,
    4.166_666_666_666_660_190_37e-2,
];

/// Return `a b + c`. Callers set `FUSED` only if [`fuses`](super::fuses) is true. `f64::mul_add` would call the C library in code that is
/// compiled for all x86-64 processors.
#[inline(always)]
pub(super) fn fma<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if !FUSED {
        return a * b + c;
    }
    #[cfg(target_arch = "x86_64")]
    {
        let mut product = a;
        // SAFETY: the processor has this instruction, which computes only on registers.
        unsafe {
            std::arch::asm!("vfmadd213sd {0}, {1}, {2}", inout(xmm_reg) product, in(xmm_reg) b, in(xmm_reg) c, options(pure, nomem, nostack, preserves_flags));
        }
        product
    }
    #[cfg(not(target_arch = "x86_64"))]
    a.mul_add(b, c)
}

/// Return sine and cosine for `|x| < REDUCTION_LIMIT`, without a branch.
#[inline(always)]
pub(super) fn sin_cos_near<const FUSED: bool>(x: f64) -> (f64, f64) {
    sin_cos_near_by(x, fma::<FUSED>)
}

/// Return sine and cosine for `|x| < REDUCTION_LIMIT`, without a branch. `fma(a, b, c)` computes `a b + c`.
#[inline(always)]
pub(crate) fn sin_cos_near_by(x: f64, fma: impl Fn(f64, f64, f64) -> f64) -> (f64, f64) {
    let rounded = fma(x, TWO_OVER_PI, ROUND);
    let (quadrant, k) = (rounded.to_bits(), rounded - ROUND);
    let r = fma(-k, PIO2[2], fma(-k, PIO2[1], fma(-k, PIO2[0], x)));
    let (z, zz) = (r * r, (r * r) * (r * r));
    // The polynomial is evaluated in pairs of coefficients (Estrin), so that fewer operations wait for one another.
    let pair = |a: [f64; 6], k: usize| fma(a[k], z, a[k + 1]);
    let polynomial = |a| fma(fma(pair(a, 0), zz, pair(a, 2)), zz, pair(a, 4));
    let sin = fma(r * z, polynomial(SIN), r).to_bits();
    let cos = fma(zz, polynomial(COS), fma(-0.5, z, 1.0)).to_bits();
    let swap = 0u64.wrapping_sub(quadrant & 1);
    let s = ((sin & !swap) | (cos & swap)) ^ ((quadrant & 2) << 62);
    let c = ((cos & !swap) | (sin & swap)) ^ ((quadrant.wrapping_add(1) & 2) << 62);
    (f64::from_bits(s), f64::from_bits(c))
}

/// Return sine and cosine of angles `|x| >= REDUCTION_LIMIT`, rad. The results are NaN for infinity and NaN.
#[cold]
#[inline(never)]
pub(crate) fn sin_cos_far(x: f64) -> (f64, f64) {
    x.sin_cos()
}
