//! The two types with one number: `f64` and [`Float`]. Plants and laws are constructed with `f64`, which never fuses multiply-add
//! operations. Runs use [`Float`].

use super::instruction_set::fuses;
use super::{Kernel, Real, trig};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// The number type of direct evaluation: an `f64`. Like programs, it fuses multiply-add operations if [`fuses`] is true.
///
/// ```
/// use armlet_core::scalar::{Float, Real, fuses};
///
/// // The product has a rounding error of 2^-60, which a fused operation does not make.
/// let (x, minus) = (1.0 + 2f64.powi(-30), -(1.0 + 2f64.powi(-29)));
/// let sum = Float(x).mul_add(Float(x), Float(minus));
/// assert_eq!(sum, Float(if fuses() { 2f64.powi(-60) } else { 0.0 }));
/// assert_eq!(Float::of(&[1.0, 2.0]), [Float(1.0), Float(2.0)]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
#[repr(transparent)]
pub struct Float(pub f64);

impl Float {
    /// Return the slice as numbers of this type.
    #[inline]
    pub fn of(x: &[f64]) -> &[Float] {
        // SAFETY: a `Float` has the layout of an `f64` (`repr(transparent)`).
        unsafe { std::slice::from_raw_parts(x.as_ptr().cast(), x.len()) }
    }

    /// Return the mutable slice as numbers of this type.
    #[inline]
    pub fn of_mut(x: &mut [f64]) -> &mut [Float] {
        // SAFETY: a `Float` has the layout of an `f64` (`repr(transparent)`), and the mutable borrow is passed on.
        unsafe { std::slice::from_raw_parts_mut(x.as_mut_ptr().cast(), x.len()) }
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Float {
            type Output = Self;
            #[inline]
            fn $method(self, other: Self) -> Self {
                Float(self.0 $op other.0)
            }
        }
    };
    ($trait:ident, $method:ident, $op:tt, $assign:ident, $assign_method:ident) => {
        operator!($trait, $method, $op);
        impl $assign for Float {
            #[inline]
            fn $assign_method(&mut self, other: Self) {
                *self = *self $op other;
            }
        }
    };
}
operator!(Add, add, +, AddAssign, add_assign);
operator!(Sub, sub, -, SubAssign, sub_assign);
operator!(Mul, mul, *, MulAssign, mul_assign);
operator!(Div, div, /);

impl Neg for Float {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Float(-self.0)
    }
}

macro_rules! single_number {
    ($wrap:expr, $get:expr, $fuses:expr) => {
        type Mask = bool;
        type One = Self;
        const LANES: usize = 1;
        #[inline]
        fn first(self) -> Self {
            self
        }
        #[inline]
        fn spread(x: Self) -> Self {
            x
        }
        #[inline]
        fn choose(mask: Self::Mask, yes: Self, no: Self) -> Self {
            Self::select(mask, yes, no)
        }
        #[inline]
        fn splat(x: f64) -> Self {
            $wrap(x)
        }
        #[inline]
        fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Self {
            $wrap(f(0))
        }
        #[inline]
        fn lane(self, _: usize) -> f64 {
            $get(self)
        }
        #[inline]
        fn mul_add(self, b: Self, c: Self) -> Self {
            let (a, b, c) = ($get(self), $get(b), $get(c));
            $wrap(if $fuses { trig::fma::<true>(a, b, c) } else { trig::fma::<false>(a, b, c) })
        }
        #[inline]
        fn neg_mul_add(self, b: Self, c: Self) -> Self {
            Real::mul_add(-self, b, c)
        }
        #[inline]
        fn recip(self) -> Self {
            $wrap(1.0 / $get(self))
        }
        #[inline]
        fn sqrt(self) -> Self {
            $wrap($get(self).sqrt())
        }
        #[inline]
        fn abs(self) -> Self {
            $wrap($get(self).abs())
        }
        #[inline]
        fn max(self, other: Self) -> Self {
            if $get(self) < $get(other) { other } else { self }
        }
        #[inline]
        fn min(self, other: Self) -> Self {
            if $get(other) < $get(self) { other } else { self }
        }
        #[inline]
        fn sin_cos(self) -> (Self, Self) {
            let x = $get(self);
            if !(x.abs() < trig::REDUCTION_LIMIT) {
                let (s, c) = trig::sin_cos_far(x);
                return ($wrap(s), $wrap(c));
            }
            self.sin_cos_near()
        }
        #[inline]
        fn sin_cos_near(self) -> (Self, Self) {
            let x = $get(self);
            let (s, c) = if $fuses { trig::sin_cos_near::<true>(x) } else { trig::sin_cos_near::<false>(x) };
            ($wrap(s), $wrap(c))
        }
        #[inline]
        fn lt(self, other: Self) -> bool {
            $get(self) < $get(other)
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
    };
}

impl Real for f64 {
    single_number!(|x: f64| x, |x: f64| x, false);
}

impl Real for Float {
    single_number!(Float, |x: Float| x.0, fuses());
}
