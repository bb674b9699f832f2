"""Inertial parameters of bodies as pseudo-inertias (Wensing, Kim and Slotine 2018).

    P = [[S, h], [h', m]],  S = 1/2 tr(I) 1 - I,  h = m c        (4 x 4, linear in the ten parameters of a body)

    possible: m > 0 and the principal moments about the centre of mass satisfy 0 < J_1 and J_3 < J_1 + J_2; equivalently P > 0
    nearest possible, in D P D with D = diag(1/l, 1/l, 1/l, 1):   (A + H)/2 + f 1,   A = D P D - f 1 = U H  (Higham 1988)

m is the mass, c the centre of mass, and I the inertia about the origin of the body frame. ' is the transpose and 1 the unit matrix. l is a
length, and f the smallest eigenvalue of the result. U H is the polar decomposition of A: U is orthogonal, and H follows from singular
values. The core clips eigenvalues of D P D instead. The order of the parameters of a body is m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz,
Izz.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array


def _pseudo_basis() -> Array:
    """The pseudo-inertias (10, 4, 4) of ten bodies: in body j, parameter j is 1 and all other parameters are 0."""
    basis = np.zeros((10, 4, 4))
    basis[0, 3, 3] = 1.0
    for axis in range(3):
        basis[1 + axis, axis, 3] = basis[1 + axis, 3, axis] = 1.0
    for index, (row, column) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
        inertia = np.zeros((3, 3))
        inertia[row, column] = inertia[column, row] = 1.0
        basis[4 + index, :3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return basis


PSEUDO = _pseudo_basis()


def pseudo_inertia(pi: ArrayLike) -> Array:
    """The pseudo-inertias P (..., 4, 4) of parameters (..., 10)."""
    P: Array = np.einsum("...p,pij->...ij", np.asarray(pi, dtype=np.float64), PSEUDO)
    return P


def parameters_of(pseudo: Array) -> Array:
    """The ten parameters of a pseudo-inertia P (4, 4)."""
    inertia = np.trace(pseudo[:3, :3]) * np.eye(3) - pseudo[:3, :3]
    return np.concatenate([[pseudo[3, 3]], pseudo[:3, 3], inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


class ParameterReport(NamedTuple):
    """Eigenvalues of the pseudo-inertias, ascending, (bodies, 4), and whether each body is physically possible, (bodies,)."""

    eigenvalues: Array
    possible: Any

    @property
    def consistent(self) -> bool:
        """Whether every body is physically possible."""
        return bool(np.all(self.possible))


def is_possible(pi: ArrayLike) -> bool:
    """Whether the mass and the principal moments about the centre of mass are positive, and satisfy the triangle inequality."""
    pi = np.asarray(pi, dtype=np.float64)
    mass, moment = pi[0], pi[1:4]
    if not mass > 0.0:
        return False
    inertia = np.array([[pi[4], pi[5], pi[7]], [pi[5], pi[6], pi[8]], [pi[7], pi[8], pi[9]]])
    central = inertia - (moment @ moment * np.eye(3) - np.outer(moment, moment)) / mass
    J = np.linalg.eigvalsh(central)
    return bool(J[0] > 0.0 and J[2] < J[0] + J[1])


def check_parameters(arm: Any, pi: ArrayLike | None = None) -> ParameterReport:
    """Check whether the bodies of parameters (10 * bodies,) are physically possible. None: the parameters of the arm."""
    bodies = np.asarray(arm.parameters if pi is None else pi, dtype=np.float64).reshape(-1, 10)
    eigenvalues = np.asarray(np.linalg.eigvalsh(pseudo_inertia(bodies)), dtype=np.float64)
    return ParameterReport(eigenvalues, np.array([is_possible(body) for body in bodies]))


def project_parameters(pi: ArrayLike, *, length: float = 0.1, floor: float = 1e-6) -> Array:
    """The nearest possible parameters (10 * bodies,). `length` is l, m. f is `floor` times the largest eigenvalue of all D P D."""
    bodies = np.array(pi, dtype=np.float64).reshape(-1, 10)
    D = np.array([1.0 / length] * 3 + [1.0])
    scaled = D[:, None] * pseudo_inertia(bodies) * D
    least = floor * float(np.linalg.eigvalsh(scaled).max())
    if not least > 0.0:
        raise ValueError("project_parameters: pi has no body to scale by")
    for body, P in zip(bodies, scaled, strict=True):
        if not is_possible(body):
            A = P - least * np.eye(4)
            _, sigma, V = np.linalg.svd(A)
            raised = (A + (V.T * sigma) @ V) / 2 + least * np.eye(4)
            body[:] = parameters_of(0.5 * (raised + raised.T) / D[:, None] / D)
    return bodies.reshape(-1)
