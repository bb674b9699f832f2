"""Laws of elastic joints against the reference: random trees with 1 to 8 joints, random gains, states and targets.

armlet multiplies by `B B0^-1`. The reference solves for the acceleration of the reduced motor, and differentiates energies for gravity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from trees import close, definite, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


def gains(rng: np.random.Generator, n: int, form: str) -> dict[str, Any]:
    """Return stiffness, damping and inertias of n joints by name: numbers, vectors (n,) or matrices (n, n)."""
    sizes = {"joint_stiffness": 800.0, "motor_inertia": 0.4, "reduced_inertia": 0.05, "kp": 300.0, "kd": 20.0, "kt": 1.0, "ks": 0.02}
    if form == "scalar":
        return sizes
    if form == "diagonal":
        return {name: size * rng.uniform(0.5, 1.5, n) for name, size in sizes.items()}
    return {name: definite(rng, n, size) for name, size in sizes.items()}


INNER = ["joint_stiffness", "motor_inertia", "reduced_inertia"]
OPTIONS: list[dict[str, Any]] = [{}, {"damping_ratio": 0.4}, {"motor_damping": 3.0}, {"relative_damping": True}]


def laws(lib: Any, name: str, arm: Any, given: dict[str, Any], frame: str, options: dict[str, Any]) -> Any:
    """Return the law with this name from `lib`, which is armlet or the reference."""
    n, rng = arm.n, np.random.default_rng(arm.n)
    target = rng.uniform(-1.0, 1.0, n)
    if options.get("moving"):
        options = {key: value for key, value in options.items() if key != "moving"}
        target = lib.Sinusoid(target, rng.uniform(0.05, 0.3, n), rng.uniform(0.5, 3.0, n), rng.uniform(0.1, 0.9, n))
    inner = {key: given[key] for key in INNER}
    if name == "MotorPD":
        return lib.MotorPD(arm, target, given["kp"], given["kd"], given["joint_stiffness"], **options)
    if name == "StateFeedback":
        return lib.StateFeedback(arm, target, *(given[key] for key in ("kp", "kd", "kt", "ks", "joint_stiffness")))
    if name == "JointTracking":
        moving = lib.Sinusoid(*rng.uniform(0.05, 0.3, (2, n)), rng.uniform(0.5, 3.0, n), rng.uniform(0.1, 0.9, n))
        return lib.JointTracking(arm, moving, *(given[key] for key in ("kp", "kd", "joint_stiffness", "motor_inertia")))
    if name == "JointImpedance":
        return lib.JointImpedance(arm, target, given["kp"], given["kd"], **inner, **options)
    axes = "xyz" if options else "z rx y"
    stiffness, damping = definite(rng, 3, 300.0), definite(rng, 3, 20.0)
    if name == "ElasticImpedance":
        return lib.ElasticImpedance(arm, rng.uniform(-0.5, 0.5, 3), stiffness, damping, **inner, frame=frame, axes=axes, **options)
    moving = lib.Sinusoid(*rng.uniform(0.1, 0.6, (4, 3)))
    inner = tuple(inner.values())
    return lib.ElasticTracking(arm, moving, stiffness, damping, *inner, frame=frame, axes=axes, **options)


NAMES = [
    *(("MotorPD", options) for options in ({}, {"online": True})),
    ("StateFeedback", {}),
    *(("MotorPD", {"moving": True} | options) for options in ({}, {"online": True})),
    ("StateFeedback", {"moving": True}),
    ("JointImpedance", {"moving": True}),
    ("JointTracking", {}),
    *((name, options) for name in ("JointImpedance", "ElasticImpedance", "ElasticTracking") for options in OPTIONS),
]


@pytest.mark.parametrize("form", ["scalar", "diagonal", "full"])
@pytest.mark.parametrize("n", range(1, 9))
@pytest.mark.parametrize(("name", "options"), NAMES, ids=str)
def test_torques(name: str, options: dict[str, Any], n: int, form: str) -> None:
    arm, theirs = driven_tree(n, 0)
    given = gains(np.random.default_rng(n), n, form)
    law, other = (laws(lib, name, arm_of, given, arm.frame_names[-1], options) for lib, arm_of in ((al, arm), (ref, theirs)))
    for t, (q, v, theta, theta_dot) in zip((0.0, 0.4), np.random.default_rng([n, 1]).uniform(-1.0, 1.0, (2, 4, n)), strict=True):
        got = law.terms(t, q, v, theta=theta, theta_dot=theta_dot)
        want = other.terms(t, q, v, theta, theta_dot)
        # The torque is a product with two full matrices, which amplify rounding.
        close(law(t, q, v, theta=theta, theta_dot=theta_dot), want["tau"], tolerance=1e-11)
        for key in {"u", "tau_J", "e", "g", "q_d", "v_d", "a_d", "theta_d", "theta_d_dot", "feedforward", "x_d"} & got.keys() & want.keys():
            close(np.asarray(got[key]), want[key], 1e3, 1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), [NAMES[1], NAMES[2], NAMES[4], NAMES[5], NAMES[6], NAMES[7], NAMES[9], NAMES[-1]], ids=str)
def test_runs(name: str, options: dict[str, Any]) -> None:
    """Runs with equal steps of the same method agree. Stiff springs damp the differences that rounding makes."""
    arm, theirs = driven_tree(3, 0)
    given = gains(np.random.default_rng(3), 3, "diagonal")
    both: list[tuple[Any, Any]] = [(al, arm), (ref, theirs)]
    law, other = (laws(lib, name, each, given, arm.frame_names[-1], options) for lib, each in both)
    plant, springs = (lib.ElasticArm(each, given["joint_stiffness"], given["motor_inertia"]) for lib, each in both)
    run = al.simulate(plant, law, np.full(3, 0.2), t_end=0.05, dt=5e-4)
    expected = ref.simulate(springs, other, np.full(3, 0.2), t_end=0.05, dt=5e-4)
    for key in ("q", "v", "theta", "theta_dot", "tau"):
        close(getattr(run, key), expected[key], tolerance=1e-10)
    for key in ("energy", "energy_balance"):
        close(run.monitors[key], expected[key], 100.0, 1e-10)
