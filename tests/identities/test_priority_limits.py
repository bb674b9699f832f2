"""Loops of "sns" respect the limits of the joints. Runs whose input switches forever end quickly with advice."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.THREE_LINKS
START = np.array([0.3, 0.8, 0.4])
LOW, HIGH = np.array([-0.2, 0.2, -0.1]), np.array([0.9, 1.1, 0.6])
SPEED, BRAKE = np.array([1.0, 1.5, 2.0]), np.array([6.0, 8.0, 10.0])
#: A tip position that requires joint positions beyond the limits.
FAR = [-0.6, 0.7]
SEVEN = models.SEVEN_AXES


@pytest.mark.parametrize("sample_time", [None, 0.05])
@pytest.mark.parametrize("brake", [None, BRAKE])
def test_velocities_keep_positions_within_limits(sample_time: float | None, brake: Any) -> None:
    limits = {"q_min": LOW, "q_max": HIGH, "v_max": SPEED, "a_max": brake, "horizon": 0.05}
    law = al.PriorityVelocity(ARM, [al.Task("link3", "xy", FAR, 4.0)], "sns", **limits)
    run = al.simulate(al.VelocityArm(ARM), law, START, t_end=3.0, dt=5e-3, sample_time=sample_time)
    # The distance to a limit is multiplied by a factor >= 0 in each step, up to rounding.
    assert (run.q >= LOW - 1e-12).all() and (run.q <= HIGH + 1e-12).all()
    assert (np.abs(run.v) <= SPEED * (1 + 1e-12)).all()
    # The limits are active: without them the joints move further.
    free = al.simulate(al.VelocityArm(ARM), al.PriorityVelocity(ARM, [al.Task("link3", "xy", FAR, 4.0)]), START, t_end=3.0, dt=5e-3)
    assert (free.q > HIGH + 0.1).any() and np.isclose(run.q[-1], HIGH, atol=1e-3).any()
    if brake is not None and sample_time is None:
        # The velocity is held between samples. It depends on the distance at the sample.
        room = np.maximum(HIGH - run.q, 0.0)
        fastest = BRAKE * 0.05 * (np.sqrt(1 + 2 * room / (BRAKE * 0.05**2)) - 1)
        assert (run.v <= fastest + 1e-9).all()
        # Braking is not earlier than necessary: some speeds equal the largest one that the distance allows, up to rounding.
        assert (np.isclose(run.v, fastest, rtol=1e-9, atol=0.0) & (room > 0.02)).any()


@pytest.mark.parametrize("sample_time", [None, 0.02])
def test_accelerations_keep_velocities_and_positions_within_limits(sample_time: float | None) -> None:
    limits = {"q_min": LOW, "q_max": HIGH, "v_max": SPEED, "a_max": BRAKE, "horizon": 0.02}
    law = al.PriorityAcceleration(ARM, [al.Task("link3", "xy", FAR, 100.0)], "sns", **limits)
    run = al.simulate(al.RigidArm(ARM), law, START, t_end=3.0, dt=1e-3, sample_time=sample_time)
    # Computed torque that is held for a sample does not realise the accelerations exactly.
    slack = 1e-9 if sample_time is None else 1e-3
    assert (run.q >= LOW - slack).all() and (run.q <= HIGH + slack).all()
    assert (np.abs(run.v) <= SPEED * (1 + slack)).all()
    step = round((sample_time or 1e-3) / 1e-3)
    a = np.diff(run.v[::step], axis=0) / (1e-3 * step)
    # Mean accelerations between samples.
    assert (np.abs(a) <= BRAKE * (1.0 + (1e-3 if sample_time is None else 0.1))).all()
    assert np.isclose(run.q[-1], HIGH, atol=1e-2).any()


def test_limits_default_to_the_arm_s_own() -> None:
    q0 = np.clip(np.array([0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4]), SEVEN.limits["q_min"], SEVEN.limits["q_max"])
    tool = SEVEN.frame_names[-1]
    for target in ([0.9, 0.9, 0.9], [-0.3, -0.3, 0.0]):
        law = al.PriorityVelocity(SEVEN, [al.Task(tool, "xyz", target, 3.0), al.PostureTask(np.full(7, 9.0), 1.0)], "sns")
        run = al.simulate(al.VelocityArm(SEVEN), law, q0, t_end=6.0, dt=0.02)
        assert (run.q >= SEVEN.limits["q_min"] - 1e-9).all() and (run.q <= SEVEN.limits["q_max"] + 1e-9).all()
        assert (np.abs(run.v) <= SEVEN.limits["v_max"] * (1 + 1e-12)).all()


def test_limits_are_refused_where_they_mean_nothing() -> None:
    task = al.Task("link3", "xy", FAR, 4.0)
    with pytest.raises(al.InputError, match="q_max bounds nothing: expected clamp, damped, exact or sns"):
        al.PriorityVelocity(ARM, [task], "chiaverini", q_max=1.0)
    with pytest.raises(al.InputError, match="v_max is missing"):
        al.PriorityVelocity(ARM, [task], "sns")
    with pytest.raises(al.InputError, match=r"q_min is out of order: .* \(first bad index 0\)"):
        al.PriorityVelocity(ARM, [task], "sns", q_min=1.0, q_max=0.0)
    with pytest.raises(al.InputError, match="horizon is not positive"):
        al.PriorityAcceleration(ARM, [task], "sns", a_max=1.0, horizon=0.0)
    with pytest.raises(al.InputError, match="a_max is not positive"):
        al.PriorityAcceleration(ARM, [task], "sns", a_max=[1.0, 0.0, 1.0])
    with pytest.raises(al.InputError, match="q_min is out of order"):
        al.PriorityVelocity(ARM, [task], "sns", q_min=float("nan"))


@pytest.mark.slow
def test_a_run_that_chatters_ends_soon_with_advice() -> None:
    tasks = [al.Task("link3", "xy", [2.0, 0.7], 5.0), al.Task("link1", "y", [-0.4], 5.0)]
    law, plant = al.PriorityVelocity(ARM, tasks, "sns", v_max=1.0), al.VelocityArm(ARM)
    with pytest.raises(al.SolveError, match="take a fixed step or a sample time") as caught:
        al.simulate(plant, law, START, t_end=10.0, method="dopri5", monitors=False)
    assert caught.value.status is al.Status.STALLED and caught.value.t is not None and 0.0 < caught.value.t < 10.0
    sampled = al.simulate(plant, law, START, t_end=10.0, method="dopri5", sample_time=0.01, monitors=False)
    fixed = al.simulate(plant, law, START, t_end=10.0, dt=0.01, monitors=False)
    assert sampled.status is al.Status.SUCCESS and fixed.status is al.Status.SUCCESS


def test_a_joint_that_must_not_rest_gives_its_speed_to_the_task() -> None:
    """For `v1 + v2 = 0.4` with `v1 >= 0.5`, the shortest velocity violates the bound at every scale up to one. `(0.5, -0.1)` is valid."""
    found = al.solve_priority([[[1.0, 1.0]]], [[0.4]], method="sns", v_min=[0.5, -1.0], v_max=[1.0, 1.0])
    np.testing.assert_allclose(found.v, [0.5, -0.1], rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(found.scales, [1.0])


def test_rounding_of_a_command_does_not_move_saturated_velocities() -> None:
    """Higher levels move joints to their bounds.

    Rounding errors must not determine whether these joints limit the velocity of a lower level.
    """
    rng = np.random.default_rng(1)
    saturated = 0
    for _ in range(60):
        n = int(rng.integers(4, 9))
        Js, vs = [rng.normal(size=(m, n)) for m in (2, 2, n)], [rng.normal(size=m) for m in (2, 2, n)]
        found = al.solve_priority(Js, vs, method="sns", v_max=0.3)
        near = [[J * (1.0 + 1e-15 * rng.normal(size=J.shape)) for J in Js] for _ in range(4)]
        moved = max(float(np.abs(al.solve_priority(other, vs, method="sns", v_max=0.3).v - found.v).max()) for other in near)
        # The inverses of the levels amplify rounding, here to at most 2e-14.
        assert moved <= 1e-9
        saturated += int(found.scales[1] < 1.0 and found.scales[2] > 0.0)
    assert saturated >= 10
