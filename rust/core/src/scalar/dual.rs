//! Dual numbers `a + sum b_k eps_k` with `eps_i eps_k = 0`. They compute derivatives without truncation error, along one or several
//! directions: `f(x + v eps) = f(x) + f'(x) v eps`. The prime is the derivative.
//!
//! The derivatives `b_k` are the lanes of a number, and share the value `a`. A Jacobian of `n` columns takes `ceil(n / lanes)` evaluations.

use super::{Array8, Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value, and one derivative for the direction of each lane of `V`.
///
/// ```
/// use armlet_core::scalar::{Dual, Dual8, Real};
///
/// // `f(x, y) = x sin y` and its derivatives along x and y.
/// let (x, y) = (Dual8::seed(2.0, 0), Dual8::seed(0.5, 1));
/// let f = x * y.sin_cos().0;
/// assert!((f.value - 2.0 * 0.5f64.sin()).abs() < 1e-15);
/// assert!((f.rate.lane(0) - 0.5f64.sin()).abs() < 1e-15 && (f.rate.lane(1) - 2.0 * 0.5f64.cos()).abs() < 1e-15);
/// // One direction takes one number.
/// assert_eq!(Dual::<f64>::seed(4.0, 0).sqrt(), Dual::new(2.0, 0.25));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<V: Real = f64> {
    /// The value.
    pub value: V::One,
    /// The derivatives of the value, one per lane.
    pub rate: V,
}

/// Dual numbers with eight derivatives, for any machine.
pub type Dual8 = Dual<Array8>;

impl<V: Real> Dual<V> {
    /// Return the dual number with this value and these derivatives.
    #[inline(always)]
    pub fn new(value: V::One, rate: V) -> Self {
        Dual { value, rate }
    }

    /// Return the number `value` with derivative 1 along direction `slot`, and 0 along the others.
    #[inline(always)]
    pub fn seed(value: V::One, slot: usize) -> Self {
        Dual { value, rate: V::from_lanes(|k| if k == slot { 1.0 } else { 0.0 }) }
    }
}

/// Return `along`, the product of `rate` and a slope, unless `rate` is zero or NaN. Then return `rate`. So a zero rate remains zero where
/// the slope is infinite.
#[inline(always)]
fn unless_still<V: Real>(rate: V, along: V) -> V {
    V::select(rate.lt(V::zero()), along, V::select(V::zero().lt(rate), along, rate))
}

impl<V: Real> Add for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Dual::new(self.value + o.value, self.rate + o.rate)
    }
}
impl<V: Real> Sub for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Dual::new(self.value - o.value, self.rate - o.rate)
    }
}
impl<V: Real> Mul for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Dual::new(self.value * o.value, self.rate.mul_add(V::spread(o.value), V::spread(self.value) * o.rate))
    }
}
impl<V: Real> Div for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        Dual::new(value, (self.rate - V::spread(value) * o.rate) / V::spread(o.value))
    }
}
impl<V: Real> Neg for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Dual::new(-self.value, -self.rate)
    }
}
impl<V: Real> AddAssign for Dual<V> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<V: Real> SubAssign for Dual<V> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl<V: Real> MulAssign for Dual<V> {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl<V: Real> Real for Dual<V> {
    type Mask = <V::One as Real>::Mask;
    type One = Self;
    const LANES: usize = V::One::LANES;

    #[inline(always)]
    fn first(self) -> Self {
        self
    }
    #[inline(always)]
    fn spread(x: Self) -> Self {
        x
    }
    #[inline(always)]
    fn choose(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self::select(mask, yes, no)
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Dual::new(V::One::splat(x), V::zero())
    }
    #[inline(always)]
    fn from_lanes(f: impl FnMut(usize) -> f64) -> Self {
        Dual::new(V::One::from_lanes(f), V::zero())
    }
    #[inline(always)]
    fn varying(x: f64) -> Self {
        Dual::new(V::One::varying(x), V::zero())
    }
    #[inline(always)]
    fn parameter(x: f64) -> Self {
        Dual::new(V::One::parameter(x), V::zero())
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.value.lane(i)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let slope = self.rate.mul_add(V::spread(b.value), V::spread(self.value) * b.rate);
        Dual::new(self.value.mul_add(b.value, c.value), slope + c.rate)
    }
    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        let slope = self.rate.mul_add(V::spread(b.value), V::spread(self.value) * b.rate);
        Dual::new(self.value.neg_mul_add(b.value, c.value), c.rate - slope)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Dual::splat(1.0) / self
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Dual::new(root, unless_still(self.rate, V::spread(V::One::splat(0.5) / root) * self.rate))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.value.lt(V::One::zero()), -self, self)
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
        (Dual::new(s, V::spread(c) * self.rate), Dual::new(c, V::spread(-s) * self.rate))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let length = x.value * x.value + self.value * self.value;
        let rate = V::spread(x.value) * self.rate - V::spread(self.value) * x.rate;
        Dual::new(self.value.atan2(x.value), unless_still(rate, rate / V::spread(length)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Dual::new(V::One::select(mask, yes.value, no.value), V::choose(mask, yes.rate, no.rate))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        V::One::any(mask)
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        V::One::all(mask)
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        V::enter(kernel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expression<S: Real>(x: &[S]) -> S {
        let (s, c) = (x[0] * x[1]).sin_cos();
        let root = (x[2] * x[2] + S::splat(1.0)).sqrt();
        let mut y = s.mul_add(x[2], c / root) - x[1].recip() + x[0].neg_mul_add(c, s).abs();
        y *= x[0].max(x[2]).min(S::splat(10.0));
        y -= -x[1];
        y + (x[0] * x[2]).atan2(x[1])
    }

    /// Three of eight lanes have directions. Their derivatives equal those of single dual numbers, up to the rounding of a dozen
    /// operations.
    #[test]
    fn directions_do_not_mix() {
        let at = [0.7, -1.3, 2.1];
        let many: Vec<Dual8> = (0..3).map(|i| Dual8::seed(at[i], 2 * i + 1)).collect();
        let all = expression(&many);
        for i in 0..3 {
            let one: Vec<Dual> = (0..3).map(|k| Dual::new(at[k], if k == i { 1.0 } else { 0.0 })).collect();
            let expected = expression(&one);
            assert!((all.lane(0) - expected.value).abs() < 1e-14);
            assert!((all.rate.lane(2 * i + 1) - expected.rate).abs() < 1e-13, "{i}: {:?} {}", all.rate, expected.rate);
            assert_eq!(all.rate.lane(2 * i), 0.0);
        }
    }

    #[test]
    fn the_root_of_zero_has_no_rate_along_nothing() {
        let root = Dual8::seed(0.0, 3).sqrt();
        assert_eq!((root.rate.lane(0), root.rate.lane(3)), (0.0, f64::INFINITY));
        assert_eq!(Dual8::splat(0.0).atan2(Dual8::splat(0.0)).rate.lane(0), 0.0);
    }
}
