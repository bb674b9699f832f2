"""Inverse kinematics against the reference, which searches by least squares without bounds: whether tasks are reached, and how near.

Which of the solutions is found is free; that it is one, and that none is nearer, is compared.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from trees import driven_tree

import armlet as al
from armlet import reference as ref


def pair(n: int, seed: int) -> tuple[al.Arm, Any, str, np.random.Generator]:
    arm, theirs = driven_tree(n, seed)
    return arm, theirs, arm.frame_names[-1], np.random.default_rng([n, seed])


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("n", range(1, 9))
def test_what_is_in_reach(n: int, seed: int) -> None:
    """The rows of a pose within the limits, and below them a centre of mass of the same pose."""
    arm, theirs, frame, rng = pair(n, seed)
    q = rng.uniform(0.9 * theirs.limits["lower"], 0.9 * theirs.limits["upper"])
    aims = (theirs.pose(q, frame)[:2, 3], theirs.center_of_mass(q)[2:])

    def tasks(lib: Any) -> list[Any]:
        return [lib.Task(frame, "xy", aims[0]), lib.CentreOfMassTask("z", aims[1])]

    found, want = (lib.inverse_kinematics(each, tasks(lib), np.zeros(n)) for lib, each in ((al, arm), (ref, theirs)))
    assert want.reached == [True, True] == list(found.reached)
    # What one of them found is a solution to the other.
    for task in tasks(ref):
        assert float(np.abs(task.error(theirs, found.q, task.motion(0.0)[0])).max()) <= 1.1e-9
    assert np.all((found.q >= theirs.limits["lower"]) & (found.q <= theirs.limits["upper"]))


@pytest.mark.parametrize("limits", [True, False])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_what_is_out_of_reach(n: int, limits: bool) -> None:
    """A point some metres away: neither reaches it, neither is nearer by its own measure, to a thousandth."""
    arm, theirs, frame, rng = pair(n, 4)
    point = 5.0 * rng.normal(size=3)
    tasks = [[lib.Task(frame, "xyz", point)] for lib in (al, ref)]
    found = al.inverse_kinematics(arm, tasks[0], np.zeros(n), limits=limits)
    want = ref.inverse_kinematics(theirs, tasks[1], np.zeros(n), limits=limits)
    bounded = limits or "prismatic" not in arm.joint_types
    assert list(found.reached) == want.reached
    if bounded:
        assert want.reached == [False] and found.status is al.Status.INFEASIBLE
        # Of several starts the core keeps the one whose largest entry is least.
        nearest, other = (np.abs(each.errors[0]).max() for each in (found, want))
        assert nearest <= other * 1.001 and np.linalg.norm(want.errors[0]) <= np.linalg.norm(found.errors[0]) * 1.001


@pytest.mark.parametrize("tolerance", [1e-9, 1e-3])
def test_a_conflict_is_settled_by_rank(tolerance: float) -> None:
    """A posture below a point that it contradicts: the point is reached, and no posture on it is nearer."""
    arm, theirs = al.planar_arm([0.5, 0.4, 0.3]), ref.planar_arm([0.5, 0.4, 0.3])
    given = ([0.6, 0.5], [1.5, -1.0, 0.3])
    tasks = [[lib.Task("link3", "xy", given[0]), lib.PostureTask(given[1])] for lib in (al, ref)]
    found = al.inverse_kinematics(arm, tasks[0], [0.3, 0.4, 0.5], tolerance=tolerance)
    want = ref.inverse_kinematics(theirs, tasks[1], [0.3, 0.4, 0.5], tolerance=tolerance)
    assert list(found.reached) == want.reached == [True, False]
    assert found.status is al.Status.DEGRADED
    # The least posture error is flat about its minimum: steps of the core end on progress below a thousandth.
    assert np.linalg.norm(found.errors[1]) == pytest.approx(np.linalg.norm(want.errors[1]), rel=0.01)


WAYS: list[dict[str, Any]] = [
    *({"method": method} for method in ("clamp", "damped", "exact", "chiaverini")),
    {"eps": 0.01},
    {"eps": [0.05, 0.01]},
    {"step_max": 0.1, "max_iterations": 400},
    {"max_iterations": 8, "restarts": 400},
    {"restarts": 20, "seed": 7},
]


@pytest.mark.parametrize("options", WAYS, ids=str)
def test_ways_to_search(options: dict[str, Any]) -> None:
    """Whatever the steps are: what is found is a solution to the reference."""
    arm, theirs, frame, rng = pair(6, 0)
    q = rng.uniform(0.8 * theirs.limits["lower"], 0.8 * theirs.limits["upper"])
    aims = (theirs.pose(q, frame)[:2, 3], theirs.center_of_mass(q)[2:])
    found = al.inverse_kinematics(arm, [al.Task(frame, "xy", aims[0]), al.CentreOfMassTask("z", aims[1])], 0.5 * q, **options)
    # Chiaverini's steps solve each level alone, and the lower one comes second to that.
    assert found.reached[0] and (found.reached[1] or options == {"method": "chiaverini"})
    levels = ((ref.Task(frame, "xy"), aims[0]), (ref.CentreOfMassTask("z"), aims[1]))
    for (task, aim), reached in zip(levels, found.reached, strict=True):
        assert not reached or float(np.abs(task.error(theirs, found.q, aim)).max()) <= 1.1e-9
