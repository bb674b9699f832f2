//! The size of the first step of an adaptive method.

use super::accuracy::Accuracy;
use super::step_controller::{StepController, finite};
use super::{Buffer, System};
use crate::scalar::Real;

impl<T: Accuracy> StepController<T> {
    /// Set the first step size `h`: `h_first` if it is positive, otherwise an estimate. The estimate uses the state `x`, its slope `k` and
    /// its curvature (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.4). `order` is the order of the
    /// error estimate. `y`, `dy` and `u` are memory for states and for the input.
    pub fn guess<S, F, B>(&mut self, system: &mut F, (x, k): (&B, &B), (y, dy, u): (&mut B, &mut B, &mut F::Input), order: f64)
    where
        S: Real,
        F: System<S>,
        B: Buffer<S>,
    {
        if self.h_first > 0.0 {
            self.h = self.h_first.min(self.h_max);
            return;
        }
        let span = self.t_end - self.t;
        let (x, k) = (x.as_ref(), k.as_ref());
        // The square of a very large component overflows. Then the norm is infinite, and the largest finite number replaces it.
        let d0 = self.norm(x, x, |i| x[i]).min(f64::MAX);
        let d1 = self.norm(x, x, |i| k[i]).min(f64::MAX);
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 }.min(span);
        for i in 0..x.len() {
            y.as_mut()[i] = S::splat(h0).mul_add(k[i], x[i]);
        }
        system.input(self.input_time(self.t + h0), u);
        system.rhs(u, y.as_ref(), dy.as_mut());
        self.work.evaluations += 1;
        let dy = dy.as_ref();
        // If the slope is not finite at the end of the trial step `h0`, the first step is at most 1e-6 of the segment. If the segment has
        // no end, it is at most `1e-6 h0`.
        let (d2, most) = if finite(dy) {
            (self.norm(x, x, |i| dy[i] - k[i]) / h0, span)
        } else {
            (0.0, if span.is_finite() { span } else { h0 } * 1e-6)
        };
        let steepest = d1.max(d2).min(f64::MAX);
        let h1 = if steepest <= 1e-15 { (1e-3 * h0).max(1e-6) } else { (0.01 / steepest).powf(1.0 / (order + 1.0)) };
        // The first step must advance the time, even if a limit is smaller.
        let smallest = self.smallest();
        self.h = (100.0 * h0).min(h1).max(2.0 * smallest).min(most).min(self.h_max).max(smallest);
    }
}
