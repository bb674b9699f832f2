//! The classical Runge-Kutta method of order 4 (Kutta 1901):
//!
//! `k1 = f(t, x)`, `k2 = f(t + h/2, x + h/2 k1)`, `k3 = f(t + h/2, x + h/2 k2)`, `k4 = f(t + h, x + h k3)`,
//! `x += h/6 (k1 + 2 k2 + 2 k3 + k4)`. The input is taken three times, and the end's serves the next step.

use super::{Advance, Buffer, FixedStep, System};
use crate::scalar::Real;

pub struct Rk4<B, U> {
    k: B,
    y: B,
    sum: B,
    start: U,
    middle: U,
    end: U,
    /// The time of `end`, NaN when there is none to reuse.
    end_time: f64,
    /// Whether the last step left the neighbourhood of its start.
    strays: bool,
}

impl<B: Clone, U: Clone> Rk4<B, U> {
    #[inline(always)]
    pub fn new(state: B, input: U) -> Self {
        let (k, y, sum) = (state.clone(), state.clone(), state);
        Rk4 { k, y, sum, start: input.clone(), middle: input.clone(), end: input, end_time: f64::NAN, strays: false }
    }
}

impl<B, U> Rk4<B, U> {
    /// The four slopes from `x`: the last in `k`, `k1 + 2 k2 + 2 k3` in `sum`.
    #[inline(always)]
    fn stages<const NEAR: bool, S, F>(&mut self, system: &mut F, h: S, x: &[S])
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let (k, y, sum) = (self.k.as_mut(), self.y.as_mut(), self.sum.as_mut());
        let (half, full, two) = (S::splat(0.5) * h, h, S::splat(2.0));
        if NEAR {
            system.anchor_near(x)
        } else {
            system.anchor(x)
        }
        system.rhs_at_anchor(&self.start, x, k);
        for i in 0..x.len() {
            sum[i] = k[i];
            y[i] = half.mul_add(k[i], x[i]);
        }
        slope::<NEAR, S, F>(system, &self.middle, y, k);
        for i in 0..x.len() {
            sum[i] = two.mul_add(k[i], sum[i]);
            y[i] = half.mul_add(k[i], x[i]);
        }
        slope::<NEAR, S, F>(system, &self.middle, y, k);
        for i in 0..x.len() {
            sum[i] = two.mul_add(k[i], sum[i]);
            y[i] = full.mul_add(k[i], x[i]);
        }
        slope::<NEAR, S, F>(system, &self.end, y, k);
    }

    /// `x += sixth (k1 + 2 k2 + 2 k3 + k4)`.
    #[inline(always)]
    fn combine<S: Real>(&self, sixth: S, x: &mut [S])
    where
        B: Buffer<S>,
    {
        let (k, sum) = (self.k.as_ref(), self.sum.as_ref());
        for i in 0..x.len() {
            x[i] = sixth.mul_add(sum[i] + k[i], x[i]);
        }
    }
}

#[inline(always)]
fn slope<const NEAR: bool, S: Real, F: System<S>>(system: &mut F, u: &F::Input, x: &[S], dx: &mut [S]) {
    if NEAR { system.rhs_near(u, x, dx) } else { system.rhs(u, x, dx) }
}

impl<S: Real, F: System<S>, B: Buffer<S>> FixedStep<S, F, B> for Rk4<B, F::Input> {
    #[inline(always)]
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        if self.end_time == t {
            std::mem::swap(&mut self.start, &mut self.end);
        } else {
            system.input(t, &mut self.start);
        }
        system.input(t + 0.5 * h, &mut self.middle);
        system.input(end, &mut self.end);
        self.end_time = end;

        // Most steps stay near their start: what each stage would ask of that is asked once, at the end.
        if !self.strays {
            self.stages::<true, S, F>(system, S::splat(h), x.as_ref());
            self.strays = system.strayed();
        }
        if self.strays {
            self.stages::<false, S, F>(system, S::splat(h), x.as_ref());
            self.strays = system.strayed();
        }
        self.combine(S::splat(h / 6.0), x.as_mut());
    }

    fn restart(&mut self) {
        self.end_time = f64::NAN;
    }
}

impl<S: Real, F: System<S>, B: Buffer<S>> Advance<S, F, B> for Rk4<B, F::Input> {
    const INSTANTS: &'static [f64] = &[0.0, 0.5, 1.0];

    fn input(&mut self, k: usize) -> &mut F::Input {
        match k {
            0 => &mut self.start,
            1 => &mut self.middle,
            _ => &mut self.end,
        }
    }

    #[inline(always)]
    fn advance(&mut self, system: &mut F, h: S, x: &mut B) {
        self.stages::<false, S, F>(system, h, x.as_ref());
        self.combine(h / S::splat(6.0), x.as_mut());
    }
}
