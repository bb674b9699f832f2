//! Explicit Runge-Kutta methods with an embedded error estimate. The methods are first same as last: the last slope of a step is the first
//! slope of the next step.
//!
//! | quantity | formula |
//! |---|---|
//! | stages | `k_i = f(t + c_i h, x + h sum_j a_ij k_j)` |
//! | new state `x_new` | the argument of the last stage |
//! | error estimates | `sum_j e_j k_j` |
//! | rows of the dense output over the last step | `h sum_j d_j k_j` |
//!
//! Some methods compute additional stages for the dense output. See Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
//! sections II.4 to II.6.

use super::accuracy::{Accuracy, Tolerance, Work};
use super::adaptive::Adaptive;
use super::chatter::Chatter;
use super::scheme::{Attempt, Scheme};
use super::step_controller::{StepController, finite, step_controlled};
use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;
use std::marker::PhantomData;

/// The method with tableau `C`. `B` is the type of the state, `U` that of the input, and `T` that of the tolerances.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Embedded, Dop853, Dopri5, Scheme, Tolerance};
/// # use armlet_core::integrate::System;
/// # struct Decay;
/// # impl System<f64> for Decay {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = -x[0]; }
/// # }
///
/// /// The number of steps of a method for `x' = -x` over 1 s.
/// fn steps<C: Scheme>() -> u64 {
///     let tolerance = Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 1 };
///     let mut method = Embedded::<C, _, _>::new(tolerance, [1.0], ());
///     method.begin(&mut Decay, 0.0, 1.0, 1.0).expect("finite");
///     while !method.step(&mut Decay).expect("smooth") {}
///     Adaptive::<f64, Decay, _>::work(&method).steps
/// }
/// assert!(steps::<Dop853>() < steps::<Dopri5>());
/// ```
pub struct Embedded<C, B, U, T = Tolerance> {
    controller: StepController<T>,
    /// The slopes of the stages, then the slopes of the dense output. The last slope of the stages is at the end of the step.
    k: Vec<B>,
    estimates: Vec<B>,
    /// The rows of the dense output.
    rows: Vec<B>,
    /// The times at which the stages of a tried step need the input.
    times: Vec<f64>,
    y: B,
    x: B,
    x_old: B,
    u: U,
    /// The time of the input `u`, or NaN if it cannot be reused.
    u_time: f64,
    /// Whether `rows` are computed for the last step.
    dense_ready: bool,
    chatter: Chatter<B>,
    scheme: PhantomData<C>,
}

impl<C: Scheme, B: Clone, U: Clone, T: Accuracy> Embedded<C, B, U, T> {
    /// Return the method with this tolerance and the initial state `state`. The sizes of `state` and `input` determine the sizes of its
    /// memory.
    pub fn new(tolerance: T, state: B, input: U) -> Self {
        let like = |rows: &[&[f64]]| vec![state.clone(); rows.len()];
        Embedded {
            controller: StepController::new(tolerance),
            chatter: Chatter::new(&state),
            k: like(C::A),
            estimates: like(C::E),
            rows: like(C::D),
            times: vec![0.0; C::STAGES],
            y: state.clone(),
            x: state.clone(),
            x_old: state,
            u: input,
            u_time: f64::NAN,
            dense_ready: false,
            scheme: PhantomData,
        }
    }

    /// Prepare a new run from the initial state `x`, with the same tolerance and memory.
    pub fn restart<S>(&mut self, x: &[S])
    where
        S: Real,
        B: Buffer<S>,
        T: Clone,
    {
        self.controller = StepController::new(self.controller.tolerance.clone());
        self.chatter.restart();
        self.x.as_mut().copy_from_slice(x);
        self.u_time = f64::NAN;
    }

    /// Compute an attempt of size `h`, s: the new state `y`, its slope, which is the last one of the stages, and the error estimates.
    fn attempt<S, F>(&mut self, system: &mut F, h: f64)
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let mut times = std::mem::take(&mut self.times);
        self.stage_times(h, &mut times);
        let Embedded { k, estimates, y, x, u, u_time, .. } = self;
        let mut attempt = Attempt { h: S::splat(h), times: &times, x: x.as_ref(), slopes: k, y: y.as_mut(), estimates };
        if system.attempt::<C, B>(&mut attempt) {
            *u_time = f64::NAN;
        } else {
            C::stages(&mut attempt, |i, y, dx| {
                if times[i] != *u_time {
                    system.input(times[i], u);
                    *u_time = times[i];
                }
                system.rhs(u, y, dx);
            });
        }
        self.times = times;
    }

    /// Whether the last step reached the end of the segment.
    pub fn is_done(&self) -> bool {
        self.controller.done()
    }

    /// Begin a step from the state `x`, before its first attempt. Error: [`Status::Stalled`] if the slope jumps along the solution.
    pub fn open<S, F>(&mut self, system: &mut F) -> Result<(), Status>
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        if self.chatter.due(&self.controller.work) {
            self.u_time = f64::NAN;
            self.chatter.check(system, &mut self.controller, &mut self.u, &self.x)?;
        }
        // From here on, the new step replaces the slopes of the last step, which its dense output uses.
        if self.controller.t > self.controller.t_old {
            self.k.swap(0, C::STAGES);
            self.controller.t_old = self.controller.t;
        }
        self.dense_ready = false;
        self.controller.open();
        Ok(())
    }

    /// Return the size of the next attempt of the step, s, and the time at its end, s. Error: the reason why no attempt is possible.
    pub fn propose(&mut self) -> Result<(f64, f64), Status> {
        self.controller.propose()
    }

    /// Write the times of the inputs of all stages after the first one of an attempt of size `h` to `times`, all in s.
    pub fn stage_times(&self, h: f64, times: &mut [f64]) {
        for (time, c) in times.iter_mut().zip(&C::C[1..]) {
            *time = self.controller.input_time(self.controller.t + c * h);
        }
    }

    /// The slope at the start of the present step.
    pub fn slope(&self) -> &B {
        &self.k[0]
    }

    /// The memory of the last step: the states and the slopes at its start and at its end. A caller that computes the attempts writes it
    /// before it calls other functions that read the state or interpolate.
    pub fn last_step(&mut self) -> [(&mut B, &mut B); 2] {
        let (first, rest) = self.k.split_at_mut(1);
        [(&mut self.x_old, &mut first[0]), (&mut self.x, &mut rest[C::STAGES - 1])]
    }

    /// Whether [`Embedded::open`] reads the state.
    pub fn checks_chatter(&self) -> bool {
        self.chatter.due(&self.controller.work)
    }

    /// Return whether an attempt of size `h`, s, to time `t_new`, s, is accepted. `error` is its error divided by the allowed error, and NaN
    /// if the new state or its slope is not finite. An accepted attempt is the last step.
    pub fn judge(&mut self, error: f64, h: f64, t_new: f64) -> bool {
        self.controller.work.evaluations += C::STAGES as u64;
        self.controller.judge(error, h, t_new, &C::CONTROL)
    }

    /// The error of the last attempt, of size `h`, divided by the allowed error. It is NaN if the new state or its slope is not finite.
    fn error<S>(&self, h: f64) -> f64
    where
        S: Real,
        B: Buffer<S>,
    {
        let (x, y, tolerance) = (self.x.as_ref(), self.y.as_ref(), &self.controller.tolerance);
        if !finite(y) || !finite(self.k[C::STAGES].as_ref()) {
            return f64::NAN;
        }
        C::error_within(tolerance, h, x, y, &self.estimates)
    }

    /// The size of the last step, s, for its dense output. `times` receives the times of the additional stages, s.
    pub fn dense_times(&self, times: &mut [f64]) -> f64 {
        let StepController { t, t_old, .. } = self.controller;
        for (time, c) in times.iter_mut().zip(&C::C[C::STAGES + 1..]) {
            *time = self.controller.input_time(t_old + c * (t - t_old));
        }
        t - t_old
    }

    /// Receive the rows of the dense output of the last step, which the caller has computed. `write(i, row)` writes row `i`.
    pub fn receive_dense<S>(&mut self, mut write: impl FnMut(usize, &mut [S]))
    where
        B: Buffer<S>,
    {
        self.rows.iter_mut().enumerate().for_each(|(i, row)| write(i, row.as_mut()));
        self.controller.work.evaluations += (C::A.len() - C::STAGES - 1) as u64;
        self.dense_ready = true;
    }

    /// Compute the slopes and rows of the dense output for the last step, of size `h`.
    fn prepare_dense<S, F>(&mut self, system: &mut F, h: f64)
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        for i in C::STAGES + 1..C::A.len() {
            C::argument(i, S::splat(h), self.x_old.as_ref(), &self.k, self.y.as_mut());
            system.input(self.controller.input_time(self.controller.t_old + C::C[i] * h), &mut self.u);
            system.rhs(&self.u, self.y.as_ref(), self.k[i].as_mut());
            self.controller.work.evaluations += 1;
            self.u_time = f64::NAN;
        }
        C::rows(S::splat(h), &self.k, &mut self.rows);
        self.dense_ready = true;
    }
}

impl<C, S, F, B, U, T> Adaptive<S, F, B> for Embedded<C, B, U, T>
where
    C: Scheme,
    S: Real,
    F: System<S, Input = U>,
    B: Buffer<S>,
    U: Clone,
    T: Accuracy,
{
    step_controlled!(C::DEGREE);

    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        self.controller.begin(t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        self.dense_ready = false;
        self.u_time = f64::NAN;
        system.input(t, &mut self.u);
        system.rhs(&self.u, self.x.as_ref(), self.k[0].as_mut());
        self.controller.work.evaluations += 1;
        if !finite(self.x.as_ref()) || !finite(self.k[0].as_ref()) {
            return Err(Status::Diverged);
        }
        let [k0, k1, ..] = &mut self.k[..] else { unreachable!("a pair has several stages") };
        self.controller.guess(system, (&self.x, k0), (&mut self.y, k1, &mut self.u), C::DEGREE as f64);
        Ok(())
    }

    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        if self.controller.done() {
            return Ok(true);
        }
        self.open(system)?;
        loop {
            let (h, t_new) = self.propose()?;
            self.attempt::<S, F>(system, h);
            if self.judge(self.error::<S>(h), h, t_new) {
                std::mem::swap(&mut self.x_old, &mut self.x);
                std::mem::swap(&mut self.x, &mut self.y);
                return Ok(self.controller.done());
            }
        }
    }

    fn interpolate(&mut self, system: &mut F, t: f64, out: &mut B) {
        let Some((part, h)) = self.controller.within(t) else { return out.clone_from(&self.x) };
        if !self.dense_ready {
            self.prepare_dense::<S, F>(system, h);
        }
        let (r, at, h) = (S::splat(part), (S::splat(part), S::splat(1.0 - part)), S::splat(h));
        let (x0, x1, f0, f1) = (self.x_old.as_ref(), self.x.as_ref(), self.k[0].as_ref(), self.k[C::STAGES].as_ref());
        for (c, out) in out.as_mut().iter_mut().enumerate() {
            let dense = C::dense(at, h, x1[c] - x0[c], [f0[c], f1[c]], |row| self.rows[row].as_ref()[c]);
            *out = dense.mul_add(r, x0[c]);
        }
    }
}
