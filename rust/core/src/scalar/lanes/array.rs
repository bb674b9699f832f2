//! Eight lanes as a plain array, which the compiler vectorises. Multiply-add operations are fused on AArch64 only, where every processor
//! can do this.

use super::super::{Kernel, Real, trig};
use std::array::from_fn;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Eight independent numbers, one per lane.
///
/// ```
/// use armlet_core::scalar::{Array8, Real};
///
/// let x = Array8::from_lanes(|lane| lane as f64);
/// let y = x * x - Array8::splat(9.0);
/// assert_eq!((y.lane(0), y.lane(7)), (-9.0, 40.0));
/// // A selection instead of a branch.
/// let positive = Array8::select(Array8::zero().lt(y), y, Array8::zero());
/// assert_eq!((positive.lane(3), positive.lane(4)), (0.0, 7.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct Array8([f64; 8]);

/// Whether multiply-add operations are fused.
const FUSED: bool = cfg!(target_arch = "aarch64");

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Array8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

macro_rules! assign {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Array8 {
            #[inline(always)]
            fn $method(&mut self, other: Self) {
                *self = *self $op other;
            }
        }
    };
}
assign!(AddAssign, add_assign, +);
assign!(SubAssign, sub_assign, -);
assign!(MulAssign, mul_assign, *);

impl Neg for Array8 {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for i in 0..8 {
            self.0[i] = -self.0[i];
        }
        self
    }
}

impl Array8 {
    #[inline(always)]
    fn each(mut self, f: impl Fn(f64) -> f64) -> Self {
        for i in 0..8 {
            self.0[i] = f(self.0[i]);
        }
        self
    }

    #[inline(always)]
    fn zip(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for i in 0..8 {
            self.0[i] = f(self.0[i], other.0[i]);
        }
        self
    }
}

impl Real for Array8 {
    /// All bits of a lane are set where the condition is true. So a selection consists of bit operations, which the compiler vectorises.
    type Mask = [u64; 8];
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Array8([x; 8])
    }
    #[inline(always)]
    fn from_lanes(f: impl FnMut(usize) -> f64) -> Self {
        Array8(from_fn(f))
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.0[i]
    }
    #[inline(always)]
    fn mul_add(mut self, b: Self, c: Self) -> Self {
        for i in 0..8 {
            self.0[i] = trig::fma::<FUSED>(self.0[i], b.0[i], c.0[i]);
        }
        self
    }
    #[inline(always)]
    fn neg_mul_add(mut self, b: Self, c: Self) -> Self {
        for i in 0..8 {
            self.0[i] = trig::fma::<FUSED>(-self.0[i], b.0[i], c.0[i]);
        }
        self
    }
    #[inline(always)]
    fn recip(self) -> Self {
        self.each(|x| 1.0 / x)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(f64::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { b } else { a })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if b < a { b } else { a })
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (mut s, mut c) = (self, self);
        for i in 0..8 {
            (s.0[i], c.0[i]) = trig::sin_cos_near::<FUSED>(self.0[i]);
        }
        let mut far = false;
        for i in 0..8 {
            far |= !(self.0[i].abs() < trig::REDUCTION_LIMIT);
        }
        if far {
            for i in 0..8 {
                if !(self.0[i].abs() < trig::REDUCTION_LIMIT) {
                    (s.0[i], c.0[i]) = trig::sin_cos_far(self.0[i]);
                }
            }
        }
        (s, c)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> [u64; 8] {
        from_fn(|i| if self.0[i] < other.0[i] { u64::MAX } else { 0 })
    }
    #[inline(always)]
    fn select(mask: [u64; 8], yes: Self, no: Self) -> Self {
        Array8(from_fn(|i| f64::from_bits((yes.0[i].to_bits() & mask[i]) | (no.0[i].to_bits() & !mask[i]))))
    }
    #[inline(always)]
    fn any(mask: [u64; 8]) -> bool {
        let mut any = 0;
        for i in 0..8 {
            any |= mask[i];
        }
        any != 0
    }
    #[inline(always)]
    fn all(mask: [u64; 8]) -> bool {
        let mut all = u64::MAX;
        for i in 0..8 {
            all &= mask[i];
        }
        all == u64::MAX
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}
