//! The analytic derivatives of inverse and forward dynamics, and the linear model of an arm about a state.

use super::Arm;
use super::evaluate::ArmCall;
use crate::arrays::flag_or_false;
use crate::errors::{Failure, entry};
use armlet_core::analysis::linearisation::state_matrices;
use armlet_core::dynamics::{Quantity, Query};
use armlet_core::memory;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The caller's tuple of result arrays, or `None` for new arrays.
type Outs<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

impl Arm {
    fn three<'py>(
        &self,
        function: &str,
        third: &str,
        values: [&Bound<'py, PyAny>; 3],
        (quantity, friction): (Quantity, Option<&Bound<'py, PyAny>>),
        out: Outs<'_, 'py>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let py = values[0].py();
        entry(py, function, || {
            let query = Query { friction: flag_or_false(function, "friction", friction)?, ..quantity.into() };
            let square = self.model.n() * self.model.n();
            let call = ArmCall { function, names: ["q", "v", third], values };
            self.apart(&call, &query, [&[self.model.n(); 2]; 3], out, |slopes, to: [&mut [f64]; 3]| {
                for (from, to) in slopes.chunks_exact(square.max(1)).zip(to) {
                    memory::copy(from, to);
                }
            })
        })
    }
}

#[entered]
#[pymethods]
impl Arm {
    /// The partial derivatives of inverse dynamics, `d tau / d q`, `d tau / d v` and `d tau / d a = M`.
    ///
    /// One recursion over composite bodies computes them without difference quotients. Without friction, `d tau / d v = 2 C(q, v)`, where
    /// `C` is the Coriolis matrix of `coriolis_matrix`.
    ///
    /// Args:
    ///     q, v, a: positions (rad or m), velocities (per s) and accelerations (per s^2), `(..., n)`, broadcast over the leading axes.
    ///     friction: add the damping to `d tau / d v` (keyword only). The derivative of Coulomb friction is zero where `v` is not zero.
    ///     out: a tuple of three arrays to write to (keyword only).
    ///
    /// Returns:
    ///     Three arrays `(..., n, n)`. Row `i`, column `j` is the derivative of `tau_i` with respect to `q_j`, `v_j` or `a_j`.
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// Source: Carpentier and Mansard 2018.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.pendulum(2.0, 3.0)
    /// >>> dtau_dq, dtau_dv, M = arm.inverse_dynamics_derivatives([0.0], [1.0], [0.0])
    /// >>> float(dtau_dq[0, 0]), float(dtau_dv[0, 0]), float(M[0, 0])
    /// (3.0, 0.0, 2.0)
    #[arguments(q, v, a, *, friction=false, out=None)]
    fn inverse_dynamics_derivatives<'py>(&self) -> PyResult<Bound<'py, PyTuple>> {
        self.three("inverse_dynamics_derivatives", "a", [q, v, a], (Quantity::InverseDynamicsDerivatives, friction), out)
    }

    /// The partial derivatives of forward dynamics, `d a / d q`, `d a / d v` and `d a / d tau = M^-1`.
    ///
    /// Args:
    ///     q, v, tau: positions (rad or m), velocities (per s) and torques (N m or N), `(..., n)`, broadcast over the leading axes.
    ///     friction: subtract the joints' friction from the torque (keyword only).
    ///     out: a tuple of three arrays to write to (keyword only).
    ///
    /// Returns:
    ///     Three arrays `(..., n, n)`. Row `i`, column `j` is the derivative of `a_i` with respect to `q_j`, `v_j` or `tau_j`.
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, the mass matrix is singular, or `out` cannot be written.
    ///
    /// Source: Carpentier and Mansard 2018.
    ///
    /// >>> import armlet as al
    /// >>> da_dq, da_dv, Minv = al.pendulum(4.0, 3.0).forward_dynamics_derivatives([0.0], [1.0], [0.0])
    /// >>> float(da_dq[0, 0]), float(Minv[0, 0])
    /// (-0.75, 0.25)
    #[arguments(q, v, tau, *, friction=false, out=None)]
    fn forward_dynamics_derivatives<'py>(&self) -> PyResult<Bound<'py, PyTuple>> {
        self.three("forward_dynamics_derivatives", "tau", [q, v, tau], (Quantity::ForwardDynamicsDerivatives, friction), out)
    }

    /// The linear model of the arm about a state: `d/dt [dq; dv] = A [dq; dv] + B dtau`.
    ///
    /// `A = [[0, 1], [da/dq, da/dv]]` and `B = [[0], [M^-1]]`. `dq`, `dv` and `dtau` are small deviations from the motion through the
    /// state, which need not be an equilibrium.
    ///
    /// Args:
    ///     q, v, tau: positions (rad or m), velocities (per s) and torques (N m or N), `(..., n)`, broadcast over the leading axes.
    ///     friction: subtract the joints' friction from the torque (keyword only).
    ///     out: a tuple of two arrays to write to (keyword only).
    ///
    /// Returns:
    ///     `A`, `(..., 2 n, 2 n)`, and `B`, `(..., 2 n, n)`.
    ///
    /// Raises:
    ///     InputError: as for `forward_dynamics_derivatives`.
    ///
    /// >>> import armlet as al
    /// >>> A, B = al.pendulum(4.0, 3.0).linearize([0.0], [0.0], [0.0])
    /// >>> (A + 0.0).tolist(), B.tolist()
    /// ([[0.0, 1.0], [-0.75, 0.0]], [[0.0], [0.25]])
    #[arguments(q, v, tau, *, friction=false, out=None)]
    fn linearize<'py>(&self) -> Result<Bound<'py, PyTuple>, Failure> {
        const NAME: &str = "linearize";
        let query = Query { friction: flag_or_false(NAME, "friction", friction)?, ..Quantity::ForwardDynamicsDerivatives.into() };
        let n = self.model.n();
        let call = ArmCall { function: NAME, names: ["q", "v", "tau"], values: [q, v, tau] };
        self.apart(&call, &query, [&[2 * n, 2 * n], &[2 * n, n]], out, |slopes, [a, b]| {
            state_matrices(n, slopes, a, b);
        })
    }
}
