"""Theorems about `JointTracking`, the feed-forward of elastic joints along a joint motion.

With an exact model and a start on the desired state, the links follow the motion without error. On the desired motion, the torque is that
of full-state feedback linearisation, which this file computes from the equations of the plant:

a(q, v, theta) = M(q)^-1 (K_J (theta - q) - C(q, v) v - g(q)),   B theta_ddot + K_J (theta - q) = tau

The first derivative of `a` with respect to time is affine in theta_dot, and the second is affine in theta_ddot. They are the jerk and the
snap of the links. Differences along Taylor polynomials of the motion compute both derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

PLANAR = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], coms=[0.25, 0.2], inertias=[0.0625, 0.027])
SIX = models.SIX_AXES
TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-12, "atol": 1e-13}
#: Central differences of order 8: weights of the first and of the second derivative at the multiples 1 to 4 of the step.
FIRST = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([8 / 5, -1 / 5, 8 / 315, -1 / 560])
STEP = 4e-3


def positive(n: int, scale: float) -> Array:
    """Return a positive definite matrix that is not diagonal."""
    half = np.random.default_rng(n).normal(size=(n, n))
    return np.asarray(scale * (0.2 * half @ half.T / n + np.eye(n)))


def motions(n: int) -> dict[str, al.Motion]:
    start, end = np.linspace(0.2, 0.7, n), np.linspace(0.9, -0.4, n)
    sinusoid = al.Sinusoid(start, np.full(n, 0.3), np.linspace(2.0, 3.0, n), np.linspace(0.0, 1.0, n))
    rows = [np.array(x) for x in zip(*(sinusoid(0.25 * k) for k in range(5)), strict=True)]
    return {"sinusoid": sinusoid, "quintic": al.Quintic(start, end, 1.0), "table": al.Table(0.25, *rows), "hold": al.Hold(start)}


def tracking(arm: al.Arm, motion: al.Motion) -> tuple[al.ElasticArm, al.JointTracking]:
    K, B = positive(arm.n, 900.0), positive(arm.n, 0.3)
    return al.ElasticArm(arm, K, B), al.JointTracking(arm, motion, positive(arm.n, 150.0), 15.0, K, B)


ARMS = {"planar 2R": PLANAR, "six axes": SIX}
CASES = [(arm, motion) for arm in ARMS for motion in motions(2)]


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_links_follow_the_motion_without_error(name: str, kind: str) -> None:
    arm = ARMS[name]
    motion = motions(arm.n)[kind]
    plant, law = tracking(arm, motion)
    q, v, _ = motion(0.0)
    start = law.terms(0.0, q, v, theta=q, theta_dot=v)
    # The torque of a table jumps at its knots, where integrators do not restart. So this run ends at the second knot.
    t_end = 0.25 if kind == "table" else 1.0
    run = al.simulate(plant, law, q, v0=v, theta0=start["theta_d"], theta_dot0=start["theta_d_dot"], t_end=t_end, **TIGHT)
    error = np.abs(run.q - np.array([motion(t)[0] for t in run.t])).max()
    assert error < 1e-9, error


def test_a_wrong_start_is_forgotten() -> None:
    """From rest at the first position, the PD control of the motors removes the error."""
    motion = motions(2)["sinusoid"]
    plant, law = tracking(PLANAR, motion)
    run = al.simulate(plant, law, motion(0.0)[0], t_end=20.0, method="dop853", rtol=1e-10, atol=1e-12)
    errors = np.abs(run.q - np.array([motion(t)[0] for t in run.t])).max(axis=1)
    assert errors[run.t < 1.0].max() > 1e-2 and errors[run.t > 19.0].max() < 1e-6


def linearised(arm: al.Arm, K: Array, B: Array, rows: Array) -> tuple[Array, Array, Array]:
    """Return motor positions, motor velocities and the torque of feedback linearisation for the derivatives (5, n) of the motion."""
    n, (q, v, a, jerk, snap) = arm.n, rows
    powers = np.array([[k / 1.0, k**2 / 2.0, k**3 / 6.0] for k in STEP * np.arange(-4, 5)])

    def accelerations(theta: Array, theta_dot: Array, theta_ddot: Array) -> Array:
        """The accelerations of the links at nine times, if link positions and motor positions are Taylor polynomials."""
        return np.array(
            [
                np.asarray(
                    arm.forward_dynamics(
                        at := q + s * v + s2 * a + s3 * jerk, v + s * a + s2 * jerk, K @ (theta + s * theta_dot + s2 * theta_ddot - at)
                    )
                )
                for s, s2, s3 in powers
            ]
        )

    def derivative(order: int, values: Array) -> Array:
        after, before = values[5:], values[3::-1]
        if order == 1:
            return np.asarray(FIRST @ (after - before) / STEP)
        return np.asarray((SECOND @ (after + before) - 205 / 72 * values[4]) / STEP**2)

    def solved(response: Callable[[Array], Array], wanted: Array) -> Array:
        """Solve `response(x) = wanted` for an affine response."""
        offset = response(np.zeros(n))
        slope = np.array([response(1e3 * row) - offset for row in np.eye(n)]).T / 1e3
        return np.asarray(np.linalg.solve(slope, wanted - offset))

    none = np.zeros(n)
    theta = solved(lambda x: accelerations(x, none, none)[4], a)
    theta_dot = solved(lambda x: derivative(1, accelerations(theta, x, none)), jerk)
    theta_ddot = solved(lambda x: derivative(2, accelerations(theta, theta_dot, x)), snap)
    return theta, theta_dot, B @ theta_ddot + K @ (theta - q)


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_the_feedforward_is_that_of_feedback_linearisation(name: str, kind: str) -> None:
    arm = ARMS[name]
    motion = motions(arm.n)[kind]
    _, law = tracking(arm, motion)
    for t in (0.13, 0.46, 0.81):
        rows = motion.derivatives(t, 4)
        theta, theta_dot, tau = linearised(arm, positive(arm.n, 900.0), positive(arm.n, 0.3), rows)
        terms = law.terms(t, rows[0], rows[1], theta=theta, theta_dot=theta_dot)
        scale = np.abs(tau).max()
        np.testing.assert_allclose(terms["theta_d"], theta, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(terms["theta_d_dot"], theta_dot, rtol=0.0, atol=1e-7)
        np.testing.assert_allclose(terms["feedforward"], tau, rtol=0.0, atol=1e-6 * scale)
        np.testing.assert_allclose(terms["tau"], tau, rtol=0.0, atol=1e-6 * scale)
