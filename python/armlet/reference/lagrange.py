"""Lagrangian mechanics of an arm whose energies are linear in its parameters.

    T(q, v) = 1/2 v' M(q) v,   M(q) = sum_k pi_k M_k(q) + diag(armature),   U(q) = sum_k pi_k U_k(q)
    g_i   = dU/dq_i
    C_ij  = 1/2 sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) v_k          (Christoffel symbols of the first kind)
    tau   = M(q) a + C(q, v) v + g(q) + [damping v + friction sign(v)] - J'F
    Y(q, v, v_r, a_r)[:, k] = M_k a_r + C_k v_r + g_k                      (pi_k = 1, all other parameters 0)

T and U are the kinetic and the potential energy. pi are the parameters, F is an external wrench at a frame with the Jacobian J, and ' is
the transpose. Subclasses define M_k and U_k, the *unit energies*. Every derivative is a complex step, df/dx = Im f(x + i h) / h (Martins,
Sturdza and Alonso, 2003). The formula has no subtraction, so h = 1e-30 causes no cancellation. Friction is included only with
`friction=True`; sign(0) = 0.
"""

from copy import copy
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Analytic = NDArray[Any]  # float64, or complex128 inside a complex step

STEP = 1e-30


def vectors(*values: ArrayLike, n: int | None = None) -> list[Array]:
    """Convert values to float arrays, and broadcast their leading axes. The last axis of each must have the length n, if n is not None."""
    arrays = [np.asarray(value, dtype=np.float64) for value in values]
    if n is not None:
        for array in arrays:
            if array.ndim == 0 or array.shape[-1] != n:
                raise ValueError(f"expected the last axis of length {n}, got shape {array.shape}")
    if len({array.shape for array in arrays}) == 1:
        return arrays
    lead = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    return [np.broadcast_to(array, lead + array.shape[-1:]) for array in arrays]


def solve(matrix: Array, right: Array) -> Array:
    """The solution x of matrix x = right in float64, by numpy.linalg.solve."""
    solution: Array = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    return solution


def complex_steps(q: Array) -> NDArray[np.complex128]:
    """The n complex points q + i h e_k, (..., n, n). Row k changes coordinate k."""
    return q[..., None, :] + 1j * STEP * np.eye(q.shape[-1])


class Expansion(NamedTuple):
    """The unit energies M_k and U_k at q, and their derivatives.

    The fields are M_k (..., p, n, n), dM_k/dq_l (..., l, p, n, n), U_k (..., p) and dU_k/dq_i (..., p, n).
    """

    mass: Array
    mass_slopes: Array
    potential: Array
    gravity: Array


class Mechanism:
    """An arm with parameters pi (p,), mass matrix sum pi_k M_k(q) + diag(armature) and potential energy sum pi_k U_k(q).

    M_k and U_k are the *unit energies*. All functions broadcast over leading axes.
    """

    def __init__(self, n: int, parameters: ArrayLike, armature: ArrayLike = 0.0) -> None:
        self.n = n
        self.parameters: Array = np.array(parameters, dtype=np.float64)
        self.armature, self.damping, self.friction = (self._each(value) for value in (armature, 0.0, 0.0))
        self.angles: Any = np.ones(n, dtype=bool)  # whether a coordinate is an angle, (n,)
        self._last: tuple[tuple[tuple[int, ...], bytes], Expansion] | None = None

    def _each(self, value: ArrayLike) -> Array:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.n,)).copy()

    def with_parameters(self, parameters: ArrayLike) -> Self:
        """A copy of the arm with other parameters (p,)."""
        other = copy(self)
        other.parameters = np.array(parameters, dtype=np.float64)
        return other

    def with_drives(
        self, *, armature: ArrayLike | None = None, damping: ArrayLike | None = None, friction: ArrayLike | None = None
    ) -> Self:
        """A copy of the arm with other rotor inertia, damping or Coulomb friction, scalar or (n,)."""
        other = copy(self)
        for name, value in (("armature", armature), ("damping", damping), ("friction", friction)):
            if value is not None:
                setattr(other, name, self._each(value))
        return other

    def friction_torque(self, v: ArrayLike) -> Array:
        """The friction torque damping v + friction sign(v), (..., n)."""
        v = np.asarray(v, dtype=np.float64)
        return np.asarray(self.damping * v + self.friction * np.sign(v))

    def _load(self, q: Array, wrench: Array, frame: str) -> Array:
        """The joint torque J'F, (..., n), of a wrench F = [f; m] in world axes at a frame's origin."""
        raise NotImplementedError

    def energy_basis(self, q: Analytic) -> tuple[Analytic, Analytic]:
        """The unit energies M_k(q) (..., p, n, n) and U_k(q) (..., p) for q (..., n). They must be analytic in q."""
        raise NotImplementedError

    def _expand(self, q: Array) -> Expansion:
        """The unit energies and their derivatives at q. The last result is stored, because all functions of a control law use it."""
        key = (q.shape, q.tobytes())
        if self._last is None or self._last[0] != key:
            mass, potential = self.energy_basis(complex_steps(q))
            # The real part of f(q + i h e_k) is f(q), because h^2 is below the last bit.
            slopes = np.swapaxes(potential.imag / STEP, -1, -2)
            self._last = (key, Expansion(mass[..., 0, :, :, :].real, mass.imag / STEP, potential[..., 0, :].real, slopes))
        return self._last[1]

    def mass_matrix(self, q: ArrayLike) -> Array:
        """The mass matrix M(q), (..., n, n). Its diagonal includes the rotor inertia."""
        (q,) = vectors(q, n=self.n)
        mass: Array = np.einsum("p,...pij->...ij", self.parameters, self._expand(q).mass)
        return mass + np.diag(self.armature)

    def mass_matrix_rate(self, q: ArrayLike, v: ArrayLike) -> Array:
        """The time derivative dM/dt for dq/dt = v, (..., n, n)."""
        q, v = vectors(q, v, n=self.n)
        rate: Array = np.einsum("p,...lpij,...l->...ij", self.parameters, self._expand(q).mass_slopes, v)
        return rate

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike) -> Array:
        """The Coriolis matrix C(q, v) of the Christoffel symbols, (..., n, n)."""
        q, v = vectors(q, v, n=self.n)
        slopes = np.einsum("p,...lpij->...lij", self.parameters, self._expand(q).mass_slopes)
        return _christoffel(slopes[..., None, :, :], v)[..., 0, :, :]

    def christoffel(self, q: ArrayLike) -> Array:
        """The Christoffel symbols c[i, j, k] = (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) / 2, (..., n, n, n)."""
        (q,) = vectors(q, n=self.n)
        slopes = np.einsum("p,...kpij->...ijk", self.parameters, self._expand(q).mass_slopes)
        symbols: Array = 0.5 * (slopes + np.swapaxes(slopes, -1, -2) - np.moveaxis(slopes, -1, -3))
        return symbols

    def gravity(self, q: ArrayLike) -> Array:
        """The gravity torque g(q) = dU/dq, (..., n)."""
        (q,) = vectors(q, n=self.n)
        torque: Array = np.einsum("p,...pi->...i", self.parameters, self._expand(q).gravity)
        return torque

    def bias(self, q: ArrayLike, v: ArrayLike, *, friction: bool = False) -> Array:
        """The torque C(q, v) v + g(q) at zero acceleration, (..., n), plus the friction torque if `friction`."""
        q, v = vectors(q, v, n=self.n)
        bias: Array = np.einsum("...ij,...j->...i", self.coriolis_matrix(q, v), v) + self.gravity(q)
        return bias + self.friction_torque(v) if friction else bias

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        wrench_frame: str | None = None,
        friction: bool = False,
    ) -> Array:
        """The torque tau = M a + C v + g - J'F, (..., n), plus the friction torque if `friction`."""
        q, v, a = vectors(q, v, a, n=self.n)
        tau: Array = np.einsum("...ij,...j->...i", self.mass_matrix(q), a) + self.bias(q, v, friction=friction)
        return tau if wrench is None else tau - self._load(q, np.asarray(wrench, dtype=np.float64), str(wrench_frame))

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        wrench_frame: str | None = None,
        friction: bool = False,
    ) -> Array:
        """The acceleration a, (..., n), from M a = tau + J'F - C v - g, by a dense linear solve.

        With `friction`, the friction torques of the joints are subtracted from the right-hand side.
        """
        q, v, tau = vectors(q, v, tau, n=self.n)
        rest = self.inverse_dynamics(q, v, np.zeros(self.n), wrench=wrench, wrench_frame=wrench_frame, friction=friction)
        return solve(self.mass_matrix(q), (tau - rest)[..., None])[..., 0]

    def regressor(
        self,
        q: ArrayLike,
        v: ArrayLike,
        v_r: ArrayLike,
        a_r: ArrayLike,
        *,
        armature: bool = False,
        friction: bool = False,
        offset: bool = False,
    ) -> Array:
        """The regressor Y with Y pi = M a_r + C(q, v) v_r + g, (..., n, p), where M excludes the rotor inertia.

        `armature` appends the columns diag(a_r), and `friction` then appends diag(v_r) and diag(sign v). `offset` appends the identity.
        """
        q, v, v_r, a_r = vectors(q, v, v_r, a_r, n=self.n)
        inertial = np.einsum("...pij,...j->...pi", self._expand(q).mass, a_r)
        coriolis = np.einsum("...pij,...j->...pi", _christoffel(self._expand(q).mass_slopes, v), v_r)
        columns: Array = np.swapaxes(inertial + coriolis + self._expand(q).gravity, -1, -2)
        drives = [a_r] * armature + [v_r, np.sign(v)] * friction + [np.ones_like(v_r)] * offset
        return np.concatenate([columns, *(np.eye(self.n) * x[..., None, :] for x in drives)], axis=-1)

    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
        """The kinetic and the potential energy, (...) each, J."""
        q, v = vectors(q, v, n=self.n)
        kinetic: Array = 0.5 * np.einsum("...i,...ij,...j->...", v, self.mass_matrix(q), v)
        potential: Array = np.einsum("p,...p->...", self.parameters, self._expand(q).potential)
        return kinetic, potential


def _christoffel(slopes: Array, v: Array) -> Array:
    """The Coriolis matrices 1/2 sum_k (D_kij + D_jik - D_ijk) v_k of every parameter. `slopes`: D_kij = dM_ij/dq_k as (..., k, p, i, j)."""
    first = np.einsum("...kpij,...k->...pij", slopes, v)
    second = np.einsum("...jpik,...k->...pij", slopes, v)
    third = np.einsum("...ipjk,...k->...pij", slopes, v)
    matrix: Array = 0.5 * (first + second - third)
    return matrix
