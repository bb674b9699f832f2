//! The number types of algorithms: one number (`f64`) for one run, or several numbers ([`lanes`]) for several independent runs. A
//! *lane* is one of these numbers.
//!
//! Algorithms are generic over [`Real`]. They use `select` instead of branches on the data of lanes. Planners and sinusoidal motions run
//! directly on the lane types of this module. Plants and laws are recorded (`trace`), and the recorded machine code, a *program*, runs in
//! lanes. Functions of planners are `#[inline(always)]`, so that they are compiled for the instruction set of the calling function. Lanes
//! of AVX2 with FMA or AVX-512 run only inside [`Real::enter`].

mod atan;
mod dispatch;
pub mod hex;
#[doc(hidden)]
pub mod hyperbolic;
#[doc(hidden)]
pub mod instruction_set;
#[doc(hidden)]
pub mod lanes;
#[doc(hidden)]
pub mod log;
#[doc(hidden)]
pub mod rows;
mod scalars;
#[doc(hidden)]
pub mod trig;

pub use dispatch::{GenericKernel, run_lanes};
pub use instruction_set::{Isa, fuses, isa};
pub use lanes::Array8;

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number, or one real number per lane.
///
/// ```
/// use armlet_core::scalar::{Array8, Real};
///
/// /// `sqrt(1 + x^2)`, for any number type.
/// fn length<S: Real>(x: S) -> S {
///     x.mul_add(x, S::splat(1.0)).sqrt()
/// }
/// assert_eq!(length(0.75), 1.25);
/// assert_eq!(length(Array8::from_lanes(|lane| 0.75 * lane as f64)).lane(1), 1.25);
/// ```
pub trait Real:
    Copy
    + PartialEq
    + Debug
    + Default
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// One truth value per lane.
    type Mask: Copy + Send;
    /// The number of lanes.
    const LANES: usize;

    /// Return `x` in every lane.
    fn splat(x: f64) -> Self;
    /// Return the number `f(i)` in each lane `i`.
    fn from_lanes(f: impl FnMut(usize) -> f64) -> Self;
    /// Return a number that may differ between runs, such as a gain, a target or a limit. In the set-up of a recording (`trace`), it becomes
    /// an input.
    #[inline(always)]
    fn varying(x: f64) -> Self {
        Self::splat(x)
    }
    /// Return an inertial parameter of an arm, which may differ between runs. In a recording (`trace`), parameters of equal value share one
    /// input.
    #[inline(always)]
    fn parameter(x: f64) -> Self {
        Self::varying(x)
    }
    /// Return a set-up parameter: a number that is constant in a run, such as a mass. A recording (`trace`) contains it as a constant,
    /// unless its derivative is required.
    #[inline(always)]
    fn fixed(x: f64) -> Self {
        Self::splat(x)
    }
    /// Label the numbers that `f` creates with `name` and indices from `first` on. Listings of recordings (`trace`) show these labels.
    #[inline(always)]
    fn labelled<T>(_name: &'static str, _first: u32, f: impl FnOnce() -> T) -> T {
        f()
    }
    /// Compute `f` with exactly its operations. A recording (`trace`) then contracts no product with the sum that uses it.
    #[inline(always)]
    fn as_written<T>(f: impl FnOnce() -> T) -> T {
        f()
    }
    /// Return the number in lane `i`.
    fn lane(self, i: usize) -> f64;

    /// Return the first numbers of a slice, `from[i]` in lane `i`.
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Self::from_lanes(|lane| from[lane])
    }
    /// Write the lanes to the first numbers of a slice.
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        for lane in 0..Self::LANES {
            to[lane] = self.lane(lane);
        }
    }

    /// Return `self * b + c`, fused if the instruction set has fused multiply-add.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Return `c - self * b`, fused if the instruction set has fused multiply-add.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// Return `1 / self` to 1 ulp, for normal numbers.
    fn recip(self) -> Self;
    /// Return the square root.
    fn sqrt(self) -> Self;
    /// Return the absolute value.
    fn abs(self) -> Self;
    /// Return the larger number.
    fn max(self, other: Self) -> Self;
    /// Return the smaller number.
    fn min(self, other: Self) -> Self;
    /// Return sine and cosine to 1.5 ulp for every finite argument, rad.
    fn sin_cos(self) -> (Self, Self);
    /// Return sine and cosine for `|self|` below [`trig::REDUCTION_LIMIT`], rad, without a check of this limit.
    #[inline(always)]
    fn sin_cos_near(self) -> (Self, Self) {
        self.sin_cos()
    }

    /// Return the angle of the point `(x, self)` to 2 ulp, rad.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        atan::atan2(self, x)
    }

    /// Return `self < other` for each lane. The result is false if one number is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// Return `yes` in lanes where `mask` is true, and `no` in the other lanes.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Return whether any lane is true.
    fn any(mask: Self::Mask) -> bool;
    /// Return whether all lanes are true.
    fn all(mask: Self::Mask) -> bool;

    /// Run `kernel`, compiled for the instruction set of this type.
    fn enter<K: Kernel>(kernel: K) -> K::Output;

    /// Name an intermediate result of this shape. Only a recording of the terms of a law computes the `values`.
    #[inline(always)]
    fn term(_name: &'static str, _shape: &[usize], _values: impl FnOnce() -> Vec<Self>) {}

    /// Return zero in every lane.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }

    /// Return the number limited to `[low, high]` in each lane. NaN remains NaN.
    #[inline(always)]
    fn clamped(self, low: Self, high: Self) -> Self {
        Self::select(high.lt(self), high, Self::select(self.lt(low), low, self))
    }
}

/// Code that is compiled for the instruction set of a known [`Real`]. `run` must be `#[inline(always)]`.
///
/// ```
/// use armlet_core::scalar::{Kernel, Real};
///
/// struct Sum<'a>(&'a [f64]);
/// impl Kernel for Sum<'_> {
///     type Output = f64;
///     #[inline(always)]
///     fn run(self) -> f64 {
///         self.0.iter().sum()
///     }
/// }
/// assert_eq!(f64::enter(Sum(&[1.0, 2.0, 4.0])), 7.0);
/// ```
pub trait Kernel {
    /// The type of the result.
    type Output;
    /// Run the code.
    fn run(self) -> Self::Output;
}

/// Return numbers that may differ between runs ([`Real::varying`]), with the label `name` and indices from 1 on.
pub(crate) fn labelled_numbers<S: Real>(name: &'static str, numbers: &[f64]) -> Vec<S> {
    S::labelled(name, 1, || numbers.iter().map(|&x| S::varying(x)).collect())
}

/// Return the sign of `x` as -1, 0 or 1. It is zero for zero and NaN.
#[inline(always)]
pub fn sign<S: Real>(x: S) -> S {
    let (zero, one) = (S::zero(), S::splat(1.0));
    S::select(zero.lt(x), one, S::select(x.lt(zero), -one, zero))
}

#[cfg(test)]
mod tests;
