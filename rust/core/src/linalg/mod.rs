//! Small dense linear algebra on row-major slices, with their sizes as separate arguments. Iterative algorithms have a limit on the number
//! of iterations.
//!
//! The routines of a control step reuse their memory: `cholesky::factor_into`, `ClampedInverse`, `lu`, `Pairs` and `Svd::decompose`.

pub mod cholesky;
pub mod clamp;
pub mod clamped_inverse;
pub mod eigenvalues;
pub mod gain;
pub mod householder;
pub mod jacobi_rotation;
pub mod lu;
pub mod null_basis;
pub mod pinv;
pub mod ratio_damping;
pub mod resolvent;
pub mod svd;
pub mod symmetric_eigen;

pub use cholesky::Cholesky;
pub use clamp::{clamp_gain, clamp_remainder};
pub use clamped_inverse::{ClampedInverse, clamped_inverse};
pub use gain::{AnyGain, Gain};
pub use null_basis::null_basis;
pub use pinv::pinv;
pub use ratio_damping::ratio_damping;
pub use resolvent::Pairs;
pub use svd::Svd;
pub use symmetric_eigen::symmetric_eigen;

/// Return the scalar product of two vectors of equal length.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Compute `y += s x`.
#[inline]
pub fn axpy(s: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}

/// Return the largest magnitude. It is NaN if an entry is not finite.
#[inline]
pub fn largest(a: &[f64]) -> f64 {
    let (mut most, mut sound) = (0.0f64, 0.0);
    for x in a {
        most = most.max(x.abs());
        sound += x * 0.0;
    }
    most + sound
}
