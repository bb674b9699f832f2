"""The `repr` of a batched result is short, and so is that of an object with long arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
ROWS = 1000


def ik(solutions: int | None = None) -> al.InverseKinematics:
    targets = np.random.default_rng(0).uniform(0.1, 0.8, (ROWS, 2))
    return al.inverse_kinematics(ARM, [al.Task("link2", "xy", targets)], [0.1, 0.2], solutions=solutions, restarts=2)


def batch() -> al.BatchRun:
    laws = [al.PDGravity(ARM, [0.1, 0.2], kp, 5.0) for kp in np.linspace(10.0, 20.0, ROWS)]
    return al.simulate_batch(al.RigidArm(ARM), laws, np.zeros((ROWS, 2)), t_end=0.01, dt=1e-3, keep="final")


def crossings() -> Any:
    t = np.linspace(0.0, 1.0, ROWS)
    return al.Events(t, np.zeros(ROWS, dtype=np.int64), ("up",), np.zeros((ROWS, 2)))


LONG: dict[str, Callable[[], Any]] = {
    "inverse kinematics": ik,
    "solutions": lambda: ik(2),
    "runs": batch,
    "bang_bang_time": lambda: al.bang_bang_time(0.0, np.linspace(0.1, 1.0, ROWS), 1.0, 0.5, 5.0),
    "contacts": lambda: al.Contact(np.zeros(ROWS), np.zeros(ROWS, dtype=np.int64), np.zeros((ROWS, 2))),
    "crossings": crossings,
    "task": lambda: al.Task("link2", "xy", np.zeros((300, 2))),
    "table": lambda: al.Table(1e-3, *np.zeros((3, ROWS, 2))),
    "solution": lambda: al.solve_priority([np.ones((1, ROWS))], [[1.0]]),
}


@pytest.mark.parametrize("name", LONG)
def test_a_long_result_is_shown_briefly(name: str) -> None:
    text = repr(LONG[name]())
    # Ten lines of a terminal of 80 columns.
    assert text.count("\n") <= 2 and len(text) <= 800, text[:1000]


def test_the_text_of_a_batch_has_its_numbers() -> None:
    points = [[0.3, 0.5], [0.5, 0.2], [2.0, 0.0]]
    found = al.inverse_kinematics(ARM, [al.Task("link2", "xy", points)], [0.1, 0.2])
    assert repr(found) == "InverseKinematics(q of shape (3, 2), 2 of 3 reached, status=2 success, 1 infeasible)"
    assert repr(LONG["contacts"]()) == "Contact(time=an array (1000,), joint=an array (1000,), residual=an array (1000, 2))"


def test_a_short_result_is_shown_completely() -> None:
    found = al.inverse_kinematics(ARM, [al.Task("link2", "xy", [0.3, 0.5])], [0.1, 0.2])
    assert "reached=[True]" in repr(found) and "status=<Status.SUCCESS: 0>" in repr(found)
    assert repr(al.Hold([1.0, 2.0])) == "Hold(q=[1.0, 2.0])"
    assert repr(al.Contact(0.25, 1, np.array([2.0, 3.0]))) == "Contact(time=0.25, joint=1, residual=array([2., 3.]))"
