"""Poles of `to_control` for laws with states: the eigenvalues of differences of the reference's loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al
from armlet import reference
from armlet.reference.loop import ClosedLoop
from armlet.reference.static_equilibrium import slope

LENGTHS, MASSES = [0.5, 0.4], [3.0, 2.0]
ARM, THEIRS = al.planar_arm(LENGTHS, masses=MASSES), reference.planar_arm(LENGTHS, masses=MASSES)
HOLD = np.array([0.3, 1.0])
TARGET = ARM.position(HOLD, "link2")[:2]
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}
STIFF, MOTORS = np.array([[800.0, 50.0], [50.0, 500.0]]), np.array([[0.4, 0.1], [0.1, 0.25]])
PID: dict[str, dict[str, Any]] = {
    "PID": {"ki": 60.0},
    "PD with filter": {"ki": None, "derivative_filter": [300.0, 200.0]},
    "PD with observer": {"ki": None, "observer_bandwidth": 20.0},
    "PID with filter and observer": {"ki": 60.0, "derivative_filter": 300.0, "observer_bandwidth": [20.0, 30.0]},
}


def pair(name: str) -> tuple[al.Law, Any]:
    """The law `name` and its reference."""
    if name in PID:
        gains: dict[str, Any] = {"kp": 80.0, "kd": 15.0} | PID[name]
        return al.PID(ARM, HOLD, **gains), reference.PID(THEIRS, HOLD, **gains)
    if name == "guarded":
        inner = pair("PID with filter and observer")
        observers = al.MomentumObserver(ARM, 30.0), reference.MomentumObserver(THEIRS, 30.0)
        return al.Guarded(inner[0], observers[0]), reference.Guarded(inner[1], observers[1])
    if name == "adaptive":
        given: Any = (100.0, 20.0, 1.0)
        estimate = 0.9 * ARM.parameters
        theirs = reference.Adaptive(THEIRS, reference.Hold(HOLD), *given, estimate=estimate)
        return al.Adaptive(ARM, al.Hold(HOLD), *given, estimate=estimate), theirs
    springs: dict[str, Any] = TIP | {"integral_gain": [200.0, 300.0]}
    if name == "impedance":
        arguments: Any = (TARGET, 300.0 * np.eye(2), 40.0 * np.eye(2))
        return al.CartesianImpedance(ARM, *arguments, **springs), reference.CartesianImpedance(THEIRS, *arguments, **springs)
    arguments = (TARGET, 300.0 * np.eye(2), 40.0 * np.eye(2), STIFF, MOTORS, 0.25 * MOTORS)
    return al.ElasticImpedance(ARM, *arguments, **springs), reference.ElasticImpedance(THEIRS, *arguments, **springs)


@pytest.mark.parametrize("name", [*PID, "guarded", "adaptive", "impedance", "elastic impedance"])
def test_poles_of_a_law_with_a_state(name: str) -> None:
    """The differences of the reference have relative errors of 1e-10. Multiple poles have the square root of this error."""
    law, theirs = pair(name)
    elastic = name == "elastic impedance"
    plant: Any = al.ElasticArm(ARM, STIFF, MOTORS) if elastic else al.RigidArm(ARM)
    mirror: Any = reference.ElasticArm(THEIRS, STIFF, MOTORS) if elastic else reference.RigidArm(THEIRS)
    still = np.zeros(2)
    x = np.concatenate([HOLD, still, HOLD + np.linalg.solve(STIFF, ARM.gravity(HOLD)), still] if elastic else [HOLD, still])
    z = theirs.start(HOLD, still)
    loop = ClosedLoop(mirror, theirs, None, None)

    def rates(y: Any) -> Any:
        given = loop.initial(y[: x.size])
        given[x.size : x.size + z.size] = y[x.size :]
        return loop(0.0, given)[: x.size + z.size]

    wanted = slope(rates, np.concatenate([x, z]))
    linear = al.to_control(plant, law, HOLD)
    scale = np.abs(wanted).max()
    np.testing.assert_allclose(linear.A, wanted, rtol=0.0, atol=1e-8 * scale)
    poles = [np.sort_complex(np.linalg.eigvals(matrix).round(3)) for matrix in (linear.A, wanted)]
    np.testing.assert_allclose(*poles, rtol=0.0, atol=2e-3)
