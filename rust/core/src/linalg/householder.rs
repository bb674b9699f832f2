//! Householder reflections `H = I - beta w w'` with `H x = alpha e1`. `alpha = -sign(x1) |x|`, `w = x - alpha e1`, `beta = 1 / (|x| |w1|)`
//! (Golub and Van Loan, Matrix Computations, 5.1).
//!
//! The sign of `alpha` avoids cancellation in `w1`. So the reflection is orthogonal to working precision.

use super::{axpy, dot};

/// If the squared norm of `x` without its first entry is below this limit, no reflection is made. These entries are then below 1e-145.
pub const TAIL: f64 = 1e-290;

/// Compute the reflection `H = I - beta w w'` with `H x = alpha e1`. Overwrite `x` by `w`, and return `(alpha, beta)`. If the
/// squared norm of the other entries is below [`TAIL`], `beta = 0`, and `H` is the identity.
#[inline]
pub fn reflector(x: &mut [f64]) -> (f64, f64) {
    let x0 = x[0];
    let tail = dot(&x[1..], &x[1..]);
    if tail < TAIL {
        return (x0, 0.0);
    }
    let norm = (x0 * x0 + tail).sqrt();
    let alpha = -norm.copysign(x0);
    x[0] = x0 - alpha;
    (alpha, 1.0 / (norm * (norm + x0.abs())))
}

/// Replace `y` by `H y`, with the reflection `H = I - beta w w'`.
#[inline]
pub fn reflect(w: &[f64], beta: f64, y: &mut [f64]) {
    let s = -beta * dot(w, y);
    axpy(s, w, y);
}
