//! Radau IIA with three stages, order 5, L-stable (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8):
//!
//! `z_i = h sum_j a_ij f(t + c_j h, x + z_j)`, `x_new = x + z_3`.
//!
//! The solver is simplified Newton iteration on `w = T^-1 z`, with the Jacobian `J = df/dx`. `T` is a constant matrix such that
//! `T^-1 A^-1 T` is block diagonal, where `A` has the entries `a_ij`. It has one block for the real eigenvalue `m` of `A^-1`, and one for
//! the complex pair `a + ib`, `a - ib`: `(m/h - J) dw_1 = (T^-1 f)_1 - m/h w_1` and `((a + ib)/h - J)(dw_2 + i dw_3) = ..`. Here `f` are
//! the slopes at the stages, and `dw` is the change of `w` in one iteration. The error estimate is
//! `(m/h - J)^-1 (f(t, x) + (e_1 z_1 + e_2 z_2 + e_3 z_3)/h)`. The collocation polynomial of degree 3 is the dense output. Its
//! extrapolation starts the next Newton iteration. The step-size control is predictive (Gustafsson 1994).

mod newton;

use super::accuracy::{Accuracy, Tolerance, Work};
use super::adaptive::Adaptive;
use super::chatter::Chatter;
use super::radau5_tableau::{C, E, P, T_INVERSE, poles, transform};
use super::rounding::{Rounding, add_product, two_sum};
use super::step_controller::{StepController, finite, step_controlled};
use super::{Buffer, Differentiable};
use crate::linalg::Pairs;
use crate::linalg::lu::Complex;
use crate::scalar::Real;
use crate::status::Status;

const ITERATIONS: usize = 6;
const SHRINK: f64 = 0.2;
const GROW: f64 = 10.0;
/// After an accepted step with an unchanged Jacobian, the step size changes only if it would grow by at least this factor. Otherwise it
/// remains the same, and the matrix decompositions are reused.
const LEAST_GROWTH: f64 = 1.2;
/// The Euclidean norm of the weights of all slopes in the error estimate: `|(1, e A)|` with the row `e = (e_1, e_2, e_3)`.
const GAIN: f64 = 2.0;
/// If the ratio of the last two increments of Newton's iteration exceeds this number, the next step has a new Jacobian. One or two
/// iterations never cause a new Jacobian.
const SLOW: f64 = 1e-3;

/// The method Radau IIA of order 5. `B` is the type of the state.
///
/// ```
/// use armlet_core::integrate::{Adaptive, Differentiable, Radau5, System, Tolerance};
/// # struct Stiff;
/// # impl System<f64> for Stiff {
/// #     type Input = f64;
/// #     fn input(&mut self, t: f64, u: &mut f64) { *u = t; }
/// #     fn rhs(&mut self, t: &f64, x: &[f64], dx: &mut [f64]) { dx[0] = 1e6 * (t.cos() - x[0]); }
/// # }
/// # impl Differentiable<f64> for Stiff {
/// #     fn linearise(&mut self, _: f64, u: &f64, x: &[f64], dx: &mut [f64], j: &mut [f64]) {
/// #         self.rhs(u, x, dx);
/// #         j[0] = -1e6;
/// #     }
/// #     fn time_derivative(&mut self, t: f64, _: &f64, _: &[f64], dft: &mut [f64]) { dft[0] = -1e6 * t.sin(); }
/// # }
///
/// // The stiff system `x' = 1e6 (cos t - x)`, which an explicit method would integrate in steps of microseconds.
/// let tolerance = Tolerance { rtol: 1e-6, atol: 1e-9, controlled: 1 };
/// let mut method = Radau5::new(tolerance, [1.0], 0.0);
/// method.begin(&mut Stiff, 0.0, 1.0, 1.0).expect("finite");
/// while !method.step(&mut Stiff).expect("smooth") {}
/// # let method: &dyn Adaptive<f64, Stiff, [f64; 1]> = &method;
/// assert!((method.x()[0] - 1f64.cos()).abs() < 1e-5 && method.work().steps < 100);
/// ```
pub struct Radau5<S, B, U, A = Tolerance> {
    controller: StepController<A>,
    newton_tolerance: f64,
    z: [B; 3],
    w: [B; 3],
    f: [B; 3],
    /// The stages of the last step, which define its polynomial.
    z_old: [B; 3],
    slope: B,
    y: B,
    error: B,
    x: B,
    x_old: B,
    u: U,
    rounding: Rounding<B>,
    jacobian: Vec<S>,
    real: Vec<S>,
    complex: Vec<Complex<S>>,
    pair: Vec<Complex<S>>,
    real_work: B,
    complex_work: Vec<Complex<S>>,
    real_pivots: Vec<usize>,
    complex_pivots: Vec<usize>,
    /// The step size of the present matrix decompositions, s, or NaN if they are not valid.
    h_factored: f64,
    /// Whether the Jacobian is evaluated at the present state.
    current: bool,
    /// Whether the last step can be extrapolated as the first guess of the next stages.
    warm: bool,
    /// For the last accepted step: its step size before any rejection, and its error.
    last: Option<(f64, f64)>,
    chatter: Chatter<B>,
}

impl<S: Real, B: Buffer<S>, U: Clone, A: Accuracy> Radau5<S, B, U, A> {
    /// Return the method with this tolerance and the initial state `state`. The sizes of `state` and `input` determine the sizes of its
    /// memory.
    pub fn new(tolerance: A, state: B, input: U) -> Self {
        let n = state.as_ref().len();
        let three = || std::array::from_fn(|_| state.clone());
        let rtol = tolerance.rtol();
        Radau5 {
            newton_tolerance: (10.0 * f64::EPSILON / rtol).max(rtol.sqrt().min(0.03)),
            controller: StepController::new(tolerance),
            chatter: Chatter::new(&state),
            z: three(),
            w: three(),
            f: three(),
            z_old: three(),
            slope: state.clone(),
            y: state.clone(),
            error: state.clone(),
            x_old: state.clone(),
            real_work: state.clone(),
            rounding: Rounding::new(state.clone()),
            x: state,
            u: input,
            jacobian: vec![S::zero(); n * n],
            real: vec![S::zero(); n * n],
            complex: vec![Complex::default(); n * n],
            pair: vec![Complex::default(); n],
            complex_work: vec![Complex::default(); n],
            real_pivots: vec![0; n],
            complex_pivots: vec![0; n],
            h_factored: f64::NAN,
            current: false,
            warm: false,
            last: None,
        }
    }

    /// Compute the slope and the Jacobian at the present state.
    fn linearise<F: Differentiable<S, Input = U>>(&mut self, system: &mut F) {
        let (t, x) = (self.controller.t, self.x.as_ref());
        system.input(self.controller.input_time(t), &mut self.u);
        system.linearise(t, &self.u, x, self.slope.as_mut(), &mut self.jacobian);
        self.controller.work.evaluations += 1;
        self.controller.work.jacobians += 1;
        self.compensate_slope();
        self.current = true;
        self.h_factored = f64::NAN;
    }

    /// If states are compensated, add the effect of the state's rounding error to the slope.
    fn compensate_slope(&mut self) {
        if self.rounding.compensated {
            add_product(&self.jacobian, self.rounding.remainder.as_ref(), self.slope.as_mut());
        }
    }

    /// Decompose both matrices for a step of size `h`. Return false if one is singular or if a stop is requested.
    fn factor<F: Differentiable<S, Input = U>>(&mut self, system: &mut F, h: f64) -> bool {
        let (n, j, pairs) = (self.x.as_ref().len(), &self.jacobian, system.pairs());
        let (real, complex) = poles::<S>(h);
        self.controller.work.factorisations += 2;
        let sound = pairs.decompose(n, real, j, &mut self.real, &mut self.real_pivots, || system.stopped())
            && pairs.decompose(n, complex, j, &mut self.complex, &mut self.complex_pivots, || system.stopped());
        self.h_factored = if sound { h } else { f64::NAN };
        sound
    }

    /// Component `c` of the polynomial of the last step, at the fraction `s` of this step.
    fn extrapolate(z: &[B; 3], x_old: &[S], s: f64, c: usize) -> S {
        let mut sum = x_old[c];
        for i in 0..3 {
            sum = S::splat(s * (P[i][0] + s * (P[i][1] + s * P[i][2]))).mul_add(z[i].as_ref()[c], sum);
        }
        sum
    }

    /// Set the start of the Newton iteration for a step of size `h`. It is the extrapolated polynomial of the last step if that is valid,
    /// otherwise zero.
    fn start(&mut self, h: f64) {
        let h_old = self.controller.t - self.controller.t_old;
        for i in 0..3 {
            let z = self.z[i].as_mut();
            for c in 0..z.len() {
                z[c] = if self.warm {
                    Self::extrapolate(&self.z_old, self.x_old.as_ref(), 1.0 + h * C[i] / h_old, c) - self.x.as_ref()[c]
                } else {
                    S::zero()
                };
            }
        }
        transform(&T_INVERSE, &self.z, &mut self.w);
    }

    /// Count the rejection of a step of size `h`. After several rejections, measure the rounding error of the error estimate. If this error
    /// is large, compensate the states from now on. If they are compensated already, raise the tolerance of Newton's iterations. Error:
    /// `ExcessAccuracy` if the remaining error is too large for the tolerance.
    fn rejected<F: Differentiable<S, Input = U>>(&mut self, system: &mut F, h: f64) -> Result<(), Status> {
        // The check requires the matrix decomposition for this step size.
        if !self.rounding.rejected() || self.h_factored != h {
            return Ok(());
        }
        let (n, pairs, (pole, _)) = (self.x.as_ref().len(), system.pairs(), poles::<S>(h));
        let (j, lu, pivots, work) = (&self.jacobian, &self.real, &self.real_pivots, self.real_work.as_mut());
        let solve = |b: &mut [S]| pairs.solve(n, pole, j, (lu, pivots), b, work);
        let [dy, ..] = &mut self.f;
        let known = (&self.x, &self.slope, &j[..]);
        let finest = (GAIN, self.newton_tolerance);
        if let Some(left) = self.rounding.estimate(system, &mut self.controller, known, (&mut self.y, dy, &mut self.u), finest, solve)? {
            // Newton's increments cannot become smaller than the rounding error.
            self.newton_tolerance = self.newton_tolerance.max(4.0 * left);
        }
        Ok(())
    }

    /// Return the error of the step to `y`, computed with the slope in `f[0]`.
    fn estimate(&mut self, pairs: Pairs, h: f64) -> f64 {
        let n = self.x.as_ref().len();
        let error = self.error.as_mut();
        for c in 0..n {
            let mut sum = S::zero();
            for i in 0..3 {
                sum = S::splat(E[i] / h).mul_add(self.z[i].as_ref()[c], sum);
            }
            error[c] = self.f[0].as_ref()[c] + sum;
        }
        let (real, _) = poles::<S>(h);
        pairs.solve(n, real, &self.jacobian, (&self.real, &self.real_pivots), error, self.real_work.as_mut());
        self.controller.norm(self.x.as_ref(), self.y.as_ref(), |c| error[c])
    }

    /// Write to `f[0]` the slope at the point `x + e`, where `x` is the initial state and `e` the first error estimate. The second error
    /// estimate uses this slope, because the stiff components of `e` are too large.
    fn filter<F: Differentiable<S, Input = U>>(&mut self, system: &mut F) {
        let (x, filtered, remainder) = (self.x.as_ref(), self.error.as_ref(), self.rounding.remainder.as_ref());
        let [slope, at, lost] = &mut self.f;
        for c in 0..x.len() {
            (at.as_mut()[c], lost.as_mut()[c]) = two_sum(x[c], filtered[c] + remainder[c]);
        }
        system.input(self.controller.input_time(self.controller.t), &mut self.u);
        system.rhs(&self.u, at.as_ref(), slope.as_mut());
        if self.rounding.compensated {
            add_product(&self.jacobian, lost.as_ref(), slope.as_mut());
        }
        self.controller.work.evaluations += 1;
    }

    /// Return `error^(-1/4)`, multiplied by the smaller of 1 and `h/h_old (error_old/error)^(1/4)`. For the last accepted step, `h_old` is
    /// its step size before any rejection, and `error_old` is its error.
    fn predict(&self, h: f64, error: f64) -> f64 {
        let trend = match self.last {
            Some((h_old, error_old)) if error > 0.0 => (h / h_old * (error_old / error).powf(0.25)).min(1.0),
            _ => 1.0,
        };
        // The limit 1e10 replaces the infinite result for the error zero.
        (trend * error.powf(-0.25)).min(1e10)
    }
}

impl<S, F, B, U, A> Adaptive<S, F, B> for Radau5<S, B, U, A>
where
    S: Real,
    F: Differentiable<S, Input = U>,
    B: Buffer<S>,
    U: Clone,
    A: Accuracy,
{
    step_controlled!(3);

    fn begin(&mut self, system: &mut F, t: f64, t_end: f64, input_end: f64) -> Result<(), Status> {
        self.controller.begin(t, t_end, input_end);
        self.x_old.clone_from(&self.x);
        self.rounding.begin();
        (self.warm, self.last) = (false, None);
        self.linearise(system);
        if !finite(self.x.as_ref()) || !finite(self.slope.as_ref()) {
            return Err(Status::Diverged);
        }
        let [k, ..] = &mut self.f;
        self.controller.guess(system, (&self.x, &self.slope), (&mut self.y, k, &mut self.u), 3.0);
        Ok(())
    }

    fn step(&mut self, system: &mut F) -> Result<bool, Status> {
        if self.controller.done() {
            return Ok(true);
        }
        if !finite(self.slope.as_ref()) {
            return Err(Status::Diverged);
        }
        if self.chatter.due(&self.controller.work) {
            self.chatter.check(system, &mut self.controller, &mut self.u, &self.x)?;
        }
        self.controller.open();
        let h_begun = self.controller.h;
        let mut rejected = false;
        loop {
            let (h, t_new) = self.controller.propose()?;
            if self.h_factored != h && !self.factor(system, h) {
                if system.stopped() {
                    return Err(Status::Interrupted);
                }
                self.controller.reject(0.5 * h, true);
                continue;
            }
            self.start(h);
            let newton = self.newton(system, h);
            if !newton.converged {
                if self.current {
                    let blown = !self.f.iter().all(|f| finite(f.as_ref()));
                    self.controller.reject(0.5 * h, blown);
                    if !blown {
                        self.rejected(system, h)?;
                    }
                } else {
                    self.linearise(system);
                }
                continue;
            }
            self.place(2);
            self.f[0].clone_from(&self.slope);
            let mut error = self.estimate(system.pairs(), h);
            if rejected && error > 1.0 {
                self.filter(system);
                error = self.estimate(system.pairs(), h);
            }
            let safety = 0.9 * (2 * ITERATIONS + 1) as f64 / (2 * ITERATIONS + newton.iterations) as f64;
            if !(error <= 1.0) {
                let blown = !error.is_finite();
                self.controller.reject(h * if blown { SHRINK } else { (safety * self.predict(h, error)).max(SHRINK) }, blown);
                rejected = true;
                if !blown {
                    self.rejected(system, h)?;
                }
                continue;
            }
            let renew = newton.iterations > 2 && newton.rate > SLOW;
            let mut factor = (safety * self.predict(h, error)).min(GROW);
            if !renew && factor < LEAST_GROWTH {
                factor = 1.0;
            }
            // Store the step size before any rejection. After rejections, this size limits the growth for one more step.
            self.last = Some((h_begun, error));
            self.controller.accept(t_new, h * factor);
            std::mem::swap(&mut self.x_old, &mut self.x);
            std::mem::swap(&mut self.x, &mut self.y);
            std::mem::swap(&mut self.z_old, &mut self.z);
            self.warm = true;
            self.rounding.accepted();
            if renew {
                self.linearise(system);
            } else {
                self.current = false;
                system.input(self.controller.input_time(self.controller.t), &mut self.u);
                system.rhs(&self.u, self.x.as_ref(), self.slope.as_mut());
                self.controller.work.evaluations += 1;
                self.compensate_slope();
            }
            return Ok(self.controller.done());
        }
    }

    fn interpolate(&mut self, _: &mut F, t: f64, out: &mut B) {
        let Some((s, _)) = self.controller.within(t) else { return out.clone_from(&self.x) };
        for c in 0..self.x.as_ref().len() {
            out.as_mut()[c] = Self::extrapolate(&self.z_old, self.x_old.as_ref(), s, c);
        }
    }
}
