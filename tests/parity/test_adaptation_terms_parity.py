"""Adaptation of armature and friction, leakage and dead zone against the reference.

The reference computes the Lyapunov balance from the plant's dynamics.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from adaptive_options import columns_beside, laws, parametrisation
from numpy.typing import NDArray
from trees import body, close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

#: Keywords of `al.Adaptive` by name of the case.
OPTIONS: dict[str, dict[str, Any]] = {
    "friction": {"friction": True},
    "all columns": {"friction": ("stribeck", "coulomb", "viscous"), "armature": True, "friction_speed": 0.4},
    "one column": {"friction": ("coulomb",)},
    "armature": {"armature": True},
    "leakage": {"leakage": 0.3},
    "e-modification": {"leakage": 0.2, "leakage_form": "e", "friction": True},
    "dead zone": {"dead_zone": 1.0},
    "leakage and dead zone": {"dead_zone": 1.0, "leakage": 0.1},
    "base": {"friction": True, "armature": True, "leakage": 0.1},
    "natural": {"friction": True, "leakage": 0.2, "dead_zone": 0.3},
    "projection": {"armature": True, "friction": True, "leakage": 0.5},
    "with offset": {"friction": ("coulomb",), "offset": True, "leakage": 0.1},
}


def pair(option: str, n: int) -> tuple[Any, Any, tuple[Any, Any]]:
    """Return armlet's law, the reference's law and both arms.

    `gamma` is a full matrix, except for natural adaptation, which requires a vector.
    """
    rng = np.random.default_rng([n, sorted(OPTIONS).index(option)])
    arm, theirs = driven_tree(n, 2)
    bodies = np.concatenate([body(rng) for _ in range(n)])
    arm, theirs = arm.with_parameters(bodies), theirs.with_parameters(bodies)
    motion = rng.uniform(0.2, 0.8, (4, n))
    keywords = dict(OPTIONS[option])
    beside = columns_beside(n, keywords)
    own, other, size = parametrisation(option, (arm, theirs), bodies)
    if option == "natural":
        gamma: Any = rng.uniform(0.1, 1.0, n + beside)
    else:
        root = rng.standard_normal((size + beside, size + beside))
        gamma = 0.2 * (root @ root.T / (size + beside) + 0.1 * np.eye(size + beside))
    estimate = np.concatenate([0.25 * bodies[:size], rng.uniform(-0.2, 0.5, beside)])
    if option == "e-modification":
        keywords["leakage_centre"] = rng.uniform(0.0, 0.5, size + beside)
    common = {"estimate": estimate, **keywords}
    ours, expected = laws((arm, theirs), motion, gamma, common | own, common | other)
    return ours, expected, (arm, theirs)


@pytest.mark.slow
@pytest.mark.parametrize("n", range(1, 9))
@pytest.mark.parametrize("option", OPTIONS)
def test_torques_and_rates(option: str, n: int) -> None:
    ours, other, _ = pair(option, n)
    assert len(ours.parameter_names) == other.state0.size
    rng = np.random.default_rng(n)
    for t, share in ((0.0, 1.0), (0.9, 1.4)):
        # The slow state is inside the dead zone and the fast one outside.
        for speed in (0.02, 1.0):
            q, v = rng.uniform(-1.0, 1.0, n), speed * rng.uniform(-1.0, 1.0, n)
            state = share * other.state0
            got, want = ours.terms(t, q, v, state=state), other.terms(t, q, v, state=state)
            for key in ("tau", "Y", "s"):
                close(got[key], want[key], tolerance=1e-11)
            # For natural adaptation the reference solves with a 10 x 10 matrix for each body, which amplifies rounding.
            close(got["estimate_rate"], want["state_rate"], tolerance=1e-10)
            close(ours(t, q, v, state=state), want["tau"], tolerance=1e-11)


@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("option", OPTIONS)
def test_runs(option: str, friction: bool) -> None:
    """Runs agree in states, torques, Lyapunov function and its balance, for a plant with friction and without."""
    ours, other, (arm, theirs) = pair(option, 2)
    start = {"q0": [0.3, -0.2], "v0": [0.4, 0.1]}
    run = al.simulate(al.RigidArm(arm, friction=friction), ours, **start, t_end=0.1, dt=2e-3, check_limits=False)
    expected = ref.simulate(ref.RigidArm(theirs, friction=friction), other, **start, t_end=0.1, dt=2e-3)
    for key in ("q", "v", "tau", "estimate"):
        close(getattr(run, key), expected[key], tolerance=1e-9)
    for key in ("lyapunov", "lyapunov_balance"):
        close(run.monitors[key], expected[key], tolerance=1e-9)


def test_a_sampled_run() -> None:
    ours, other, (arm, theirs) = pair("all columns", 3)
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "sample_time": 2e-3}
    run = al.simulate(al.RigidArm(arm, friction=True), ours, [0.1, 0.2, -0.3], **options, check_limits=False)
    expected = ref.simulate(ref.RigidArm(theirs, friction=True), other, [0.1, 0.2, -0.3], **options)
    for key in ("q", "v", "tau", "estimate"):
        close(getattr(run, key), expected[key], tolerance=1e-9)
    close(run.monitors["lyapunov_balance"], expected["lyapunov_balance"], tolerance=1e-9)


def test_names_follow_the_regressor() -> None:
    """The law's parameters and the columns of its regressor have the order of `Arm.regressor(armature=True, friction=True)`.

    All columns are equal except those of Coulomb friction, in which the law uses a smooth sign of `v_r`.
    """
    arm, _ = driven_tree(3, 2)
    rng = np.random.default_rng(5)
    law = al.Adaptive(arm, al.Hold(rng.normal(size=3)), 30.0, 10.0, 1.0, friction=True, armature=True, friction_speed=1e-6)
    q, v = rng.normal(size=(2, 3))
    parts = law.terms(0.0, q, v)
    known = arm.regressor(q, v, parts["v_r"], parts["a_r"], armature=True, friction=True)
    close(parts["Y"][:, :-3], known[:, :-3])
    np.testing.assert_array_equal(parts["Y"][:, -3:], np.diag(np.sign(parts["v_r"])))
    kinds = ("armature", "damping", "friction")
    assert law.parameter_names[30:] == tuple(f"{kind}[{joint}]" for kind in kinds for joint in arm.joint_names)
    based = al.Adaptive(arm, al.Hold(np.zeros(3)), 30.0, 10.0, 1.0, base=arm.base_parameters(), friction="viscous")
    assert set(based.parameter_names[:-3]) < set(law.parameter_names[:30])
