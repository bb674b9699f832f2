//! Linearisation of `a = M^-1 (tau - C v - g)` about any state, not only about an equilibrium:
//!
//! `d/dt [dq; dv] = A [dq; dv] + B dtau`, `A = [[0, 1], [da/dq, da/dv]]`, `B = [[0], [M^-1]]`.

use crate::interrupt;
use crate::memory;

/// Write the state matrix `A`, `(2 n, 2 n)`, and the input matrix `B`, `(2 n, n)`, row-major. `slopes`, `(3 n, n)`, has the rows of
/// `Quantity::ForwardDynamicsDerivatives`.
pub fn state_matrices(n: usize, slopes: &[f64], a: &mut [f64], b: &mut [f64]) {
    memory::set(a, 0.0);
    memory::set(b, 0.0);
    for i in 0..n {
        interrupt::check_at_row(i);
        a[2 * n * i + n + i] = 1.0;
        let row = 2 * n * (n + i);
        a[row..row + n].copy_from_slice(&slopes[n * i..n * (i + 1)]);
        a[row + n..row + 2 * n].copy_from_slice(&slopes[n * (n + i)..n * (n + i + 1)]);
        b[n * (n + i)..n * (n + i + 1)].copy_from_slice(&slopes[n * (2 * n + i)..n * (2 * n + i + 1)]);
    }
}
