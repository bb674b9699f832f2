//! The selection of the lane type for generic code.

#[cfg(not(target_arch = "x86_64"))]
use super::lanes::Array8;
use super::{Kernel, Real};
#[cfg(target_arch = "x86_64")]
use super::{
    instruction_set::{Isa, isa},
    lanes,
};

/// Code that is generic over [`Real`]. [`run_lanes`] selects the number type at run time. `run` must be `#[inline(always)]`.
///
/// ```
/// use armlet_core::scalar::{GenericKernel, Real, run_lanes};
///
/// /// Write the squares, as many numbers at once as the number type has lanes.
/// struct Squares<'a>(&'a mut [f64; 64]);
/// impl GenericKernel for Squares<'_> {
///     type Output = ();
///     #[inline(always)]
///     fn run<S: Real>(self) {
///         for part in self.0.chunks_exact_mut(S::LANES) {
///             let x = S::load(part);
///             (x * x).store(part);
///         }
///     }
/// }
/// let mut x = std::array::from_fn(|k| k as f64);
/// run_lanes(Squares(&mut x));
/// assert_eq!(x[63], 3969.0);
/// ```
pub trait GenericKernel {
    /// The type of the result.
    type Output;
    /// Run the code with the number type `S`.
    fn run<S: Real>(self) -> Self::Output;
}

/// Generic code with a selected number type.
struct On<S, T>(T, std::marker::PhantomData<S>);

impl<S: Real, T: GenericKernel> Kernel for On<S, T> {
    type Output = T::Output;
    #[inline(always)]
    fn run(self) -> T::Output {
        self.0.run::<S>()
    }
}

#[inline(always)]
pub(super) fn on<S: Real, T: GenericKernel>(task: T) -> T::Output {
    S::enter(On::<S, T>(task, std::marker::PhantomData))
}

/// Run `task` on the lane type that is fastest on this processor: one register with AVX-512, otherwise two registers.
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
