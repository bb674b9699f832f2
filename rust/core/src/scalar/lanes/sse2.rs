//! Explicit SSE2, which every x86-64 processor has: a register has two lanes, and multiply-add is not fused.
//!
//! SAFETY (all blocks of this file): the intrinsics compute only on register values, and every x86-64 processor has them.

use super::super::{Kernel, Real, trig};
use super::vector::{sin_cos_near, vector};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

vector!(
    Sse2,
    __m128d,
    2,
    __m128d,
    _mm_set1_pd,
    _mm_add_pd,
    _mm_sub_pd,
    _mm_mul_pd,
    _mm_div_pd,
    _mm_sqrt_pd,
    _mm_max_pd,
    _mm_min_pd,
    _mm_xor_pd,
    _mm_andnot_pd
);
sin_cos_near!(__m128d, _mm_set1_pd, _mm_sub_pd, _mm_mul_pd, _mm_xor_pd, swap, sign_of_bit_1, next);

#[inline(always)]
fn fma(a: __m128d, b: __m128d, c: __m128d) -> __m128d {
    unsafe { _mm_add_pd(_mm_mul_pd(a, b), c) }
}

#[inline(always)]
fn fnma(a: __m128d, b: __m128d, c: __m128d) -> __m128d {
    unsafe { _mm_sub_pd(c, _mm_mul_pd(a, b)) }
}

#[inline(always)]
fn recip(x: __m128d) -> __m128d {
    unsafe { _mm_div_pd(_mm_set1_pd(1.0), x) }
}

#[inline(always)]
fn lt(a: __m128d, b: __m128d) -> __m128d {
    unsafe { _mm_cmplt_pd(a, b) }
}

/// Copy each bit from `yes` where the bit of the mask is one, otherwise from `no`.
#[inline(always)]
fn select(mask: __m128d, yes: __m128d, no: __m128d) -> __m128d {
    unsafe { _mm_or_pd(_mm_and_pd(mask, yes), _mm_andnot_pd(mask, no)) }
}

#[inline(always)]
fn bits(mask: __m128d) -> u32 {
    unsafe { _mm_movemask_pd(mask) as u32 }
}

/// Set all bits of a lane if its bit 0 is set, otherwise clear them.
#[inline(always)]
fn swap(quadrant: __m128d) -> __m128d {
    unsafe { _mm_castsi128_pd(_mm_sub_epi64(_mm_setzero_si128(), _mm_and_si128(_mm_castpd_si128(quadrant), _mm_set1_epi64x(1)))) }
}

/// Move bit 1 to the sign bit, and clear other bits.
#[inline(always)]
fn sign_of_bit_1(quadrant: __m128d) -> __m128d {
    unsafe { _mm_castsi128_pd(_mm_slli_epi64::<62>(_mm_and_si128(_mm_castpd_si128(quadrant), _mm_set1_epi64x(2)))) }
}

/// Add one to the bits as an integer.
#[inline(always)]
fn next(quadrant: __m128d) -> __m128d {
    unsafe { _mm_castsi128_pd(_mm_add_epi64(_mm_castpd_si128(quadrant), _mm_set1_epi64x(1))) }
}

#[inline(always)]
fn enter<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
