//! The torque of null space and compensated coupling in an impedance law: see `null_space`.

use super::CartesianImpedanceSpec;
use super::null_space::{NullProjection, TaskInertia};
use crate::law::equations::Loop;
use crate::linalg::Cholesky;
use crate::scalar::Real;
use crate::trace::expression::zeros;
use crate::trace::{E, M, V};

impl CartesianImpedanceSpec {
    /// The torque `N' tau_0 + C v` of null space and compensated coupling, which the law adds to `J' F + g`, and the wrench
    /// `L (x_d_ddot - J_dot v)` of the coupling. `j` is the Jacobian of the controlled rows.
    pub(super) fn null_space(&self, at: &Loop, j: &M, x_d_ddot: &V) -> [V; 2] {
        let (options, arm, rows) = (self.options(), at.arm(), &self.coordinates.rows);
        let (mut torque, mut wrench) = (zeros(at.q.len()), zeros(rows.len()));
        if options.null_space.is_none() && !options.compensate_coupling {
            return [torque, wrench];
        }
        let floor = at.number("null_eps_squared");
        let mass = Cholesky::of(&arm.mass_matrix());
        let consistent = TaskInertia::consistent(&mass, j, rows, floor);
        if options.compensate_coupling {
            torque += arm.bias(&at.v) - arm.gravity();
            wrench = &consistent.l * (x_d_ddot - arm.jacobian_dot(&self.coordinates, &at.v) * &at.v);
        }
        let Some(null_space) = &options.null_space else {
            name_inertia(at, &consistent);
            return [torque, wrench];
        };
        let tau_0 = null_space.spring_torque(at);
        let (task, weighed) = match null_space.projection {
            NullProjection::Static => (TaskInertia::new(j.clone(), rows, floor), tau_0.clone()),
            NullProjection::Consistent => (consistent, mass.solve_lower_vector(&tau_0)),
        };
        name_inertia(at, &task);
        let projected = at.term("tau_0", tau_0) - j.tr_mul(&(&task.l * (&task.g * weighed)));
        torque += at.term("null_torque", projected);
        [torque, wrench]
    }
}

fn name_inertia(at: &Loop, task: &TaskInertia) {
    at.matrix_term("L", task.l.clone());
    E::term("loss", &[], || vec![task.loss]);
}
