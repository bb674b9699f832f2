//! ROS2, an L-stable Rosenbrock-W method of order 2 with fixed step size (Verwer, Spee, Blom and Hundsdorfer 1999):
//!
//! `W k1 = f(t, x) + g h f_t`, `W k2 = f(t + h, x + h k1) - 2 k1 - g h f_t`, `W = I - g h df/dx`,
//! `x += h (3 k1 + k2) / 2`, `g = 1 - 1/sqrt 2`.
//!
//! `f_t` is `df/dt`. The method with `g = 1 + 1/sqrt 2` is also L-stable, and stays positive for real negative poles. But its error
//! constant is 34 times larger for `x' = lambda x`, where `x'` is the time derivative. If `W` is singular, the new state is NaN, and the
//! run reports divergence.

use super::{Buffer, Differentiable, FixedStep};
use crate::scalar::Real;

const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// The method ROS2. `B` is the type of a state, `M` the type of an `(n, n)` matrix, and `P` the type of `n` indices. They are arrays for
/// small closed-form systems, otherwise vectors.
///
/// ```
/// use armlet_core::integrate::{Differentiable, FixedStep, Ros2, System};
/// # struct Decay;
/// # impl System<f64> for Decay {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = -x[0]; }
/// # }
/// # impl Differentiable<f64> for Decay {
/// #     fn linearise(&mut self, _: f64, u: &(), x: &[f64], dx: &mut [f64], j: &mut [f64]) {
/// #         self.rhs(u, x, dx);
/// #         j[0] = -1.0;
/// #     }
/// #     fn time_derivative(&mut self, _: f64, _: &(), _: &[f64], dft: &mut [f64]) { dft[0] = 0.0; }
/// # }
///
/// /// The error for `x' = -x` after 1 s, in `steps` steps.
/// fn error(steps: u32) -> f64 {
///     let (h, mut x) = (1.0 / f64::from(steps), [1.0]);
///     let mut method = Ros2::new(x, [0.0], [0], ());
///     (0..steps).for_each(|k| method.step(&mut Decay, h * f64::from(k), h, h * f64::from(k + 1), &mut x));
///     (x[0] - (-1.0f64).exp()).abs()
/// }
/// // Order 2: half of the step size has a quarter of the error.
/// assert!((error(50) / error(100) - 4.0).abs() < 0.1);
/// ```
pub struct Ros2<B, M, P, U> {
    k1: B,
    k2: B,
    y: B,
    dft: B,
    jacobian: M,
    lu: M,
    pivots: P,
    work: B,
    u: U,
    end: U,
}

impl<B: Clone, M: Clone, P, U: Clone> Ros2<B, M, P, U> {
    /// Return the method. The sizes of the arguments determine the sizes of its memory.
    pub fn new(state: B, matrix: M, pivots: P, input: U) -> Self {
        Ros2 {
            k1: state.clone(),
            k2: state.clone(),
            y: state.clone(),
            dft: state.clone(),
            work: state,
            jacobian: matrix.clone(),
            lu: matrix,
            pivots,
            u: input.clone(),
            end: input,
        }
    }
}

impl<S, F, B, M, P> FixedStep<S, F, B> for Ros2<B, M, P, F::Input>
where
    S: Real,
    F: Differentiable<S>,
    B: Buffer<S>,
    M: Buffer<S>,
    P: AsMut<[usize]>,
{
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        let x = x.as_mut();
        let n = x.len();
        let (k1, k2, y, dft) = (self.k1.as_mut(), self.k2.as_mut(), self.y.as_mut(), self.dft.as_mut());
        let (lu, pivots, work) = (self.lu.as_mut(), self.pivots.as_mut(), self.work.as_mut());
        let (gh, s, pairs) = (S::splat(GAMMA * h), S::splat(1.0 / (GAMMA * h)), system.pairs());
        let moves = !system.autonomous();

        system.input(t, &mut self.u);
        system.linearise(t, &self.u, x, k1, self.jacobian.as_mut());
        if moves {
            system.time_derivative(t, &self.u, x, dft);
            for i in 0..n {
                k1[i] = gh.mul_add(dft[i], k1[i]);
            }
        }
        let jacobian = self.jacobian.as_ref();
        if !pairs.decompose(n, s, jacobian, lu, pivots, || system.stopped()) {
            x.fill(S::splat(f64::NAN));
            return;
        }
        // The decomposed matrix is `s W`, so that the right-hand side is multiplied by `s`.
        let mut solve = |k: &mut [S]| {
            for i in 0..n {
                k[i] = s * k[i];
            }
            pairs.solve(n, s, jacobian, (lu, pivots), k, work);
        };
        solve(k1);
        for i in 0..n {
            y[i] = S::splat(h).mul_add(k1[i], x[i]);
        }
        system.input(end, &mut self.end);
        system.rhs(&self.end, y, k2);
        for i in 0..n {
            k2[i] = S::splat(-2.0).mul_add(k1[i], k2[i]);
            if moves {
                k2[i] = gh.neg_mul_add(dft[i], k2[i]);
            }
        }
        solve(k2);
        for i in 0..n {
            x[i] = S::splat(0.5 * h).mul_add(S::splat(3.0).mul_add(k1[i], k2[i]), x[i]);
        }
    }

    fn restart(&mut self) {}
}
