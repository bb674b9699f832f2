"""Rest-to-rest motions under limits of speed, acceleration and jerk: within the limits, synchronous, as fast as the closed form."""

from __future__ import annotations

import math
import pickle
import sys
from typing import Any

import models
import numpy as np
import pytest

import armlet as al


def test_random_moves() -> None:
    """Distances span 13 and limits 9 orders of magnitude. Every joint is at rest at both ends, and every limit is respected."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        n = int(rng.integers(1, 8))
        q0 = rng.uniform(-3.0, 3.0, n)
        q1 = q0 + rng.uniform(-1.0, 1.0, n) * 10.0 ** rng.uniform(-12.0, 1.0)
        if n > 1 and rng.random() < 0.3:
            q1[rng.integers(n)] = q0[rng.integers(n)]
        v_max, a_max, j_max = (10.0 ** rng.uniform(-3.0, 6.0, n) for _ in range(3))
        p = al.point_to_point(q0, q1, v_max, a_max, j_max)
        # The limits are compared in scaled numbers of order one, so the tolerance is a few rounding errors.
        assert p.margin >= -1e-14 and np.isfinite(p.duration)
        t = np.linspace(0.0, p.duration, 300)
        q, v, a = p(t)
        assert np.all(np.abs(v) <= v_max * (1 + 1e-9)) and np.all(np.abs(a) <= a_max * (1 + 1e-9))
        rises = np.abs(np.diff(a, axis=0)) / np.diff(t)[:, None]
        # Differences of accelerations near a_max have the rounding error 1e-16 a_max per step.
        assert np.all(rises[:-1] <= j_max * (1 + 1e-9) + 1e-15 * a_max / t[1])
        np.testing.assert_array_equal(q[-1], q1)
        # Just before the end, the motion reaches the goal up to rounding of the phases. After the end the goal is held.
        almost = p(p.duration * (1.0 - 1e-9))[0]
        np.testing.assert_allclose(almost, q1, rtol=0.0, atol=1e-9 * np.abs(q1 - q0).max() + 1e-15 * np.abs(q1).max())


def test_closed_forms() -> None:
    """One active limit: jerk T = (32 d / j)^(1/3), acceleration 2 sqrt(d / a), speed d / v. The slowest joint determines the time."""
    d, far = 0.8, 1e4
    assert al.point_to_point([0.0], [d], far, far, 5.0).duration == pytest.approx((32.0 * d / 5.0) ** (1.0 / 3.0), rel=1e-9)
    # A large jerk limit adds about a/j to the duration.
    assert al.point_to_point([0.0], [d], far, 2.0, 1e7).duration == pytest.approx(2.0 * math.sqrt(d / 2.0), rel=1e-5)
    assert al.point_to_point([0.0], [d], 0.1, 1e5, 1e9).duration == pytest.approx(d / 0.1, rel=1e-4)
    alone = al.point_to_point([0.0], [1.0], 1.0, 2.0, 10.0).duration
    assert al.point_to_point([0.0, 0.0], [1.0, -0.1], 1.0, 2.0, 10.0).duration == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize(("v_max", "j_max"), [(1e20, 1e20), (1e7, 1e13), (10.0, 1e13)])
def test_phases_shorter_than_rounding(v_max: float, j_max: float) -> None:
    """With these jerk limits, the phases of nonzero jerk are shorter than a rounding error. The duration is 2 sqrt(d / a)."""
    p = al.point_to_point([0.0, 0.0], [1.0, -2.0], v_max, [1.0, 2.0], j_max)
    assert p.duration == pytest.approx(2.0, rel=1e-3) and p.margin >= -1e-14
    np.testing.assert_array_equal(p(p.duration)[0], [1.0, -2.0])


def test_start_and_goal_are_equal() -> None:
    p = al.point_to_point([1.0, 2.0], [1.0, 2.0], 1.0, 1.0, 1.0)
    assert p.feasible and p.duration == 0.0
    np.testing.assert_array_equal(p(3.0), [[1.0, 2.0], [0.0, 0.0], [0.0, 0.0]])


def test_in_a_loop() -> None:
    arm = models.TWO_LINKS
    p = al.point_to_point([0.0, 0.0], [1.0, -0.5], 1.0, 4.0, 40.0)
    run = al.simulate(al.RigidArm(arm), al.ComputedTorque(arm, p, 100.0, 20.0), [0.0, 0.0], t_end=p.duration, method="dop853", rtol=1e-10)
    # The run follows the motion to 2e-10 rad.
    np.testing.assert_allclose(run.q, p(run.t)[0], atol=1e-7)
    again = pickle.loads(pickle.dumps(p))
    assert again == p and type(again) is al.TimedPath


@pytest.mark.parametrize("name", ["q0", "q1", "v_max", "a_max", "j_max"])
@pytest.mark.parametrize("bad", [math.nan, "1", 1j, [1.0, math.inf], [[1.0]], [1.0, 2.0, 3.0], None, True], ids=repr)
def test_refusals(name: str, bad: Any) -> None:
    given: dict[str, Any] = {"q0": [0.0, 0.0], "q1": [1.0, 1.0], "v_max": 1.0, "a_max": 1.0, "j_max": 1.0}
    given[name] = bad
    wanted = "q1" if name == "q0" and bad == [1.0, 2.0, 3.0] else name
    with pytest.raises(al.InputError, match=rf"^point_to_point: {wanted} "):
        al.point_to_point(**given)


@pytest.mark.parametrize("name", ["v_max", "a_max", "j_max"])
@pytest.mark.parametrize("bad", [0.0, -1.0, [1.0, 0.0]], ids=repr)
def test_limits_are_positive(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^point_to_point: {name} is not positive"):
        al.point_to_point([0.0, 0.0], [1.0, 1.0], **{"v_max": 1.0, "a_max": 1.0, "j_max": 1.0, name: bad})


def test_without_ruckig(monkeypatch: pytest.MonkeyPatch) -> None:
    """If Ruckig is missing, one line names the package to install."""
    monkeypatch.setitem(sys.modules, "ruckig", None)
    with pytest.raises(
        ImportError, match=r"^point_to_point: ruckig is not installed: pip install '\.\[ruckig\]' in the folder of armlet's sources$"
    ):
        al.point_to_point([0.0], [1.0], 1.0, 1.0, 1.0)
