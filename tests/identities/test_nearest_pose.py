"""Inverse kinematics of targets that cannot be reached: the result is a local minimum of the squared error within the joint limits.

The conditions of Karush, Kuhn and Tucker are for `g = -J' e`: it is zero between the limits, not negative at a lower limit
and not positive at an upper limit. Closed forms: a stretched arm, and a slide at its end.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from trees import driven_tree

import armlet as al
from armlet import reference as ref

ROWS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
SCARA = al.Arm.from_chain(
    [
        {"type": "R", "xyz": [0, 0, 0.387]},
        {"type": "R", "xyz": [0.325, 0, 0]},
        {"type": "P", "xyz": [0.275, 0, 0], "rpy": [np.pi, 0, 0], "lower": 0.0, "upper": 0.21},
        {"type": "R"},
    ]
)


def slope_within_limits(arm: al.Arm, q: np.ndarray, g: np.ndarray) -> float:
    """The largest entry of the slope `g` along which a joint can decrease the squared error."""
    low, high = (np.asarray(arm.limits[name]) for name in ("q_min", "q_max"))
    return float(np.abs(np.where(q <= low, np.minimum(g, 0.0), np.where(q >= high, np.maximum(g, 0.0), g))).max())


@pytest.mark.parametrize("radius", [0.9 + 1e-6, 0.91, 1.0, 1.5, 3.0, 10.0, 1e3])
def test_a_stretched_arm_points_at_its_target(radius: float) -> None:
    arm = models.TWO_LINKS
    aim = np.array([np.cos(0.7), np.sin(0.7)])
    found = al.inverse_kinematics(arm, [al.Task("link2", "xy", radius * aim)], [0.1, 0.2])
    assert found.status is al.Status.INFEASIBLE
    # Near the reach, the error hardly depends on the elbow: its curvature is the distance of 1e-6 m.
    np.testing.assert_allclose(arm.position(found.q, "link2")[:2], 0.9 * aim, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.09])
def test_a_folded_arm_is_nearest_to_a_target_inside(radius: float) -> None:
    """The tip of links of 0.5 m and 0.4 m cannot be nearer to the shoulder than 0.1 m."""
    arm = models.TWO_LINKS
    found = al.inverse_kinematics(arm, [al.Task("link2", "xy", [radius, 0.0])], [0.1, 0.2])
    tip = arm.position(found.q, "link2")[:2]
    assert np.linalg.norm(tip - [radius, 0.0]) == pytest.approx(0.1 - radius, abs=1e-12)


@pytest.mark.parametrize("z", [0.15, 0.0, -2.0, 0.9])
def test_a_slide_stops_at_its_end(z: float) -> None:
    """The height of the flange is between 0.177 m and 0.387 m. The other coordinates are reached."""
    found = al.inverse_kinematics(SCARA, [al.Task("link4", "xyz", [0.4, 0.1, z])], [0.1, 0.2, 0.1, 0.1])
    expected = [0.4, 0.1, min(max(z, 0.177), 0.387)]
    np.testing.assert_allclose(SCARA.position(found.q, "link4"), expected, rtol=0.0, atol=1e-11)
    assert found.status is al.Status.INFEASIBLE


@pytest.mark.parametrize("order", [0, 1])
def test_a_lower_level_uses_what_is_left(order: int) -> None:
    """Height and position as two levels, in both orders: the height ends at the limit, and the position is reached."""
    tasks = [al.Task("link4", "z", [0.1]), al.Task("link4", "xy", [0.4, 0.1])][:: 1 - 2 * order]
    found = al.inverse_kinematics(SCARA, tasks, [0.1, 0.2, 0.1, 0.1])
    np.testing.assert_allclose(SCARA.position(found.q, "link4"), [0.4, 0.1, 0.177], rtol=0.0, atol=1e-9)
    assert found.reached == [bool(order), not order]


@pytest.mark.parametrize("axes", ["xyz", "xy", "z", "rx ry rz", "xyz rx ry rz"])
@pytest.mark.parametrize("n", range(1, 9))
def test_conditions_of_a_minimum(n: int, axes: str) -> None:
    """Random trees with joint limits and targets, most of them out of reach."""
    rows = [ROWS[axis] for axis in axes.replace("xyz", "x y z").replace("xy", "x y").split()]
    for seed in range(3):
        arm, _ = driven_tree(n, seed)
        frame, rng = arm.frame_names[-1], np.random.default_rng([n, seed, len(rows)])
        target = np.where(np.array(rows) < 3, 3.0, 1.0) * rng.normal(size=len(rows))
        found = al.inverse_kinematics(arm, [al.Task(frame, axes, target)], np.zeros(n), restarts=5)
        assert found.status in (al.Status.SUCCESS, al.Status.INFEASIBLE)
        e, J = found.errors[0], arm.jacobian(found.q, frame)[rows]
        # The tolerance is relative to an arm of one metre, because a Jacobian may vanish at the minimum; and some rounding errors of J.
        assert slope_within_limits(arm, found.q, -J.T @ e) <= 1e-9 * (1.0 + np.linalg.norm(J)) * np.linalg.norm(e) + 1e-14


@pytest.mark.parametrize("n", [3, 5, 7])
def test_levels_below_an_unreached_level(n: int) -> None:
    """A point out of reach and a posture: both levels have errors as small as those of the reference, which weights the levels."""
    arm, theirs = driven_tree(n, 4)
    frame = arm.frame_names[-1]
    rng = np.random.default_rng(n)
    given = (5.0 * rng.normal(size=3), 0.3 * rng.normal(size=n))

    def tasks(lib: Any) -> list[Any]:
        return [lib.Task(frame, "xyz", given[0]), lib.PostureTask(given[1])]

    found = al.inverse_kinematics(arm, tasks(al), np.zeros(n))
    want = ref.inverse_kinematics(theirs, tasks(ref), np.zeros(n))
    assert found.status is al.Status.INFEASIBLE and want.reached == [False, False]
    first, second = ([float(np.linalg.norm(e)) for e in each.errors] for each in (found, want))
    assert first[0] <= second[0] * (1.0 + 1e-9)
    # The minima of the point may be isolated, and the libraries may end at different ones with nearly the same distance.
    if first[0] > second[0] * (1.0 - 1e-9):
        assert first[1] <= second[1] * (1.0 + 1e-4)


def test_batches_are_single_calls() -> None:
    arm = models.THREE_LINKS
    points = np.array([[2.0, 0.3], [0.5, 0.4], [-1.5, -1.5]])
    rows = al.inverse_kinematics(arm, [al.Task("link3", "xy", points)], [0.1, 0.2, 0.3], solutions=2)
    for i, point in enumerate(points):
        one = al.inverse_kinematics(arm, [al.Task("link3", "xy", point)], [0.1, 0.2, 0.3], solutions=2)
        np.testing.assert_array_equal(rows.q[i], one.q)
    np.testing.assert_allclose(arm.position(rows.q[0, 0], "link3")[:2], 1.2 * points[0] / np.linalg.norm(points[0]), atol=1e-11)
