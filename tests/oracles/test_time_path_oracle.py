"""Durations of random splines of a seven-axis arm against toppra, with the same path, limits and a grid of a thousand points."""

from __future__ import annotations

import logging
from typing import Any

import models
import numpy as np
import pytest
import toppra
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointTorqueConstraint, JointVelocityConstraint

import armlet as al

ARM = models.SEVEN_AXES
TAU_MAX = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])
GRID = np.linspace(0.0, 1.0, 1001)


def both_signs(limit: np.ndarray) -> np.ndarray:
    return np.stack([-limit, limit], axis=1)


def peer(q: np.ndarray, s: np.ndarray, v_max: float | None, scheme: Any) -> float:
    """Return the duration in s that toppra computes, or NaN if it finds none."""
    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    path = toppra.SplineInterpolator(s, q, bc_type="natural")
    limits: list[Any] = [
        JointTorqueConstraint(
            lambda q, v, a: ARM.inverse_dynamics(np.array(q), np.array(v), np.array(a)),
            both_signs(TAU_MAX),
            np.zeros(7),
            discretization_scheme=scheme,
        )
    ]
    if v_max is not None:
        limits.append(JointVelocityConstraint(both_signs(np.full(7, v_max))))
    speed = TOPPRA(limits, path, gridpoints=GRID, solver_wrapper="seidel").compute_parameterization(0.0, 0.0)[1]
    return float("nan") if speed is None else float(np.sum(2 * np.diff(GRID) / (speed[1:] + speed[:-1])))


def test_durations() -> None:
    """armlet's duration is at most 1e-4 longer than toppra's, and at most 5e-3 shorter (relative).

    toppra keeps a constant path acceleration within the limits at both ends of a segment, so its grid makes it slower by about 1e-3.
    """
    rng = np.random.default_rng(11)
    for k in range(20):
        q, s = rng.uniform(-1.0, 1.0, (5, 7)), np.linspace(0.0, 1.0, 5)
        v_max = 2.0 if k % 2 else None
        p = al.time_path(ARM, q, knots=s, tau_max=TAU_MAX, v_max=v_max, check_limits=False)
        theirs = peer(q, s, v_max, DiscretizationType.Interpolation)
        assert p.feasible == np.isfinite(theirs), p.reason
        if p.feasible:
            assert -5e-3 <= p.duration / theirs - 1.0 <= 1e-4, k


@pytest.mark.parametrize("size", [1e-16, 1e-12, 1e-8, 1e-6])
def test_tiny_moves(size: float) -> None:
    """Very short moves are feasible, although toppra may find no timing.

    From rest and under the same torque limits, a short straight line scaled by c takes sqrt(c) times as long.
    """
    q0 = np.array([0.0, 0.3, 0.0, -1.2, 0.0, 1.0, 0.0])
    line = np.array([1.0, -0.5, 0.3, 0.2, -1.0, 0.4, 0.6])
    light = ARM.with_gravity([0.0, 0.0, 0.0])
    tiny = al.time_path(light, [size * 0.0 * line, size * line], tau_max=TAU_MAX, check_limits=False)
    small = al.time_path(light, [0.0 * line, 1e-5 * line], tau_max=TAU_MAX, check_limits=False)
    # Along the longer line the dynamics change by a relative 1e-5.
    assert tiny.feasible and tiny.duration == pytest.approx(small.duration * np.sqrt(size / 1e-5), rel=1e-4)
    assert al.time_path(ARM, [q0, q0 + max(size, 1e-15) * line], tau_max=TAU_MAX, check_limits=False).feasible
