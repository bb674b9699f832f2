"""Derivatives of runs of priority laws with bounds, at a fixed active set: compared with differences of runs, and the adjoint."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet.reference import sensitivity
from armlet.run.named_numbers import loop_with, named_numbers

Array = NDArray[np.float64]

ARM = al.planar_arm([1.0, 1.0, 0.25, 0.25], masses=[3.0, 2.0, 1.0, 0.5])
Q0 = np.array([0.1, 1.4, 1.3, 0.4])
TIP = al.Task("link4", "xy", [1.4, 1.6], 2.0)
ELBOW = al.Task("link2", "xy", [1.6, 1.5], 1.5)
LIMITS: dict[str, Any] = {"v_max": [9.0, 0.2, 9.0, 9.0]}
BELOW = np.array([0.0, -1.0, -1.0, -1.0])

LAWS: dict[str, Callable[[], Any]] = {
    "a speed limit holds level 2": lambda: al.PriorityVelocity(ARM, [TIP, ELBOW], method="exact", **LIMITS),
    "a clamp and a speed limit": lambda: al.PriorityVelocity(ARM, [TIP], method="clamp", v_max=[9.0, 0.05, 0.3, 9.0]),
    "damped, and a speed limit": lambda: al.PriorityVelocity(ARM, [TIP, ELBOW], method="damped", **LIMITS),
    # The elbow does not depend on joints 3 and 4, so that joint 1 alone moves it.
    "a limit with fewer directions than rows": lambda: al.PriorityVelocity(ARM, [ELBOW, TIP], method="exact", **LIMITS),
    "a violated wall": lambda: al.PriorityVelocity(
        ARM, [al.Task("link4", "y", gain=2.0, upper=0.9), TIP, ELBOW], method="exact", v_max=[0.3, 0.3, 9.0, 9.0]
    ),
    "a wall that pushes": lambda: al.PriorityVelocity(
        ARM, [al.Task("link2", "y", gain=2.0, lower=1.3), TIP, ELBOW], method="exact", **LIMITS
    ),
    "limits of all kinds": lambda: al.PriorityVelocity(
        ARM, [TIP, ELBOW], method="exact", q_max=[3.0, 1.43, 3.0, 3.0], v_max=0.5, a_max=3.0
    ),
    "two tasks in one level": lambda: al.PriorityVelocity(ARM, [[TIP, (ELBOW, 0.3)]], method="exact", **LIMITS),
    "accelerations": lambda: al.PriorityAcceleration(ARM, [TIP, ELBOW], method="exact", a_max=0.4),
    "clamped accelerations": lambda: al.PriorityAcceleration(ARM, [TIP], a_max=0.4),
}


def loop_of(name: str) -> tuple[Any, Any]:
    law = LAWS[name]()
    return (al.RigidArm(ARM) if isinstance(law, al.PriorityAcceleration) else al.VelocityArm(ARM)), law


def records(plant: Any, law: Any, options: dict[str, Any], name: str, value: Array) -> Array:
    plant, law, begun = loop_with(plant, law, {"q0": Q0, "v0": None, "theta0": None, "theta_dot0": None}, name, value)
    run = al.simulate(plant, law, begun["q0"], monitors=False, **options)
    return np.concatenate([run.q, run.v, run.tau], axis=-1)


@pytest.mark.parametrize("sample_time", [None, 4e-3], ids=["continuous", "sampled"])
@pytest.mark.parametrize("name", LAWS)
def test_derivatives_are_those_of_the_active_set(name: str, sample_time: float | None) -> None:
    plant, law = loop_of(name)
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "sample_time": sample_time, "record_every": 4}
    known = named_numbers(plant, law, {"q0": Q0, "v0": None, "theta0": None, "theta_dot0": None})
    left = ("arm.parameters", "arm.damping", "arm.friction", "arm.armature", ".eps", "rounding", "damping_ratio", "v0", "law.tasks.0.1.1")
    names = [each for each in known if not each.endswith(left) and np.isfinite(known[each]).all()]
    run = al.simulate(plant, law, Q0, **options)
    at = [law.terms(t, q, v) for t, q, v in zip(run.t, run.q, run.v, strict=True)]
    assert all(any(terms["active"]) or len(terms["limits"]) for terms in at), "a bound is active"
    run = al.simulate(plant, law, Q0, monitors=False, sensitivity=names, **options)
    assert run.sensitivity is not None
    moves = 0
    for each in names:
        value = known[each]
        size = np.where(value == 0.0, 0.05, np.abs(value))
        expected = sensitivity(lambda at, each=each: records(plant, law, options, each, at), value, size)
        one = run.sensitivity[each]
        got, largest = np.concatenate([one.q, one.v, one.tau], axis=1), np.abs(expected).max()
        moves += largest > 1e-6
        # The rounding errors of the solutions, divided by the step of the differences.
        rounding = 1e-13 * np.abs(records(plant, law, options, each, value)).max() / (1e-3 * size.min())
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-8 * largest + rounding, err_msg=each)
    assert moves >= 2


def test_the_adjoint_is_that_of_the_tangents() -> None:
    plant, law = loop_of("a wall that pushes")
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "sample_time": 4e-3}
    names = ["law.tasks.0.gain", "law.tasks.1.target", "law.v_max", "q0"]
    run = al.simulate(plant, law, Q0, monitors=False, sensitivity=names, **options)
    assert run.sensitivity is not None
    value, slopes = al.gradient(lambda run: (0.5 * np.sum(run.q**2), {"q": run.q}), plant, law, Q0, names, **options)
    assert np.isclose(value, 0.5 * np.sum(run.q**2), rtol=1e-14)
    for name in names:
        expected = np.tensordot(run.q, run.sensitivity[name].q, axes=2)
        np.testing.assert_allclose(slopes[name], expected, rtol=1e-11, atol=1e-13 * abs(value), err_msg=name)


def test_near_a_singularity_there_is_no_derivative() -> None:
    """Outstretched, the tip has only one direction, and the method decides ranks."""
    law = al.PriorityVelocity(ARM, [TIP], method="clamp", v_max=0.1)
    with pytest.raises(al.SolveError, match="near a singularity"):
        al.simulate(al.VelocityArm(ARM), law, [0.3, 1e-4, 1e-4, 1e-4], t_end=0.01, dt=1e-3, monitors=False, sensitivity="q0")


def test_scaled_commands_have_no_derivatives() -> None:
    law = al.PriorityVelocity(ARM, [TIP], method="sns", v_max=0.1)
    with pytest.raises(al.InputError, match="law has no derivatives of runs"):
        al.simulate(al.VelocityArm(ARM), law, Q0, t_end=0.01, dt=1e-3, monitors=False, sensitivity="q0")
