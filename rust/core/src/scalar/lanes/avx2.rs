//! Explicit AVX2 and FMA: a register has four lanes.
//!
//! SAFETY (all blocks of this file): the intrinsics compute only on register values. The processor has these intrinsics, because `enter`
//! checks the processor.

use super::super::instruction_set::{Isa, enter_avx2, isa};
use super::super::{Kernel, Real, trig};
use super::vector::{sin_cos_near, vector};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

vector!(
    Avx2,
    __m256d,
    4,
    __m256d,
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

/// Copy each lane from `yes` if the sign bit of the mask's lane is set, otherwise from `no`.
#[inline(always)]
fn select(mask: __m256d, yes: __m256d, no: __m256d) -> __m256d {
    unsafe { _mm256_blendv_pd(no, yes, mask) }
}

#[inline(always)]
fn bits(mask: __m256d) -> u32 {
    unsafe { _mm256_movemask_pd(mask) as u32 }
}

/// Move bit 0 to the sign bit.
#[inline(always)]
fn swap(quadrant: __m256d) -> __m256d {
    unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<63>(_mm256_castpd_si256(quadrant))) }
}

/// Move bit 1 to the sign bit, and clear other bits.
#[inline(always)]
fn sign_of_bit_1(quadrant: __m256d) -> __m256d {
    unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<62>(_mm256_and_si256(_mm256_castpd_si256(quadrant), _mm256_set1_epi64x(2)))) }
}

/// Add one to the bits as an integer.
#[inline(always)]
fn next(quadrant: __m256d) -> __m256d {
    unsafe { _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(quadrant), _mm256_set1_epi64x(1))) }
}

#[inline(always)]
fn enter<K: Kernel>(kernel: K) -> K::Output {
    assert!(isa() >= Isa::Avx2, "these lanes need AVX2 and FMA");
    enter_avx2(kernel)
}
