//! Adaptation that keeps bodies physically possible. Where a pseudo-inertia is below its lower bound, the rate of the estimate `pi_hat` is
//! corrected. The method is `pomet1992adaptive`, with a convex set of pseudo-inertias in place of a ball. `Y` is the regressor, `s` the
//! sliding variable, `Gamma` the gain, and `'` the transpose.
//!
//! ```text
//! P_k(pi_hat) the pseudo-inertia of body k, P_k^min = L L' its lower bound,  Z_k = L^-1 P_k L^-T - 1,  N_k the negative part of Z_k
//! f^2 = sum |N_k|^2 (Frobenius),   g = grad f^2 / 2,   g . d pi = sum tr(L^-T N_k L^-1 P_k(d pi))
//! pi_hat_dot = Gamma (y - c g),   y = Y' s,   c = [min(1, f / LAYER) max(0, g' Gamma y) + PULL f^2] / g' Gamma g
//! ```
//!
//! `f^2` is convex. It is zero where every `P_k >= P_k^min`. The true `pi` must satisfy this condition. Then
//! `(pi_hat - pi) . g >= f^2 / 2`. The correction subtracts `c (pi_hat - pi) . g >= 0` from the derivative of Slotine and Li's Lyapunov
//! function, so it never increases this derivative. Where `f >= LAYER`, `f df/dt <= -PULL f^2`. So in continuous time, an estimate that
//! starts with `P_k >= P_k^min` keeps `P_k >= (1 - LAYER) P_k^min`. The rate is Lipschitz continuous. The parameters `(A, B, C)` of the
//! planar PR arm are one body with `P = [[A, B], [B, C]]`.

use crate::error::{Error, Result, finite};
use crate::linalg::gain::AnyGain;
use crate::linalg::jacobi_rotation::{JacobiRotation, least_to_turn};
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::{Pseudo, adjoint, factor, parameters_of, pseudo_inertia};

/// Thickness of the layer in which the rate is corrected, relative to the lower bounds `P_k^min`.
const LAYER: f64 = 0.5;
/// Rate at which an estimate returns after an integration step across the boundary, 1/s. The time constant of 0.1 s is long compared with
/// the steps of integration methods.
const PULL: f64 = 10.0;
/// Sweeps of Jacobi's method. Convergence is quadratic, so after the fourth sweep of a 4 x 4 matrix only rounding errors remain.
const SWEEPS: usize = 6;
/// Number of parameters of the planar PR arm.
const PR: usize = 3;

/// The lower bounds `P_k^min` of the pseudo-inertias.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, Projection};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
///
/// let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
/// // Every estimate keeps at least the inertia of 0.1 kg at a distance of 0.05 m from each plane. So it cannot start at zero.
/// let law = law.projected(Projection::of_mass(10, 0.1, 0.05)?)?;
/// assert!((LawSpec::from(law).initial_state()[0] - 0.1).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    width: usize,
    /// The lower triangular factor `L` of each `P_k^min`.
    factors: Vec<Pseudo<f64>>,
}

/// The pseudo-inertia `P` of one body. For the planar PR arm, `other` fills the remaining diagonal.
fn matrix_of<S: Real>(pi: &[S], other: f64) -> Pseudo<S> {
    if let Ok(pi) = <&[S; PARAMETERS]>::try_from(pi) {
        return pseudo_inertia(pi);
    }
    let (o, r) = (S::zero(), S::splat(other));
    [[pi[0], pi[1], o, o], [pi[1], pi[2], o, o], [o, o, r, o], [o, o, o, r]]
}

/// Compute the gradient `g`, for which `g . pi = tr(W P(pi))`.
fn gradient_of<S: Real>(w: &Pseudo<S>, g: &mut [S]) {
    match <&mut [S; PARAMETERS]>::try_from(&mut *g) {
        Ok(g) => *g = adjoint(w),
        Err(_) => (g[0], g[1], g[2]) = (w[0][0], w[0][1] + w[0][1], w[1][1]),
    }
}

fn product<S: Real>(a: &Pseudo<S>, b: &Pseudo<S>) -> Pseudo<S> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + (a[i][1] * b[1][j] + (a[i][2] * b[2][j] + a[i][3] * b[3][j]))))
}

fn transposed<S: Real>(a: &Pseudo<S>) -> Pseudo<S> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// The inverse `L^-1` of a lower triangular `L`.
fn inverse(l: &Pseudo<f64>) -> Pseudo<f64> {
    let mut x = [[0.0; 4]; 4];
    for j in 0..4 {
        x[j][j] = 1.0 / l[j][j];
        for i in j + 1..4 {
            x[i][j] = -(j..i).map(|k| l[i][k] * x[k][j]).sum::<f64>() / l[i][i];
        }
    }
    x
}

/// The relative excess over the lower bound, `Z = L^-1 P L^-T - 1`.
fn relative<S: Real>(inverse: &Pseudo<S>, p: &Pseudo<S>) -> Pseudo<S> {
    let mut z = product(&product(inverse, p), &transposed(inverse));
    for (i, row) in z.iter_mut().enumerate() {
        row[i] -= S::splat(1.0);
    }
    z
}

/// The smallest pivot of Gaussian elimination. It is positive if and only if the matrix is positive definite.
fn least_pivot<S: Real>(a: &Pseudo<S>) -> S {
    let mut a = *a;
    let mut least = a[0][0];
    for k in 0..3 {
        let inverse = S::splat(1.0) / a[k][k];
        for i in k + 1..4 {
            let factor = a[i][k] * inverse;
            for j in k + 1..=i {
                a[i][j] -= factor * a[j][k];
            }
        }
        least = least.min(a[k + 1][k + 1]);
    }
    least
}

/// The negative part of a symmetric matrix `A`: `f(A)` with `f(l) = min(l, 0)`, as `V G V'`, by Jacobi's method.
///
/// `B = V' A V` is nearly diagonal. The diagonal of `G` is `G_ii = f(B_ii)`. Its other entries use divided differences (Daleckii and
/// Krein): `G_ij = B_ij (f(B_ii) - f(B_jj)) / (B_ii - B_jj)`. With these entries, the result has the correct derivative, independent of the
/// derivatives of `V`. The derivatives of `V` must be bounded. So two axes are not rotated if their eigenvalues are nearly equal
/// ([`least_to_turn`]). Their divided difference is exact if both eigenvalues have the same sign.
fn negative_part<S: Real>(a: &Pseudo<S>) -> Pseudo<S> {
    let (zero, one) = (S::zero(), S::splat(1.0));
    let mut a = *a;
    let least = least_to_turn(a.as_flattened());
    let mut v: Pseudo<S> = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { one } else { zero }));
    for _ in 0..SWEEPS {
        for p in 0..3 {
            for q in p + 1..4 {
                let rotation = JacobiRotation::new(a[p][p], a[q][q], a[p][q], least);
                for row in a.iter_mut().chain(v.iter_mut()) {
                    (row[p], row[q]) = rotation.turn(row[p], row[q]);
                }
                for j in 0..4 {
                    (a[p][j], a[q][j]) = rotation.turn(a[p][j], a[q][j]);
                }
            }
        }
    }
    let mut g = a;
    for i in 0..4 {
        g[i][i] = a[i][i].min(zero);
        for j in 0..i {
            let (low, high) = (a[i][i].min(a[j][j]), a[i][i].max(a[j][j]));
            let (some, both) = (low.lt(zero), high.lt(zero));
            // The divided difference is 1 if both eigenvalues are negative, and 0 if both are positive, even for equal eigenvalues.
            let apart = S::select(both, one, S::select(some, low - high, one));
            let share = S::select(both, one, S::select(some, low / apart, zero));
            g[i][j] = share * a[i][j];
            g[j][i] = g[i][j];
        }
    }
    let n = product(&product(&v, &g), &transposed(&v));
    std::array::from_fn(|i| std::array::from_fn(|j| n[i.min(j)][i.max(j)]))
}

impl Projection {
    /// Create lower bounds from parameters `least`, `(p,)`. Each of their bodies must be physically possible.
    ///
    /// Errors: `WrongShape` for a wrong length, `Input` for numbers that are not finite, or a body that is not physically possible.
    pub fn new(p: usize, least: &[f64]) -> Result<Self> {
        if least.len() != p {
            return Err(Error::wrong_shape("projection", &[p], &[least.len()]));
        }
        finite("projection", least)?;
        let width = if p == PR { PR } else { PARAMETERS };
        let possible = |(k, pi): (usize, &[f64])| {
            let (l, possible) = factor(&matrix_of(pi, 1.0));
            if possible == 1.0 {
                return Ok(l);
            }
            let problem = format!("is not physically possible: expected positive definite pseudo-inertias (first bad body {k})");
            Err(Error::input("projection", problem))
        };
        Ok(Projection { width, factors: least.chunks_exact(width).enumerate().map(possible).collect::<Result<_>>()? })
    }

    /// Create the same lower bound for every body: a `mass`, kg, at the origin, with the second moment `mass length^2` along each axis.
    /// `length` is in m. Errors: `Input` for a mass or a length that is not positive, or numbers that are not finite.
    pub fn of_mass(p: usize, mass: f64, length: f64) -> Result<Self> {
        crate::error::positive("projection", mass)?;
        crate::error::positive("length", length)?;
        let second = mass * length * length;
        let body = [mass, 0.0, 0.0, 0.0, 2.0 * second, 0.0, 2.0 * second, 0.0, 0.0, 2.0 * second];
        let least: Vec<f64> = if p == PR { vec![mass, 0.0, second] } else { body.into_iter().cycle().take(p).collect() };
        Self::new(p, &least)
    }

    /// Replace the pseudo-inertia of each body below its lower bound `L L'` by the nearest one that satisfies the bound. The distance of
    /// `P` and `Q` is the Frobenius norm of `L^-1 (P - Q) L^-T`.
    pub(super) fn start(&self, estimate: &mut [f64]) {
        for (l, pi) in self.factors.iter().zip(estimate.chunks_exact_mut(self.width)) {
            let p = matrix_of(pi, 2.0);
            let z = relative(&inverse(l), &p);
            if least_pivot(&z) > 0.0 {
                continue;
            }
            let missing = product(&product(l, &negative_part(&z)), &transposed(l));
            let raised: Pseudo<f64> = std::array::from_fn(|i| std::array::from_fn(|j| p[i][j] - missing[i][j]));
            match <&mut [f64; PARAMETERS]>::try_from(&mut *pi) {
                Ok(pi) => *pi = parameters_of(&raised),
                Err(_) => pi.copy_from_slice(&[raised[0][0], raised[0][1], raised[1][1]]),
            }
        }
    }
}

/// The projection in a control loop.
pub struct Projector<S> {
    width: usize,
    /// The inverse factor `L^-1` of the lower bound of each body's pseudo-inertia.
    inverses: Vec<Pseudo<S>>,
}

impl<S: Real> Projector<S> {
    /// Create the projection for a control loop.
    pub fn new(projection: &Projection) -> Self {
        let inverses = projection.factors.iter().map(|factor| inverse(factor).map(|row| row.map(S::varying))).collect();
        Projector { width: projection.width, inverses }
    }

    /// Correct the rate `dz = Gamma y` of the estimate.
    pub fn correct(&self, gamma: &AnyGain<S>, estimate: &[S], y: &[S], dz: &mut [S]) {
        let zero = S::zero();
        let (mut square, mut touched) = (zero, false);
        let mut gradient = vec![zero; estimate.len()];
        let bodies = estimate.chunks_exact(self.width).zip(gradient.chunks_exact_mut(self.width));
        for ((pi, g), inverse) in bodies.zip(&self.inverses) {
            let z = relative(inverse, &matrix_of(pi, 2.0));
            let inside = zero.lt(least_pivot(&z));
            if S::all(inside) {
                continue;
            }
            touched = true;
            // A recording cannot branch: a body that satisfies its bound has no correction.
            let n = negative_part(&z).map(|row| row.map(|x| S::select(inside, zero, x)));
            square = n.as_flattened().iter().fold(square, |sum, &x| sum + x * x);
            gradient_of(&product(&product(&transposed(inverse), &n), inverse), g);
        }
        if !touched {
            return;
        }
        let mut weighted = gradient.clone();
        gamma.multiply(&gradient, &mut weighted);
        let dot = |b: &[S]| weighted.iter().zip(b).fold(zero, |sum, (&a, &b)| sum + a * b);
        let (push, size) = (dot(y), dot(&gradient));
        // Below `f^2 = 1e-200`, products underflow. The correction is then zero.
        let there = S::splat(1e-200).lt(square);
        let f = S::select(there, square, S::splat(1.0)).sqrt();
        let share = (f * S::splat(1.0 / LAYER)).min(S::splat(1.0));
        let c = (share * push.max(zero) + S::splat(PULL) * square) / S::select(there, size, S::splat(1.0));
        let c = S::select(there, c, zero);
        for (rate, &g) in dz.iter_mut().zip(&weighted) {
            *rate -= c * g;
        }
    }
}

#[cfg(test)]
#[path = "projection_tests.rs"]
mod tests;
