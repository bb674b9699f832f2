//! Explicit AVX-512: a register has eight lanes.
//!
//! The intrinsics below require AVX-512 F, and DQ for bit operations. Code computes with this type only inside [`Real::enter`], which
//! checks that the processor has both.
//!
//! SAFETY (all blocks of this file): the intrinsics compute only on register values. The processor has these intrinsics, because `enter`
//! checks the processor.

use super::super::instruction_set::{Isa, enter_avx512, isa};
use super::super::{Kernel, Real, trig};
use super::vector::{sin_cos_near, vector};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

vector!(
    Avx512,
    __m512d,
    8,
    u8,
    _mm512_set1_pd,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_sqrt_pd,
    _mm512_max_pd,
    _mm512_min_pd,
    _mm512_xor_pd,
    _mm512_andnot_pd
);
sin_cos_near!(__m512d, _mm512_set1_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_xor_pd, swap, sign_of_bit_1, next);

#[inline(always)]
fn fma(a: __m512d, b: __m512d, c: __m512d) -> __m512d {
    unsafe { _mm512_fmadd_pd(a, b, c) }
}

#[inline(always)]
fn fnma(a: __m512d, b: __m512d, c: __m512d) -> __m512d {
    unsafe { _mm512_fnmadd_pd(a, b, c) }
}

/// The reciprocal is a division, because the divider works in parallel with the two ports of other instructions. The alternative would be
/// six instructions (an estimate and two Newton steps).
#[inline(always)]
fn recip(x: __m512d) -> __m512d {
    unsafe { _mm512_div_pd(_mm512_set1_pd(1.0), x) }
}

#[inline(always)]
fn lt(a: __m512d, b: __m512d) -> u8 {
    unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b) }
}

#[inline(always)]
fn select(mask: u8, yes: __m512d, no: __m512d) -> __m512d {
    unsafe { _mm512_mask_blend_pd(mask, no, yes) }
}

#[inline(always)]
fn bits(mask: u8) -> u32 {
    u32::from(mask)
}

/// Return the lanes in which bit 0 is set.
#[inline(always)]
fn swap(quadrant: __m512d) -> u8 {
    unsafe { _mm512_test_epi64_mask(_mm512_castpd_si512(quadrant), _mm512_set1_epi64(1)) }
}

/// Move bit 1 to the sign bit, and clear other bits.
#[inline(always)]
fn sign_of_bit_1(quadrant: __m512d) -> __m512d {
    unsafe { _mm512_castsi512_pd(_mm512_slli_epi64::<62>(_mm512_and_si512(_mm512_castpd_si512(quadrant), _mm512_set1_epi64(2)))) }
}

/// Add one to the bits as an integer.
#[inline(always)]
fn next(quadrant: __m512d) -> __m512d {
    unsafe { _mm512_castsi512_pd(_mm512_add_epi64(_mm512_castpd_si512(quadrant), _mm512_set1_epi64(1))) }
}

#[inline(always)]
fn enter<K: Kernel>(kernel: K) -> K::Output {
    assert!(isa() >= Isa::Avx512, "these lanes need AVX-512");
    enter_avx512(kernel)
}
