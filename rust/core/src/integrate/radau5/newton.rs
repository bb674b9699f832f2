//! The stages of one step of Radau IIA: simplified Newton iteration on the transformed stages `w = T^-1 z`. The source is section IV.8 of
//! Hairer and Wanner, Solving Ordinary Differential Equations II. Iteration `k`, from 0 to `k_max - 1`:
//!
//! ```text
//! f_i = f(t + c_i h, x + z_i),   g = T^-1 f
//! (m/h - J) dw_1 = g_1 - m/h w_1
//! ((a + ib)/h - J) (dw_2 + i dw_3) = g_2 + i g_3 - (a + ib)/h (w_2 + i w_3)
//! w <- w + dw,   z = T w
//! Theta_k = |dw^k| / |dw^(k-1)|
//! converged   if Theta_k/(1 - Theta_k) |dw^k| < kappa
//! too slow    if Theta_k >= 1 or Theta_k^(k_max - k)/(1 - Theta_k) |dw^k| > kappa
//! ```
//!
//! `m` and `a + ib`, `a - ib` are the eigenvalues of `A^-1`: gamma, alpha and beta with a hat in the book. The norm is scaled by the tolerance
//! of the run. `rate` is `Theta_k`, `newton_tolerance` is `kappa`, and `ITERATIONS` is `k_max`.

use super::{ITERATIONS, Radau5};
use crate::integrate::accuracy::Accuracy;
use crate::integrate::radau5_tableau::{C, T, T_INVERSE, poles, transform};
use crate::integrate::rounding::add_product;
use crate::integrate::step_controller::finite;
use crate::integrate::{Buffer, Differentiable};
use crate::linalg::lu::Complex;
use crate::scalar::Real;

/// An increment below this fraction of Newton's tolerance ends the iteration. Rounding errors may make it larger than the increment before.
const NEGLIGIBLE: f64 = 1e-6;

/// The result of a Newton iteration.
pub(super) struct Newton {
    pub converged: bool,
    pub iterations: usize,
    /// `Theta_k`, the ratio of the norms of the last two increments.
    pub rate: f64,
}

impl<S: Real, B: Buffer<S>, U: Clone, A: Accuracy> Radau5<S, B, U, A> {
    /// Compute the argument `y = x + z_i` of stage `i`.
    pub(super) fn place(&mut self, i: usize) {
        let (x, y, z, remainder) = (self.x.as_ref(), self.y.as_mut(), self.z[i].as_ref(), self.rounding.remainder.as_ref());
        if self.rounding.compensated {
            for c in 0..x.len() {
                y[c] = z[c] + remainder[c];
            }
            self.rounding.place(x, y);
        } else {
            for c in 0..x.len() {
                y[c] = x[c] + z[c];
            }
        }
    }

    /// Solve the stages of a step of size `h`. The start of the iteration is in `z` and `w`.
    pub(super) fn newton<F: Differentiable<S, Input = U>>(&mut self, system: &mut F, h: f64) -> Newton {
        let n = self.x.as_ref().len();
        let (mut rate, mut norm_old) = (f64::NAN, f64::NAN);
        for k in 0..ITERATIONS {
            for i in 0..3 {
                self.place(i);
                system.input(self.controller.input_time(self.controller.t + C[i] * h), &mut self.u);
                system.rhs(&self.u, self.y.as_ref(), self.f[i].as_mut());
                self.controller.work.evaluations += 1;
                if self.rounding.compensated {
                    add_product(&self.jacobian, self.rounding.lost.as_ref(), self.f[i].as_mut());
                }
                if !finite(self.f[i].as_ref()) {
                    return Newton { converged: false, iterations: k + 1, rate };
                }
            }
            // The poles are m/h and (a + ib)/h.
            let (m, a_ib) = poles::<S>(h);
            let Complex(a, b) = a_ib;
            let (dw_1, dw_23) = (self.error.as_mut(), &mut self.pair);
            for c in 0..n {
                let f: [S; 3] = std::array::from_fn(|i| self.f[i].as_ref()[c]);
                let w: [S; 3] = std::array::from_fn(|i| self.w[i].as_ref()[c]);
                let g = T_INVERSE.map(|t| S::splat(t[2]).mul_add(f[2], S::splat(t[1]).mul_add(f[1], S::splat(t[0]) * f[0])));
                dw_1[c] = m.neg_mul_add(w[0], g[0]);
                dw_23[c] = Complex(g[1] - (a * w[1] - b * w[2]), g[2] - (a * w[2] + b * w[1]));
            }
            let (pairs, j) = (system.pairs(), &self.jacobian);
            pairs.solve(n, m, j, (&self.real, &self.real_pivots), dw_1, self.real_work.as_mut());
            pairs.solve(n, a_ib, j, (&self.complex, &self.complex_pivots), dw_23, &mut self.complex_work);
            let x = self.x.as_ref();
            let norms = [
                self.controller.norm(x, x, |c| dw_1[c]),
                self.controller.norm(x, x, |c| dw_23[c].0),
                self.controller.norm(x, x, |c| dw_23[c].1),
            ];
            let norm = (norms.iter().map(|p| p * p).sum::<f64>() / 3.0).sqrt();
            rate = norm / norm_old;
            let negligible = k > 0 && norm <= NEGLIGIBLE * self.newton_tolerance;
            // In the first iteration, `rate` is NaN, and both comparisons with `rate` are false.
            let slow = rate >= 1.0 || rate.powi((ITERATIONS - k) as i32) / (1.0 - rate) * norm > self.newton_tolerance;
            if !norm.is_finite() || slow && !negligible {
                return Newton { converged: false, iterations: k + 1, rate };
            }
            for c in 0..n {
                self.w[0].as_mut()[c] += dw_1[c];
                self.w[1].as_mut()[c] += dw_23[c].0;
                self.w[2].as_mut()[c] += dw_23[c].1;
            }
            transform(&T, &self.w, &mut self.z);
            if norm == 0.0 || negligible || rate / (1.0 - rate) * norm < self.newton_tolerance {
                return Newton { converged: true, iterations: k + 1, rate };
            }
            norm_old = norm;
        }
        Newton { converged: false, iterations: ITERATIONS, rate }
    }
}
