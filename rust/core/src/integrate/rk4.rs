//! The classical Runge-Kutta method of order 4 (Kutta 1901):
//!
//! `k1 = f(t, x)`, `k2 = f(t + h/2, x + h/2 k1)`, `k3 = f(t + h/2, x + h/2 k2)`, `k4 = f(t + h, x + h k3)`,
//! `x += h/6 (k1 + 2 k2 + 2 k3 + k4)`. The input is taken three times, and the end's serves the next step.

use super::{Advance, Buffer, FixedStep, System};
use crate::scalar::Real;

/// The instants of the inputs, as parts of the step.
pub(super) const INSTANTS: &[f64] = &[0.0, 0.5, 1.0];

/// The classical Runge-Kutta method.
///
/// ```
/// use armlet_core::integrate::{FixedStep, Rk4, System};
/// use armlet_core::scalar::Real;
///
/// /// `x' = t`, whose input is the time.
/// struct Ramp;
/// impl<S: Real> System<S> for Ramp {
///     type Input = f64;
///     fn input(&mut self, t: f64, u: &mut f64) {
///         *u = t;
///     }
///     fn rhs(&mut self, u: &f64, _: &[S], dx: &mut [S]) {
///         dx[0] = S::splat(*u);
///     }
/// }
/// let (mut method, mut x) = (Rk4::new([0.0], 0.0), [0.0]);
/// for k in 0..10 {
///     let t = 0.1 * f64::from(k);
///     method.step(&mut Ramp, t, 0.1, t + 0.1, &mut x);
/// }
/// assert!((x[0] - 0.5f64).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Rk4<B, U> {
    k: B,
    y: B,
    sum: B,
    start: U,
    middle: U,
    end: U,
    /// The time of `end`, NaN when there is none to reuse.
    end_time: f64,
}

impl<B: Clone, U: Clone> Rk4<B, U> {
    /// The method; `state` and `input` give the sizes.
    pub fn new(state: B, input: U) -> Self {
        let (k, y, sum) = (state.clone(), state.clone(), state);
        Rk4 { k, y, sum, start: input.clone(), middle: input.clone(), end: input, end_time: f64::NAN }
    }
}

impl<S: Real, F: System<S>, B: Buffer<S>> FixedStep<S, F, B> for Rk4<B, F::Input> {
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        if self.end_time == t {
            std::mem::swap(&mut self.start, &mut self.end);
        } else {
            system.input(t, &mut self.start);
        }
        system.input(t + 0.5 * h, &mut self.middle);
        system.input(end, &mut self.end);
        self.end_time = end;
        self.advance(system, S::splat(h), x);
    }

    fn restart(&mut self) {
        self.end_time = f64::NAN;
    }
}

impl<S: Real, F: System<S>, B: Buffer<S>> Advance<S, F, B> for Rk4<B, F::Input> {
    const INSTANTS: &'static [f64] = INSTANTS;

    fn input(&mut self, k: usize) -> &mut F::Input {
        match k {
            0 => &mut self.start,
            1 => &mut self.middle,
            _ => &mut self.end,
        }
    }

    fn advance(&mut self, system: &mut F, h: S, x: &mut B) {
        let (x, k, y, sum) = (x.as_mut(), self.k.as_mut(), self.y.as_mut(), self.sum.as_mut());
        let (half, sixth, two) = (S::splat(0.5) * h, h / S::splat(6.0), S::splat(2.0));
        system.rhs(&self.start, x, k);
        for i in 0..x.len() {
            sum[i] = k[i];
            y[i] = half.mul_add(k[i], x[i]);
        }
        system.rhs(&self.middle, y, k);
        for i in 0..x.len() {
            sum[i] = two.mul_add(k[i], sum[i]);
            y[i] = half.mul_add(k[i], x[i]);
        }
        system.rhs(&self.middle, y, k);
        for i in 0..x.len() {
            sum[i] = two.mul_add(k[i], sum[i]);
            y[i] = h.mul_add(k[i], x[i]);
        }
        system.rhs(&self.end, y, k);
        for i in 0..x.len() {
            x[i] = sixth.mul_add(sum[i] + k[i], x[i]);
        }
    }
}
