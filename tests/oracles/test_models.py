"""The arms of `models.py` against their closed forms and known solutions."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al


@pytest.mark.parametrize(
    ("arm", "reference", "torque"), [model[1:] for model in models.CLOSED_FORMS], ids=[m[0] for m in models.CLOSED_FORMS]
)
def test_the_torque_is_the_closed_form(arm: al.Arm, reference: Any, torque: Any) -> None:
    for motion in np.random.default_rng(arm.n).uniform(-3.0, 3.0, (20, 3, arm.n)):
        expected = torque(*motion)
        # Torques are at most 200 N m, and their terms are rounded a few times.
        np.testing.assert_allclose(arm.inverse_dynamics(*motion), expected, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(reference.inverse_dynamics(*motion), expected, rtol=0.0, atol=1e-12)


def free(arm: al.Arm, q0: Any, v0: Any, t_end: float) -> al.Run:
    """A run without torque."""
    plant, tolerances = al.RigidArm(arm), {"rtol": 1e-12, "atol": 1e-12}
    return al.simulate(plant, lambda t, q, v: np.zeros(arm.n), q0, v0=v0, t_end=t_end, sample_time=0.1, method="dop853", **tolerances)


@pytest.mark.parametrize("q0", [0.3, 3.0])
def test_the_pendulum_swings_as_known(q0: float) -> None:
    run = free(models.PENDULUM, [q0], [0.0], 5.0)
    # Near the upward position, errors of the integration grow by exp(2 w t) in a part of the period.
    np.testing.assert_allclose(run.q[:, 0], models.pendulum_swing(1.0, 5.0, q0, run.t), rtol=0.0, atol=1e-8)
    assert np.ptp(run.q) > 1.9 * q0


def test_the_pr_robot_drifts_as_known() -> None:
    q0, v0 = np.array([0.2, -1.0]), np.array([-0.4, 2.0])
    run = free(models.PR, q0, v0, 5.0)
    t, q1 = models.pr_drift(2.0, 0.5, 0.5, q0, v0, run.q[:, 1])
    # The tolerance of the integration, accumulated over 5 s.
    np.testing.assert_allclose(t, run.t, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.q[:, 0], q1, rtol=0.0, atol=1e-9)
    assert run.q[-1, 1] > 2 * np.pi and np.ptp(run.q[:, 0] - run.t * (run.q[-1, 0] - 0.2) / 5.0) > 0.1


@pytest.mark.parametrize("arm", [models.PR, models.TWO_LINKS, models.THREE_LINKS, models.SIX_AXES, models.SEVEN_AXES])
def test_computed_torque_is_critically_damped(arm: al.Arm) -> None:
    """The error of `kp = w^2`, `kd = 2 w` is `e(t) = (1 + w t) e(0) exp(-w t)` for every arm."""
    start, w = np.linspace(-0.3, 0.4, arm.n), 5.0
    law = al.ComputedTorque(arm, al.Hold(np.zeros(arm.n)), w**2, 2 * w)
    run = al.simulate(al.RigidArm(arm), law, start, t_end=2.0, dt=1e-3, check_limits=False)
    # The error of the method of order four with w dt = 0.005.
    np.testing.assert_allclose(run.q, np.exp(-w * run.t)[:, None] * (1 + w * run.t)[:, None] * start, rtol=0.0, atol=1e-10)
