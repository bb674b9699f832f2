"""Distances of spheres and capsules in both priority laws and in inverse kinematics against the reference.

The reference compares all pairs of ends and inner points, and differentiates homogeneous transforms with complex steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

SOLIDS = ["sphere sphere", "sphere capsule", "capsule sphere", "capsule capsule", "world", "frame"]


def distance_task(lib: Any, solids: str, arm: al.Arm, rng: np.random.Generator, **options: Any) -> Any:
    """A task between two solids, for which the same random numbers are drawn from `rng`."""
    frame, other = arm.frame_names[-1], arm.frame_names[0]
    capsules = [word == "capsule" for word in solids.split()] if " " in solids else [True, True]
    points = [rng.uniform(-0.6, 0.6, (2, 3) if capsule else 3) for capsule in capsules]
    given = {"points": points[0], "radius": rng.uniform(0.0, 0.05), "other_points": points[1], "other_radius": rng.uniform(0.0, 0.05)}
    if solids == "world":
        return lib.DistanceTask(None, frame, **given, **options)
    return lib.DistanceTask(frame, None if solids == "frame" else other, **given, **options)


@pytest.mark.parametrize("name", ["PriorityVelocity", "PriorityAcceleration"])
@pytest.mark.parametrize("solids", SOLIDS)
def test_distances_in_laws(solids: str, name: str) -> None:
    active, damped = 0, name == "PriorityAcceleration"
    options: dict[str, Any] = {"gain": 2.0, "lower": 0.4, "upper": 0.9} | ({"damping": 1.7} if damped else {})
    for seed in range(6):
        arm, theirs = driven_tree(2 + seed % 2, seed)
        both = []
        for lib in (al, ref):
            tip = lib.Task(arm.frame_names[-1], "xy", [0.3, -0.2], 2.0, **({"damping": 2.0} if damped else {}))
            both.append([distance_task(lib, solids, arm, np.random.default_rng([seed, 7]), **options), tip])
        law, other = getattr(al, name)(arm, both[0], "exact"), getattr(ref, name)(theirs, both[1], "exact")
        for q, v in np.random.default_rng([seed, 1]).uniform(-0.9, 0.9, (2, 2, arm.n)):
            terms, task = law.terms(0.3, q, v), both[1][0]
            x = -task.error(theirs, q, np.zeros(len(terms["e"][0])))
            low, high = task.within(theirs, x.size)
            close(terms["e"][0], np.clip(x, low, high) - x, tolerance=1e-9)
            # A place on an axis is exact to 1e-12 of its length, because the core regularises nearly parallel axes.
            close(terms["J"][0], task.jacobian(theirs, q), tolerance=1e-8)
            if damped:
                close(terms["J_dot"][0], task.jacobian_dot(theirs, q, v), tolerance=1e-7)
            if x.size == 1:  # the enumeration of active sets is for independent rows
                close(law(0.3, q, v), other.terms(0.3, q, v)["tau"], tolerance=1e-6)
            assert float(terms["certificate"]) < 1e-9
            active += any(terms["active"])
    assert active >= 2


@pytest.mark.parametrize("solids", SOLIDS[:5])
def test_distances_and_intervals_in_inverse_kinematics(solids: str) -> None:
    """A tip at its target with a distance and a posture within bounds: both reach all tasks, or both do not."""
    reached = 0
    for seed in range(2):
        arm, theirs = driven_tree(4, seed)
        tasks = []
        for lib in (al, ref):
            near = distance_task(lib, solids, arm, np.random.default_rng([seed, 7]), lower=0.3, upper=0.8)
            band = lib.Task(arm.frame_names[-1], "z", lower=-0.5, upper=0.5)
            tasks.append([near, band, lib.PostureTask(joints=[arm.joint_names[0]], lower=-0.4, upper=0.4)])
        got = al.inverse_kinematics(arm, tasks[0], np.full(4, 0.3), limits=False, seed=1)
        want = ref.inverse_kinematics(theirs, tasks[1], np.full(4, 0.3), limits=False, seed=1)
        assert got.reached == want.reached
        for task, errors in zip(tasks[1], got.errors, strict=True):
            x = -task.error(theirs, got.q, np.zeros(errors.size))
            close(errors, np.clip(x, *(task.within(theirs, x.size) or (x, x))) - x, tolerance=1e-9)
        reached += bool(got)
    assert reached >= 1
