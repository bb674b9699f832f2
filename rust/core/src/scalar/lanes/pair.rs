//! A pair of numbers with twice as many lanes. Its two halves are independent, so that the latencies of their operations overlap.

use super::super::{Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// The lanes of the first number, then the lanes of the second. The numbers are fields, because an array would need loops that must be
/// unrolled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair<V>(V, V);

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<V: Real> $trait for Pair<V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Pair($trait::$method(self.0, other.0), $trait::$method(self.1, other.1))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

macro_rules! assign {
    ($trait:ident, $method:ident) => {
        impl<V: Real> $trait for Pair<V> {
            #[inline(always)]
            fn $method(&mut self, other: Self) {
                $trait::$method(&mut self.0, other.0);
                $trait::$method(&mut self.1, other.1);
            }
        }
    };
}
assign!(AddAssign, add_assign);
assign!(SubAssign, sub_assign);
assign!(MulAssign, mul_assign);

impl<V: Real> Neg for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Pair(-self.0, -self.1)
    }
}

impl<V: Real> Real for Pair<V> {
    type Mask = (V::Mask, V::Mask);
    const LANES: usize = 2 * V::LANES;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Pair(V::splat(x), V::splat(x))
    }
    #[inline(always)]
    fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Self {
        let first = V::from_lanes(&mut f);
        Pair(first, V::from_lanes(|i| f(V::LANES + i)))
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        if i < V::LANES { self.0.lane(i) } else { self.1.lane(i - V::LANES) }
    }
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Pair(V::load(from), V::load(&from[V::LANES..]))
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        self.0.store(to);
        self.1.store(&mut to[V::LANES..]);
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Pair(self.0.mul_add(b.0, c.0), self.1.mul_add(b.1, c.1))
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Pair(self.0.neg_mul_add(b.0, c.0), self.1.neg_mul_add(b.1, c.1))
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Pair(self.0.recip(), self.1.recip())
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Pair(self.0.sqrt(), self.1.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Pair(self.0.abs(), self.1.abs())
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Pair(self.0.max(other.0), self.1.max(other.1))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Pair(self.0.min(other.0), self.1.min(other.1))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let ((s0, c0), (s1, c1)) = (self.0.sin_cos(), self.1.sin_cos());
        (Pair(s0, s1), Pair(c0, c1))
    }
    #[inline(always)]
    fn sin_cos_near(self) -> (Self, Self) {
        let ((s0, c0), (s1, c1)) = (self.0.sin_cos_near(), self.1.sin_cos_near());
        (Pair(s0, s1), Pair(c0, c1))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        (self.0.lt(other.0), self.1.lt(other.1))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Pair(V::select(mask.0, yes.0, no.0), V::select(mask.1, yes.1, no.1))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        V::any(mask.0) | V::any(mask.1)
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        V::all(mask.0) & V::all(mask.1)
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        V::enter(kernel)
    }
}
