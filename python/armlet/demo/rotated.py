"""Exercise 2 in absolute angles and in the rotated frame: the transformation, its Jacobians and the factors of the determinant.

    q' = T q (absolute angles),   J'_E = J_E T^-1,   1J'_E = blockdiag(R', R') J'_E,   R = R(q1)
    det J_E = det J'_E = det 1J'_E = l1 l2 l3 l4 sin q2 sin q4

Here the prime of `q'` and `J'_E` marks absolute angles, `R'` is a transpose, and `1J'_E` is in the axes of link 1. `l_i` are link lengths.
Column i of `J'_E` depends on link i alone: `l_i (-sin q'_i, cos q'_i)`. The rows of the secondary task depend on links 1 and 2 only. So the
determinant is the product of two 2 x 2 determinants.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

import armlet as al

if TYPE_CHECKING:
    from .report import Report

Array: TypeAlias = NDArray[np.float64]

# T converts relative joint angles to absolute angles. T^-1 takes differences of absolute angles.
T = np.tril(np.ones((4, 4)))
# The tolerance covers a few dozen products of entries below 10.
TOLERANCE = 1e-13


def stacked(arm: al.Arm, q: ArrayLike) -> Array:
    """The Jacobian J_E, (4, 4): two rows of the tip of link 4, then two rows of the tip of link 2."""
    return np.vstack([arm.jacobian(q, frame)[:2] for frame in ("link4", "link2")])


def turned(q1: float) -> Array:
    """The matrix blockdiag(R', R'), (4, 4), with one block `R'` per task."""
    s, c = np.sin(q1), np.cos(q1)
    return np.asarray(np.kron(np.eye(2), [[c, s], [-s, c]]), dtype=np.float64)


def run(report: Report) -> None:
    rng = np.random.default_rng(5)
    worst = {"columns": 0.0, "rotated": 0.0, "determinant": 0.0, "block": 0.0}
    for _ in range(200):
        lengths, q = rng.uniform(0.1, 2.0, 4), rng.uniform(-3.0, 3.0, 4)
        J_E = stacked(al.planar_arm(lengths), q)
        absolute = J_E @ np.linalg.inv(T)
        rotated = turned(q[0]) @ absolute
        for name, base, J in (("columns", 0.0, absolute), ("rotated", q[0], rotated)):
            angles = T @ q - base
            links = lengths * np.stack([-np.sin(angles), np.cos(angles)])
            worst[name] = max(worst[name], np.abs(J - np.vstack([links, links * [1, 1, 0, 0]])).max())
        factored = lengths.prod() * np.sin(q[1]) * np.sin(q[3])
        for J in (J_E, absolute, rotated):
            worst["determinant"] = max(worst["determinant"], abs(np.linalg.det(J) - factored))
        # With a single block R', as printed in the exam, only the rows of the primary task are rotated.
        only = turned(q[0])
        only[2:, 2:] = np.eye(2)
        worst["block"] = max(worst["block"], np.abs(only @ absolute - rotated).max())
    report.bound("200 random arms: columns of J'_E = J_E T^-1 are l_i (-sin, cos) of absolute angles (m)", worst["columns"], TOLERANCE)
    report.bound("200 random arms: 1J'_E = blockdiag(R', R') J'_E has angles from link 1 (m)", worst["rotated"], TOLERANCE)
    report.bound("200 random arms: det J_E, J'_E, 1J'_E = l1 l2 l3 l4 sin q2 sin q4", worst["determinant"], TOLERANCE)
    text = "a block that is not R'"
    report.equal("one R' for each task: without the second one 1J'_E is wrong", True, bool(worst["block"] > 0.1), text, "E6")
    roles(report)


def roles(report: Report) -> None:
    """Errata E2 and E5: the primary task has the Jacobian J1, and `J_E v` has four entries."""
    arm, q = al.planar_arm([1.0, 1.0, 0.25, 0.25]), np.array([0.0, np.pi / 2, np.pi / 2, 0.0])
    J_E, ones, rest = stacked(arm, q), np.ones(2), np.zeros(2)
    rounding = 8 * np.finfo(np.float64).eps * (1 + np.abs(q).sum())
    right = al.solve_priority([J_E[:2], J_E[2:]], [ones, rest], method="exact", rounding=rounding).v
    swapped = al.solve_priority([J_E[2:], J_E[:2]], [rest, ones], method="exact", rounding=rounding).v
    report.near(
        "case a, p2 = 0, J1 first: the primary task is exact (m/s)", ones, J_E[:2] @ right, TOLERANCE, "primary task Jacobian J2", "E2"
    )
    missed = float(np.linalg.norm(J_E[:2] @ swapped - ones))
    report.equal(
        f"case a, p2 = 0, J2 first: the primary task has an error of {missed:.2f} m/s", True, missed > 0.1, "primary task Jacobian J2", "E2"
    )
    report.equal("case a: entries of J_E v", 4, (J_E @ right).size, "(1, 1, 1, 1, 1)", "E5")
