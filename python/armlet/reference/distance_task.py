"""A task of the distance of two spheres or capsules.

    distance        e = d_d - d,  d = |p_a - p_b| - r_a - r_b         n'(J_a - J_b),  n = (p_a - p_b) / |p_a - p_b|

p_a and p_b are the nearest points of two segments: the nearest of all pairs of an end or an inner point.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Analytic, Array
from .tasks import Task


class DistanceTask(Task):
    """A task that keeps the distance of two spheres or capsules within bounds. A frame of None is the world."""

    def __init__(
        self,
        frame: str | None,
        other: str | None = None,
        lower: ArrayLike | None = None,
        gain: ArrayLike = 1.0,
        *,
        upper: ArrayLike | None = None,
        points: ArrayLike = (0.0, 0.0, 0.0),
        radius: float = 0.0,
        other_points: ArrayLike = (0.0, 0.0, 0.0),
        other_radius: float = 0.0,
        damping: ArrayLike | None = None,
    ) -> None:
        self.sides = [
            (name, np.reshape(np.asarray(each, dtype=np.float64), (-1, 3))) for name, each in ((frame, points), (other, other_points))
        ]
        self.radii = radius + other_radius
        self._aim(None, gain, None, damping)
        self.bounds = (lower, upper)

    def _ends(self, arm: Arm, q: Analytic) -> list[tuple[Analytic, Analytic]]:
        """The ends of each axis, (k, 3), and their Jacobians, (k, 3, n)."""
        found = []
        for name, points in self.sides:
            local = np.c_[points, np.ones(len(points))]
            X, slope = (np.eye(4), np.zeros((arm.n, 4, 4))) if name is None else arm._frame(q, name)
            found.append((local @ X[:3].T, np.einsum("nij,kj->kin", slope[:, :3], local)))
        return found

    def _pairs(self, arm: Arm, q: Analytic) -> list[tuple[Analytic, Analytic]]:
        """For each row, p_a - p_b, (3,), and its Jacobian, (3, n)."""
        (A, J_A), (B, J_B) = self._ends(arm, q)
        ends: Any = [None] if len(A) == len(B) == 1 else []
        if len(A) == len(B) == 2:
            ends = [(0, None), (1, None), (None, 0), (None, 1), (None, None)]
        elif not ends:
            ends = [(0, None) if len(A) == 1 else (None, 0)]
        pairs = []
        for given in ends:
            s, t = (0.0, 0.0) if given is None else _nearest(A, B, given)
            weights = [np.array([1.0 - x, x])[: len(P)] if len(P) == 2 else np.ones(1) for x, P in ((s, A), (t, B))]
            pairs.append((weights[0] @ A - weights[1] @ B, np.tensordot(weights[0], J_A, 1) - np.tensordot(weights[1], J_B, 1)))
        return pairs

    def jacobian(self, arm: Arm, q: Analytic) -> Analytic:
        return np.array([r @ J / np.sqrt(r @ r) for r, J in self._pairs(arm, q)])

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        return np.asarray(target - [np.linalg.norm(r) - self.radii for r, _ in self._pairs(arm, q)])


def _nearest(A: Analytic, B: Analytic, given: tuple[int | None, int | None]) -> tuple[Any, Any]:
    """The places s and t of the nearest points of two segments. A place that is not None is given."""
    apart = A[0] - B[0]
    directions = [P[1] - P[0] if len(P) == 2 else np.zeros(3) for P in (A, B)]
    best, found = np.inf, (0.0, 0.0)
    for places in itertools.product(*((0, 1, None) if place is None else (place,) for place in given)):
        # r = apart + s u - t w, perpendicular to the direction of each inner point
        columns = np.stack([directions[0], -directions[1]], axis=1)
        place = np.array([0.0 if each is None else each for each in places], dtype=np.result_type(A, B))
        inner = [i for i, each in enumerate(places) if each is None]
        if inner:
            M = columns[:, inner]
            if np.linalg.cond((M.T @ M).real) > 1e13:
                continue
            place[inner] = -np.linalg.solve(M.T @ M, M.T @ (apart + columns @ place))
        size = float(np.linalg.norm((apart + columns @ place).real))
        if ((place.real >= 0.0) & (place.real <= 1.0)).all() and size < best:
            best, found = size, (place[0], place[1])
    return found
