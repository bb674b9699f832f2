"""The null-space torque of an impedance law and its coupling with the frame (Khatib 1987; Ott 2008), from singular values.

    G = S J W^-1/2 = U diag(s) V',  W = M (consistent) or 1 (static)
    N' = W^1/2 (1 - V diag(min(1, (s/eps)^2)) V') W^-1/2,   L = S U diag(1 / max(s, eps)^2) U' S
    tau_0 = K_n (q_n - q) + D_n (q_n_dot - v),   coupling: tau += C v, wrench += L (x_d_ddot - J_dot v), with L for W = M

S is diagonal, with one factor for the rows of position and one for the rows of orientation. It scales each block of rows of J W^-1/2 so
that the root mean square of the norms of its rows is one. J is the Jacobian of the task with the target x_d, N' the projector and M the
mass matrix. s are singular values and eps their threshold. q_n is the posture, K_n and D_n are its stiffness and damping. ' is the
transpose, _dot and _ddot are time derivatives.

A moving rotation vector r has the angular velocity w = A r_dot and the angular acceleration w_dot = A r_ddot + A_dot r_dot. Here
A = int_0^1 exp(u r) du comes from Gauss-Legendre quadrature, and d exp(u r)/dt = [u A(u r) r_dot]x exp(u r). [..]x is the matrix of the
cross product.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array
from .law import gain
from .motion import Hold, Motion
from .task import Coordinates, rotation_matrices

EPS = 0.02
_X, _W = np.polynomial.legendre.leggauss(12)
# Gauss-Legendre nodes and weights on [0, 1], 12 on each half.
NODES, WEIGHTS = np.concatenate([0.25 + 0.25 * _X, 0.75 + 0.25 * _X]), np.concatenate([0.25 * _W, 0.25 * _W])


@dataclass
class NullSpace:
    """A spring and a damper at the joints, for the null space. `q_d` is (n,) or a motion; gains are scalar, (n,) or (n, n)."""

    q_d: Any
    stiffness: ArrayLike
    damping: ArrayLike
    projection: str = field(default="consistent", kw_only=True)

    def torque(self, t: float, q: Array, v: Array) -> Array:
        """The torque tau_0 (n,) before the projection."""
        motion: Motion = self.q_d if callable(self.q_d) else Hold(self.q_d)
        q_n, rate, _ = motion(t)
        return gain(self.stiffness, q.size) @ (q_n - q) + gain(self.damping, q.size) @ (rate - v)


def clamped(J: Array, W: Array, rows: list[int], eps: float) -> tuple[Array, Array, float]:
    """The projector N' (n, n), the coupling matrix L (m, m), and the loss 1 - min(1, (s/eps)^2) for the smallest singular value s."""
    values, vectors = np.linalg.eigh(W)
    root, inverse = (vectors * values**0.5) @ vectors.T, (vectors * values**-0.5) @ vectors.T
    G = J @ inverse
    scales = np.ones(len(rows))
    for turns in (False, True):
        block = [k for k, row in enumerate(rows) if (row > 2) == turns]
        size = np.sqrt(np.mean(np.sum(G[block] ** 2, axis=1))) if block else 0.0
        scales[block] = 1.0 / size if size > 0.0 else 1.0
    U, s, Vt = np.linalg.svd(scales[:, None] * G)
    s = np.concatenate([s, np.zeros(U.shape[0] - s.size)])
    kept = np.minimum(1.0, (s / eps) ** 2)
    V = Vt[: min(s.size, Vt.shape[0])].T
    N = root @ (np.eye(W.shape[0]) - (V * kept[: V.shape[1]]) @ V.T) @ inverse
    L = scales[:, None] * ((U / np.maximum(s, eps) ** 2) @ U.T) * scales
    return N, L, float(1.0 - kept.min())


def coupling(arm: Arm, at: Coordinates, q: Array, v: Array, acceleration: Array, eps: float) -> tuple[Array, Array]:
    """The coupling torque C v (n,) and the coupling wrench L (x_d_ddot - J_dot v) (m,), with the L of W = M."""
    _, L, _ = clamped(at.jacobian(q), arm.mass_matrix(q), at.rows, eps)
    J_dot = arm.jacobian_dot(q, v, at.frame)[at.rows]
    return arm.coriolis_matrix(q, v) @ v, L @ (acceleration - J_dot @ v)


def rate_of_rotation(r: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
    """The angular velocity and the angular acceleration of the rotation exp(r), (3,) each. `rate` is r_dot, `acceleration` is r_ddot."""

    def means(scales: Array) -> Array:
        """A(s r) of each s in `scales`, by quadrature, (k, 3, 3)."""
        turns = rotation_matrices(r, np.outer(scales, NODES).ravel()).reshape(scales.size, NODES.size, 3, 3)
        total: Array = np.einsum("j,kjab->kab", WEIGHTS, turns)
        return total

    A = means(np.ones(1))[0]
    change = WEIGHTS @ np.cross(NODES[:, None] * (means(NODES) @ rate), rotation_matrices(r, NODES) @ rate)
    return A @ rate, A @ acceleration + change


def row_rates(rows: list[int], target: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
    """x_d_dot and x_d_ddot of the rows. For rows of orientation they are angular velocity and angular acceleration of the target."""
    if max(rows) < 3:
        return rate, acceleration
    full = np.zeros((3, 6))
    full[:, rows] = target, rate, acceleration
    full[1, 3:], full[2, 3:] = rate_of_rotation(*full[:, 3:])
    return full[1, rows], full[2, rows]


def held(free: Array, limit: Array, push: Array) -> bool:
    """Whether the magnitude of some entry of `free` exceeds its limit, and `push` would increase this magnitude."""
    return bool(np.any((np.abs(free) > limit) & (push * free > 0.0)))
