"""Inverse kinematics against the reference, which searches by least squares: whether tasks are reached, and the remaining errors.

The two libraries may find different solutions. The tests compare that both are solutions, and that neither has a smaller error.
"""

from __future__ import annotations

from typing import Any

import models
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
    """The first task is the position x, y of a pose within the limits. The second is the height of the centre of mass in this pose."""
    arm, theirs, frame, rng = pair(n, seed)
    q = rng.uniform(0.9 * theirs.limits["lower"], 0.9 * theirs.limits["upper"])
    aims = (theirs.pose(q, frame)[:2, 3], theirs.center_of_mass(q)[2:])

    def tasks(lib: Any) -> list[Any]:
        return [lib.Task(frame, "xy", aims[0]), lib.CentreOfMassTask("z", aims[1])]

    found, want = (lib.inverse_kinematics(each, tasks(lib), np.zeros(n)) for lib, each in ((al, arm), (ref, theirs)))
    assert want.reached == [True, True] == list(found.reached)
    # armlet's solution satisfies the tasks of the reference.
    for task in tasks(ref):
        assert float(np.abs(task.error(theirs, found.q, task.motion(0.0)[0])).max()) <= 1.1e-9
    assert np.all((found.q >= theirs.limits["lower"]) & (found.q <= theirs.limits["upper"]))


@pytest.mark.parametrize("limits", [True, False])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_what_is_out_of_reach(n: int, limits: bool) -> None:
    """A point some metres away: neither library reaches it.

    Both libraries minimise the norm of the error, so armlet's result is at least as near as the reference's.
    """
    arm, theirs, frame, rng = pair(n, 4)
    point = 5.0 * rng.normal(size=3)
    tasks = [[lib.Task(frame, "xyz", point)] for lib in (al, ref)]
    found = al.inverse_kinematics(arm, tasks[0], np.zeros(n), limits=limits)
    want = ref.inverse_kinematics(theirs, tasks[1], np.zeros(n), limits=limits)
    bounded = limits or "prismatic" not in arm.joint_types
    assert list(found.reached) == want.reached
    if bounded:
        assert want.reached == [False] and found.status is al.Status.INFEASIBLE
        nearest, other = (np.linalg.norm(each.errors[0]) for each in (found, want))
        assert nearest <= other * (1.0 + 1e-12)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-3])
def test_a_conflict_is_settled_by_rank(tolerance: float) -> None:
    """A posture task conflicts with a position task of higher priority.

    The arm reaches the position, and both libraries find the same least error of the posture.
    """
    arm, theirs = models.THREE_LINKS, models.REFERENCE_THREE_LINKS
    given = ([0.6, 0.5], [1.5, -1.0, 0.3])
    tasks = [[lib.Task("link3", "xy", given[0]), lib.PostureTask(given[1])] for lib in (al, ref)]
    found = al.inverse_kinematics(arm, tasks[0], [0.3, 0.4, 0.5], tolerance=tolerance)
    want = ref.inverse_kinematics(theirs, tasks[1], [0.3, 0.4, 0.5], tolerance=tolerance)
    assert list(found.reached) == want.reached == [True, False]
    assert found.status is al.Status.DEGRADED
    # armlet ends at a minimum. The reference has a flat minimum, because it weights the position by 1e6, and ends within a hundredth.
    ours, other = (np.linalg.norm(each.errors[1]) for each in (found, want))
    assert 0.99 * other <= ours <= other * (1.0 + 1e-9)


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
    """With every method and option, the solution of armlet satisfies the tasks of the reference."""
    arm, theirs, frame, rng = pair(6, 0)
    q = rng.uniform(0.8 * theirs.limits["lower"], 0.8 * theirs.limits["upper"])
    aims = (theirs.pose(q, frame)[:2, 3], theirs.center_of_mass(q)[2:])
    found = al.inverse_kinematics(arm, [al.Task(frame, "xy", aims[0]), al.CentreOfMassTask("z", aims[1])], 0.5 * q, **options)
    # Chiaverini's method solves each level separately, so the second level may remain unsolved.
    assert found.reached[0] and (found.reached[1] or options == {"method": "chiaverini"})
    levels = ((ref.Task(frame, "xy"), aims[0]), (ref.CentreOfMassTask("z"), aims[1]))
    for (task, aim), reached in zip(levels, found.reached, strict=True):
        assert not reached or float(np.abs(task.error(theirs, found.q, aim)).max()) <= 1.1e-9


@pytest.mark.parametrize("n", range(1, 9))
def test_many_targets(n: int) -> None:
    """Leading axes of starts and targets broadcast as in the reference. Each row of armlet's result satisfies the reference's task."""
    arm, theirs, frame, rng = pair(n, 7)
    q = rng.uniform(0.8 * theirs.limits["lower"], 0.8 * theirs.limits["upper"], (2, n))
    aims = (np.array([theirs.pose(row, frame)[:2, 3] for row in q])[:, None], theirs.center_of_mass(q[0])[2:])
    starts = np.clip(q[0] + rng.uniform(-0.3, 0.3, (3, n)), theirs.limits["lower"], theirs.limits["upper"])
    found = al.inverse_kinematics(arm, [al.Task(frame, "xy", aims[0])], starts)
    want = ref.inverse_kinematics(theirs, [ref.Task(frame, "xy", aims[0])], starts)
    assert found.q.shape == want.q.shape == (2, 3, n) and found.errors[0].shape == want.errors[0].shape == (2, 3, 2)
    assert found.reached.tolist() == want.reached.tolist() == [[True] * 3] * 2
    assert found and found.status.tolist() == [[0] * 3] * 2
    # 1.1e-9 is the tolerance plus the rounding of the reference's evaluation.
    for i, j in np.ndindex(2, 3):
        assert np.abs(ref.Task(frame, "xy").error(theirs, found.q[i, j], aims[0][i, 0])).max() <= 1.1e-9
    both = [[lib.Task(frame, "xy", aims[0]), lib.CentreOfMassTask("z", aims[1])] for lib in (al, ref)]
    # The centre of mass of the second row may be out of reach, so the test allows few restarts.
    two = al.inverse_kinematics(arm, both[0], starts[0], restarts=2)
    other = ref.inverse_kinematics(theirs, both[1], starts[0], restarts=1)
    assert two.q.shape == other.q.shape == (2, 1, n) and [e.shape for e in two.errors] == [e.shape for e in other.errors]
    assert two.reached[0, 0] and other.reached[0, 0]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_several_solutions(count: int) -> None:
    """Both elbow solutions of a planar arm are found, the nearer one first. A third solution does not exist and is NaN."""
    arm, theirs = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    points = np.array([[0.3, 0.5], [-0.2, 0.4], [2.0, 0.0]])
    found = al.inverse_kinematics(arm, [al.Task("link2", "xy", points)], [0.1, 0.2], solutions=count)
    want = ref.inverse_kinematics(theirs, [ref.Task("link2", "xy", points)], [0.1, 0.2], solutions=count)
    assert found.q.shape == want.q.shape == (3, count, 2) and found.errors[0].shape == want.errors[0].shape
    assert found.reached.tolist() == want.reached.tolist()
    here = min(count, 2)
    # Both solutions err by the tolerance divided by the smallest singular value. Joints without limits may differ by full turns.
    gap = found.q[:2, :here] - want.q[:2, :here]
    if count == 2:
        order = np.argsort(np.sin(found.q[:2, :here, 1])), np.argsort(np.sin(want.q[:2, :here, 1]))
        gap = np.take_along_axis(found.q[:2, :here], order[0][..., None], 1) - np.take_along_axis(want.q[:2, :here], order[1][..., None], 1)
        assert np.abs(np.exp(1j * gap) - 1.0).max() < 1e-7
    for each in (found, want):
        away = np.linalg.norm(each.q[:2, :here] - [0.1, 0.2], axis=-1)
        assert np.all(np.diff(away, axis=1) >= 0.0)
