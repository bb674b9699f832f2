//! The two single numbers: `f64` for the baseline, [`Fused`] where the machine has fused multiply-add.

#[cfg(target_arch = "x86_64")]
use super::lanes::Avx2;
use super::lanes::{enter_avx2, fuses};
use super::{Kernel, Real, trig};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// An `f64` whose `mul_add` is one instruction; use it only under [`Real::enter`].
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
#[repr(transparent)]
pub struct Fused(pub f64);

macro_rules! operator {
    ($trait:ident, $method:ident, $assign:ident, $assign_method:ident, $op:tt) => {
        impl $trait for Fused {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Fused(self.0 $op other.0)
            }
        }
        impl $assign for Fused {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = *self $op other;
            }
        }
    };
}
operator!(Add, add, AddAssign, add_assign, +);
operator!(Sub, sub, SubAssign, sub_assign, -);
operator!(Mul, mul, MulAssign, mul_assign, *);

impl Div for Fused {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Fused(self.0 / other.0)
    }
}

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Fused(-self.0)
    }
}

macro_rules! single_number {
    ($type:ty, $wrap:expr, $get:expr, $fused:literal) => {
        type Mask = bool;
        type One = Self;
        const LANES: usize = 1;
        #[inline(always)]
        fn splat(x: f64) -> Self {
            $wrap(x)
        }
        #[inline(always)]
        fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Self {
            $wrap(f(0))
        }
        #[inline(always)]
        fn lane(self, _: usize) -> f64 {
            $get(self)
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            $wrap(trig::fma::<$fused>($get(self), $get(b), $get(c)))
        }
        #[inline(always)]
        fn neg_mul_add(self, b: Self, c: Self) -> Self {
            $wrap(trig::fma::<$fused>(-$get(self), $get(b), $get(c)))
        }
        #[inline(always)]
        fn recip(self) -> Self {
            $wrap(1.0 / $get(self))
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            $wrap($get(self).sqrt())
        }
        #[inline(always)]
        fn abs(self) -> Self {
            $wrap($get(self).abs())
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            if $get(self) < $get(other) { other } else { self }
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            if $get(other) < $get(self) { other } else { self }
        }
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            let x = $get(self);
            if !(x.abs() < trig::REDUCTION_LIMIT) {
                let (s, c) = trig::sin_cos_far(x);
                return ($wrap(s), $wrap(c));
            }
            self.sin_cos_near()
        }
        #[inline(always)]
        fn sin_cos_near(self) -> (Self, Self) {
            let (s, c) = trig::sin_cos_near::<$fused>($get(self));
            ($wrap(s), $wrap(c))
        }
        #[inline(always)]
        fn lt(self, other: Self) -> bool {
            $get(self) < $get(other)
        }
        #[inline(always)]
        fn select(mask: bool, yes: Self, no: Self) -> Self {
            if mask { yes } else { no }
        }
        #[inline(always)]
        fn any(mask: bool) -> bool {
            mask
        }
        #[inline(always)]
        fn all(mask: bool) -> bool {
            mask
        }
    };
}

impl Real for f64 {
    single_number!(f64, |x: f64| x, |x: f64| x, false);
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}

impl Real for Fused {
    single_number!(Fused, Fused, |x: Fused| x.0, true);
    /// Four to a register: the joints of one arm are as good as four runs of one joint.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn sin_cos_each(x: &[Self], out: &mut [(Self, Self)]) {
        for (x, out) in x.chunks(4).zip(out.chunks_mut(4)) {
            let (s, c) = Avx2::from_lanes(|i| x[i.min(x.len() - 1)].0).sin_cos();
            for (i, out) in out.iter_mut().enumerate() {
                *out = (Fused(s.lane(i)), Fused(c.lane(i)));
            }
        }
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        assert!(fuses(), "the fused route needs AVX2 and FMA");
        enter_avx2(kernel)
    }
}
