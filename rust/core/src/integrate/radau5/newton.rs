//! The stages of one step of Radau IIA: simplified Newton iteration on the transformed stages `w` (see `radau5`).

use super::{ITERATIONS, Radau5};
use crate::integrate::accuracy::Accuracy;
use crate::integrate::radau5_tableau::{C, COMPLEX_POLE, REAL_POLE, T, T_INVERSE, poles, transform};
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
            let (real, re, im) = (S::splat(REAL_POLE / h), S::splat(COMPLEX_POLE.0 / h), S::splat(COMPLEX_POLE.1 / h));
            let error = self.error.as_mut();
            for c in 0..n {
                let f: [S; 3] = std::array::from_fn(|i| self.f[i].as_ref()[c]);
                let w: [S; 3] = std::array::from_fn(|i| self.w[i].as_ref()[c]);
                let row = |i: usize| {
                    let m = T_INVERSE[i];
                    S::splat(m[2]).mul_add(f[2], S::splat(m[1]).mul_add(f[1], S::splat(m[0]) * f[0]))
                };
                error[c] = real.neg_mul_add(w[0], row(0));
                self.pair[c] = Complex(row(1) - (re * w[1] - im * w[2]), row(2) - (re * w[2] + im * w[1]));
            }
            let (pairs, j, (real, complex)) = (system.pairs(), &self.jacobian, poles::<S>(h));
            pairs.solve(n, real, j, (&self.real, &self.real_pivots), error, self.real_work.as_mut());
            pairs.solve(n, complex, j, (&self.complex, &self.complex_pivots), &mut self.pair, &mut self.complex_work);
            let (x, pair) = (self.x.as_ref(), &self.pair);
            let parts = [
                self.controller.norm(x, x, |c| error[c]),
                self.controller.norm(x, x, |c| pair[c].0),
                self.controller.norm(x, x, |c| pair[c].1),
            ];
            let norm = (parts.iter().map(|p| p * p).sum::<f64>() / 3.0).sqrt();
            rate = norm / norm_old;
            let left = (ITERATIONS - k) as i32;
            let negligible = k > 0 && norm <= NEGLIGIBLE * self.newton_tolerance;
            // In the first iteration, `rate` is NaN, and both comparisons with `rate` are false.
            let slow = rate >= 1.0 || rate.powi(left) / (1.0 - rate) * norm > self.newton_tolerance;
            if !norm.is_finite() || slow && !negligible {
                return Newton { converged: false, iterations: k + 1, rate };
            }
            for c in 0..n {
                self.w[0].as_mut()[c] += error[c];
                self.w[1].as_mut()[c] += self.pair[c].0;
                self.w[2].as_mut()[c] += self.pair[c].1;
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
