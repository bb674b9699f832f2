"""Limits of velocity, position and braking in laws of task priority, with methods other than "sns"."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
SEVEN = models.SEVEN_AXES
PLANT = al.VelocityArm(SEVEN)
TOOL = SEVEN.frame_names[-1]
LOW, HIGH, SPEED = (SEVEN.limits[name] for name in ("q_min", "q_max", "v_max"))
METHODS = ["exact", "clamp", "damped"]


def simulate(*arguments: Any, **options: Any) -> Any:
    return al.simulate(*arguments, **options)


def start(rng: np.random.Generator, beyond: float = 0.0) -> Array:
    """Random joint positions within the limits, or up to `beyond` outside of some."""
    low, high = np.maximum(LOW, -3.0), np.minimum(HIGH, 3.0)
    q = low + rng.uniform(0.2, 0.8, 7) * (high - low)
    if beyond:
        q[1], q[3] = high[1] + beyond * rng.uniform(0.2, 1.0), low[3] - beyond * rng.uniform(0.2, 1.0)
    return np.asarray(q)


def random_law(rng: np.random.Generator, method: str, **limits: Any) -> Any:
    """A tip that moves fast along sines, partly out of reach, and a posture."""
    tip = al.Sinusoid(rng.uniform(-0.6, 0.6, 3), rng.uniform(0.3, 1.2, 3), rng.uniform(0.5, 4.0, 3), rng.uniform(0.0, 6.0, 3))
    return al.PriorityVelocity(SEVEN, [al.Task(TOOL, "xyz", tip, 8.0), al.PostureTask(rng.uniform(-4.0, 4.0, 7), 3.0)], method, **limits)


@pytest.mark.parametrize("method", METHODS)
def test_an_unreachable_target_stays_within_the_limits_of_the_arm(method: str) -> None:
    tasks = [al.Task(TOOL, "xyz", [2.0, 0.5, 0.3], 5.0), al.AxisTask(TOOL, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], 5.0)]
    q0 = start(np.random.default_rng(0))
    free = simulate(PLANT, al.PriorityVelocity(SEVEN, tasks, method, limits=False), q0, t_end=3.0, dt=0.01)
    run = simulate(PLANT, al.PriorityVelocity(SEVEN, tasks, method, limits=True), q0, t_end=3.0, dt=0.01)
    assert (np.abs(free.tau) > 1.5 * SPEED).any() or ((free.q < LOW) | (free.q > HIGH)).any()
    assert (np.abs(run.tau) <= SPEED).all()
    assert (run.q >= LOW).all() and (run.q <= HIGH).all()


@pytest.mark.parametrize("sample_time", [None, 0.01])
@pytest.mark.parametrize("method", METHODS)
def test_random_motions_keep_all_limits(method: str, sample_time: float | None) -> None:
    touched = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        brakes = rng.uniform(3.0, 20.0, 7)
        law = random_law(rng, method, limits=True, a_max=brakes)
        run = simulate(PLANT, law, start(rng), t_end=2.0, dt=0.01, sample_time=sample_time)
        assert (np.abs(run.tau) <= SPEED).all()
        # Rounding of a step of up to 0.03 rad.
        assert (run.q >= LOW - 1e-12).all() and (run.q <= HIGH + 1e-12).all()
        # The held command leaves a distance in which `brakes` stops the joint: u h + u^2 / (2 a) <= d.
        h = sample_time or 0.1
        for room, u in ((HIGH - run.q, run.tau), (run.q - LOW, -run.tau)):
            u = np.maximum(u, 0.0)
            assert (u * h + u * u / (2 * brakes) <= room * (1 + 1e-9) + 1e-9).all()
        touched += int((np.abs(run.tau) == SPEED).sum())
    assert touched > 20


def test_a_sampled_joint_brakes_with_its_deceleration() -> None:
    arm = models.PENDULUM
    law = al.PriorityVelocity(arm, [al.PostureTask([9.0], 50.0)], "exact", q_max=1.0, v_max=2.0, a_max=4.0)
    run = simulate(al.VelocityArm(arm), law, [0.0], t_end=1.5, dt=0.01, sample_time=0.01)
    decelerations = -np.diff(run.tau[:, 0]) / 0.01
    # At most the given deceleration, and near it: the joint does not brake earlier than necessary.
    assert decelerations.max() <= 4.0 * (1 + 1e-9) and decelerations.max() > 3.9
    assert run.tau[0, 0] == 2.0 and 0.99 < run.q[-1, 0] <= 1.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sample_time", [None, 0.01])
def test_a_start_outside_of_the_limits_returns(method: str, sample_time: float | None) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        law = random_law(rng, method, limits=True)
        run = simulate(PLANT, law, start(rng, 0.5), t_end=2.0, dt=0.01, sample_time=sample_time, check_limits=False)
        outside = np.maximum(np.maximum(LOW - run.q, run.q - HIGH), 0.0)
        assert outside[0].max() > 0.05 and (np.abs(run.tau) <= SPEED).all()
        assert (np.diff(outside, axis=0) <= 1e-12).all()
        # From 0.5 rad at 2 rad/s at least, then with the time constant 0.1 s of the horizon.
        assert outside[-1].max() < 1e-6


def test_a_far_bound_changes_nothing() -> None:
    """Without an active bound, the run is that of the law without limits, up to rounding of the program."""
    rng = np.random.default_rng(3)
    tasks = [al.Task(TOOL, "xyz", SEVEN.position(start(rng), TOOL) + 0.05, 2.0)]
    for method in METHODS:
        runs = [
            simulate(PLANT, al.PriorityVelocity(SEVEN, tasks, method, limits=False, **bounds), start(rng), t_end=0.5, dt=0.01)
            for rng, bounds in ((np.random.default_rng(3), {}), (np.random.default_rng(3), {"v_max": 1e3}))
        ]
        np.testing.assert_allclose(runs[1].q, runs[0].q, rtol=0.0, atol=1e-12)


def test_terms_have_the_active_rows_and_the_reason() -> None:
    arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
    q = np.array([0.0, np.pi / 2, np.pi / 2, 0.4])
    tasks = [
        al.Task("link4", "xy", arm.position(q, "link4")[:2] + 1.0, 1.0),
        al.Task("link2", "xy", arm.position(q, "link2")[:2] + 1.0, 1.0),
    ]
    law = al.PriorityVelocity(arm, tasks, "exact", v_max=[9.0, 0.5, 9.0, 9.0])
    terms = law.terms(0.0, q, np.zeros(4))
    stacks = [arm.jacobian(q, frame)[:2] for frame in ("link4", "link2")]
    sol = al.solve_priority(stacks, [[1.0, 1.0], [1.0, 1.0]], method="exact", v_max=[9.0, 0.5, 9.0, 9.0])
    np.testing.assert_allclose(terms["v"], sol.v, rtol=0.0, atol=1e-12)
    assert [limit[:2] for limit in terms["limits"]] == [limit[:2] for limit in sol.limits] == [(1, "lower"), (3, "upper")]
    assert terms["active"] == [[], []]
    assert terms["why"][0] == "level 1 is reached" and "joint 2 at its lower bound (level 0)" in terms["why"][1]
    np.testing.assert_array_equal(terms["upper"], [9.0, 0.5, 9.0, 9.0])
    assert "active" not in al.PriorityVelocity(arm, tasks).terms(0.0, q, np.zeros(4))


def test_rows_of_a_batch_are_the_single_runs() -> None:
    laws = [random_law(np.random.default_rng(seed), "clamp", limits=True) for seed in range(5)]
    starts = np.array([start(np.random.default_rng(seed)) for seed in range(5)])
    batch = al.simulate_batch(PLANT, laws, starts, t_end=0.5, dt=0.01, sample_time=0.02)
    for i, law in enumerate(laws):
        run = simulate(PLANT, law, starts[i], t_end=0.5, dt=0.01, sample_time=0.02)
        np.testing.assert_allclose(batch.q[i], run.q, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("kind", [al.PriorityVelocity, al.PriorityAcceleration])
def test_limits_of_zero_and_missing_limits_are_ignored_by_name(kind: Any) -> None:
    body = {"type": "R", "axis": [0, 0, 1], "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "xyz": [0.5, 0.0, 0.0]}
    joints = [body | extra for extra in ({"velocity": 0.0}, {}, {"lower": 0.0, "upper": 0.0, "velocity": 2.0})]
    arm = al.Arm.from_chain(joints)
    task = al.PostureTask([1.0, 1.0, 1.0], 4.0)
    with pytest.warns(UserWarning, match="limits=True ignores limits of the arm") as caught:
        law = kind(arm, [task], limits=True)
    text = str(caught[0].message)
    for words in ("joint1 has the velocity limit 0", "joint2 has no velocity limit", "joint3 has the position limits 0 and 0"):
        assert words in text
    assert len(caught) == 1
    assert (np.abs(law(0.0, np.zeros(3), np.zeros(3))) > 0.1).all()
    # Given limits replace those of the arm, so that nothing is ignored.
    torques = {"tau_max": np.inf} if kind is al.PriorityAcceleration else {}
    kind(arm, [task], limits=True, v_max=2.0, q_min=-1.0, q_max=1.0, **torques)


@pytest.mark.parametrize("kind", [al.PriorityVelocity, al.PriorityAcceleration])
def test_a_speed_limit_of_zero_does_not_freeze_a_joint_with_sns(kind: Any) -> None:
    body = {"type": "R", "axis": [0, 0, 1], "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "xyz": [0.5, 0.0, 0.0]}
    arm = al.Arm.from_chain([body | {"velocity": 0.0}, body | {"velocity": 2.0}])
    with pytest.warns(UserWarning, match="the method sns ignores limits of the arm: joint joint1 has the velocity limit 0"):
        law = kind(arm, [al.PostureTask([1.0, 1.0], 4.0)], "sns")
    assert (np.abs(law(0.0, np.zeros(2), np.zeros(2))) > 0.1).all()
    solver = al.PrioritySolver.for_arm(arm, [al.PostureTask()], method="sns")
    np.testing.assert_allclose(solver.solve(np.zeros(2), [[3.0, 1.0]]), [3.0, 1.0], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("kind", [al.PriorityVelocity, al.PriorityAcceleration])
def test_wrong_limits_are_refused(kind: Any) -> None:
    task = al.Task(TOOL, "x", [0.3])
    for options, words in (
        ({"method": "chiaverini", "limits": True}, "limits bounds nothing: expected clamp, damped, exact or sns, got chiaverini"),
        ({"method": "chiaverini", "v_max": 1.0}, "v_max bounds nothing"),
        ({"horizon": 0.1}, "horizon takes effect only with limits"),
        ({"limits": 1.5}, "limits is not a flag"),
        ({"v_max": [1.0, 2.0]}, "v_max has the wrong shape"),
        ({"v_max": float("nan")}, "v_min is out of order|v_max"),
        ({"q_min": 1.0, "q_max": 0.0}, "q_min is out of order"),
        ({"v_max": 1.0, "a_max": 0.0, "q_max": 1.0}, "a_max is not positive"),
    ):
        with pytest.raises(al.InputError, match=words):
            kind(SEVEN, [task], **options)
    free = models.THREE_LINKS
    with pytest.raises(al.InputError, match="limits has no use: expected an arm with limits"):
        kind(free, [al.Task("link2", "x", [0.3])], limits=True)


def test_a_law_with_scaled_commands_has_no_derivatives_and_no_c(tmp_path: Any) -> None:
    law = al.PriorityVelocity(SEVEN, [al.Task(TOOL, "x", [0.3])], limits=True, method="sns")
    with pytest.raises(al.InputError, match="PriorityVelocity"):
        simulate(PLANT, law, np.zeros(7), t_end=0.1, dt=0.01, sensitivity=["q0"], check_limits=False)
    with pytest.raises(al.InputError, match="PriorityVelocity with a map that branches on its data: scaled commands"):
        al.export_c(law, tmp_path)
