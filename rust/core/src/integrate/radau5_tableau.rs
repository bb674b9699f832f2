//! The coefficients of Radau IIA with three stages (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8).

use super::Buffer;
use crate::linalg::lu::Complex;
use crate::scalar::Real;

const ROOT6: f64 = 2.449489742783178;
pub(super) const C: [f64; 3] = [(4.0 - ROOT6) / 10.0, (4.0 + ROOT6) / 10.0, 1.0];
pub(super) const E: [f64; 3] = [(-13.0 - 7.0 * ROOT6) / 3.0, (-13.0 + 7.0 * ROOT6) / 3.0, -1.0 / 3.0];
/// The eigenvalues of `A^-1`: `3 + 9^(1/3) - 3^(1/3)`, and `3 + (3^(1/3) - 9^(1/3))/2 -+ i (3^(5/6) + 3^(7/6))/2`.
pub(super) const REAL_POLE: f64 = 3.637834252744496;
pub(super) const COMPLEX_POLE: (f64, f64) = (2.681082873627752, -3.0504301992474105);
pub(super) const T: [[f64; 3]; 3] = [
    [0.09443876248897524, -0.14125529502095421, 0.03002919410514742],
    [0.25021312296533332, 0.20412935229379994, -0.38294211275726192],
    [1.0, 1.0, 0.0],
];
pub(super) const T_INVERSE: [[f64; 3]; 3] = [
    [4.17871859155190428, 0.32768282076106237, 0.52337644549944951],
    [-4.17871859155190428, -0.32768282076106237, 0.47662355450055044],
    [0.50287263494578682, -2.57192694985560522, 0.59603920482822492],
];
/// The coefficients of the polynomial `x(t_old + s h) = x_old + sum_i z_i (P_i0 s + P_i1 s^2 + P_i2 s^3)`.
pub(super) const P: [[f64; 3]; 3] = [
    [13.0 / 3.0 + 7.0 * ROOT6 / 3.0, -23.0 / 3.0 - 22.0 * ROOT6 / 3.0, 10.0 / 3.0 + 5.0 * ROOT6],
    [13.0 / 3.0 - 7.0 * ROOT6 / 3.0, -23.0 / 3.0 + 22.0 * ROOT6 / 3.0, 10.0 / 3.0 - 5.0 * ROOT6],
    [1.0 / 3.0, -8.0 / 3.0, 10.0 / 3.0],
];

/// Return the shifts of the real and the complex linear system for a step of size `h`.
pub(super) fn poles<S: Real>(h: f64) -> (S, Complex<S>) {
    (S::splat(REAL_POLE / h), Complex(S::splat(COMPLEX_POLE.0 / h), S::splat(COMPLEX_POLE.1 / h)))
}

/// Multiply each component of the three stages with the matrix: `to = m from`.
pub(super) fn transform<S: Real, B: Buffer<S>>(m: &[[f64; 3]; 3], from: &[B; 3], to: &mut [B; 3]) {
    for i in 0..3 {
        let out = to[i].as_mut();
        for c in 0..out.len() {
            let sum = S::splat(m[i][0]) * from[0].as_ref()[c];
            let sum = S::splat(m[i][1]).mul_add(from[1].as_ref()[c], sum);
            out[c] = S::splat(m[i][2]).mul_add(from[2].as_ref()[c], sum);
        }
    }
}
