//! Explicit AVX-512: eight lanes in a register.
//!
//! Every intrinsic below needs AVX-512 F (and DQ for bit logic). Values of this type are only computed with
//! inside [`Real::enter`], which checks for both.
//!
//! SAFETY (all blocks of this file): the intrinsics only compute on register values, and the processor has
//! them because `enter` refused to run otherwise.

use super::super::{Fused, Kernel, Real, trig};
use super::vector::{rows_fit, sin_cos_near, vector};
use super::{Isa, enter_avx512, isa};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

vector!(
    Avx512,
    __m512d,
    8,
    u8,
    Fused,
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

/// The divider works beside the two ports of everything else: one instruction for six (an estimate and two Newton steps).
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

/// Where bit 0 is set.
#[inline(always)]
fn swap(quadrant: __m512d) -> u8 {
    unsafe { _mm512_test_epi64_mask(_mm512_castpd_si512(quadrant), _mm512_set1_epi64(1)) }
}

/// Bit 1 moved to the sign.
#[inline(always)]
fn sign_of_bit_1(quadrant: __m512d) -> __m512d {
    unsafe { _mm512_castsi512_pd(_mm512_slli_epi64::<62>(_mm512_and_si512(_mm512_castpd_si512(quadrant), _mm512_set1_epi64(2)))) }
}

/// The bits plus one.
#[inline(always)]
fn next(quadrant: __m512d) -> __m512d {
    unsafe { _mm512_castsi512_pd(_mm512_add_epi64(_mm512_castpd_si512(quadrant), _mm512_set1_epi64(1))) }
}

/// An 8 x 8 transpose in three rounds: neighbours within 128 bits, then 128-bit pieces at distance one and two.
#[inline(always)]
fn transpose(x: [__m512d; 8]) -> [__m512d; 8] {
    unsafe {
        let pair = |k: usize| (_mm512_unpacklo_pd(x[k], x[k + 1]), _mm512_unpackhi_pd(x[k], x[k + 1]));
        let ((a0, a1), (b0, b1), (c0, c1), (d0, d1)) = (pair(0), pair(2), pair(4), pair(6));
        // Of a and b the pieces 0 1 | 0 1 and 2 3 | 2 3; of their halves in turn the even and the odd ones.
        let (ab0, ab1) = (_mm512_shuffle_f64x2::<0x88>(a0, b0), _mm512_shuffle_f64x2::<0xdd>(a0, b0));
        let (cd0, cd1) = (_mm512_shuffle_f64x2::<0x88>(c0, d0), _mm512_shuffle_f64x2::<0xdd>(c0, d0));
        let (ab2, ab3) = (_mm512_shuffle_f64x2::<0x88>(a1, b1), _mm512_shuffle_f64x2::<0xdd>(a1, b1));
        let (cd2, cd3) = (_mm512_shuffle_f64x2::<0x88>(c1, d1), _mm512_shuffle_f64x2::<0xdd>(c1, d1));
        [
            _mm512_shuffle_f64x2::<0x88>(ab0, cd0),
            _mm512_shuffle_f64x2::<0x88>(ab2, cd2),
            _mm512_shuffle_f64x2::<0x88>(ab1, cd1),
            _mm512_shuffle_f64x2::<0x88>(ab3, cd3),
            _mm512_shuffle_f64x2::<0xdd>(ab0, cd0),
            _mm512_shuffle_f64x2::<0xdd>(ab2, cd2),
            _mm512_shuffle_f64x2::<0xdd>(ab1, cd1),
            _mm512_shuffle_f64x2::<0xdd>(ab3, cd3),
        ]
    }
}

/// Four lanes, from `first` on, of values `k` and `k + 4` side by side: half of the transpose is done by where memory is read.
#[inline(always)]
fn halves(x: &[Avx512; 8], first: usize, k: usize) -> __m512d {
    let half = |k: usize| {
        // SAFETY: four of the eight numbers of a value.
        unsafe { _mm256_loadu_pd(std::ptr::from_ref(&x[k]).cast::<f64>().add(first)) }
    };
    unsafe { _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(half(k)), half(k + 4)) }
}

/// Rows `first..first + 4`: a 4 x 4 transpose in both halves of a register. Of two pieces that change places one is shuffled and both
/// are blended in, as only one port shuffles.
#[inline(always)]
fn four_rows(x: &[Avx512; 8], first: usize) -> [__m512d; 4] {
    let (a, b, c, d) = (halves(x, first, 0), halves(x, first, 1), halves(x, first, 2), halves(x, first, 3));
    unsafe {
        let across = _mm512_setr_epi64(2, 3, 8, 9, 6, 7, 12, 13);
        let swapped = |left: __m512d, right: __m512d| {
            let middle = _mm512_permutex2var_pd(left, across, right);
            (_mm512_mask_blend_pd(0xcc, left, middle), _mm512_mask_blend_pd(0xcc, middle, right))
        };
        let (row0, row2) = swapped(_mm512_unpacklo_pd(a, b), _mm512_unpacklo_pd(c, d));
        let (row1, row3) = swapped(_mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d));
        [row0, row1, row2, row3]
    }
}

#[inline(always)]
fn transpose_out(x: &[Avx512; 8]) -> [[f64; 8]; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (four_rows(x, 0), four_rows(x, 4));
    [to_array(a), to_array(b), to_array(c), to_array(d), to_array(e), to_array(f), to_array(g), to_array(h)]
}

#[inline(always)]
fn transpose_two(a: __m512d, b: __m512d) -> [[f64; 2]; 8] {
    // Quarter k of each is the pair of lane 2 k, or 2 k + 1.
    let (even, odd) = unsafe { (to_array(_mm512_unpacklo_pd(a, b)), to_array(_mm512_unpackhi_pd(a, b))) };
    let mut pairs = [[0.0; 2]; 8];
    for k in 0..4 {
        (pairs[2 * k], pairs[2 * k + 1]) = ([even[2 * k], even[2 * k + 1]], [odd[2 * k], odd[2 * k + 1]]);
    }
    pairs
}

#[inline(always)]
fn transpose_in(rows: [[f64; 8]; 8]) -> [__m512d; 8] {
    let [a, b, c, d, e, f, g, h] = rows;
    transpose([from_array(a), from_array(b), from_array(c), from_array(d), from_array(e), from_array(f), from_array(g), from_array(h)])
}

#[inline(always)]
fn enter<K: Kernel>(kernel: K) -> K::Output {
    assert!(isa() >= Isa::Avx512, "these lanes need AVX-512");
    enter_avx512(kernel)
}
