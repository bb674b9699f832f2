//! The dynamics of an arm in the coordinates of a Cartesian impedance, as terms for diagnosis:
//!
//! `M_x = (J M^-1 J')^-1`, `S_x = M_x (J M^-1 C - J_dot) M^-1 J' M_x`, with the mass matrix `M`, the Coriolis matrix `C` and the Jacobian
//! `J` of the controlled rows.

use super::CartesianImpedanceSpec;
use crate::law::equations::Loop;
use crate::linalg::Cholesky;
use crate::scalar::Real;
use crate::trace::expression::constant;
use crate::trace::{E, M};

impl CartesianImpedanceSpec {
    /// Name `M`, `C` (as `S`), `g`, `J_dot`, `M_x` and `S_x`. The last two are NaN where `J` is singular.
    pub(in crate::law) fn name_target_dynamics(&self, at: &Loop, j: &M) {
        if !at.collects_terms() {
            return;
        }
        let (arm, m) = (at.arm(), j.nrows());
        let mass = at.matrix_term("M", arm.mass_matrix());
        let c = at.matrix_term("S", arm.coriolis_matrix(&at.v));
        at.term("g", arm.gravity());
        let j_dot = at.matrix_term("Jdot", arm.jacobian_dot(&self.coordinates, &at.v));

        let mass = Cholesky::of(&mass);
        let spread = mass.solve(&j.transpose()).transpose();
        let task = Cholesky::of(&(j * spread.transpose()));
        let m_x = task.solve(&M::from_diagonal_element(m, m, constant(1.0)));
        let s_x = &m_x * (&spread * c - j_dot) * spread.transpose() * &m_x;
        let definite = E::zero().lt(mass.definite.min(task.definite));
        for (name, x) in [("M_x", m_x), ("S_x", s_x)] {
            at.matrix_term(name, x.map(|x| E::select(definite, x, constant(f64::NAN))));
        }
    }
}
