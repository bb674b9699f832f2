//! The torque of a static null space, computed with another method than in the law: `J J'` is factored without a clamp of singular values.
//! `J` is the Jacobian of the controlled rows, and `'` the transpose.
//!
//! `N' tau_0 = tau_0 - J' (J J')^-1 J tau_0`, `tau_0 = K_n (q_n - q) + D_n (q_n_dot - v)`, with the stiffness `K_n`, the damping `D_n` and
//! the desired posture `q_n` of the null space. `N' tau_0` accelerates the frame by `J M^-1 N' tau_0`, with the mass matrix `M`.

use crate::law::{CartesianImpedanceSpec, NullProjection};
use crate::linalg::cholesky;
use crate::linalg::gain::AnyGain;
use crate::scalar::Real;
use crate::trace::Sym;

pub struct StaticTorque {
    stiffness: AnyGain<Sym>,
    damping: AnyGain<Sym>,
    work: Vec<Sym>,
    /// The torque `N' tau_0`, shape `(n,)`, N m or N.
    pub torque: Vec<Sym>,
    /// Memory for a wrench, shape `(m,)`.
    pub wrench: Vec<Sym>,
    /// The matrix `J J'`, shape `(m, m)`.
    square: Vec<Sym>,
    /// The Cholesky factor of `J J'`, shape `(m, m)`.
    factor: Vec<Sym>,
}

impl StaticTorque {
    /// Return the torque of a law. The result is `None` unless the law's null space has the static projector.
    pub fn new(law: &CartesianImpedanceSpec) -> Option<Self> {
        let null_space = law.options().null_space.as_ref().filter(|null_space| null_space.projection == NullProjection::Static)?;
        let (n, m) = (law.model.n(), law.coordinates.m());
        let zeros = |k: usize| vec![Sym::zero(); k];
        Some(StaticTorque {
            stiffness: AnyGain::labelled("null_stiffness", &null_space.stiffness),
            damping: AnyGain::labelled("null_damping", &null_space.damping),
            work: zeros(n),
            torque: zeros(n),
            wrench: zeros(m),
            square: zeros(m * m),
            factor: zeros(m * m),
        })
    }

    /// Compute `N' tau_0` at `q`, `v` and `J`. `posture`: the desired posture `q_n`, then its rate.
    pub fn evaluate(&mut self, posture: &[Sym], q: &[Sym], v: &[Sym], jacobian: &[Sym]) {
        let (n, m) = (q.len(), self.wrench.len());
        let StaticTorque { stiffness, damping, work, torque, wrench, square, factor } = self;
        for i in 0..n {
            work[i] = posture[i] - q[i];
        }
        stiffness.multiply(work, torque);
        for i in 0..n {
            work[i] = posture[n + i] - v[i];
        }
        damping.add_to(work, torque);
        let row = |k: usize| &jacobian[k * n..(k + 1) * n];
        let dot = |a: &[Sym], b: &[Sym]| a.iter().zip(b).fold(Sym::zero(), |sum, (&a, &b)| sum + a * b);
        for k in 0..m {
            wrench[k] = dot(row(k), torque);
            for l in 0..m {
                square[k * m + l] = dot(row(k), row(l));
            }
        }
        cholesky::factor_into(m, square, factor);
        cholesky::solve(m, factor, wrench);
        for (k, &share) in wrench.iter().enumerate() {
            torque.iter_mut().zip(row(k)).for_each(|(torque, &j)| *torque -= j * share);
        }
    }
}
