//! The number that an algorithm runs on: one run ([`Float`]), or several independent runs side by
//! side ([`lanes`]), one per lane.
//!
//! Algorithms are written once over [`Real`]. They use `select` instead of branches on lane data. Only planners run in lanes of these types.
//! All other algorithms run in lanes as programs (`trace`). Functions for planners are `#[inline(always)]`, because code gets the
//! instruction set of the function around it. [`Real::enter`] is the only entry into a region compiled for AVX2 + FMA or AVX-512.

mod atan;
pub mod dual;
pub mod duals;
pub mod hex;
#[doc(hidden)]
pub mod hyperbolic;
#[doc(hidden)]
pub mod lanes;
#[doc(hidden)]
pub mod log;
#[doc(hidden)]
pub mod rows;
mod scalars;
#[doc(hidden)]
pub mod trig;

pub use dual::Dual;
pub use duals::{Dual8, Duals};
pub use lanes::{Array8, Isa, fuses, isa};
pub use scalars::Float;

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number, or one real number per lane.
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
    type Mask: Copy;
    /// The number for a single run on the same instruction set.
    type One: Real;
    /// How many independent runs the number carries.
    const LANES: usize;

    /// The same number in every lane.
    fn splat(x: f64) -> Self;
    /// `f(i)` in lane `i`.
    fn from_lanes(f: impl FnMut(usize) -> f64) -> Self;
    /// A number of an arm, `f(i)` in lane `i`. A loop may hold several copies of it, in its plant and in its law.
    #[inline(always)]
    fn parameter(f: impl FnMut(usize) -> f64) -> Self {
        Self::from_lanes(f)
    }
    /// A number of the set-up. It is a constant of recordings, unless its derivative is required.
    #[inline(always)]
    fn fixed(x: f64) -> Self {
        Self::splat(x)
    }
    /// Label the numbers that `f` makes with `name` and indices from `first` on. Readers of recordings see these labels.
    #[inline(always)]
    fn labelled<T>(_name: &'static str, _first: u32, f: impl FnOnce() -> T) -> T {
        f()
    }
    /// The number in lane `i`.
    fn lane(self, i: usize) -> f64;

    /// `from[i]` in lane `i`, from the first numbers of a slice.
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

    /// `self * b + c`, fused if the instruction set has it.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// `c - self * b`, fused if the instruction set has it.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// `1 / self` to 1 ulp, for normal numbers.
    fn recip(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// The larger number.
    fn max(self, other: Self) -> Self;
    /// The smaller number.
    fn min(self, other: Self) -> Self;
    /// Sine and cosine to 1 ulp for every finite argument.
    fn sin_cos(self) -> (Self, Self);
    /// The same below [`trig::REDUCTION_LIMIT`], without a check of that limit.
    #[inline(always)]
    fn sin_cos_near(self) -> (Self, Self) {
        self.sin_cos()
    }

    /// The angle of the point `(x, self)` to about 1 ulp.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        atan::atan2(self, x)
    }

    /// `self < other`, lane by lane; false if either is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Whether any lane is true.
    fn any(mask: Self::Mask) -> bool;
    /// Whether all lanes are true.
    fn all(mask: Self::Mask) -> bool;

    /// Run `kernel` compiled for the instruction set of this number.
    fn enter<K: Kernel>(kernel: K) -> K::Output;

    /// Zero in every lane.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }

    /// The number limited to `[low, high]`, lane by lane. NaN stays NaN; `min` and `max` alone would replace it.
    #[inline(always)]
    fn clamped(self, low: Self, high: Self) -> Self {
        Self::select(high.lt(self), high, Self::select(self.lt(low), low, self))
    }
}

/// Work inside the instruction-set region of a known [`Real`]. `run` must be `#[inline(always)]`.
pub trait Kernel {
    /// The type of the result.
    type Output;
    /// Do the work.
    fn run(self) -> Self::Output;
}

/// `sign(x)`; zero at zero and for NaN.
#[inline(always)]
pub fn sign<S: Real>(x: S) -> S {
    let (zero, one) = (S::zero(), S::splat(1.0));
    S::select(zero.lt(x), one, S::select(x.lt(zero), -one, zero))
}

/// Work on any [`Real`], before the instruction set is chosen. `run` must be `#[inline(always)]`.
pub trait GenericKernel {
    /// The type of the result.
    type Output;
    /// Do the work on the number `S`.
    fn run<S: Real>(self) -> Self::Output;
}

/// A task on a chosen number type.
struct On<S, T>(T, std::marker::PhantomData<S>);

impl<S: Real, T: GenericKernel> Kernel for On<S, T> {
    type Output = T::Output;
    #[inline(always)]
    fn run(self) -> T::Output {
        self.0.run::<S>()
    }
}

#[inline(always)]
fn on<S: Real, T: GenericKernel>(task: T) -> T::Output {
    S::enter(On::<S, T>(task, std::marker::PhantomData))
}

/// Run `task` on lanes, as suits this machine: one register of them, or two where registers are short.
#[cfg(target_arch = "x86_64")]
pub fn run_lanes<T: GenericKernel>(task: T) -> T::Output {
    match isa() {
        Isa::Baseline => on::<lanes::Pair<lanes::Sse2>, T>(task),
        Isa::Avx2 => on::<lanes::Pair<lanes::Avx2>, T>(task),
        Isa::Avx512 => on::<lanes::Avx512, T>(task),
    }
}

/// Run `task` on eight lanes, which the compiler vectorises.
#[cfg(not(target_arch = "x86_64"))]
pub fn run_lanes<T: GenericKernel>(task: T) -> T::Output {
    on::<Array8, T>(task)
}

#[cfg(test)]
mod tests;
