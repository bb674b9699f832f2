//! The equation of motion `M(q) a + C(q, v) v + g(q) = tau` and its terms, broadcast over leading axes.

use super::Arm;
use super::evaluate::ArmCall;
use crate::arrays::flag_or_false;
use crate::errors::{Failure, entry};
use armlet_core::dynamics::{JointTerms, Quantity, Query};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

#[entered]
#[pymethods]
impl Arm {
    /// The mass matrix `M(q)`, `(..., n, n)`, kg m^2, kg m or kg. Its diagonal includes the rotors' inertia (armature).
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// Source: the composite-rigid-body algorithm, Featherstone, Rigid Body Dynamics Algorithms, 2008.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_pr(2.0, 0.5, 0.5).mass_matrix([0.0, 0.0])
    /// array([[2. , 0.5],
    ///        [0.5, 0.5]])
    #[arguments(q, *, out=None)]
    fn mass_matrix<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("mass_matrix", ["q"], [q], Quantity::MassMatrix.into(), out)
    }

    /// The Coriolis matrix `C(q, v)` of the Christoffel symbols, `(..., n, n)`: `C(q, x) y = C(q, y) x` and `dM/dt = C + C'`.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// Source: Echeandia and Wensing, Numerical methods to compute the Coriolis matrix and Christoffel symbols, 2021.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_pr(2.0, 0.5, 0.5).coriolis_matrix([0.0, 1.5707963267948966], [0.0, 2.0])
    /// array([[ 0., -1.],
    ///        [ 0.,  0.]])
    #[arguments(q, v, *, out=None)]
    fn coriolis_matrix<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("coriolis_matrix", ["q", "v"], [q, v], Quantity::CoriolisMatrix.into(), out)
    }

    /// The Christoffel symbols of the first kind, `(..., n, n, n)`: `C(q, v)[i, j] = sum_k c[i, j, k] v[k]`.
    ///
    /// `c[i, j, k] = (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) / 2`, symmetric in `j` and `k`. The slice `c[i]` is the matrix `C_i` of the
    /// quadratic form `(C(q, v) v)_i = v' C_i v`. The unit of `c[i, j, k]` is the unit of `tau_i` divided by the units of `v_j` and `v_k`.
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// Source: Echeandia and Wensing, Numerical methods to compute the Coriolis matrix and Christoffel symbols, 2021.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_pr(2.0, 0.5, 0.5).christoffel([0.0, 1.5707963267948966])[0]
    /// array([[ 0. ,  0. ],
    ///        [ 0. , -0.5]])
    #[arguments(q, *, out=None)]
    fn christoffel<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("christoffel", ["q"], [q], Quantity::Christoffel.into(), out)
    }

    /// The gravity torque `g(q)`, `(..., n)`, N m or N: the gradient of the potential energy.
    ///
    /// Args:
    ///     q: positions, `(..., n)`, rad or m.
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: `q` is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0], masses=[2.0]).gravity([0.0])
    /// array([9.81])
    #[arguments(q, *, out=None)]
    fn gravity<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("gravity", ["q"], [q], Quantity::Gravity.into(), out)
    }

    /// The torque at zero acceleration: `C(q, v) v + g(q)`, `(..., n)`, N m or N.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
    ///     friction: add the joints' `damping v + friction sign(v)` (keyword only).
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_pr(2.0, 0.5, 0.5).bias([0.0, 1.5707963267948966], [0.0, 2.0])
    /// array([-2.,  0.])
    #[arguments(q, v, *, friction=false, out=None)]
    fn bias<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        const NAME: &str = "bias";
        let friction = entry(q.py(), NAME, || flag_or_false(NAME, "friction", friction))?;
        self.evaluate(NAME, ["q", "v"], [q, v], Query { friction, ..Quantity::Bias.into() }, out)
    }

    /// Inverse dynamics: the torque `tau = M a + C v + g - J' wrench`, `(..., n)`, N m or N.
    ///
    /// Args:
    ///     q, v, a: positions (rad or m), velocities (per s) and accelerations (per s^2), `(..., n)`, broadcast over the leading axes.
    ///     wrench: force and moment `[f; m]` on the arm, `(..., 6)`, N and N m, in world axes at a frame's origin (keyword only).
    ///     wrench_frame: name of the frame at whose origin the wrench acts (keyword only).
    ///     friction: add the joints' `damping v + friction sign(v)` (keyword only).
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, `wrench` or `wrench_frame` is alone, the frame is unknown, or
    ///         `out` cannot be written.
    ///
    /// Source: the recursive Newton-Euler algorithm, Luh, Walker and Paul, On-line computational scheme for mechanical manipulators, 1980.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0], masses=[2.0])
    /// >>> arm.inverse_dynamics([0.0], [0.0], [0.0], wrench=[0.0, 9.81, 0.0, 0.0, 0.0, 0.0], wrench_frame="link1")
    /// array([0.])
    #[arguments(q, v, a, *, wrench=None, wrench_frame=None, friction=false, out=None)]
    fn inverse_dynamics<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.loaded(("inverse_dynamics", "a"), [q, v, a], [wrench, wrench_frame, friction], Quantity::InverseDynamics, out)
    }

    /// Forward dynamics: the acceleration `a = M^-1 (tau + J' wrench - C v - g)`, `(..., n)`, rad/s^2 or m/s^2.
    ///
    /// Args:
    ///     q, v, tau: positions (rad or m), velocities (per s) and torques (N m or N), `(..., n)`, broadcast over the leading axes.
    ///     wrench, wrench_frame: as for `inverse_dynamics` (keyword only).
    ///     friction: subtract the joints' `damping v + friction sign(v)` from the torque (keyword only).
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: as for `inverse_dynamics`, or the mass matrix is singular.
    ///
    /// Source: the articulated-body algorithm, Featherstone, The calculation of robot dynamics using articulated-body inertias, 1983.
    ///
    /// >>> import armlet as al
    /// >>> al.pendulum(2.0, 3.0).forward_dynamics([0.0], [0.0], [4.0])
    /// array([2.])
    #[arguments(q, v, tau, *, wrench=None, wrench_frame=None, friction=false, out=None)]
    fn forward_dynamics<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        self.loaded(("forward_dynamics", "tau"), [q, v, tau], [wrench, wrench_frame, friction], Quantity::ForwardDynamics, out)
    }

    /// The Slotine-Li regressor `Y`, `(..., n, p)`: `Y(q, v, v_r, a_r) parameters = M a_r + C(q, v) v_r + g`.
    ///
    /// `C` is the Coriolis matrix of `coriolis_matrix`, and `M` excludes the armature, which is not one of the parameters. So
    /// `regressor(q, v, v, a) @ parameters + armature * a` is the inverse dynamics.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
    ///     v_r, a_r: reference velocities (rad/s or m/s) and accelerations (rad/s^2 or m/s^2), `(..., n)`, broadcast over the leading axes.
    ///     armature: append the `n` columns `diag(a_r)` (keyword only).
    ///     friction: append the `2 n` columns `diag(v_r)` for damping and `diag(sign v)` for Coulomb friction (keyword only).
    ///     offset: append the `n` columns of the identity matrix for torque offsets, after all other columns (keyword only).
    ///     out: an array to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// Source: [SlotineLi1987], extended to trees of bodies.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_pr(2.0, 0.5, 0.5).regressor([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 3.0])
    /// array([[1., 3., 0.],
    ///        [0., 1., 3.]])
    #[arguments(q, v, v_r, a_r, *, armature=false, friction=false, offset=false, out=None)]
    fn regressor<'py>(&self) -> PyResult<Bound<'py, PyAny>> {
        const NAME: &str = "regressor";
        let flag = |name, value| entry(q.py(), NAME, || flag_or_false(NAME, name, value));
        let (armature, friction, offset) = (flag("armature", armature)?, flag("friction", friction)?, flag("offset", offset)?);
        let query = JointTerms { armature, friction, offset }.regressor();
        self.evaluate(NAME, ["q", "v", "v_r", "a_r"], [q, v, v_r, a_r], query, out)
    }

    /// The kinetic energy `v' M v / 2` and the potential energy, whose gradient is `g`: two arrays `(...)`, J.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
    ///     out: a tuple of two arrays to write to (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// >>> import armlet as al
    /// >>> kinetic, potential = al.planar_pr(2.0, 0.5, 0.5).energy([0.0, 0.0], [1.0, 0.0])
    /// >>> float(kinetic), float(potential)
    /// (1.0, 0.0)
    #[arguments(q, v, *, out=None)]
    fn energy<'py>(&self) -> Result<Bound<'py, PyTuple>, Failure> {
        let call = ArmCall { function: "energy", names: ["q", "v"], values: [q, v] };
        self.apart(&call, &Quantity::Energy.into(), [&[], &[]], out, |both, [kinetic, potential]| {
            (kinetic[0], potential[0]) = (both[0], both[1]);
        })
    }
}
