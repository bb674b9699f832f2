"""The certificate of every method, also near singularities, with strong damping, and where no bound is active."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
LIMITS: dict[str, list[dict[str, Any]]] = {method: [{}, {"v_max": 1.0}] for method in ("exact", "clamp", "damped")}
LIMITS["sns"] = [{"v_max": 1.0}, {"v_max": 1e16}]


def near_singular(rng: np.random.Generator) -> tuple[list[Array], list[Array]]:
    """Levels in which one row is a mixture of rows above it, apart from 1e-14 to 0.1."""
    n = int(rng.integers(2, 8))
    jacobians = [rng.normal(size=(int(rng.integers(1, 4)), n)) for _ in range(int(rng.integers(1, 4)))]
    k = int(rng.integers(0, len(jacobians)))
    above = np.vstack(jacobians[: k + 1])[:-1]
    jacobians[k][-1] = rng.normal(size=len(above)) @ above + 10 ** rng.uniform(-14.0, -1.0) * rng.normal(size=n)
    return jacobians, [rng.normal(size=len(J)) for J in jacobians]


@pytest.mark.parametrize("method", LIMITS)
def test_near_singular_stacks_have_a_certificate(method: str) -> None:
    rng, worst = np.random.default_rng(2), 0.0
    for _ in range(1500):
        stack = near_singular(rng)
        worst = max([worst, *(al.solve_priority(*stack, method=method, **limits).certificate for limits in LIMITS[method])])
    # Rounding errors of 2e-16, multiplied by the condition numbers of up to 9 rows.
    assert worst < 1e-9


@pytest.mark.parametrize("method", ["clamp", "damped"])
@pytest.mark.parametrize("limits", [{}, {"v_max": 1.0}])
def test_strongly_damped_stacks_have_a_certificate(method: str, limits: dict[str, float]) -> None:
    """The threshold is up to 1e5 times the rows, so that penalty rows are much longer than the rows of the level."""
    rng, worst = np.random.default_rng(3), 0.0
    for k in range(1500):
        J = rng.integers(-2, 3, size=(6, 5)).astype(float)
        J[5], J[rng.integers(6)] = (J[5], J[0] + J[2])[k % 2], (J[0], np.zeros(5))[k % 3 == 0]
        low = rng.integers(-3, 4, 6).astype(float)
        high = low + np.r_[0, 0, rng.integers(0, 3, 2), 0, 0]
        unit = np.repeat(10.0 ** rng.uniform(-6.0, 6.0, 3), 2)
        rows, low, high = J * unit[:, None], low * unit, high * unit
        stack = [rows[:2], rows[2:4], rows[4:]], [low[:2], al.Within(low[2:4], high[2:4]), low[4:]]
        worst = max(worst, al.solve_priority(*stack, method=method, eps=0.3, **limits).certificate)
    assert worst < 1e-9


def test_runs_of_sns_have_a_certificate_where_no_bound_is_active() -> None:
    """The tip moves slowly at first, and then faster than the speed limits allow."""
    arm = models.SEVEN_AXES
    task = al.Task(arm.tip_frame, "xyz", al.Quintic([0.4, 0.2, 0.5], [0.5, -0.3, 0.4], 0.5), 5.0)
    law = al.PriorityVelocity(arm, [task], "sns", v_max=0.6)
    q0 = al.inverse_kinematics(arm, [al.Task(arm.tip_frame, "xyz", [0.4, 0.2, 0.5])], [0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4]).q
    run = al.simulate(al.VelocityArm(arm), law, q0, t_end=0.5, dt=0.01)
    held = np.abs(run.tau).max(axis=1) > 0.6 - 1e-12
    assert held.any() and not held.all()
    assert np.isfinite(run.monitors["kkt"]).all() and run.monitors["kkt"].max() < 1e-9
