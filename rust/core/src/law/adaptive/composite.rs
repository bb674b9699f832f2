//! Composite adaptation (SlotineLi1989): the estimate also follows the error of the filtered dynamics. The filter makes measured
//! accelerations unnecessary.
//!
//! ```text
//! pi_hat_dot = Gamma (Y' s + W' R e_W),   e_W = tau_W - W pi_hat,   V1_dot = -s' Kd s - e_W' R e_W  where tau_W = W pi
//! ```
//!
//! Here `Y` is the regressor, `s` the sliding variable, `pi_hat` the estimate of the parameters `pi`, `V1` the Lyapunov function, and `'`
//! the transpose. `W` and `tau_W` are the regressor and the torque of the dynamics after the filter `1/(d/dt + lambda)`. With
//! `M v = Y_M(q, v) pi` and `g - C' v = Y_D(q, v) pi`, the dynamics are `d/dt (M v) = tau + C' v - g`. Integration by parts of the filtered
//! derivative gives:
//!
//! ```text
//! W = Y_M + X,   X_dot = -lambda (Y_M + X) + Y_D,   X(0) = -Y_M(q_0, v_0)
//! ```
//!
//! So `W(0) = 0`. The joint columns of armature are part of `Y_M`, and the joint columns of friction and offsets are part of `Y_D`. Known rotor
//! inertias `B` change the torque: `tau_W = X_tau - B v`, `X_tau_dot = -lambda X_tau + tau + lambda B v`.
//!
//! `Y_M = Y(q, 0, 0, v) - Y_g` with `Y_g = Y(q, 0, 0, 0)`. Row `i` of `C' v` is `(Y(q, v, e_i, 0) - Y_g)' v`.
//!
//! Many entries of `Y_M` and `Y_D` are zero at every state. For example, the torque of a joint does not depend on the bodies between it and
//! the base. Where an entry of both `Y_M` and `Y_D` is always zero, `X` remains zero and is not computed.
//!
//! The law's state is the estimate, then `X`, then `X_tau`, `(n,)`. `X` begins with the entries of the `b` estimated parameters of bodies,
//! `(n, b)`. The entries of the joint columns follow.

use super::AdaptiveSpec;
use super::adaptation::Composite;
use crate::error::{Result, positive};
use crate::law::equations::Loop;
use crate::law::sizes::require_size;
use crate::linalg::Gain;
use crate::scalar::Real;
use crate::trace::expression::{stacked, vector, zeros};
use crate::trace::{E, M, V};
use nalgebra::DVector;

impl AdaptiveSpec {
    /// Add adaptation from the filtered dynamics. `rate` is the rate `lambda` of the filter, 1/s, and `weight` is the weight `R` of the
    /// error, of size `n`. Errors: `Input` for a rate that is not positive, `WrongShape` for a wrong size.
    pub fn composite(mut self, rate: f64, weight: Gain) -> Result<Self> {
        positive("composite_rate", rate)?;
        require_size("composite", &weight, self.model.n())?;
        self.composite = Some(Composite { rate, weight, present: self.present() });
        self.lengthen();
        Ok(self)
    }

    /// Find the entries of the regressors `Y_M` and `Y_D` that can differ from zero, `(n, p)`, row-major. Both regressors are analytic. So
    /// an entry that is zero at generic states is zero at every state.
    fn present(&self) -> Vec<bool> {
        const STATES: u32 = 3;
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        /// An entry below this fraction of the largest entry is the rounding error of a difference of equal numbers.
        const ROUNDING: f64 = 1e-12;
        let (n, p) = self.parameter_sizes();
        let mut found = vec![false; n * p];
        for state in 0..STATES {
            let x: Vec<f64> = (1..=2 * n as u32).map(|k| 0.3 + (f64::from(k + 2 * n as u32 * state) * GOLDEN).fract()).collect();
            let (arm, v) = (self.model.at(&x[..n]), DVector::from_column_slice(&x[n..]));
            let speeds = self.columns.speeds();
            let (y_m, y_d) = (self.momentum_regressor(&arm, &v, speeds), self.drift_regressor(&arm, &v, speeds));
            let least = ROUNDING * y_m.amax().max(y_d.amax());
            for (at, found) in found.iter_mut().enumerate() {
                *found |= y_m[(at / p, at % p)].abs() > least || y_d[(at / p, at % p)].abs() > least;
            }
        }
        found
    }

    /// The index in the filters `X` of entry `(i, k)` of the filtered regressor; `None` for an entry that is always zero.
    fn filter(&self, own: &Composite, i: usize, k: usize) -> Option<usize> {
        let (n, p) = self.parameter_sizes();
        let bodies = p - self.columns.count();
        let at = if k < bodies { i * bodies + k } else { n * bodies + k - bodies };
        own.present[i * p + k].then_some(at)
    }

    /// The adaptation from the filtered dynamics, `W' R e_W`, and the rates of the filters under the torque `tau`.
    pub(super) fn composite_adaptation(&self, at: &Loop, tau: &V, pi_hat: &V) -> (V, V) {
        let Some(own) = &self.composite else { return (zeros(pi_hat.len()), zeros(0)) };
        let ((n, p), x) = (self.parameter_sizes(), at.z.rows_range(pi_hat.len()..));
        let last = x.len() - n;
        let (lambda, weight) = (at.number("composite_rate"), at.gain("composite"));
        let speeds = at.vector("friction_speed").as_slice();
        let (y_m, y_d) = (self.momentum_regressor(at.arm(), &at.v, speeds), self.drift_regressor(at.arm(), &at.v, speeds));

        // W and tau_W start at exactly zero, so their sums are not fused.
        let (w, tau_w) = E::as_written(|| {
            let w = M::from_fn(n, p, |i, k| self.filter(own, i, k).map_or(E::zero(), |at| y_m[(i, k)] + x[at]));
            (w, x.rows_range(last..) - at.vector("rotors").component_mul(&at.v))
        });
        let e_w = &tau_w - &w * pi_hat;
        let push = w.tr_mul(&(weight * &e_w));

        let mut x_dot = zeros(last);
        for (i, k) in (0..n).flat_map(|i| (0..p).map(move |k| (i, k))) {
            if let Some(at) = self.filter(own, i, k) {
                x_dot[at] = y_d[(i, k)] - lambda * w[(i, k)];
            }
        }
        let tau_dot = tau - &tau_w * lambda;
        at.matrix_term("W", w);
        at.term("tau_W", tau_w);
        at.term("e_W", e_w);
        (push, stacked([&x_dot, &tau_dot]))
    }

    /// The filters at the start of a run, `X = -Y_M` and `X_tau = B v`, with which `W` and `tau_W` are zero.
    pub(super) fn first_filters(&self, at: &Loop) -> V {
        let Some(own) = &self.composite else { return zeros(0) };
        let (n, p) = self.parameter_sizes();
        let y_m = self.momentum_regressor(at.arm(), &at.v, at.vector("friction_speed").as_slice());
        let mut x = zeros(at.z.len() - p - n);
        for (i, k) in (0..n).flat_map(|i| (0..p).map(move |k| (i, k))) {
            if let Some(at) = self.filter(own, i, k) {
                x[at] = -y_m[(i, k)];
            }
        }
        stacked([&x, &vector(at.vector("rotors").component_mul(&at.v).as_slice())])
    }
}
