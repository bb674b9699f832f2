//! Explicit AVX-512: `U` vectors of eight lanes, interleaved where `U > 1` to hide the latency of one chain.
//!
//! Every intrinsic below needs AVX-512 F (and DQ for the trigonometric bit logic). Values of this type are
//! only computed with inside [`Real::enter`], which checks for both.

use super::super::{Kernel, Real, trig};
use super::{Isa, enter_avx512, isa};
use std::arch::x86_64::*;
use std::array::from_fn;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

#[derive(Clone, Copy, Debug)]
pub struct Avx512<const U: usize>([__m512d; U]);

// SAFETY (all blocks of this file): the intrinsics only compute on register values, and the processor has them
// because `enter` refused to run otherwise; `splat` and `from_lanes` used outside compile to plain moves there.
macro_rules! operator {
    ($trait:ident, $method:ident, $assign:ident, $assign_method:ident, $intrinsic:ident) => {
        impl<const U: usize> $trait for Avx512<U> {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for i in 0..U {
                    self.0[i] = unsafe { $intrinsic(self.0[i], other.0[i]) };
                }
                self
            }
        }
        impl<const U: usize> $assign for Avx512<U> {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = $trait::$method(*self, other);
            }
        }
    };
}
operator!(Add, add, AddAssign, add_assign, _mm512_add_pd);
operator!(Sub, sub, SubAssign, sub_assign, _mm512_sub_pd);
operator!(Mul, mul, MulAssign, mul_assign, _mm512_mul_pd);

impl<const U: usize> Div for Avx512<U> {
    type Output = Self;
    #[inline(always)]
    fn div(mut self, other: Self) -> Self {
        for i in 0..U {
            self.0[i] = unsafe { _mm512_div_pd(self.0[i], other.0[i]) };
        }
        self
    }
}

impl<const U: usize> Neg for Avx512<U> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|x| unsafe { _mm512_xor_pd(x, _mm512_set1_pd(-0.0)) })
    }
}

impl<const U: usize> Default for Avx512<U> {
    #[inline(always)]
    fn default() -> Self {
        Self::splat(0.0)
    }
}

impl<const U: usize> Avx512<U> {
    #[inline(always)]
    fn each(mut self, f: impl Fn(__m512d) -> __m512d) -> Self {
        for i in 0..U {
            self.0[i] = f(self.0[i]);
        }
        self
    }
}

/// One Newton step doubles the 14 bits of the estimate, the cubic one triples them: 1 ulp.
#[inline(always)]
fn recip8(x: __m512d) -> __m512d {
    unsafe {
        let one = _mm512_set1_pd(1.0);
        let y = _mm512_rcp14_pd(x);
        let e = _mm512_fnmadd_pd(x, y, one);
        let y = _mm512_fmadd_pd(_mm512_fmadd_pd(e, e, e), y, y);
        let e = _mm512_fnmadd_pd(x, y, one);
        _mm512_fmadd_pd(e, y, y)
    }
}

#[inline(always)]
fn sin_cos8(x: __m512d) -> (__m512d, __m512d) {
    unsafe {
        let set = |v: f64| _mm512_set1_pd(v);
        let rounded = _mm512_fmadd_pd(x, set(trig::TWO_OVER_PI), set(trig::ROUND));
        let quadrant = _mm512_castpd_si512(rounded);
        let k = _mm512_sub_pd(rounded, set(trig::ROUND));
        let r = _mm512_fnmadd_pd(k, set(trig::PIO2[0]), x);
        let r = _mm512_fnmadd_pd(k, set(trig::PIO2[1]), r);
        let r = _mm512_fnmadd_pd(k, set(trig::PIO2[2]), r);
        let z = _mm512_mul_pd(r, r);
        let (mut sin, mut cos) = (set(trig::SIN[0]), set(trig::COS[0]));
        for i in 1..6 {
            sin = _mm512_fmadd_pd(sin, z, set(trig::SIN[i]));
            cos = _mm512_fmadd_pd(cos, z, set(trig::COS[i]));
        }
        let sin = _mm512_fmadd_pd(_mm512_mul_pd(r, z), sin, r);
        let cos = _mm512_fmadd_pd(_mm512_mul_pd(z, z), cos, _mm512_fnmadd_pd(set(0.5), z, set(1.0)));
        let swap = _mm512_test_epi64_mask(quadrant, _mm512_set1_epi64(1));
        let two = _mm512_set1_epi64(2);
        let sign_sin = _mm512_slli_epi64::<62>(_mm512_and_si512(quadrant, two));
        let sign_cos = _mm512_slli_epi64::<62>(_mm512_and_si512(_mm512_add_epi64(quadrant, _mm512_set1_epi64(1)), two));
        let s = _mm512_xor_pd(_mm512_mask_blend_pd(swap, sin, cos), _mm512_castsi512_pd(sign_sin));
        let c = _mm512_xor_pd(_mm512_mask_blend_pd(swap, cos, sin), _mm512_castsi512_pd(sign_cos));
        let near = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(_mm512_abs_pd(x), set(trig::REDUCTION_LIMIT));
        if near != 0xff { far_lanes(x, s, c) } else { (s, c) }
    }
}

/// The lanes beyond the range of the reduction, one by one.
#[cold]
#[inline(never)]
fn far_lanes(x: __m512d, s: __m512d, c: __m512d) -> (__m512d, __m512d) {
    let (x, mut s, mut c) = (to_array(x), to_array(s), to_array(c));
    for i in 0..8 {
        if !(x[i].abs() < trig::REDUCTION_LIMIT) {
            (s[i], c[i]) = trig::sin_cos_far(x[i]);
        }
    }
    (from_array(s), from_array(c))
}

#[inline(always)]
fn to_array(x: __m512d) -> [f64; 8] {
    // SAFETY: both are 64 bytes of eight doubles.
    unsafe { std::mem::transmute(x) }
}

#[inline(always)]
fn from_array(x: [f64; 8]) -> __m512d {
    // SAFETY: both are 64 bytes of eight doubles.
    unsafe { std::mem::transmute(x) }
}

impl<const U: usize> Real for Avx512<U> {
    type Mask = [u8; U];
    const LANES: usize = 8 * U;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Avx512([from_array([x; 8]); U])
    }
    #[inline(always)]
    fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Self {
        Avx512(from_fn(|u| from_array(from_fn(|i| f(8 * u + i)))))
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        to_array(self.0[i / 8])[i % 8]
    }
    #[inline(always)]
    fn mul_add(mut self, b: Self, c: Self) -> Self {
        for i in 0..U {
            self.0[i] = unsafe { _mm512_fmadd_pd(self.0[i], b.0[i], c.0[i]) };
        }
        self
    }
    #[inline(always)]
    fn neg_mul_add(mut self, b: Self, c: Self) -> Self {
        for i in 0..U {
            self.0[i] = unsafe { _mm512_fnmadd_pd(self.0[i], b.0[i], c.0[i]) };
        }
        self
    }
    #[inline(always)]
    fn recip(self) -> Self {
        self.each(recip8)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(|x| unsafe { _mm512_sqrt_pd(x) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.each(|x| unsafe { _mm512_abs_pd(x) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other.lt(self), other, self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (mut s, mut c) = (self, self);
        for i in 0..U {
            (s.0[i], c.0[i]) = sin_cos8(self.0[i]);
        }
        (s, c)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> [u8; U] {
        from_fn(|i| unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0[i], other.0[i]) })
    }
    #[inline(always)]
    fn select(mask: [u8; U], yes: Self, no: Self) -> Self {
        Avx512(from_fn(|i| unsafe { _mm512_mask_blend_pd(mask[i], no.0[i], yes.0[i]) }))
    }
    #[inline(always)]
    fn any(mask: [u8; U]) -> bool {
        let mut any = 0;
        for i in 0..U {
            any |= mask[i];
        }
        any != 0
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        assert!(isa() >= Isa::Avx512, "these lanes need AVX-512");
        enter_avx512(kernel)
    }
}
