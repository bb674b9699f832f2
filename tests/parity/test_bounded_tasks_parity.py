"""Tasks with bounds, and several tasks in one level, in both priority laws against the reference.

The reference enumerates active sets, and differentiates homogeneous transforms with complex steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

KINDS = ["frame", "posture", "centre of mass", "axis", "relative"]


def bounded(lib: Any, kind: str, arm: al.Arm, rng: np.random.Generator, damped: bool) -> Any:
    """A task with bounds, some of which its present coordinates violate."""
    frame, other = arm.frame_names[-1], arm.frame_names[0]
    options: dict[str, Any] = {"gain": rng.uniform(0.5, 3.0)} | ({"damping": rng.uniform(1.0, 4.0)} if damped else {})
    low = rng.uniform(-0.6, 0.1, 2)
    both = {"lower": low, "upper": low + rng.uniform(0.0, 0.4, 2)}
    if kind == "frame":
        return lib.Task(frame, "x rz", **both, **options)
    if kind == "posture":
        return lib.PostureTask(joints=list(arm.joint_names)[:2], lower=[-0.3, -np.inf], upper=rng.uniform(-0.2, 0.2), **options)
    if kind == "centre of mass":
        return lib.CentreOfMassTask("yz", **both, **options)
    if kind == "axis":
        return lib.AxisTask(frame, [0.3, 0.2, 0.9], rng.normal(size=3), lower=-0.2, upper=[0.1, np.inf], **options)
    return lib.RelativeTask(frame, other, "x y", lower=[-np.inf, -0.1], **options)


def levels(lib: Any, kind: str, arm: al.Arm, seed: int, damped: bool) -> list[Any]:
    rng = np.random.default_rng(seed)
    first = bounded(lib, kind, arm, rng, damped)
    options = {"damping": 2.0} if damped else {}
    tip = lib.Task(arm.frame_names[-1], "xy", rng.uniform(-0.5, 0.5, 2), 2.0, **options)
    posture = lib.PostureTask(np.full(arm.n, 0.3), 1.5, **options)
    if seed % 3 == 0:
        return [first, tip]
    if seed % 3 == 1:
        return [tip, [(first, 4.0), posture]]
    return [[(tip, 0.5), (posture, 2.0)], first]


@pytest.mark.parametrize("name", ["PriorityVelocity", "PriorityAcceleration"])
@pytest.mark.parametrize("kind", KINDS)
def test_tasks_within_bounds(kind: str, name: str) -> None:
    active, damped = 0, name == "PriorityAcceleration"
    for seed in range(6):
        arm, theirs = driven_tree(2 + seed % 2, seed)
        limits = {"v_max": 0.8, "a_max": 3.0} if seed >= 3 and damped else {"v_max": 0.8} if seed >= 3 else {}
        law = getattr(al, name)(arm, levels(al, kind, arm, seed, damped), "exact", **limits)
        other = getattr(ref, name)(theirs, levels(ref, kind, arm, seed, damped), "exact", **limits)
        for q, v in np.random.default_rng([seed, 1]).uniform(-0.9, 0.9, (2, 2, arm.n)):
            want, terms = other.terms(0.3, q, v), law.terms(0.3, q, v)
            # The enumeration solves least squares with relative rank decisions of 1e-10.
            close(law(0.3, q, v), want["tau"], tolerance=1e-8)
            active += any(terms["active"]) or bool(terms["limits"])
            assert float(terms["certificate"]) < 1e-9 and len(terms["e"]) == len(terms["ranks"]) == 2
    assert active >= 3
