//! The number that an algorithm runs on: one run (`f64`, [`Fused`]), or several independent runs side by
//! side ([`lanes`]), one per lane.
//!
//! Algorithms are written once over [`Real`]. They have no branch on lane data: `select` instead. Everything
//! they call on the hot path is `#[inline(always)]`, because the instruction set is that of the function
//! they end up in: [`Real::enter`] is the only door into a region compiled for AVX2 + FMA or AVX-512.

pub mod dual;
pub mod lanes;
mod scalars;
pub mod trig;

pub use dual::Dual;
pub use lanes::{Array8, Isa, isa};
pub use scalars::Fused;

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number, or one real number per lane.
pub trait Real:
    Copy
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
    /// The single number of the same instruction set.
    type One: Real;
    /// How many independent runs the number carries.
    const LANES: usize;

    /// The same number in every lane.
    fn splat(x: f64) -> Self;
    /// `f(i)` in lane `i`.
    fn from_lanes(f: impl FnMut(usize) -> f64) -> Self;
    /// The number in lane `i`.
    fn lane(self, i: usize) -> f64;

    /// `from[i]` in lane `i`, from the first numbers of a slice.
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Self::from_lanes(|lane| from[lane])
    }
    /// The lanes to the first numbers of a slice.
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        for lane in 0..Self::LANES {
            to[lane] = self.lane(lane);
        }
    }

    /// `self * b + c`, fused where the instruction set has it.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// `c - self * b`, fused where the instruction set has it.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// `1 / self` to 1 ulp, for normal numbers.
    fn recip(self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    /// Sine and cosine to 1 ulp for every finite argument.
    fn sin_cos(self) -> (Self, Self);

    /// `self < other`, lane by lane; false where either is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn any(mask: Self::Mask) -> bool;
    fn all(mask: Self::Mask) -> bool;

    /// Run `kernel` compiled for the instruction set of this number.
    fn enter<K: Kernel>(kernel: K) -> K::Output;

    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }

    /// `f` of every lane: for set-up and rare paths, not for a control step.
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self::from_lanes(|i| f(self.lane(i)))
    }
}

/// Work to be done inside the instruction-set region of a known [`Real`]. `run` must be `#[inline(always)]`.
pub trait Kernel {
    type Output;
    fn run(self) -> Self::Output;
}

/// Work that can be done on any [`Real`], before the instruction set is chosen. `run` must be `#[inline(always)]`.
pub trait Task {
    type Output;
    fn run<S: Real>(self) -> Self::Output;
}

/// A task on a chosen number.
struct On<S, T>(T, std::marker::PhantomData<S>);

impl<S: Real, T: Task> Kernel for On<S, T> {
    type Output = T::Output;
    #[inline(always)]
    fn run(self) -> T::Output {
        self.0.run::<S>()
    }
}

#[inline(always)]
fn on<S: Real, T: Task>(task: T) -> T::Output {
    S::enter(On::<S, T>(task, std::marker::PhantomData))
}

/// Run `task` on one number, by the best route of this machine.
pub fn run_scalar<T: Task>(task: T) -> T::Output {
    match isa() {
        Isa::Baseline => on::<f64, T>(task),
        Isa::Avx2 | Isa::Avx512 => on::<Fused, T>(task),
    }
}

/// Run `task` on lanes, by the best route of this machine: one register of them, two where registers are short.
#[cfg(target_arch = "x86_64")]
pub fn run_lanes<T: Task>(task: T) -> T::Output {
    match isa() {
        Isa::Baseline => on::<lanes::Pair<lanes::Sse2>, T>(task),
        Isa::Avx2 => on::<lanes::Pair<lanes::Avx2>, T>(task),
        Isa::Avx512 => on::<lanes::Avx512, T>(task),
    }
}

/// Run `task` on two interleaved registers of lanes, which hides latency (small closed-form arms).
#[cfg(target_arch = "x86_64")]
pub fn run_wide_lanes<T: Task>(task: T) -> T::Output {
    match isa() {
        Isa::Baseline => on::<lanes::Pair<lanes::Sse2>, T>(task),
        Isa::Avx2 => on::<lanes::Pair<lanes::Avx2>, T>(task),
        Isa::Avx512 => on::<lanes::Pair<lanes::Avx512>, T>(task),
    }
}

/// Run `task` on eight lanes left to the compiler's vectoriser.
#[cfg(not(target_arch = "x86_64"))]
pub fn run_lanes<T: Task>(task: T) -> T::Output {
    on::<Array8<false>, T>(task)
}

/// Run `task` on eight lanes left to the compiler's vectoriser.
#[cfg(not(target_arch = "x86_64"))]
pub fn run_wide_lanes<T: Task>(task: T) -> T::Output {
    run_lanes(task)
}

#[cfg(test)]
mod tests;
