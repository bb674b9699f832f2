//! The torque of a static null space, computed with another method than in the law: `J J'` is factored without a clamp of singular values.
//! `J` is the Jacobian of the controlled rows, and `'` the transpose.
//!
//! `N' tau_0 = tau_0 - J' (J J')^-1 J tau_0`, `tau_0 = K_n (q_n - q) + D_n (q_n_dot - v)`, with the stiffness `K_n`, the damping `D_n` and
//! the desired posture `q_n` of the null space. `N' tau_0` accelerates the frame by `J M^-1 N' tau_0`, with the mass matrix `M`.

use crate::law::{CartesianImpedanceSpec, NullProjection, Sample};
use crate::linalg::Cholesky;
use crate::plant::{Parameters, PlantState};
use crate::trace::{M, V};

/// The torque of the static null space of one law.
pub struct StaticTorque {
    numbers: Parameters,
}

impl StaticTorque {
    /// The null space of `law`; `None` for a law without a static null space.
    pub fn new(law: &CartesianImpedanceSpec) -> Option<Self> {
        let null_space = law.options().null_space.as_ref().filter(|null_space| null_space.projection == NullProjection::Static)?;
        let numbers = Parameters::default().gain("null_stiffness", &null_space.stiffness).gain("null_damping", &null_space.damping);
        Some(StaticTorque { numbers })
    }

    /// The torque `N' tau_0`, `(n,)`, N m or N, for the posture `posture` and the Jacobian `j` of the controlled rows.
    pub fn torque(&self, [q_n, q_n_dot, _]: &Sample, x: &PlantState, j: &M) -> V {
        let spring = self.numbers.get_gain("null_stiffness") * &(q_n - &x.q);
        let tau_0 = spring + self.numbers.get_gain("null_damping") * &(q_n_dot - &x.v);
        let share = Cholesky::of(&(j * j.transpose())).solve_vector(&(j * &tau_0));
        tau_0 - j.tr_mul(&share)
    }
}
