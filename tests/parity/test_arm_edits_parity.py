"""Arms that armlet makes or changes against the reference, which rebuilds them from homogeneous transforms: 1 to 8 joints."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


def compare(arm: al.Arm, theirs: Any, frames: tuple[str, ...]) -> None:
    """Compare parameters, inverse dynamics, and poses and Jacobians of frames at random states."""
    q, v, a = np.random.default_rng(arm.n).uniform(-2.0, 2.0, (3, 4, arm.n))
    close(arm.parameters, theirs.parameters)
    close(arm.inverse_dynamics(q, v, a, friction=True), theirs.inverse_dynamics(q, v, a, friction=True), 10.0)
    for frame in frames:
        close(arm.pose(q, frame), theirs.pose(q, frame))
        close(arm.jacobian(q, frame), theirs.jacobian(q, frame))


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("n", range(1, 9))
def test_denavit_hartenberg_rows(n: int, convention: str) -> None:
    rng = np.random.default_rng(n)
    plain = [tuple(row) for row in rng.uniform(-1.5, 1.5, (n, 4))]
    bodies = driven_tree(n, 0)[0].parameters.reshape(n, 10)
    keys = ("a", "alpha", "d", "theta")
    rich = [dict(zip(keys, row, strict=True), type=rng.choice(["R", "P"]), phi=phi) for row, phi in zip(plain, bodies, strict=True)]
    for rows in (plain, rich):
        for options in ({}, {"gravity": (1.0, -2.0, 3.0)}):
            arm = al.Arm.from_dh(rows, convention=convention, **options)
            compare(arm, ref.from_dh(rows, convention=convention, **options), arm.frame_names)


@pytest.mark.parametrize("n", range(1, 9))
def test_planar_arms(n: int) -> None:
    rng = np.random.default_rng(n)
    lengths, masses, coms, inertias = rng.uniform(0.2, 1.0, (4, n))
    given: list[dict[str, Any]] = [{}, {"masses": masses}, {"coms": coms}, {"inertias": inertias}, {"gravity": (3.0, -4.0)}]
    for options in (*given, {key: value for each in given for key, value in each.items()}):
        arm = al.planar_arm(lengths, **options)
        compare(arm, ref.planar_arm(lengths, **options), arm.frame_names)


@pytest.mark.parametrize("n", range(1, 9))
def test_changed_arms(n: int) -> None:
    rng = np.random.default_rng(n)
    arm, theirs = driven_tree(n, 1)
    parent = arm.frame_names[-1]
    xyz, rpy, com, gravity = rng.uniform(-0.5, 0.5, (4, 3))
    root = rng.normal(size=(3, 3))
    second = 0.01 * root @ root.T
    inertia = np.trace(second) * np.eye(3) - second  # inertia of mass points with this second moment
    for place in ({}, {"xyz": xyz}, {"rpy": rpy}, {"xyz": xyz, "rpy": rpy}):
        compare(arm.with_frame("tool", parent, **place), ref.with_frame(theirs, "tool", parent, **place), ("tool",))
    for load in ({}, {"com": com}, {"com": com, "inertia": inertia}, {"inertia": inertia}):
        compare(arm.with_payload(parent, 1.3, **load), ref.with_payload(theirs, parent, 1.3, **load), (parent,))
    compare(arm.with_gravity(gravity), theirs.with_gravity(gravity), (parent,))
    pi = rng.normal(size=10 * n)
    compare(arm.with_parameters(pi), theirs.with_parameters(pi), (parent,))
    drives = dict(zip(("armature", "damping", "friction"), rng.uniform(0.1, 1.0, (3, n)), strict=True))
    compare(arm.with_drives(**drives), theirs.with_drives(**drives), (parent,))


@pytest.mark.parametrize("n", range(2, 9))
def test_held_joints(n: int) -> None:
    rng = np.random.default_rng(n)
    for seed in range(3):
        arm, theirs = driven_tree(n, seed)
        names = rng.permutation(arm.joint_names)[: rng.integers(1, n)]
        held = {str(name): float(rng.uniform(-1.0, 1.0)) for name in names}
        compare(arm.locked(held), ref.locked(theirs, held), arm.frame_names)
