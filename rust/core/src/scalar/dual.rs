//! Dual numbers `a + b eps` with `eps^2 = 0`. They compute the exact derivative along one direction: `f(x + v eps) = f(x) + f'(x) v eps`.

use super::{Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value and its derivative along one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<S: Real = f64> {
    /// The value.
    pub value: S,
    /// The derivative of the value.
    pub rate: S,
}

impl<S: Real> Dual<S> {
    /// Return the dual number with this value and derivative.
    #[inline(always)]
    pub fn new(value: S, rate: S) -> Self {
        Dual { value, rate }
    }
}

/// Return `along` if `rate` is not zero, otherwise zero. Where the slope is infinite, the product of zero rate and slope would be NaN.
#[inline(always)]
fn unless_still<S: Real>(rate: S, along: S) -> S {
    S::select(rate.lt(S::zero()), along, S::select(S::zero().lt(rate), along, rate))
}

impl<S: Real> Add for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Dual::new(self.value + o.value, self.rate + o.rate)
    }
}
impl<S: Real> Sub for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Dual::new(self.value - o.value, self.rate - o.rate)
    }
}
impl<S: Real> Mul for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Dual::new(self.value * o.value, self.rate.mul_add(o.value, self.value * o.rate))
    }
}
impl<S: Real> Div for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        Dual::new(value, (self.rate - value * o.rate) / o.value)
    }
}
impl<S: Real> Neg for Dual<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Dual::new(-self.value, -self.rate)
    }
}
impl<S: Real> AddAssign for Dual<S> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<S: Real> SubAssign for Dual<S> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl<S: Real> MulAssign for Dual<S> {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl<S: Real> Real for Dual<S> {
    type Mask = S::Mask;
    type One = Self;
    const LANES: usize = S::LANES;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Dual::new(S::splat(x), S::zero())
    }
    #[inline(always)]
    fn from_lanes(f: impl FnMut(usize) -> f64) -> Self {
        Dual::new(S::from_lanes(f), S::zero())
    }
    #[inline(always)]
    fn parameter(f: impl FnMut(usize) -> f64) -> Self {
        Dual::new(S::parameter(f), S::zero())
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.value.lane(i)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Dual::new(self.value.mul_add(b.value, c.value), self.rate.mul_add(b.value, self.value * b.rate) + c.rate)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Dual::new(self.value.neg_mul_add(b.value, c.value), c.rate - self.rate.mul_add(b.value, self.value * b.rate))
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Dual::splat(1.0) / self
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Dual::new(root, unless_still(self.rate, S::splat(0.5) / root * self.rate))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.value.lt(S::zero()), -self, self)
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
        let (s, c) = self.value.sin_cos();
        (Dual::new(s, c * self.rate), Dual::new(c, -s * self.rate))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let length = x.value * x.value + self.value * self.value;
        let rate = x.value * self.rate - self.value * x.rate;
        Dual::new(self.value.atan2(x.value), unless_still(rate, rate / length))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> S::Mask {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn select(mask: S::Mask, yes: Self, no: Self) -> Self {
        Dual::new(S::select(mask, yes.value, no.value), S::select(mask, yes.rate, no.rate))
    }
    #[inline(always)]
    fn any(mask: S::Mask) -> bool {
        S::any(mask)
    }
    #[inline(always)]
    fn all(mask: S::Mask) -> bool {
        S::all(mask)
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        S::enter(kernel)
    }
}
