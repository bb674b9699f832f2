"""Planned motions in closed loop: computed torque with the exact model, under the torque limits of the plan.

On the planned motion, the law's torque is the planned torque, which is within the limits. So clamping changes nothing. With an
integration error `e` the law adds `M (kp e + kd e')`. So the test compares with limits up to a relative tolerance.
"""

from __future__ import annotations

import models
import numpy as np
import pytest

import armlet as al

SEVEN = models.SEVEN_AXES
TAU_MAX = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])


def follow(arm: al.Arm, motion: al.Motion, tau_max: np.ndarray, t_end: float, q0: np.ndarray) -> al.Run:
    law = al.ComputedTorque(arm, motion, 400.0, 40.0)
    return al.simulate(al.RigidArm(arm), law, q0, t_end=t_end, method="dop853", rtol=1e-11, atol=1e-13, tau_max=tau_max, check_limits=False)


@pytest.mark.parametrize("rate", [None, 2000.0])
def test_seven_axes(rate: float | None) -> None:
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))
    p = al.time_path(SEVEN, q, tau_max=TAU_MAX, v_max=2.0, torque_rate=rate, check_limits=False)
    assert p.feasible
    run = follow(SEVEN, p, TAU_MAX, p.duration, q[0])
    # The run follows the plan to 7e-10 rad, although accelerations jump within a step.
    np.testing.assert_allclose(run.q, p(run.t)[0], rtol=0.0, atol=1e-6)
    assert np.all(np.abs(run.tau) <= TAU_MAX * (1.0 + 1e-12))  # the torque is clamped
    inside = run.t < p.duration
    wanted = SEVEN.inverse_dynamics(*p(run.t[inside]))
    # An error e gives the torque M kp e, here at most 2e-8 of the limits.
    np.testing.assert_allclose(run.tau[inside] / TAU_MAX, wanted / TAU_MAX, rtol=0.0, atol=1e-3)
    assert np.all(np.abs(run.v) <= 2.0 * (1.0 + 1e-5))
    np.testing.assert_allclose(run.q[-1], q[-1], rtol=0.0, atol=1e-6)


def test_seven_axes_without_enough_torque() -> None:
    """With 90 % of the planned torque the arm leaves the path. So the torque limits are active."""
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))
    p = al.time_path(SEVEN, q, tau_max=TAU_MAX, v_max=2.0, check_limits=False)
    run = follow(SEVEN, p, 0.9 * TAU_MAX, p.duration, q[0])
    assert np.abs(run.q - p(run.t)[0]).max() > 1e-3


@pytest.mark.parametrize("gravity", [0.0, 1.5])
def test_symmetric_profile(gravity: float) -> None:
    """In the shortest motion of one link, the torque reaches its limit and is not clamped."""
    inertia, tau_max = 0.7, 2.0
    arm = al.pendulum(inertia, gravity)
    report = al.bang_bang_time(-np.pi / 2, np.pi / 2, inertia, gravity, tau_max)
    motion = al.BangBang([-np.pi / 2], [np.pi / 2], report.t_min)
    limit = np.array([tau_max])
    run = follow(arm, motion, limit, report.t_min, np.array([-np.pi / 2]))
    q, v, a = (np.array(part) for part in zip(*(motion(t) for t in run.t), strict=True))
    np.testing.assert_allclose(run.q, q, rtol=0.0, atol=1e-8)
    assert np.all(np.abs(run.tau) <= tau_max * (1.0 + 1e-12))
    inside = run.t < report.t_min
    wanted = arm.inverse_dynamics(q, v, a)[inside]
    np.testing.assert_allclose(run.tau[inside], wanted, rtol=0.0, atol=1e-6 * tau_max)
    # The torque reaches its limit up to one integration step.
    assert np.abs(run.tau).max() >= 0.99 * tau_max
