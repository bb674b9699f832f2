"""Inverse kinematics of many targets: results equal single calls to the last bit, a row may fail alone, several solutions."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

SEVEN = models.SEVEN_AXES
FOUR = al.load_urdf(al.example_urdf("macro_micro_4r"))
TOOL, TIP = SEVEN.frame_names[-1], FOUR.frame_names[-1]
ONCE = {"restarts": 2, "max_iterations": 30}


def problem(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return reachable positions of the tool, and starts near their solutions."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(0.7 * SEVEN.limits["q_min"], 0.7 * SEVEN.limits["q_max"], (count, 7))
    starts = np.clip(q + rng.uniform(-0.3, 0.3, q.shape), SEVEN.limits["q_min"], SEVEN.limits["q_max"])
    return SEVEN.position(q, TOOL), starts


def test_rows_have_the_bits_of_single_calls_for_any_number_of_threads() -> None:
    """There are more rows than a thread processes at a time. One target is out of reach, and one is not finite."""
    points, starts = problem(70, 0)
    points[40] = 9.0
    points[50, 1] = np.nan
    tasks = [al.Task(TOOL, "xyz", points), al.PostureTask(np.zeros(7))]
    first, *others = (al.inverse_kinematics(SEVEN, tasks, starts, threads=threads, **ONCE) for threads in (1, 2, 3))
    for other in others:
        for name in ("q", "reached", "iterations", "restarts", "status"):
            np.testing.assert_array_equal(getattr(first, name), getattr(other, name))
    assert first.status[50] == al.Status.DIVERGED and np.isnan(first.q[50]).all() and first.iterations[50] == 0
    assert first.status[40] in (al.Status.INFEASIBLE, al.Status.MAX_STEPS) and np.isfinite(first.q[40]).all()
    for i in (0, 1, 31, 32, 40, 49, 51, 69):
        one = al.inverse_kinematics(SEVEN, [al.Task(TOOL, "xyz", points[i]), tasks[1]], starts[i], **ONCE)
        assert one.q.tobytes() == first.q[i].tobytes() and one.status == first.status[i]
        assert (one.iterations, one.restarts, all(one.reached)) == (first.iterations[i], first.restarts[i], first.reached[i])
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(one.errors, first.errors, strict=True))


def test_a_single_call_has_the_types_that_it_had() -> None:
    found = al.inverse_kinematics(FOUR, [al.Task(TIP, "xy", [1.0, 0.5])], [0.1, 0.2, 0.3, 0.4])
    assert type(found.reached) is list and type(found.iterations) is int and type(found.restarts) is int
    assert found.status is al.Status.SUCCESS and found.q.shape == (4,) and bool(found) is True


@pytest.mark.parametrize("lead", [(1,), (3,), (2, 3), (0,)])
def test_leading_axes(lead: tuple[int, ...]) -> None:
    aims = np.broadcast_to([1.0, 0.5], (*lead, 2))
    found = al.inverse_kinematics(FOUR, [al.Task(TIP, "xy", aims)], [0.1, 0.2, 0.3, 0.4])
    assert found.q.shape == (*lead, 4) and found.errors[0].shape == (*lead, 2)
    assert found.reached.shape == found.status.shape == found.iterations.shape == found.restarts.shape == lead
    assert bool(found)
    starts = al.inverse_kinematics(FOUR, [al.Task(TIP, "xy", [1.0, 0.5])], np.broadcast_to([0.1, 0.2, 0.3, 0.4], (*lead, 4)))
    np.testing.assert_array_equal(starts.q, found.q)


@pytest.mark.parametrize(
    ("task", "one"),
    [
        (lambda x: al.AxisTask(TIP, [1.0, 0.0, 0.0], x), [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]),
        (lambda x: al.CentreOfMassTask("xy", x), [[0.7, 0.2], [np.inf, 0.0], [0.5, 0.5]]),
        (lambda x: al.RelativeTask(TIP, FOUR.frame_names[1], "xy", x), [[0.7, 0.2], [np.nan, 0.0], [0.6, 0.4]]),
        (lambda x: al.PostureTask(x, joints=["joint1"]), [[0.7], [np.nan], [0.5]]),
    ],
)
def test_every_task_with_a_target_has_rows(task: Any, one: list[list[float]]) -> None:
    """Only the second row has no target. Only this row has no solution."""
    q0 = [0.1, 0.2, 0.3, 0.4]
    found = al.inverse_kinematics(FOUR, [task(one)], q0, **ONCE)
    assert found.status[1] == al.Status.DIVERGED and not found.reached[1] and not bool(found)
    for i in (0, 2):
        alone = al.inverse_kinematics(FOUR, [task(one[i])], q0, **ONCE)
        assert alone.q.tobytes() == found.q[i].tobytes() and found.reached[i] == bool(alone)


def test_a_start_that_is_not_finite_has_a_status() -> None:
    starts = np.tile([0.1, 0.2, 0.3, 0.4], (3, 1))
    starts[1, 2] = np.nan
    found = al.inverse_kinematics(FOUR, [al.Task(TIP, "xy", [1.0, 0.5])], starts)
    assert found.status.tolist() == [0, 1, 0] and found.reached.tolist() == [True, False, True]


def test_several_solutions_are_distinct_ranked_and_begin_with_that_of_a_single_call() -> None:
    points, starts = problem(4, 3)
    tasks = [al.Task(TOOL, "xyz", points)]
    found = al.inverse_kinematics(SEVEN, tasks, starts, solutions=3, restarts=12, max_iterations=40)
    assert found.q.shape == (4, 3, 7) and found.reached.shape == found.status.shape == (4, 3) and found.iterations.shape == (4,)
    assert found.reached.any(axis=1).all() and bool(found)
    for q, reached, start, point in zip(found.q, found.reached, starts, points, strict=True):
        assert sorted(reached, reverse=True) == list(reached)
        good = q[reached]
        assert np.all(np.diff(np.linalg.norm(good - start, axis=1)) >= 0.0)
        assert np.abs(SEVEN.position(good, TOOL) - point).max() <= 1.1e-9
        gaps = np.abs(np.angle(np.exp(1j * (good[:, None] - good[None])))).max(axis=-1)
        assert np.all(gaps[~np.eye(len(good), dtype=bool)] > 1e-3)
    one = al.inverse_kinematics(SEVEN, tasks, starts, solutions=1, restarts=12, max_iterations=40)
    plain = al.inverse_kinematics(SEVEN, tasks, starts, restarts=12, max_iterations=40)
    assert one.q[:, 0].tobytes() == plain.q.tobytes()
    alone = al.inverse_kinematics(SEVEN, [al.Task(TOOL, "xyz", points[2])], starts[2], solutions=3, restarts=12, max_iterations=40)
    assert alone.q.tobytes() == found.q[2].tobytes() and type(alone.iterations) is int


def test_answers_and_tasks_of_batches_are_pickled() -> None:
    aims = np.array([[1.0, 0.5], [np.nan, 0.0]])
    task = al.Task(TIP, "xy", aims)
    aims[:] = 0.0
    again = pickle.loads(pickle.dumps(task))
    assert "nan" in repr(again) and repr(again) == repr(task)
    found = al.inverse_kinematics(FOUR, [again], [0.1, 0.2, 0.3, 0.4])
    other = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(found.q, other.q)
    assert other.status.tolist() == [0, 1] and "status=" in repr(other)


def test_a_single_target_that_overflows_is_a_status_too() -> None:
    arm = models.TWO_LINKS
    for far in (1e200, 1e308):
        single = al.inverse_kinematics(arm, [al.Task("link2", "xy", [far, 0.0])], [0.1, 0.2])
        row = al.inverse_kinematics(arm, [al.Task("link2", "xy", [[far, 0.0]])], [0.1, 0.2])
        assert not single and single.status == row.status[0]
        np.testing.assert_array_equal(single.q, row.q[0])
    assert single.status is al.Status.DIVERGED and np.isnan(single.q).all()


def test_a_lower_task_does_not_keep_the_first_from_being_reached() -> None:
    arm = models.SEVEN_AXES
    low, high = arm.limits["q_min"], arm.limits["q_max"]
    targets = arm.position(np.random.default_rng(1).uniform(low, high, (24, 7)), "tcp")
    tip, posture = al.Task("tcp", "xyz", targets), al.PostureTask(np.zeros(7))
    assert al.inverse_kinematics(arm, [tip], np.zeros(7), check_limits=False).reached.all()
    both = al.inverse_kinematics(arm, [tip, posture], np.zeros(7), restarts=2, check_limits=False)
    assert (both.status == al.Status.DEGRADED).all()
    # The default tolerance of the search is 1e-9 m.
    assert np.abs(arm.position(both.q, "tcp") - targets).max() < 1e-6


@pytest.mark.parametrize(
    ("kind", "multiplier", "count"),
    [("R", 0.5, 2), ("R", 1.25, 2), ("P", 0.1, 2), ("R", 2.0, 1), ("R", -1.0, 1), ("R", 0.0, 1), ("P", 0.0, 1)],
)
def test_a_turn_of_a_leader_is_another_solution_where_it_moves_its_followers(kind: str, multiplier: float, count: int) -> None:
    """The leader is a joint with a range of two revolutions, so two of its angles reach a point.

    They count as two solutions only if its mimic joint has a different pose at the two angles.
    """
    body = {"axis": [0, 0, 1], "phi": [1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}
    leader = {"type": "R", **body, "lower": -6.5, "upper": 6.5}
    follower = {"type": kind, **body, "xyz": [1, 0, 0], "mimic": {"joint": 0, "multiplier": multiplier}}
    tip = {"type": "F", **body, "xyz": [1, 0, 0], "parent": 0}
    arm = al.Arm.from_chain([leader, follower, tip])
    found = al.inverse_kinematics(arm, [al.Task("link3", "xy", [np.cos(1.0), np.sin(1.0)])], [1.0], solutions=3, restarts=60)
    reached = found.q[found.reached, 0]
    np.testing.assert_allclose(reached, [1.0, 1.0 - 2.0 * np.pi][:count], rtol=0.0, atol=1e-7)
