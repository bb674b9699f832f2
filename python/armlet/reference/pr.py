"""The two arms in closed form: the prismatic-revolute (PR) arm on a horizontal plane, and the pendulum.

    PR:        T = 1/2 A v1^2 + B cos(q2) v1 v2 + 1/2 C v2^2,   U = 0,   A > 0, C > 0, A C > B^2
    pendulum:  T = 1/2 I v^2,   U = -G cos(theta),   theta from the downward vertical

This file has only the energies. The base class in `lagrange` computes the torques.
"""

import numpy as np

from .lagrange import Analytic, Mechanism


class PlanarPR(Mechanism):
    """The prismatic-revolute arm on a horizontal plane, with parameters (A, B, C)."""

    def __init__(self, A: float, B: float, C: float) -> None:
        if not (np.isfinite([A, B, C]).all() and A > 0.0 and C > 0.0 and A * C > B * B):
            raise ValueError(f"planar_pr: parameters are not a mass matrix: expected A > 0, C > 0, A C > B^2, got {(A, B, C)}")
        super().__init__(2, [A, B, C])
        self.angles = np.array([False, True])

    def energy_basis(self, q: Analytic) -> tuple[Analytic, Analytic]:
        basis = np.zeros((*q.shape[:-1], 3, 2, 2), dtype=q.dtype)
        basis[..., 0, 0, 0] = 1.0
        basis[..., 1, 0, 1] = np.cos(q[..., 1])
        basis[..., 1, 1, 0] = np.cos(q[..., 1])
        basis[..., 2, 1, 1] = 1.0
        return basis, np.zeros((*q.shape[:-1], 3), dtype=q.dtype)


class Pendulum(Mechanism):
    """The pendulum: one link under gravity, with parameters (I, G)."""

    def __init__(self, inertia: float, gravity_moment: float) -> None:
        if not (np.isfinite([inertia, gravity_moment]).all() and inertia > 0.0):
            raise ValueError(f"pendulum: inertia is not positive or not finite: got {(inertia, gravity_moment)}")
        super().__init__(1, [inertia, gravity_moment])

    def energy_basis(self, q: Analytic) -> tuple[Analytic, Analytic]:
        basis = np.zeros((*q.shape[:-1], 2, 1, 1), dtype=q.dtype)
        basis[..., 0, 0, 0] = 1.0
        height = np.zeros((*q.shape[:-1], 2), dtype=q.dtype)
        height[..., 1] = -np.cos(q[..., 0])
        return basis, height


def planar_pr(A: float, B: float, C: float) -> PlanarPR:
    """The PR arm with the parameters A (kg), B (kg m), C (kg m^2)."""
    return PlanarPR(A, B, C)


def pendulum(inertia: float, gravity_moment: float) -> Pendulum:
    """The pendulum with the inertia I (kg m^2) about its joint and the gravity moment G = m g0 d (N m)."""
    return Pendulum(inertia, gravity_moment)
