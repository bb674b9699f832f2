"""Moving targets of `MotorPD`, `StateFeedback` and `JointImpedance`: errors that vanish, and the feed-forward at one instant.

theta_d = q_d + K_J^-1 g(q_d),   theta_d_dot = v_d + K_J^-1 G(q_d) v_d,   G = dg/dq

The feed-forward has no inertia. So the error vanishes if the motion rests, or if its velocity, the mass matrix and gravity are constant.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_HEAVY_LINKS
K, B = np.array([800.0, 500.0]), np.array([0.4, 0.25])
RAIL = al.Arm.from_chain([{"type": "P", "axis": [0, 0, 1], "phi": [5.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1]}])
SPEED = 0.2  # m/s
UP = al.Table(4.0, [[0.0], [4.0 * SPEED]], [[SPEED], [SPEED]], [[0.0], [0.0]])
TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-11, "atol": 1e-12}
Make = Callable[[al.Arm, Any, Any, Any], al.Law]
LAWS: dict[str, Make] = {
    "MotorPD": lambda arm, target, k, b: al.MotorPD(arm, target, 400.0, 60.0, k),
    "MotorPD, online": lambda arm, target, k, b: al.MotorPD(arm, target, 400.0, 60.0, k, online=True),
    "StateFeedback": lambda arm, target, k, b: al.StateFeedback(arm, target, 400.0, 60.0, 0.5, 0.02, k),
    "JointImpedance": lambda arm, target, k, b: al.JointImpedance(arm, target, 60.0, 6.0, k, b, 0.05 * b, relative_damping=True),
}


def errors(run: al.Run, motion: al.Motion) -> Any:
    return np.abs(run.q - np.array([motion(float(t))[0] for t in run.t])).max(axis=1)


@pytest.mark.parametrize("name", LAWS)
def test_uniform_motion_along_a_vertical_rail_has_no_error(name: str) -> None:
    law = LAWS[name](RAIL, UP, 2e4, np.array([1.0]))
    sag = RAIL.gravity([0.0]) / 2e4
    start: dict[str, Any] = {"v0": [SPEED], "theta0": sag, "theta_dot0": [SPEED]}
    run = al.simulate(al.ElasticArm(RAIL, 2e4, 1.0), law, [0.0], t_end=4.0, **start, **TIGHT)
    assert errors(run, UP).max() < 1e-9
    # The damping of the inner loop without `relative_damping` acts on the motor velocity, and the spring of the outer loop balances it.
    if name == "JointImpedance":
        late = al.JointImpedance(RAIL, UP, 60.0, 60.0, 2e4, 1.0, 0.05)
        d_0 = late.terms(0.0, [0.0], [0.0], theta=[0.0], theta_dot=[0.0])["D0"][0, 0]
        slow = al.Table(40.0, [[0.0], [40.0 * SPEED]], [[SPEED], [SPEED]], [[0.0], [0.0]])
        run = al.simulate(al.ElasticArm(RAIL, 2e4, 1.0), late.replace(target=slow), [0.0], t_end=40.0, **start, **TIGHT)
        assert errors(run, slow)[-1] == pytest.approx(d_0 * SPEED / 60.0, rel=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_the_error_vanishes_where_the_motion_rests(name: str) -> None:
    motion = al.Quintic([0.3, 1.0], [0.8, 0.6], 1.0)
    law = LAWS[name](ARM, motion, K, B)
    run = al.simulate(al.ElasticArm(ARM, K, B), law, [0.3, 1.0], t_end=15.0, **TIGHT)
    found = errors(run, motion)
    # The moving arm needs torques of inertia that the law does not know.
    assert found[run.t < 1.0].max() > 1e-3 and found[-1] < 1e-8


@pytest.mark.parametrize("name", LAWS)
def test_the_error_of_a_slow_motion_is_proportional_to_the_acceleration(name: str) -> None:
    peaks = []
    for duration in (6.0, 12.0):
        motion = al.Quintic([0.3, 1.0], [0.8, 0.6], duration)
        run = al.simulate(al.ElasticArm(ARM, K, B), LAWS[name](ARM, motion, K, B), [0.3, 1.0], t_end=duration, **TIGHT)
        peaks.append(errors(run, motion).max())
    # Twice the time is a quarter of the acceleration. Terms of higher order in the rates change the ratio by less than 10 %.
    assert peaks[0] / peaks[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("law", ["MotorPD", "StateFeedback"])
def test_the_feed_forward_follows_gravity_along_the_motion(law: str) -> None:
    """The rates are products with the derivative of gravity, which `inverse_dynamics_derivatives` computes at rest."""
    motion = al.Sinusoid([0.3, 1.0], 0.4, [3.0, 2.0], 0.3)
    made = LAWS[law](ARM, motion, K, B)
    t, still = 0.37, np.zeros(2)
    q_d, v_d, _ = motion(t)
    g = ARM.gravity(q_d)
    rate = ARM.inverse_dynamics_derivatives(q_d, still, still)[0] @ v_d
    on = {"theta": q_d + g / K, "theta_dot": v_d + rate / K}
    terms = made.terms(t, q_d, v_d, **on)
    np.testing.assert_allclose(terms["theta_d"], on["theta"], rtol=1e-14)
    np.testing.assert_allclose(terms["theta_d_dot"], on["theta_dot"], rtol=1e-13)
    # On the desired motion, the joint torque and its rate are those of gravity, so that only gravity is left.
    np.testing.assert_allclose(made(t, q_d, v_d, **on), g, rtol=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_a_motion_at_rest_is_a_constant_target(name: str) -> None:
    make, state = LAWS[name], {"theta": [0.35, 1.1], "theta_dot": [0.2, -0.1]}
    held, constant = make(ARM, al.Hold([0.3, 1.0]), K, B), make(ARM, [0.3, 1.0], K, B)
    np.testing.assert_array_equal(held(0.4, [0.2, 0.9], [0.1, 0.2], **state), constant(0.4, [0.2, 0.9], [0.1, 0.2], **state))
    assert al.equilibrium(al.ElasticArm(ARM, K, B), held, q0=[0.2, 0.9]).stable


def test_elastic_tracking_is_deprecated_and_equals_elastic_impedance() -> None:
    target, tip = al.Sinusoid([0.6, 0.4], 0.05, [1.0, 2.0], 0.2), {"frame": "link2", "axes": "xy", "relative_damping": True}
    given: Any = (ARM, target, [300.0, 200.0], [40.0, 30.0], K, B, 0.1 * B)
    with pytest.warns(DeprecationWarning, match=r"^armlet.ElasticTracking is deprecated: use armlet.ElasticImpedance"):
        old = al.ElasticTracking(*given, **tip)
    new, rng = al.ElasticImpedance(*given, **tip), np.random.default_rng(1)
    for t, (q, v, theta, theta_dot) in zip(rng.uniform(0.0, 3.0, 50), rng.uniform(-1.0, 1.0, (50, 4, 2)), strict=True):
        state = {"theta": theta, "theta_dot": theta_dot}
        np.testing.assert_array_equal(old(t, q, v, **state), new(t, q, v, **state))
