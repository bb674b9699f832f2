"""Timings of paths against a planner with another method, and motions from rest to rest against closed formulas.

armlet sweeps a grid of path positions forwards and backwards. The reference solves one convex problem on its own grid.
"""

from __future__ import annotations

import re
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import reference
from armlet.reference import timing

WAYPOINTS = np.array([[0.0, 0.0], [0.5, 0.8], [1.2, 0.3], [1.0, -0.5], [0.2, -0.2]])
LIMITS: dict[str, Any] = {"tau_max": [20.0, 8.0]}
VARYING = np.array([[4.0, 3.0], [2.0, 3.0], [3.0, 1.5], [3.0, 3.0], [4.0, 2.0]])
#: Options that need more than 121 grid points of the reference.
FINER = {"spline", "tip_speed", "v_max"}


def durations(path: Any, points: int = 121, **options: Any) -> tuple[float, float]:
    """Return the durations in s that armlet and the reference compute."""
    arms = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    if options.get("friction") is True:
        drives = {"damping": [0.8, 0.3], "friction": [0.4, 0.1]}
        arms = arms[0].with_drives(**drives), arms[1].with_drives(**drives)
    p = al.time_path(arms[0], path, **options)
    assert p.feasible
    own = {name: value for name, value in options.items() if name not in ("grid", "refine")}
    return p.duration, reference.time_path(arms[1], path, grid=points, **own).duration


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "tolerance"),
    [
        ({}, 5e-4),
        ({"tau_max": [[-15.0, 20.0], [-9.0, 7.0]], "v_max": 4.0}, 5e-4),
        ({"v_max": [3.0, 2.0], "a_max": [15.0, 20.0]}, 5e-4),
        ({"tau_max": None, "a_max": 5.0}, 5e-4),
        ({"stops": [1, 3]}, 5e-4),
        ({"knots": [0.0, 0.2, 0.5, 0.8, 1.0]}, 5e-4),
        # The limits have a corner where the direction of the path changes fast. The error decreases with the step.
        ({"spline": "not-a-knot"}, 2e-3),
        # At rest with q' = 0 the path speed is unbounded, so the error of the duration is about a step of the grid.
        ({"spline": "clamped"}, 2e-2),
        ({"start_speed": 0.3, "end_speed": 0.5}, 5e-4),
        ({"grid": 401, "refine": False}, 2e-3),
        # The reference bounds the speed only at its nodes, so its error decreases with the step.
        ({"tip_speed": 0.8, "frame": "link2"}, 6e-3),
        ({"tip_acceleration": 6.0, "frame": "link2"}, 5e-4),
        ({"tau_max": None, "tip_acceleration": 6.0, "tip_speed": 0.7, "frame": "link2"}, 1e-3),
        ({"tip_speed": [0.9, 0.4, 0.8, 0.6, 1.0], "frame": "link2"}, 6e-3),
        ({"tip_acceleration": [6.0, 2.0, 5.0, 3.0, 8.0], "frame": "link2"}, 1e-3),
        ({"tip_acceleration": lambda s: 4.0 + 3.0 * np.cos(5.0 * s), "frame": "link2"}, 1e-3),
        ({"v_max": VARYING, "a_max": 8.0 * VARYING}, 1e-3),
        ({"tau_max": 5.0 * VARYING}, 5e-4),
        ({"v_max": lambda s: 2.0 + np.sin(3.0 * s)}, 5e-4),
    ],
    # Without addresses of functions, several processes have the same names of the cases.
    ids=lambda case: re.sub(r"<function .*? at \w+>", "function", str(case)),
)
def test_time_path(options: dict[str, Any], tolerance: float) -> None:
    """Durations agree within the tolerance of each option.

    The reference has a grid of 121 or 241 points. armlet refines its grid until the time changes by less than 1e-4.
    """
    ours, theirs = durations(WAYPOINTS, 241 if FINER & options.keys() else 121, **LIMITS | options)
    assert ours == pytest.approx(theirs, rel=tolerance)
    if options:
        plain = al.time_path(models.TWO_LINKS, WAYPOINTS, **LIMITS).duration
        assert abs(ours / plain - 1.0) > 1e-9


@pytest.mark.parametrize("friction", [True, [1.5, 0.5]], ids=["drives", "viscous"])
def test_friction(friction: Any) -> None:
    """With viscous friction the limits are curves, which armlet replaces by tangents.

    This makes its duration longer than that of the reference, by at most 3e-3.
    """
    ours, theirs = durations(WAYPOINTS, **LIMITS, friction=friction)
    plain = al.time_path(models.TWO_LINKS, WAYPOINTS, **LIMITS).duration
    assert -5e-4 < ours / theirs - 1.0 < 3e-3
    assert abs(ours / plain - 1.0) > 4e-3


def swing(s: float) -> Any:
    return np.array([np.sin(2.0 * s), 0.8 * s - s**3])


def test_paths_that_are_functions() -> None:
    """Both libraries replace a function by a spline through samples. A function that also returns derivatives is the path itself.

    The path starts where it is fastest. The 121 points of the reference are less accurate there.
    """

    def whole(s: float) -> Any:
        return swing(s), np.array([2.0 * np.cos(2.0 * s), 0.8 - 3.0 * s**2]), np.array([-4.0 * np.sin(2.0 * s), -6.0 * s])

    for path, samples in ((swing, 201), (swing, 11), (whole, 201)):
        ours, theirs = durations(path, **LIMITS, samples=samples)
        assert ours == pytest.approx(theirs, rel=2e-3)


def test_a_limited_rate_of_the_torque() -> None:
    """With a limit of the torque rate, the reference's torques are within all limits.

    The duration is longer than the optimum without this limit.
    """
    arms = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    limits, rate = np.array([20.0, 8.0]), np.array([400.0, 200.0])
    p = al.time_path(arms[0], WAYPOINTS, tau_max=limits, torque_rate=rate)
    t = np.linspace(0.0, p.duration, 4001)
    tau, _ = timing.torques(arms[1], *p(t))
    assert timing.excess(tau, limits) <= 1e-9
    # Differences over 1/4000 of the duration are mean rates of the torque.
    assert timing.excess(np.diff(tau, axis=0) / np.diff(t)[:, None], rate) <= 1e-6
    assert p.duration > reference.time_path(arms[1], WAYPOINTS, tau_max=limits, grid=121).duration


def test_position_limits() -> None:
    arms = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    for keywords in ({"q_max": 1.2}, {"q_min": [-1.0, -0.5]}):
        assert not al.time_path(arms[0], WAYPOINTS, **LIMITS, **keywords).feasible
        assert np.isnan(reference.time_path(arms[1], WAYPOINTS, grid=31, **LIMITS, **keywords).duration)
    ours, theirs = durations(WAYPOINTS, **LIMITS, q_min=-1.0, q_max=[1.3, 1.0])
    assert ours == pytest.approx(theirs, rel=5e-4)


def test_paths_that_the_arm_cannot_hold_are_infeasible() -> None:
    arms = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    path = [[-np.pi / 2, 0.0], [np.pi / 4, 0.0]]
    assert not al.time_path(arms[0], path, tau_max=[2.0, 8.0]).feasible
    assert np.isnan(reference.time_path(arms[1], path, tau_max=[2.0, 8.0]).duration)


def test_point_to_point() -> None:
    """Durations agree with Ruckig's phases to 1e-7, and no limit is exceeded.

    armlet slows the motion down where it exceeds a limit.
    """
    rng = np.random.default_rng(3)
    for n in (1, 2, 5, 8):
        q0, q1 = rng.uniform(-2.0, 2.0, (2, n))
        limits = 10.0 ** rng.uniform(-0.5, [[0.7], [1.2], [2.0]], (3, n))
        p = al.point_to_point(q0, q1, *limits)
        assert p.duration == pytest.approx(reference.point_to_point(q0, q1, *limits).max(), rel=1e-7)
        t = np.linspace(0.0, p.duration, 2001)
        q, v, a = p(t)
        # The acceleration is continuous, so its difference over a step is at most the jerk limit times the step.
        jerk = np.abs(np.diff(a, axis=0)).max(axis=0) / t[1]
        for used, limit in zip((np.abs(v).max(axis=0), np.abs(a).max(axis=0), jerk), limits, strict=True):
            assert np.all(used <= limit * (1.0 + 1e-9))
        np.testing.assert_allclose(q[[0, -1]], [q0, q1], rtol=0.0, atol=1e-12)
