//! Explicit Runge-Kutta methods of fixed step size in which each stage uses only the previous slope:
//!
//! `k_i = f(t + c_i h, x + a_i h k_{i-1})`, `x += h/d sum_i b_i k_i`, with a common divisor `d` of the weights. The input is evaluated once
//! per distinct `c_i`. If the last `c_i` is 1, the next step reuses the input at the end.

use super::{Advance, Buffer, FixedStep, System};
use crate::scalar::Real;
use std::marker::PhantomData;

/// A stage of a method whose stages use only the previous slope.
///
/// ```
/// use armlet_core::integrate::{EqualSteps, Rk4};
///
/// let weights: Vec<f64> = Rk4::STAGES.iter().map(|stage| stage.weight / Rk4::DIVISOR).collect();
/// assert_eq!(weights, [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// The index of the stage's time in `INSTANTS`.
    pub instant: usize,
    /// The coefficient `a_i` of the previous slope in the argument of the stage.
    pub part: f64,
    /// The weight `b_i` of the slope in the sum.
    pub weight: f64,
}

/// The tableau of a method whose stages use only the previous slope.
///
/// ```
/// use armlet_core::integrate::{EqualSteps, Explicit, FixedStep, Stage, System};
/// # struct Growth;
/// # impl System<f64> for Growth {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = x[0]; }
/// # }
///
/// /// Heun's method of order 2.
/// struct Heun;
/// impl EqualSteps for Heun {
///     const INSTANTS: &'static [f64] = &[0.0, 1.0];
///     const STAGES: &'static [Stage] =
///         &[Stage { instant: 0, part: 0.0, weight: 1.0 }, Stage { instant: 1, part: 1.0, weight: 1.0 }];
///     const DIVISOR: f64 = 2.0;
/// }
/// let mut x = [1.0];
/// Explicit::<Heun, _, _>::new(x, ()).step(&mut Growth, 0.0, 0.5, 0.5, &mut x);
/// assert_eq!(x, [1.0 + 0.5 + 0.125]); // `x' = x`
/// ```
pub trait EqualSteps {
    /// The times of the inputs, as increasing fractions of the step.
    const INSTANTS: &'static [f64];
    /// The stages.
    const STAGES: &'static [Stage];
    /// The divisor `d` of the weighted sum.
    const DIVISOR: f64;
}

/// The method with tableau `C`. `B` is the type of the state.
///
/// ```
/// use armlet_core::integrate::{Explicit, FixedStep, Rk4};
/// # use armlet_core::integrate::System;
/// # struct Growth;
/// # impl System<f64> for Growth {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = x[0]; }
/// # }
///
/// // One step of 1 s for `x' = x`: the first five terms of the series of `e`.
/// let mut x = [1.0];
/// let mut method = Explicit::<Rk4, _, _>::new(x, ());
/// method.step(&mut Growth, 0.0, 1.0, 1.0, &mut x);
/// assert!((x[0] - 65.0 / 24.0f64).abs() < 1e-15);
/// ```
pub struct Explicit<C, B, U> {
    k: B,
    y: B,
    sum: B,
    /// The input at each instant.
    inputs: Vec<U>,
    /// The time of the last input, or NaN if it cannot be reused.
    end_time: f64,
    tableau: PhantomData<C>,
}

impl<C: EqualSteps, B: Clone, U: Clone> Explicit<C, B, U> {
    /// Return the method. The sizes of `state` and `input` determine the sizes of its memory.
    pub fn new(state: B, input: U) -> Self {
        let (k, y, sum) = (state.clone(), state.clone(), state);
        Explicit { k, y, sum, inputs: vec![input; C::INSTANTS.len()], end_time: f64::NAN, tableau: PhantomData }
    }
}

impl<C: EqualSteps, S: Real, F: System<S>, B: Buffer<S>> FixedStep<S, F, B> for Explicit<C, B, F::Input> {
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        let last = C::INSTANTS.len() - 1;
        let known = self.end_time == t;
        if known {
            self.inputs.swap(0, last);
        }
        for (input, part) in self.inputs.iter_mut().zip(C::INSTANTS).skip(usize::from(known)) {
            system.input(if *part == 1.0 { end } else { t + part * h }, input);
        }
        if C::INSTANTS[last] == 1.0 {
            self.end_time = end;
        }
        self.advance(system, S::splat(h), x);
    }

    fn restart(&mut self) {
        self.end_time = f64::NAN;
    }
}

impl<C: EqualSteps, S: Real, F: System<S>, B: Buffer<S>> Advance<S, F, B> for Explicit<C, B, F::Input> {
    const INSTANTS: &'static [f64] = C::INSTANTS;

    fn input(&mut self, k: usize) -> &mut F::Input {
        &mut self.inputs[k]
    }

    fn advance(&mut self, system: &mut F, h: S, x: &mut B) {
        let (x, k, y, sum) = (x.as_mut(), self.k.as_mut(), self.y.as_mut(), self.sum.as_mut());
        for (i, stage) in C::STAGES.iter().enumerate() {
            let weight = S::splat(stage.weight);
            if i == 0 {
                system.rhs(&self.inputs[stage.instant], x, k);
                for c in 0..x.len() {
                    sum[c] = weight * k[c];
                }
            } else {
                let part = S::splat(stage.part) * h;
                for c in 0..x.len() {
                    y[c] = part.mul_add(k[c], x[c]);
                }
                system.rhs(&self.inputs[stage.instant], y, k);
                for c in 0..x.len() {
                    sum[c] = weight.mul_add(k[c], sum[c]);
                }
            }
        }
        let part = h / S::splat(C::DIVISOR);
        for c in 0..x.len() {
            x[c] = part.mul_add(sum[c], x[c]);
        }
    }
}
