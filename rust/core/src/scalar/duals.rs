//! Dual numbers with several rates, `a + sum b_k eps_k` with `eps_i eps_k = 0`. They compute exact derivatives along several directions, so
//! that a Jacobian of `n` columns takes `ceil(n / RATES)` evaluations.
//!
//! The rates are the lanes of a vector. All rates share one value.

use super::lanes::Array8;
use super::{Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value, and one derivative for the direction of each lane of `V`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Duals<V: Real> {
    /// The value.
    pub value: V::One,
    /// The derivatives of the value, one per lane.
    pub rates: V,
}

/// Dual numbers with eight rates, for any machine.
pub type Dual8 = Duals<Array8>;

impl<V: Real> Duals<V> {
    /// The number of directions in one evaluation.
    pub const RATES: usize = V::LANES;

    /// Return the dual number with this value and these derivatives.
    #[inline(always)]
    pub fn new(value: V::One, rates: V) -> Self {
        Duals { value, rates }
    }

    /// Return the number `value` with derivative 1 along direction `slot`, and 0 along the others.
    #[inline(always)]
    pub fn seed(value: V::One, slot: usize) -> Self {
        Duals { value, rates: V::from_lanes(|k| if k == slot { 1.0 } else { 0.0 }) }
    }

    /// The derivative along direction `slot`.
    #[inline(always)]
    pub fn rate(self, slot: usize) -> f64 {
        self.rates.lane(slot)
    }

    #[inline(always)]
    fn spread(x: V::One) -> V {
        V::splat(x.lane(0))
    }
}

impl<V: Real> Add for Duals<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Duals::new(self.value + o.value, self.rates + o.rates)
    }
}
impl<V: Real> Sub for Duals<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Duals::new(self.value - o.value, self.rates - o.rates)
    }
}
impl<V: Real> Mul for Duals<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Duals::new(self.value * o.value, self.rates.mul_add(Self::spread(o.value), o.rates * Self::spread(self.value)))
    }
}
impl<V: Real> Div for Duals<V> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        let inverse = V::One::splat(1.0) / o.value;
        Duals::new(value, o.rates.neg_mul_add(Self::spread(value), self.rates) * Self::spread(inverse))
    }
}
impl<V: Real> Neg for Duals<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Duals::new(-self.value, -self.rates)
    }
}
impl<V: Real> AddAssign for Duals<V> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<V: Real> SubAssign for Duals<V> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl<V: Real> MulAssign for Duals<V> {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl<V: Real> Real for Duals<V> {
    type Mask = bool;
    type One = Self;
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Duals::new(V::One::splat(x), V::zero())
    }
    #[inline(always)]
    fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Self {
        Duals::splat(f(0))
    }
    #[inline(always)]
    fn lane(self, _: usize) -> f64 {
        self.value.lane(0)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let rates = self.rates.mul_add(Self::spread(b.value), b.rates.mul_add(Self::spread(self.value), c.rates));
        Duals::new(self.value.mul_add(b.value, c.value), rates)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        let rates = self.rates.neg_mul_add(Self::spread(b.value), b.rates.neg_mul_add(Self::spread(self.value), c.rates));
        Duals::new(self.value.neg_mul_add(b.value, c.value), rates)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let value = self.value.recip();
        Duals::new(value, self.rates * Self::spread(-(value * value)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        let slope = V::One::splat(0.5) / root;
        // Where the slope is infinite, a zero rate remains zero.
        let nothing = self.rates.abs().lt(V::splat(f64::MIN_POSITIVE));
        Duals::new(root, V::select(nothing, V::zero(), self.rates * Self::spread(slope)))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if self.lane(0) < 0.0 { -self } else { self }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self.lane(0) < other.lane(0) { other } else { self }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if other.lane(0) < self.lane(0) { other } else { self }
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.value.sin_cos();
        (Duals::new(s, self.rates * Self::spread(c)), Duals::new(c, self.rates * Self::spread(-s)))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let square = x.value.mul_add(x.value, self.value * self.value);
        let across = x.rates.neg_mul_add(Self::spread(self.value), self.rates * Self::spread(x.value));
        // At the origin, the angle has no derivative. A zero rate remains zero.
        let nothing = across.abs().lt(V::splat(f64::MIN_POSITIVE));
        Duals::new(self.value.atan2(x.value), V::select(nothing, V::zero(), across / Self::spread(square)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self.lane(0) < other.lane(0)
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
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        V::enter(kernel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dual;

    fn expression<S: Real>(x: &[S]) -> S {
        let (s, c) = (x[0] * x[1]).sin_cos();
        let root = (x[2] * x[2] + S::splat(1.0)).sqrt();
        let mut y = s.mul_add(x[2], c / root) - x[1].recip() + x[0].neg_mul_add(c, s).abs();
        y *= x[0].max(x[2]).min(S::splat(10.0));
        y -= -x[1];
        y + (x[0] * x[2]).atan2(x[1])
    }

    /// Each rate equals that of a single dual number along its direction, up to the rounding of a dozen operations.
    #[test]
    fn rates_are_those_of_single_duals() {
        let at = [0.7, -1.3, 2.1];
        let many: Vec<Dual8> = (0..3).map(|i| Dual8::seed(at[i], 2 * i + 1)).collect();
        let all = expression(&many);
        for i in 0..3 {
            let one: Vec<Dual> = (0..3).map(|k| Dual::new(at[k], if k == i { 1.0 } else { 0.0 })).collect();
            let expected = expression(&one);
            assert!((all.lane(0) - expected.value).abs() < 1e-14);
            assert!((all.rate(2 * i + 1) - expected.rate).abs() < 1e-13, "{i}: {} {}", all.rate(2 * i + 1), expected.rate);
            assert_eq!(all.rate(2 * i), 0.0);
        }
    }

    #[test]
    fn the_root_of_zero_has_no_rate_along_nothing() {
        let root = Dual8::seed(0.0, 3).sqrt();
        assert_eq!((root.rate(0), root.rate(3)), (0.0, f64::INFINITY));
        assert_eq!(Dual8::splat(0.0).atan2(Dual8::splat(0.0)).rate(0), 0.0);
    }
}
