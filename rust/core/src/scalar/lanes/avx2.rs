//! Explicit AVX2 and FMA: four lanes in a register.
//!
//! SAFETY (all blocks of this file): the intrinsics only compute on register values, and the processor has
//! them because `enter` refused to run otherwise.

use super::super::{Fused, Kernel, Real, trig};
use super::vector::{rows_fit, sin_cos_near, vector};
use super::{Isa, enter_avx2, isa};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

vector!(
    Avx2,
    __m256d,
    4,
    __m256d,
    Fused,
    _mm256_set1_pd,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_sqrt_pd,
    _mm256_max_pd,
    _mm256_min_pd,
    _mm256_xor_pd,
    _mm256_andnot_pd
);
sin_cos_near!(__m256d, _mm256_set1_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_xor_pd, swap, sign_of_bit_1, next);

#[inline(always)]
fn fma(a: __m256d, b: __m256d, c: __m256d) -> __m256d {
    unsafe { _mm256_fmadd_pd(a, b, c) }
}

#[inline(always)]
fn fnma(a: __m256d, b: __m256d, c: __m256d) -> __m256d {
    unsafe { _mm256_fnmadd_pd(a, b, c) }
}

#[inline(always)]
fn recip(x: __m256d) -> __m256d {
    unsafe { _mm256_div_pd(_mm256_set1_pd(1.0), x) }
}

#[inline(always)]
fn lt(a: __m256d, b: __m256d) -> __m256d {
    unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(a, b) }
}

/// By the sign bit of the mask.
#[inline(always)]
fn select(mask: __m256d, yes: __m256d, no: __m256d) -> __m256d {
    unsafe { _mm256_blendv_pd(no, yes, mask) }
}

#[inline(always)]
fn bits(mask: __m256d) -> u32 {
    unsafe { _mm256_movemask_pd(mask) as u32 }
}

/// Bit 0 moved to the sign.
#[inline(always)]
fn swap(quadrant: __m256d) -> __m256d {
    unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<63>(_mm256_castpd_si256(quadrant))) }
}

/// Bit 1 moved to the sign.
#[inline(always)]
fn sign_of_bit_1(quadrant: __m256d) -> __m256d {
    unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<62>(_mm256_and_si256(_mm256_castpd_si256(quadrant), _mm256_set1_epi64x(2)))) }
}

/// The bits plus one.
#[inline(always)]
fn next(quadrant: __m256d) -> __m256d {
    unsafe { _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(quadrant), _mm256_set1_epi64x(1))) }
}

/// A 4 x 4 transpose in two rounds.
#[inline(always)]
fn transpose(a: __m256d, b: __m256d, c: __m256d, d: __m256d) -> [__m256d; 4] {
    unsafe {
        let (ab0, ab1) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (cd0, cd1) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(ab0, cd0),
            _mm256_permute2f128_pd::<0x20>(ab1, cd1),
            _mm256_permute2f128_pd::<0x31>(ab0, cd0),
            _mm256_permute2f128_pd::<0x31>(ab1, cd1),
        ]
    }
}

#[inline(always)]
fn transpose_out([a, b, c, d, e, f, g, h]: &[Avx2; 8]) -> [[f64; 8]; 4] {
    let (left, right) = (transpose(a.0, b.0, c.0, d.0), transpose(e.0, f.0, g.0, h.0));
    let mut rows = [[0.0; 8]; 4];
    for lane in 0..4 {
        let ([a, b, c, d], [e, f, g, h]) = (to_array(left[lane]), to_array(right[lane]));
        rows[lane] = [a, b, c, d, e, f, g, h];
    }
    rows
}

#[inline(always)]
fn transpose_two(a: __m256d, b: __m256d) -> [[f64; 2]; 4] {
    // Halves of each are the pairs of lanes 0 and 2, or 1 and 3.
    let (even, odd) = unsafe { (to_array(_mm256_unpacklo_pd(a, b)), to_array(_mm256_unpackhi_pd(a, b))) };
    [[even[0], even[1]], [odd[0], odd[1]], [even[2], even[3]], [odd[2], odd[3]]]
}

#[inline(always)]
fn transpose_in(rows: [[f64; 8]; 4]) -> [__m256d; 8] {
    let left = |lane: usize| from_array([rows[lane][0], rows[lane][1], rows[lane][2], rows[lane][3]]);
    let right = |lane: usize| from_array([rows[lane][4], rows[lane][5], rows[lane][6], rows[lane][7]]);
    let [p, q, r, s] = transpose(left(0), left(1), left(2), left(3));
    let [t, u, v, w] = transpose(right(0), right(1), right(2), right(3));
    [p, q, r, s, t, u, v, w]
}

#[inline(always)]
fn enter<K: Kernel>(kernel: K) -> K::Output {
    assert!(isa() >= Isa::Avx2, "these lanes need AVX2 and FMA");
    enter_avx2(kernel)
}
