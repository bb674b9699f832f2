//! The dynamics of an arm in the coordinates of a Cartesian impedance, as terms for diagnosis.

use super::cartesian_impedance::CartesianImpedance;
use crate::dynamics::{AnyArm, Dynamics};
use crate::kinematics::jacobian_dot;
use crate::linalg::cholesky;
use crate::scalar::Real;
use crate::trace::Sym;

impl CartesianImpedance {
    /// Name the mass matrix `M`, the Coriolis matrix `S`, the gravity torque `g` and `Jdot`, after an evaluation. In the task space, name
    /// `M_x = (J M^-1 J')^-1` and `S_x = M_x (J M^-1 S - Jdot) M^-1 J' M_x`.
    ///
    /// `M_x` and `S_x` are NaN where `J` loses rank. The torque does not use them.
    pub(super) fn name_target_dynamics(&mut self, trig: &[(Sym, Sym)], q: &[Sym], v: &[Sym]) {
        let (n, m) = (q.len(), self.e.len());
        let CartesianImpedance { arm, workspace, coordinates, jacobian, .. } = self;
        let mut all: Vec<(&'static str, [usize; 2], Vec<Sym>)> = Vec::new();
        // The entries are computed once, and only in a recording of terms.
        Sym::term("M", &[n, n], || {
            let zeros = |k: usize| vec![Sym::zero(); k];
            let (mut mass, mut coriolis, mut g, mut rate) = (zeros(n * n), zeros(n * n), zeros(n), zeros(m * n));
            arm.mass_matrix(workspace, trig, q, &mut mass);
            arm.coriolis_matrix(workspace, trig, q, v, &mut coriolis);
            arm.gravity(workspace, trig, q, &mut g);
            if let AnyArm::Tree(tree) = &*arm {
                let mut full = zeros(6 * n);
                jacobian_dot(tree, &mut workspace.poses, &mut workspace.motion, (trig, q), v, coordinates.frame, &mut full);
                coordinates.copy_rows(&full, &mut rate);
            }
            let [m_x, s_x] = in_task_space([n, m], jacobian, &mass, &coriolis, &rate);
            all = vec![("S", [n, n], coriolis), ("g", [n, 1], g), ("Jdot", [m, n], rate), ("M_x", [m, m], m_x), ("S_x", [m, m], s_x)];
            mass
        });
        for (name, shape, values) in all {
            Sym::term(name, if name == "g" { &shape[..1] } else { &shape }, || values);
        }
    }
}

/// Return `M_x` and `S_x` of [`CartesianImpedance::name_target_dynamics`].
fn in_task_space([n, m]: [usize; 2], jacobian: &[Sym], mass: &[Sym], coriolis: &[Sym], rate: &[Sym]) -> [Vec<Sym>; 2] {
    let zeros = |k: usize| vec![Sym::zero(); k];
    let dot = |a: &[Sym], b: &[Sym]| a.iter().zip(b).fold(Sym::zero(), |sum, (&a, &b)| sum + a * b);
    // The product a b' of two matrices with rows of length n.
    let product =
        |a: &[Sym], b: &[Sym]| -> Vec<Sym> { a.chunks_exact(n).flat_map(|a| b.chunks_exact(n).map(move |b| dot(a, b))).collect() };
    let (mut l, mut l_x) = (zeros(n * n), zeros(m * m));
    let mut spread = jacobian.to_vec();
    let definite = cholesky::factor_into(n, mass, &mut l);
    spread.chunks_exact_mut(n).for_each(|row| cholesky::solve(n, &l, row));
    let definite = definite.min(cholesky::factor_into(m, &product(jacobian, &spread), &mut l_x));
    // Multiply by M_x from the right, row by row: M_x is symmetric.
    let times_m_x = |x: &mut [Sym]| x.chunks_exact_mut(m).for_each(|row| cholesky::solve(m, &l_x, row));
    let mut m_x: Vec<Sym> = (0..m * m).map(|at| Sym::splat(f64::from(u8::from(at % (m + 1) == 0)))).collect();
    times_m_x(&mut m_x);
    let column = |k: usize| (0..n).map(move |i| coriolis[i * n + k]).collect::<Vec<Sym>>();
    let drift: Vec<Sym> = (0..m * n).map(|at| dot(&spread[at / n * n..(at / n + 1) * n], &column(at % n)) - rate[at]).collect();
    let mut right = product(&drift, &spread);
    times_m_x(&mut right);
    let s_x = (0..m * m).map(|at| (0..m).fold(Sym::zero(), |sum, k| sum + m_x[at / m * m + k] * right[k * m + at % m])).collect();
    let valid = |x: Vec<Sym>| x.into_iter().map(|x| Sym::select(Sym::zero().lt(definite), x, Sym::splat(f64::NAN))).collect();
    [valid(m_x), valid(s_x)]
}
