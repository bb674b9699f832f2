"""One number in place of numbers per joint: it holds for all joints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
HOLD = al.Hold([0.1, 0.2])
Q, V, A = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 50, 2))

#: The call with a number for all joints or parameters, and how many there are.
CALLS: dict[str, tuple[Callable[[Any], Any], int]] = {
    "armature": (lambda x: ARM.with_drives(armature=x), 2),
    "damping": (lambda x: ARM.with_drives(damping=x), 2),
    "friction": (lambda x: ARM.with_drives(friction=x), 2),
    "masses": (lambda x: al.planar_arm([0.5, 0.4], masses=x), 2),
    "coms": (lambda x: al.planar_arm([0.5, 0.4], coms=x), 2),
    "inertias": (lambda x: al.planar_arm([0.5, 0.4], inertias=x), 2),
    "joint_damping": (lambda x: al.ElasticArm(ARM, 100.0, 0.1, joint_damping=x), 2),
    "motor_friction": (lambda x: al.ElasticArm(ARM, 100.0, 0.1, motor_friction=x), 2),
    "target": (lambda x: al.PDGravity(ARM, x, 20.0, 5.0), 2),
    "estimate": (lambda x: al.Adaptive(ARM, HOLD, 20.0, 5.0, 0.1, estimate=x), 20),
    "leakage_centre": (lambda x: al.Adaptive(ARM, HOLD, 20.0, 5.0, 0.1, leakage=0.1, leakage_centre=x), 20),
    "noise": (lambda x: ARM.identify(Q, V, A, ARM.inverse_dynamics(Q, V, A), noise=x), 2),
}


def state(thing: Any) -> list[bytes]:
    """What the object computes, without its stored arguments."""
    if isinstance(thing, al.Arm):
        return [np.asarray(thing.limits[name]).tobytes() for name in sorted(thing.limits)] + [thing.parameters.tobytes()]
    if isinstance(thing, al.ElasticArm):
        run = al.simulate(thing, al.MotorPD(ARM, [0.1, 0.2], 20.0, 5.0, 100.0), [0.0, 0.0], t_end=0.05, dt=1e-3)
        return [run.q.tobytes(), run.theta.tobytes()]  # type: ignore[union-attr]
    if isinstance(thing, al.Law):
        return [al.simulate(al.RigidArm(ARM), thing, [0.0, 0.0], t_end=0.05, dt=1e-3).q.tobytes()]
    return [thing.deviations.tobytes(), thing.values.tobytes()]


@pytest.mark.parametrize("name", CALLS)
def test_a_number_holds_for_all(name: str) -> None:
    make, n = CALLS[name]
    assert state(make(0.3)) == state(make([0.3] * n)) != state(make([0.2] * n))


@pytest.mark.parametrize("name", CALLS)
def test_other_shapes_and_numbers_that_are_not_finite_are_refused(name: str) -> None:
    make, n = CALLS[name]
    for bad in ([0.3] * (n + 1), [[0.3]], np.nan, np.inf):
        with pytest.raises(al.InputError, match=name):
            make(bad)


def test_gravity_is_no_number() -> None:
    """A vector in space has no meaning as one number."""
    with pytest.raises(al.InputError, match=r"gravity has the wrong shape: expected \(3,\), got \(\)"):
        ARM.with_gravity(-9.81)  # type: ignore[arg-type]
