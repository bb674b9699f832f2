//! ROS2, the L-stable Rosenbrock-W method of order 2 with a fixed step (Verwer, Spee, Blom and Hundsdorfer 1999):
//!
//! `W k1 = f(t, x) + g h f_t`, `W k2 = f(t + h, x + h k1) - 2 k1 - g h f_t`, `W = I - g h df/dx`,
//! `x += h (3 k1 + k2) / 2`, `g = 1 - 1/sqrt 2`.
//!
//! `g = 1 + 1/sqrt 2` is L-stable too and stays positive on real negative poles, with an error constant 20 times larger.
//! A `W` that cannot be inverted leaves NaN, which the run's own check takes for what it is.

use super::{Buffer, Differentiable, FixedStep};
use crate::linalg::lu;
use crate::scalar::Real;

const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// `M` holds an `(n, n)` matrix and `P` `n` indices: arrays for small closed-form systems, the heap for any other.
pub struct Ros2<B, M, P, U> {
    k1: B,
    k2: B,
    y: B,
    dft: B,
    w: M,
    pivots: P,
    u: U,
    end: U,
}

impl<B: Clone, M, P, U: Clone> Ros2<B, M, P, U> {
    #[inline(always)]
    pub fn new(state: B, matrix: M, pivots: P, input: U) -> Self {
        Ros2 { k1: state.clone(), k2: state.clone(), y: state.clone(), dft: state, w: matrix, pivots, u: input.clone(), end: input }
    }
}

impl<S, F, B, M, P> FixedStep<S, F, B> for Ros2<B, M, P, F::Input>
where
    S: Real,
    F: Differentiable<S>,
    B: Buffer<S>,
    M: AsMut<[S]>,
    P: AsMut<[usize]>,
{
    #[inline(always)]
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        let x = x.as_mut();
        let n = x.len();
        let (k1, k2, y, dft) = (self.k1.as_mut(), self.k2.as_mut(), self.y.as_mut(), self.dft.as_mut());
        let (w, pivots) = (&mut self.w.as_mut()[..n * n], &mut self.pivots.as_mut()[..n]);
        let gh = S::splat(GAMMA * h);
        let moves = !system.autonomous();

        system.anchor(x);
        system.input(t, &mut self.u);
        system.linearise(t, &self.u, x, k1, w);
        if moves {
            system.time_derivative(t, &self.u, x, dft);
            for i in 0..n {
                k1[i] = gh.mul_add(dft[i], k1[i]);
            }
        }
        for i in 0..n {
            for j in 0..n {
                w[i * n + j] = -(gh * w[i * n + j]);
            }
            w[i * n + i] += S::splat(1.0);
        }
        if !lu::decompose(n, w, pivots) {
            x.fill(S::splat(f64::NAN));
            return;
        }
        lu::solve(n, w, pivots, k1);
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
        lu::solve(n, w, pivots, k2);
        for i in 0..n {
            x[i] = S::splat(0.5 * h).mul_add(S::splat(3.0).mul_add(k1[i], k2[i]), x[i]);
        }
    }

    fn restart(&mut self) {}
}
