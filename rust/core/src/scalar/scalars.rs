//! The number type of one run: `f64`.

use super::instruction_set::fuses;
use super::{Kernel, Real, trig};

/// One run. Like programs, `f64` fuses multiply-add operations if [`fuses`] is true.
///
/// ```
/// use armlet_core::scalar::{Real, fuses};
///
/// // The product has a rounding error of 2^-60, which a fused operation does not make.
/// let (x, minus) = (1.0 + 2f64.powi(-30), -(1.0 + 2f64.powi(-29)));
/// assert_eq!(Real::mul_add(x, x, minus), if fuses() { 2f64.powi(-60) } else { 0.0 });
/// ```
impl Real for f64 {
    type Mask = bool;
    const LANES: usize = 1;
    #[inline]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline]
    fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Self {
        f(0)
    }
    #[inline]
    fn lane(self, _: usize) -> f64 {
        self
    }
    #[inline]
    fn mul_add(self, b: Self, c: Self) -> Self {
        if fuses() { trig::fma::<true>(self, b, c) } else { trig::fma::<false>(self, b, c) }
    }
    #[inline]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Real::mul_add(-self, b, c)
    }
    #[inline]
    fn recip(self) -> Self {
        1.0 / self
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        if self < other { other } else { self }
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        if !(self.abs() < trig::REDUCTION_LIMIT) {
            return trig::sin_cos_far(self);
        }
        self.sin_cos_near()
    }
    #[inline]
    fn sin_cos_near(self) -> (Self, Self) {
        if fuses() { trig::sin_cos_near::<true>(self) } else { trig::sin_cos_near::<false>(self) }
    }
    #[inline]
    fn lt(self, other: Self) -> bool {
        self < other
    }
    #[inline]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline]
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline]
    fn all(mask: bool) -> bool {
        mask
    }
    #[inline]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}
