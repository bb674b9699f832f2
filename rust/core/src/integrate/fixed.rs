//! Methods of fixed step size with the interface of adaptive methods: `t_k = t_0 + k h`, and a shorter step at the end.
//!
//! Dense output is the cubic Hermite polynomial over a step (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.6):
//!
//! `x(s) = (1-s) x_0 + s x_1 + s (s-1) ((1-2s)(x_1 - x_0) + (s-1) h f_0 + s h f_1)`.

use super::accuracy::Work;
use super::adaptive::Adaptive;
use super::step_controller::finite;
use super::{Buffer, FixedStep, System};
use crate::scalar::Real;
use crate::status::Status;

/// If the remainder of the time span is below this fraction of a step, the last step includes it.
const LEAST_REMAINDER: f64 = 1e-9;

/// A method of fixed step size `h` as an adaptive method.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Explicit, Rk4, Steps, Work};
/// # use armlet_core::integrate::System;
/// # struct Decay;
/// # impl System<f64> for Decay {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = -x[0]; }
/// # }
///
/// // Steps of 0.3 s, and a last step of 0.1 s, for `x' = -x`.
/// let each = Work { evaluations: 4, ..Work::default() };
/// let mut method = Steps::new(Explicit::<Rk4, _, _>::new([0.0], ()), 0.3, each, [1.0], ());
/// method.begin(&mut Decay, 0.0, 1.0, 1.0).expect("finite");
/// while !method.step(&mut Decay).expect("finite") {}
/// # let method: &dyn Adaptive<f64, Decay, [f64; 1]> = &method;
/// assert!((method.x()[0] - (-1.0f64).exp()).abs() < 1e-4);
/// assert_eq!(method.work().steps, 4);
/// ```
pub struct Steps<M, B, U> {
    method: M,
    h: f64,
    x: B,
    x_old: B,
    f_old: B,
    f: B,
    u: U,
    begun: f64,
    taken: u64,
    t: f64,
    t_old: f64,
    t_end: f64,
    input_end: f64,
    dense: bool,
    work: Work,
    /// The numbers of evaluations, Jacobians and decompositions of one step.
    each: Work,
}

impl<M, B: Clone, U: Clone> Steps<M, B, U> {
    /// Return a method with steps of size `h > 0`, s, and the initial state `state`. `each`: the numbers of evaluations, Jacobians and
    /// decompositions of one step. The sizes of `state` and `input` determine the sizes of its memory.
    pub fn new(method: M, h: f64, each: Work, state: B, input: U) -> Self {
        let (x_old, f_old, f) = (state.clone(), state.clone(), state.clone());
        Steps {
            method,
            h,
            x: state,
            x_old,
            f_old,
            f,
            u: input,
            begun: 0.0,
            taken: 0,
            t: 0.0,
            t_old: 0.0,
            t_end: 0.0,
            input_end: 0.0,
            dense: false,
            work: Work::default(),
            each,
        }
    }
}

impl<S, F, B, M> Adaptive<S, F, B> for Steps<M, B, F::Input>
where
    S: Real,
    F: System<S>,
    B: Buffer<S>,
    M: FixedStep<S, F, B>,
{
    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        (self.begun, self.taken, self.t, self.t_old, self.t_end, self.input_end) = (t, 0, t, t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        self.method.restart();
        system.input(t.min(input_end), &mut self.u);
        system.rhs(&self.u, self.x.as_ref(), self.f.as_mut());
        self.work.evaluations += 1;
        if finite(self.x.as_ref()) && finite(self.f.as_ref()) { Ok(()) } else { Err(Status::Diverged) }
    }

    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        if self.t >= self.t_end {
            return Ok(true);
        }
        let mut t_new = self.begun + (self.taken + 1) as f64 * self.h;
        if t_new > self.t_end - LEAST_REMAINDER * self.h {
            t_new = self.t_end;
        }
        if !(t_new > self.t) {
            return Err(Status::StepUnderflow);
        }
        self.x_old.clone_from(&self.x);
        self.method.step(system, self.t, t_new - self.t, t_new.min(self.input_end), &mut self.x);
        self.work.evaluations += self.each.evaluations;
        self.work.jacobians += self.each.jacobians;
        self.work.factorisations += self.each.factorisations;
        if !finite(self.x.as_ref()) {
            self.x.clone_from(&self.x_old);
            return Err(Status::Diverged);
        }
        self.taken += 1;
        self.work.steps += 1;
        (self.t_old, self.t, self.dense) = (self.t, t_new, false);
        Ok(self.t >= self.t_end)
    }

    fn interpolate(&mut self, system: &mut F, t: f64, out: &mut B) {
        let h = self.t - self.t_old;
        if h == 0.0 || t >= self.t {
            out.clone_from(&self.x);
            return;
        }
        if !self.dense {
            for (t, x, f) in [(self.t_old, &self.x_old, &mut self.f_old), (self.t, &self.x, &mut self.f)] {
                system.input(t.min(self.input_end), &mut self.u);
                system.rhs(&self.u, x.as_ref(), f.as_mut());
                self.work.evaluations += 1;
            }
            self.dense = true;
        }
        let s = (t - self.t_old) / h;
        let k = S::splat;
        let (x0, x1, f0, f1) = (self.x_old.as_ref(), self.x.as_ref(), self.f_old.as_ref(), self.f.as_ref());
        for (c, out) in out.as_mut().iter_mut().enumerate() {
            let cubic = k(1.0 - 2.0 * s) * (x1[c] - x0[c]) + k((s - 1.0) * h) * f0[c] + k(s * h) * f1[c];
            *out = k(1.0 - s) * x0[c] + k(s) * x1[c] + k(s * (s - 1.0)) * cubic;
        }
    }

    fn dense_degree(&self) -> usize {
        3
    }
    fn t(&self) -> f64 {
        self.t
    }
    fn t_old(&self) -> f64 {
        self.t_old
    }
    fn x(&self) -> &B {
        &self.x
    }
    fn x_mut(&mut self) -> &mut B {
        &mut self.x
    }
    fn work(&self) -> Work {
        self.work
    }
    /// Has no effect, because the step size is fixed.
    fn limit_step(&mut self, _: f64) {}
    fn first_step(&mut self, _: f64) {}
}

impl<S, F, B, M> FixedStep<S, F, B> for Box<M>
where
    S: Real,
    F: System<S>,
    B: Buffer<S>,
    M: FixedStep<S, F, B> + ?Sized,
{
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        (**self).step(system, t, h, end, x);
    }
    fn restart(&mut self) {
        (**self).restart();
    }
}
