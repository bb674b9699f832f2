"""Derivatives of runs with respect to the times of a table. Expected: the derivative of the motion by its start is minus its rate."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
START = "law.tasks.0.target.start"


def rates_of(run: Any, name: str) -> Any:
    return run.sensitivity[name]


def rest_to_rest(start: float = 0.0, dt: float = 0.3, knots: int = 2, joints: int = 2) -> Any:
    """A table that begins and ends at rest. Between its knots the acceleration changes its slope."""
    far = np.full(joints, 0.1)
    along = np.linspace(0.0, 1.0, knots)
    x = np.outer(along**3 * (10 - 15 * along + 6 * along**2), far) + np.array([0.6, 0.3])[:joints]
    T = dt * (knots - 1)
    v = np.outer(30 * along**2 * (1 - along) ** 2, far) / T
    a = np.outer(60 * along * (1 - along) * (1 - 2 * along), far) / T**2
    return al.Table(dt, x, v, a, start=start)


def follow(table: Any) -> Any:
    return al.PriorityVelocity(ARM, [al.Task("link2", "xy", table, 4.0)])


@pytest.mark.parametrize("start", [0.0, 0.05])
def test_nothing_moves_at_the_first_knot(start: float) -> None:
    """At a knot at rest, q_d, v_d and a_d are continuous, so v = J^-1 (v_d + K (q_d - q)) does not depend on the start of the table."""
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "sensitivity": START}
    run = al.simulate(al.VelocityArm(ARM), follow(rest_to_rest(start)), [-0.2, 1.2], **options)
    rates = rates_of(run, START).v
    k = round(start / 1e-3)
    # At the knot, rounding of differences 2^-10 apart is left. After it, the derivative grows with the jerk.
    assert np.abs(rates[: k + 1]).max() < 1e-9 * np.abs(rates).max()
    assert np.abs(rates[k + 1]).max() > 1e-3 * np.abs(rates).max()


@pytest.mark.parametrize(("change", "method"), [("start", "rk4"), ("dt", "rk4"), ("start", "dop853")])
def test_derivatives_near_knots(change: str, method: Any) -> None:
    """`ComputedTorque` feeds the acceleration forward, whose slope jumps at each of the knots, which are at steps and between steps."""
    arm, name = models.PENDULUM, f"law.motion.{change}"

    def law(**moved: float) -> Any:
        rows = rest_to_rest(0.1, 0.1, knots=5, joints=1).__getnewargs_ex__()[1]
        return al.ComputedTorque(arm, al.Table(**{**rows, **moved}), 20.0, 6.0)

    base = {"start": 0.1, "dt": 0.1}[change]
    t = np.linspace(0.003, 0.597, 49)
    exact: dict[str, Any] = {"dt": 1e-4, "t_eval": t, "t_end": 0.6}
    h = 2e-5
    runs = [al.simulate(al.RigidArm(arm), law(**{change: base + s}), [0.5], **exact) for s in (h, -h)]
    own: dict[str, Any] = {"dt": 1e-3} if method == "rk4" else {"rtol": 1e-10, "atol": 1e-12}
    run = al.simulate(al.RigidArm(arm), law(), [0.5], method=method, t_end=0.6, t_eval=t, sensitivity=name, **own)
    near = 1e-5 if method == "rk4" else 2e-4
    for part in ("q", "v"):
        difference = (getattr(runs[0], part) - getattr(runs[1], part)) / (2.0 * h)
        # The difference has an error of h^2 times derivatives below 1e4, and of steps of 1e-4 s over a knot that moves within them. An
        # adaptive step passes over a knot with the error of its tolerance, and the tangents have a larger one.
        np.testing.assert_allclose(getattr(rates_of(run, name), part)[:, :, 0], difference, atol=near * np.abs(difference).max())


def test_a_jump_that_moves_is_refused() -> None:
    arm = models.PENDULUM
    moving = al.Table(0.1, [[0.5], [0.6]], [[1.0], [0.0]], [[0.0], [0.0]], start=0.2)
    law = al.ComputedTorque(arm, moving, 20.0, 6.0)
    with pytest.raises(al.InputError, match=r"law\.motion\.start has no derivative: it moves an instant at which the motion jumps"):
        al.simulate(al.RigidArm(arm), law, [0.5], t_end=0.6, dt=1e-3, sensitivity="law.motion.start")


def test_jerk_and_snap_of_a_table_have_derivatives() -> None:
    """`JointTracking` feeds jerk and snap forward, which jump at the knots. A step begins at each knot, and the values after it count."""
    K, B, dt = [800.0, 500.0], [0.4, 0.25], 0.1
    rows = np.random.default_rng(1).uniform(-0.3, 0.3, (3, 5, 2))

    def law(q: Any, dt: float = dt) -> Any:
        return al.JointTracking(ARM, al.Table(dt, q, *rows[1:]), [50.0, 40.0], [5.0, 4.0], K, B)

    options: dict[str, Any] = {"t_end": 0.4, "dt": 2e-3, "monitors": False}
    plant, name, h = al.ElasticArm(ARM, K, B), "law.motion.q", 1e-4
    run = al.simulate(plant, law(rows[0]), rows[0, 0], sensitivity=name, **options)
    for k in range(10):
        step = h * np.eye(10)[k].reshape(5, 2)
        first, second = (al.simulate(plant, law(rows[0] + sign * step), rows[0, 0], **options).q for sign in (1.0, -1.0))
        difference = (first - second) / (2.0 * h)
        got = np.reshape(rates_of(run, name).q, (*difference.shape, 10))[..., k]
        np.testing.assert_allclose(got, difference, rtol=0.0, atol=1e-6 * np.abs(difference).max(), err_msg=str(k))
    with pytest.raises(al.InputError, match=r"law\.motion\.dt has no derivative: it moves an instant at which the motion jumps"):
        al.simulate(plant, law(rows[0]), rows[0, 0], sensitivity="law.motion.dt", **options)
