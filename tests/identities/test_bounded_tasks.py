"""Tasks with bounds in closed loops, several tasks in one level, and the records of active bounds."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.THREE_LINKS
PLANT = al.VelocityArm(ARM)
START = np.array([0.3, 0.8, 0.4])
SPACE: al.Arm = models.SEVEN_AXES
NAMES: Any = ["link3"]
METHODS = ["exact", "clamp", "damped"]


def simulate(*arguments: Any, **options: Any) -> Any:
    return al.simulate(*arguments, **options)


def height(run: Any, frame: str = "link3") -> Any:
    return ARM.position(run.q, frame)[:, 1]


@pytest.mark.parametrize("method", METHODS)
def test_a_wall_holds_and_is_approached_with_the_gain(method: str) -> None:
    """The tip may not rise above 0.9 m, and its target is at 1.1 m. The bound becomes active, and the height approaches it from below."""
    wall, tip = al.Task("link3", "y", gain=5.0, upper=0.9), al.Task("link3", "xy", [0.4, 1.1], 3.0)
    run = simulate(PLANT, al.PriorityVelocity(ARM, [wall, tip], method), START, t_end=3.0, dt=0.01)
    # RK4 of y_dot <= K (0.9 - y) with K dt = 0.05 does not overshoot.
    assert (height(run) <= 0.9 + 1e-9).all() and height(run)[-1] > 0.9 - 1e-4
    assert abs(ARM.position(run.q[-1], "link3")[0] - 0.4) < 1e-3
    assert run.monitors["kkt"].max() < 1e-9 and run.monitors["violation_1"].max() < 1e-9
    np.testing.assert_array_equal(run.monitors["violation_2"], run.monitors["residual_2"])
    assert run.monitors["violation_2"][-1] > 0.5
    assert [(hold.name, hold.side, hold.level, hold.end) for hold in run.active] == [("row 1 of level 1", "upper", 2, 3.0)]


def test_a_start_outside_of_the_interval_returns_with_the_gain() -> None:
    band = al.Task("link3", "y", gain=4.0, lower=0.2, upper=0.5)
    run = simulate(PLANT, al.PriorityVelocity(ARM, [band], "exact"), START, t_end=2.0, dt=0.005)
    apart = height(run) - 0.5
    assert apart[0] > 0.1
    # y_dot = -K (y - 0.5) exactly, by RK4 with K dt = 0.02.
    np.testing.assert_allclose(apart, apart[0] * np.exp(-4.0 * run.t), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(run.monitors["error_1"], np.maximum(apart, 0.0), rtol=0.0, atol=1e-12)


def test_an_interval_without_width_is_a_target() -> None:
    point: Any = {"lower": [0.5, 0.6], "upper": [0.5, 0.6]}
    for method in METHODS:
        runs = [
            simulate(PLANT, al.PriorityVelocity(ARM, [task], method), START, t_end=1.0, dt=0.01)
            for task in (al.Task("link3", "xy", [0.5, 0.6], 3.0), al.Task("link3", "xy", gain=3.0, **point))
        ]
        np.testing.assert_allclose(runs[1].q, runs[0].q, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("sample_time", [None, 0.01])
def test_accelerations_keep_a_wall(sample_time: float | None) -> None:
    wall = al.Task("link3", "y", gain=100.0, damping=25.0, upper=0.9)
    tip = al.Task("link3", "xy", [0.4, 1.1], 30.0)
    law = al.PriorityAcceleration(ARM, [wall, tip], "exact")
    run = simulate(al.RigidArm(ARM), law, START, t_end=3.0, dt=2e-3, sample_time=sample_time)
    # D^2 > 4 K: the height decays to the bound without oscillation. A torque that is held for a sample adds an error of its square.
    assert height(run).max() <= 0.9 + (1e-6 if sample_time is None else 2e-3)
    assert abs(height(run)[-1] - 0.9) < 1e-2


def test_tasks_of_one_level_share_the_error_by_their_weights() -> None:
    """One joint with two targets: it rests at the mean with the weights w1 K1 and w2 K2 of the targets."""
    arm = models.PENDULUM
    tasks = [al.PostureTask([1.0], 2.0), al.PostureTask([0.0], 2.0)]
    for weight in (1.0, 3.0):
        law = al.PriorityVelocity(arm, [[(tasks[0], weight), tasks[1]]], "exact")
        run = simulate(al.VelocityArm(arm), law, [0.2], t_end=8.0, dt=0.01)
        assert run.q[-1, 0] == pytest.approx(weight / (1 + weight), abs=1e-6)
        assert "residual_2" not in run.monitors and law.terms(0.0, [0.2], [0.0])["e"][0].shape == (2,)
    # In two levels, the first target wins.
    run = simulate(al.VelocityArm(arm), al.PriorityVelocity(arm, tasks, "exact"), [0.2], t_end=8.0, dt=0.01)
    assert run.q[-1, 0] == pytest.approx(1.0, abs=1e-6)


def test_the_active_set_is_quiet_at_rest() -> None:
    """An arm at rest at two bounds, sampled: after one second of motion, each bound changes at most twice per second."""
    wall, tip = al.Task("link3", "y", gain=5.0, upper=0.7), al.Task("link3", "xy", [0.1, 1.1], 3.0)
    for method in METHODS:
        law = al.PriorityVelocity(ARM, [wall, tip], method, v_max=1.0, q_min=-2.0, q_max=[2.0, 1.2, 2.0], a_max=5.0)
        run = simulate(PLANT, law, START, t_end=4.0, dt=0.01, sample_time=0.01)
        assert np.abs(run.tau[-1]).max() < 1e-3
        late = [hold for hold in run.active if hold.start > 1.0]
        assert len(late) <= 2 * 3


@pytest.mark.parametrize("sample_time", [None, 0.01])
def test_a_speed_limit_alone_holds_a_level(sample_time: float | None) -> None:
    """A joint needs 3 s at its speed limit of 0.5 rad/s, and its target has the gain 2/s: the limit holds until the error is 0.25 rad."""
    arm = models.PENDULUM
    law = al.PriorityVelocity(arm, [al.PostureTask([1.75], 2.0)], v_max=0.5, limits=False)
    run = simulate(al.VelocityArm(arm), law, [0.0], t_end=4.0, dt=0.01, sample_time=sample_time)
    assert [(hold.name, hold.side, hold.level, hold.start) for hold in run.active] == [("joint 1", "upper", 1, 0.0)]
    # The error is 0.25 rad at 3 s. A record before or after it has the change.
    assert run.active[0].end == pytest.approx(3.0, abs=0.0101)


def test_batches_pickles_and_replacements() -> None:
    wall = al.Task("link3", "y", gain=5.0, upper=0.9)
    law = al.PriorityVelocity(ARM, [[wall, (al.PostureTask([0.0, 1.0, 0.5], 1.0), 0.3)], al.Task("link3", "x", [0.4], 2.0)], limits=False)
    copy = pickle.loads(pickle.dumps(law))
    assert repr(copy) == repr(law) and "upper=0.9" in repr(law)
    q0 = np.array([START, START + 0.1])
    batch = al.simulate_batch(PLANT, [law, copy], q0, t_end=0.5, dt=0.01)
    for i in range(2):
        run = simulate(PLANT, law, q0[i], t_end=0.5, dt=0.01)
        np.testing.assert_allclose(batch.q[i], run.q, rtol=0.0, atol=1e-10)
        assert batch[i].active == run.active
    assert simulate(PLANT, al.PriorityVelocity(ARM, [al.Task("link3", "x", [0.4], 2.0)]), START, t_end=0.1, dt=0.01).active == []
    held = simulate(al.RigidArm(ARM), al.PDGravity(ARM, START, 2.0, 0.1), START, t_end=0.01, dt=1e-3)
    assert held.active is None


REFUSED: list[tuple[Any, str]] = [
    (lambda: al.Task("link3", "y", [0.1], upper=0.9), "Task: target is given with bounds"),
    (lambda: al.Task("link3", "y", lower=float("nan")), "Task: lower"),
    (lambda: al.Task("link3", "y", upper="high"), "Task: upper"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link3", "xy", upper=[0.9])]), r"tasks\[0\].upper has the wrong shape"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link3", "y", lower=1.0, upper=0.9)]), r"tasks\[0\].lower is out of order"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link3", "y", lower=np.inf)]), r"tasks\[0\].lower is out of order"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link3", "y", gain=0.0, upper=0.9)]), r"tasks\[0\].gain is not positive"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link3", "xy", gain=[[2.0, 1.0], [1.0, 2.0]], upper=0.9)]), "gain is not positive for each"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link3", "y", upper=0.9)], "chiaverini"), "method is wrong: expected clamp"),
    (lambda: al.PriorityVelocity(ARM, [[]]), r"tasks\[0\] is empty"),
    (lambda: al.PriorityVelocity(ARM, [NAMES]), r"tasks\[0\]\[0\] is of the wrong type"),
    (lambda: al.PriorityVelocity(ARM, [[(al.PostureTask(START), 0.0)]]), r"tasks\[0\]\[0\] has no positive weight"),
    (lambda: al.PriorityVelocity(ARM, [[(al.PostureTask(START), np.inf)]]), r"tasks\[0\]\[0\] has no positive weight"),
    (lambda: al.PriorityVelocity(SPACE, [al.AxisTask(SPACE.tip_frame, [0, 0, 1], upper=0.1)]), r"tasks\[0\].target is missing"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED, ids=range(len(REFUSED)))
def test_wrong_bounds_are_refused(call: Any, words: str) -> None:
    with pytest.raises(al.InputError, match=words):
        call()
