//! RODAS: a stiffly accurate, L-stable Rosenbrock method of order 4, with an embedded method of order 3 and dense output of order 3.
//!
//! Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7. The coefficients are from its code `rodas.f`.
//!
//! For six stages, `(I/(g h) - df/dx) u_i = f(t + c_i h, x + sum_j a_ij u_j) + sum_j c_ij u_j / h + d_i h df/dt`. Then
//! `x_5 = x + sum a_5j u_j + u_5`, `x_new = x_5 + u_6`, and the error estimate is `u_6`. In this file, `GAMMA` is `g`, and `K` has the
//! entries `c_ij`.

use super::accuracy::{Accuracy, Tolerance, Work};
use super::adaptive::Adaptive;
use super::chatter::Chatter;
use super::rounding::{Rounding, add_product, two_sum};
use super::step_controller::{Control, StepController, finite, step_controlled};
use super::{Buffer, Differentiable};
use crate::scalar::Real;
use crate::status::Status;

const GAMMA: f64 = 0.25;
/// The times of the stages, as fractions of the step.
const C: [f64; 6] = [0.0, 0.386, 0.21, 0.63, 1.0, 1.0];
/// The weights of `h df/dt` in the stages.
const D: [f64; 6] = [0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0];
/// The weights of earlier stages in the argument of each stage. The last argument contains stage 5 with weight 1.
const A: [[f64; 5]; 6] = [
    [0.0; 5],
    [1.544, 0.0, 0.0, 0.0, 0.0],
    [0.9466785280815826, 0.2557011698983284, 0.0, 0.0, 0.0],
    [3.314825187068521, 2.896124015972201, 0.9986419139977817, 0.0, 0.0],
    [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 0.0],
    [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1.0],
];
/// The weights `c_ij` of earlier stages on the right-hand side. They are divided by `h`.
const K: [[f64; 5]; 6] = [
    [0.0; 5],
    [-5.6688, 0.0, 0.0, 0.0, 0.0],
    [-2.430093356833875, -0.2063599157091915, 0.0, 0.0, 0.0],
    [-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0.0, 0.0],
    [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616, 0.0],
    [8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054],
];
/// The weights of the stages in the rows of the dense output.
const DENSE: [[f64; 5]; 2] = [
    [10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662],
    [-0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872],
];
/// The Euclidean norm of the weights of all slopes in the error estimate `u_6`. Its value depends on `J`: 1 if `J` is much larger than
/// `1/h`, and 11 if `J` is negligible. The constant is a value between these limits.
const GAIN: f64 = 5.0;
const CONTROL: Control = Control { safety: 0.9, alpha: 0.25, beta: 0.0, shrink: 0.2, grow: 6.0 };

/// The method RODAS. `B` is the type of a state, `M` the type of an `(n, n)` matrix, and `P` the type of `n` indices. They are arrays for
/// small closed-form systems, otherwise vectors.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Differentiable, Rodas4, System, Tolerance};
/// # struct Follower;
/// # impl System<f64> for Follower {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { (dx[0], dx[1]) = (-x[0], 1e6 * (x[0] - x[1])); }
/// # }
/// # impl Differentiable<f64> for Follower {
/// #     fn linearise(&mut self, _: f64, _: &(), x: &[f64], dx: &mut [f64], j: &mut [f64]) {
/// #         self.rhs(&(), x, dx);
/// #         j.copy_from_slice(&[-1.0, 0.0, 1e6, -1e6]);
/// #     }
/// #     fn time_derivative(&mut self, _: f64, _: &(), _: &[f64], dft: &mut [f64]) { dft.fill(0.0); }
/// # }
///
/// // The stiff system `x' = -x`, `y' = 1e6 (x - y)`: a state of two numbers, and a Jacobian of four.
/// let tolerance = Tolerance { rtol: 1e-6, atol: 1e-9, controlled: 2 };
/// let mut method = Rodas4::new(tolerance, [1.0, 0.0], [0.0; 4], [0; 2], ());
/// method.begin(&mut Follower, 0.0, 1.0, 1.0).expect("finite");
/// while !method.step(&mut Follower).expect("smooth") {}
/// # let method: &dyn Adaptive<f64, Follower, [f64; 2]> = &method;
/// assert!(method.x().iter().all(|x| (x - (-1.0f64).exp()).abs() < 1e-5) && method.work().steps < 100);
/// ```
pub struct Rodas4<B, M, P, U, T = Tolerance> {
    controller: StepController<T>,
    stages: [B; 6],
    slope: B,
    dft: B,
    y: B,
    x: B,
    x_old: B,
    jacobian: M,
    lu: M,
    pivots: P,
    work: B,
    u: U,
    start: U,
    rounding: Rounding<B>,
    /// Whether `slope` and the Jacobian are evaluated at the state `x`.
    linear: bool,
    chatter: Chatter<B>,
}

impl<B: Clone, M: Clone, P, U: Clone, T: Accuracy> Rodas4<B, M, P, U, T> {
    /// Return the method with this tolerance and the initial state `state`. The sizes of the other arguments determine the sizes of its
    /// memory.
    pub fn new(tolerance: T, state: B, matrix: M, pivots: P, input: U) -> Self {
        Rodas4 {
            controller: StepController::new(tolerance),
            chatter: Chatter::new(&state),
            stages: std::array::from_fn(|_| state.clone()),
            slope: state.clone(),
            dft: state.clone(),
            y: state.clone(),
            x: state.clone(),
            x_old: state.clone(),
            rounding: Rounding::new(state.clone()),
            work: state,
            jacobian: matrix.clone(),
            lu: matrix,
            pivots,
            u: input.clone(),
            start: input,
            linear: false,
        }
    }

    /// Compute the slope, the Jacobian and the time derivative at the start of a step.
    fn linearise<S, F>(&mut self, system: &mut F)
    where
        S: Real,
        F: Differentiable<S, Input = U>,
        B: Buffer<S>,
        M: Buffer<S>,
    {
        let (t, x) = (self.controller.t, self.x.as_ref());
        system.input(self.controller.input_time(t), &mut self.start);
        system.linearise(t, &self.start, x, self.slope.as_mut(), self.jacobian.as_mut());
        if !system.autonomous() {
            system.time_derivative(t, &self.start, x, self.dft.as_mut());
        }
        if self.rounding.compensated {
            add_product(self.jacobian.as_ref(), self.rounding.remainder.as_ref(), self.slope.as_mut());
        }
        self.controller.work.evaluations += 1;
        self.controller.work.jacobians += 1;
        self.linear = true;
    }

    /// Try a step of size `h`, write the new state to `y`, and return the error.
    fn attempt<S, F>(&mut self, system: &mut F, h: f64) -> f64
    where
        S: Real,
        F: Differentiable<S, Input = U>,
        B: Buffer<S>,
        M: Buffer<S>,
        P: AsMut<[usize]>,
    {
        let (n, pairs, s) = (self.x.as_ref().len(), system.pairs(), S::splat(1.0 / (GAMMA * h)));
        let (moves, compensated) = (!system.autonomous(), self.rounding.compensated);
        let (jacobian, lu, pivots) = (self.jacobian.as_ref(), self.lu.as_mut(), self.pivots.as_mut());
        self.controller.work.factorisations += 1;
        if !pairs.decompose(n, s, jacobian, lu, pivots, || system.stopped()) {
            return f64::NAN;
        }
        for i in 0..6 {
            let (done, stages) = self.stages.split_at_mut(i);
            let (x, y, stage) = (&self.x.as_ref()[..n], &mut self.y.as_mut()[..n], &mut stages[0].as_mut()[..n]);
            if i == 0 {
                stage.copy_from_slice(&self.slope.as_ref()[..n]);
            } else {
                // Both sums of earlier stages precede the evaluation of the slope, so the processor overlaps the second one with it.
                let from = if compensated { self.rounding.remainder.as_ref() } else { x };
                for c in 0..n {
                    let (mut argument, mut sum) = (from[c], S::zero());
                    for (j, done) in done.iter().enumerate() {
                        let u = done.as_ref()[c];
                        argument = S::splat(A[i][j]).mul_add(u, argument);
                        sum = S::splat(K[i][j]).mul_add(u, sum);
                    }
                    (y[c], stage[c]) = (argument, sum);
                }
                if compensated {
                    self.rounding.place(x, y);
                }
                system.input(self.controller.input_time(self.controller.t + C[i] * h), &mut self.u);
                let slope = &mut self.work.as_mut()[..n];
                system.rhs(&self.u, y, slope);
                self.controller.work.evaluations += 1;
                if compensated {
                    add_product(jacobian, &self.rounding.lost.as_ref()[..n], slope);
                }
                for c in 0..n {
                    stage[c] = S::splat(1.0 / h).mul_add(stage[c], slope[c]);
                }
            }
            if moves && D[i] != 0.0 {
                let dft = self.dft.as_ref();
                for c in 0..n {
                    stage[c] = S::splat(D[i] * h).mul_add(dft[c], stage[c]);
                }
            }
            pairs.solve(n, s, jacobian, (lu, pivots), stage, self.work.as_mut());
        }
        let (y, error) = (self.y.as_mut(), self.stages[5].as_ref());
        if compensated {
            let lost = self.rounding.lost.as_mut();
            for c in 0..n {
                (y[c], lost[c]) = two_sum(y[c], lost[c] + error[c]);
            }
        } else {
            for c in 0..n {
                y[c] += error[c];
            }
        }
        if !finite(self.y.as_ref()) {
            return f64::NAN;
        }
        self.controller.norm(self.x.as_ref(), self.y.as_ref(), |c| error[c])
    }

    /// Measure the rounding error of the error estimate of a step of size `h`. If this error is large, compensate the states from now on.
    /// Error: `ExcessAccuracy` if the states are compensated already, and the remaining error is too large for the tolerance.
    #[cold]
    fn estimate_rounding<S, F>(&mut self, system: &mut F, h: f64) -> Result<(), Status>
    where
        S: Real,
        F: Differentiable<S, Input = U>,
        B: Buffer<S>,
        M: Buffer<S>,
        P: AsMut<[usize]>,
    {
        let (n, pairs, s) = (self.x.as_ref().len(), system.pairs(), S::splat(1.0 / (GAMMA * h)));
        let (jacobian, lu, pivots) = (self.jacobian.as_ref(), self.lu.as_ref(), self.pivots.as_mut());
        let ([.., dy], work) = (&mut self.stages, self.work.as_mut());
        let solve = |b: &mut [S]| pairs.solve(n, s, jacobian, (lu, pivots), b, work);
        let known = (&self.x, &self.slope, jacobian);
        self.rounding.estimate(system, &mut self.controller, known, (&mut self.y, dy, &mut self.u), (GAIN, 1.0), solve).map(|_| ())
    }
}

impl<S, F, B, M, P, U, T> Adaptive<S, F, B> for Rodas4<B, M, P, U, T>
where
    S: Real,
    F: Differentiable<S, Input = U>,
    B: Buffer<S>,
    M: Buffer<S>,
    P: AsMut<[usize]>,
    U: Clone,
    T: Accuracy,
{
    step_controlled!(3);

    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        self.controller.begin(t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        self.rounding.begin();
        self.linearise::<S, F>(system);
        if !finite(self.x.as_ref()) || !finite(self.slope.as_ref()) {
            return Err(Status::Diverged);
        }
        let [k, ..] = &mut self.stages;
        self.controller.guess(system, (&self.x, &self.slope), (&mut self.y, k, &mut self.u), 3.0);
        Ok(())
    }

    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        if self.controller.done() {
            return Ok(true);
        }
        if !self.linear {
            self.linearise::<S, F>(system);
        }
        if self.chatter.due(&self.controller.work) {
            self.chatter.check(system, &mut self.controller, &mut self.u, &self.x)?;
        }
        self.controller.open();
        loop {
            let (h, t_new) = self.controller.propose()?;
            let error = self.attempt::<S, F>(system, h);
            if !error.is_finite() && system.stopped() {
                return Err(Status::Interrupted);
            }
            if self.controller.judge(error, h, t_new, &CONTROL) {
                std::mem::swap(&mut self.x_old, &mut self.x);
                std::mem::swap(&mut self.x, &mut self.y);
                self.linear = false;
                self.rounding.accepted();
                return Ok(self.controller.done());
            }
            if self.rounding.rejected() && error.is_finite() {
                self.estimate_rounding::<S, F>(system, h)?;
            }
        }
    }

    fn interpolate(&mut self, _: &mut F, t: f64, out: &mut B) {
        let Some((theta, _)) = self.controller.within(t) else { return out.clone_from(&self.x) };
        let (r, q) = (S::splat(theta), S::splat(1.0 - theta));
        let (x0, x1, out) = (self.x_old.as_ref(), self.x.as_ref(), out.as_mut());
        for c in 0..x0.len() {
            let (mut row2, mut row3) = (S::zero(), S::zero());
            for j in 0..5 {
                let u = self.stages[j].as_ref()[c];
                row2 = S::splat(DENSE[0][j]).mul_add(u, row2);
                row3 = S::splat(DENSE[1][j]).mul_add(u, row3);
            }
            let tail = row3.mul_add(r, row2);
            out[c] = r.mul_add(tail.mul_add(q, x1[c]), x0[c] * q);
        }
    }
}
