"""Derivatives of the dynamics of arms without mimic joints from values at other states, without truncation error.

    In an angle q_j the torque is a trigonometric polynomial of degree 2:  df/dq_j = sum_k w_k f(q_j + 2 pi k/5),
        w_k = 2/5 (sin x_k + 2 sin 2 x_k),  x_k = 2 pi k/5,  k = 0..4
    In a prismatic q_j, and in every velocity, it is a polynomial of degree 2:  df/dx = (f(x + 1) - f(x - 1)) / 2
    forward dynamics:  M a = tau - h(q, v),  so  da/dq = -M^-1 d tau/dq,  da/dv = -M^-1 d tau/dv,  da/dtau = M^-1
    linearisation:     d/dt [dq; dv] = [[0, 1], [da/dq, da/dv]] [dq; dv] + [[0], [M^-1]] dtau

Both rules follow from the pose of a body, T = T_parent place exp(xi q) (see `arm`), and from the mass matrix M. T has degree one in q,
cos q and sin q, and M is quadratic in T. h(q, v) is the torque at zero acceleration.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism, solve, vectors

TURNS = 2.0 * np.pi * np.arange(5) / 5.0
WEIGHTS = 0.4 * (np.sin(TURNS) + 2.0 * np.sin(2.0 * TURNS))


def _central(f: Callable[[Array], Array], x: Array) -> Array:
    """The derivatives df/dx (..., n, n) of a polynomial f of degree 2."""
    steps = np.eye(x.shape[-1])
    return np.swapaxes((f(x[..., None, :] + steps) - f(x[..., None, :] - steps)) / 2.0, -1, -2)


def _periodic(f: Callable[[Array], Array], q: Array) -> Array:
    """The derivatives df/dq (..., n, n) of a trigonometric polynomial f of degree 2."""
    points = q[..., None, None, :] + TURNS[:, None, None] * np.eye(q.shape[-1])
    slopes: Array = np.einsum("k,...kji->...ij", WEIGHTS, f(points))
    return slopes


def inverse_dynamics_derivatives(
    arm: Mechanism, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, friction: bool = False
) -> tuple[Array, Array, Array]:
    """The derivatives d tau/dq, d tau/dv and d tau/da = M, (..., n, n) each. `friction` adds the damping to d tau/dv."""
    q, v, a = vectors(q, v, a, n=arm.n)

    def by_position(x: Array) -> Array:
        between = tuple(range(q.ndim - 1, x.ndim - 1))
        return arm.inverse_dynamics(x, np.expand_dims(v, between), np.expand_dims(a, between))

    def by_velocity(x: Array) -> Array:
        return arm.inverse_dynamics(q[..., None, :], x, a[..., None, :])

    by_q = np.where(arm.angles, _periodic(by_position, q), _central(by_position, q))
    by_v = _central(by_velocity, v) + friction * np.diag(arm.damping)
    return by_q, by_v, arm.mass_matrix(q)


def forward_dynamics_derivatives(
    arm: Mechanism, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, friction: bool = False
) -> tuple[Array, Array, Array]:
    """The derivatives da/dq, da/dv and da/dtau = M^-1, (..., n, n) each."""
    q, v, tau = vectors(q, v, tau, n=arm.n)
    a = arm.forward_dynamics(q, v, tau, friction=friction)
    by_q, by_v, mass = inverse_dynamics_derivatives(arm, q, v, a, friction=friction)
    return -solve(mass, by_q), -solve(mass, by_v), solve(mass, np.broadcast_to(np.eye(arm.n), mass.shape))


def linearize(arm: Mechanism, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, friction: bool = False) -> tuple[Array, Array]:
    """The matrices A (..., 2 n, 2 n) and B (..., 2 n, n) of the linear model about a state, which need not be an equilibrium."""
    by_q, by_v, inverse = forward_dynamics_derivatives(arm, q, v, tau, friction=friction)
    one, zero = np.broadcast_to(np.eye(arm.n), by_q.shape), np.zeros(by_q.shape)
    A = np.concatenate([np.concatenate([zero, one], axis=-1), np.concatenate([by_q, by_v], axis=-1)], axis=-2)
    return A, np.concatenate([zero, inverse], axis=-2)
