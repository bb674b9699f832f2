"""Every kind of task, for velocities and accelerations, against the reference: trees with 1 to 8 joints, tasks with 1 to 8 rows.

armlet computes Jacobians and their time derivatives column by column. The reference differentiates homogeneous transforms with complex
steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


def sinusoid(lib: Any, rng: np.random.Generator, rows: int) -> Any:
    """Return a moving target that never becomes zero, as directions require."""
    return lib.Sinusoid(rng.uniform(0.4, 0.8, rows), rng.uniform(-0.3, 0.3, rows), rng.uniform(0.5, 2.0, rows), rng.uniform(0.0, 6.0, rows))


def task(lib: Any, kind: str, arm: al.Arm, rng: np.random.Generator, damped: bool = False) -> Any:
    """Return one task of this kind from `lib`, with the same random numbers for armlet and for the reference.

    `damped`: whether tasks have a damping, which laws of velocities refuse.
    """
    frame, other = arm.frame_names[-1], arm.frame_names[0]
    gain, damping = rng.uniform(0.5, 3.0), rng.uniform(1.0, 4.0)
    names = [arm.joint_names[-1]] if arm.n == 1 else [arm.joint_names[-1], arm.joint_names[0]]
    aim = "motion" if arm.n % 2 else "target"
    damp = {"damping": damping} if damped else {}
    keywords: dict[str, Any] = {"gain": gain, **damp}
    if kind == "frame":
        return lib.Task(frame, "xyz rx ry rz", **{aim: sinusoid(lib, rng, 6)}, **keywords)
    if kind == "frame rows":
        full = rng.uniform(0.5, 1.0, (3, 3))
        return lib.Task(frame, "y z rx", rng.uniform(-0.5, 0.5, 3), full @ full.T + np.eye(3))
    if kind == "posture":
        return lib.PostureTask(sinusoid(lib, rng, len(names)), rng.uniform(0.5, 3.0, len(names)), joints=names)
    if kind == "posture of all":
        return lib.PostureTask(**{aim: sinusoid(lib, rng, arm.n)}, **keywords)
    if kind == "centre of mass":
        return lib.CentreOfMassTask("zx", **{aim: sinusoid(lib, rng, 2)}, **keywords)
    if kind == "axis":
        return lib.AxisTask(frame, rng.normal(size=3), **{aim: sinusoid(lib, rng, 3)}, gain=rng.uniform(0.5, 3.0, 2), **damp)
    if kind == "axis z":
        return lib.AxisTask(frame, [0.0, 0.0, 2.0], [0.3, -0.2, 0.5])
    if kind == "relative":
        return lib.RelativeTask(frame, other, "x rz y ry", **{aim: sinusoid(lib, rng, 4)}, **keywords)
    if kind == "chosen limits":
        return lib.JointLimitTask(joints=names, margin=0.4, **keywords)
    return lib.JointLimitTask(gain)


KINDS = ["frame", "frame rows", "posture", "posture of all", "centre of mass", "axis", "axis z", "relative", "limits", "chosen limits"]
# A relative task needs two frames, so the arm needs two bodies.
CASES = [(kind, n, seed) for kind in KINDS for n in range(1, 9) for seed in range(3) if kind != "relative" or n > 1]


def pair(kind: str, n: int, seed: int, damped: bool = False) -> tuple[al.Arm, Any, Any, Any]:
    arm, theirs = driven_tree(n, seed)
    ours, other = (task(lib, kind, arm, np.random.default_rng(seed), damped) for lib in (al, ref))
    return arm, theirs, ours, other


@pytest.mark.parametrize(("kind", "n", "seed"), CASES)
def test_velocities_of_one_task(kind: str, n: int, seed: int) -> None:
    arm, theirs, ours, other = pair(kind, n, seed)
    law = al.PriorityVelocity(arm, [ours], eps=0.1)
    expected = ref.PriorityVelocity(theirs, [other], eps=0.1)
    for t, q in zip((0.0, 0.4, 2.3), np.random.default_rng([n, seed, 5]).uniform(-2.0, 2.0, (3, n)), strict=True):
        got, want = law.terms(t, q, np.zeros(n)), expected.terms(t, q, np.zeros(n))
        J = other.jacobian(theirs, q)
        close(got["J"][0], J)
        # Near half a turn, the direction of the rotation vector is an eigenvector of a quaternion matrix. The gap of its eigenvalues
        # amplifies rounding.
        close(got["e"][0], want["e"], tolerance=1e-11)
        # Errors and Jacobians are divided by eps, some of them twice.
        close(law(t, q, np.zeros(n)), want["tau"], tolerance=1e-10)


@pytest.mark.parametrize(("kind", "n", "seed"), CASES)
def test_accelerations_of_one_task(kind: str, n: int, seed: int) -> None:
    arm, theirs, ours, other = pair(kind, n, seed, damped=True)
    law = al.PriorityAcceleration(arm, [ours], eps=0.1, joint_damping=3.0)
    expected = ref.PriorityAcceleration(theirs, [other], eps=0.1, joint_damping=3.0)
    for t, (q, v) in zip((0.0, 0.4, 2.3), np.random.default_rng([n, seed, 6]).uniform(-1.5, 1.5, (3, 2, n)), strict=True):
        got, want = law.terms(t, q, v), expected.terms(t, q, v)
        close(got["J_dot"][0], other.jacobian_dot(theirs, q, v))
        close(got["e_dot"][0], want["e_dot"])
        close(got["a"], want["u"], tolerance=1e-10)
        close(got["tau"], want["tau"], tolerance=1e-10)


def test_an_axis_at_its_target_and_opposite() -> None:
    """Errors of an axis task agree at the target and opposite to it.

    Opposite, all directions of rotation are equally short. Both libraries choose the same perpendicular axis.
    """
    arm, theirs = al.planar_arm([1.0, 1.0]), ref.planar_arm([1.0, 1.0])
    for axis in np.eye(3):
        for target in (axis, -axis):
            for q in np.zeros(2), np.array([1e-9, 0.0]), np.array([-1e-4, 0.0]):
                got = al.PriorityVelocity(arm, [al.AxisTask("link2", axis, target)]).terms(0.0, q, np.zeros(2))["e"][0]
                want = ref.AxisTask("link2", axis, target).error(theirs, q, target)
                # At an angle d from half a turn, rounding of the direction of rotation is divided by d.
                close(got, want, tolerance=1e-6)


def levels(lib: Any, arm: al.Arm, seed: int, law: str = "PriorityVelocity") -> list[Any]:
    """Return three tasks of different kinds. With few joints, the last conflicts with the first two."""
    rng = np.random.default_rng(seed)
    damped = law == "PriorityAcceleration"
    return [task(lib, kind, arm, rng, damped) for kind in ("frame rows", "axis", "posture of all")]


@pytest.mark.parametrize("method", ["exact", "clamp", "damped", "chiaverini"])
@pytest.mark.parametrize("n", [2, 5, 8])
def test_three_levels(n: int, method: str) -> None:
    """Torques agree with one threshold for all levels, with one for each level, and with the default."""
    arm, theirs = driven_tree(n, 2)
    for name, speed in (("PriorityVelocity", 0.0), ("PriorityAcceleration", 1.0)):
        # "exact" has no thresholds.
        for eps in (None,) if method == "exact" else (None, 0.1, [0.05, 0.1, 0.2]):
            law = getattr(al, name)(arm, levels(al, arm, n, name), method, eps)
            other = getattr(ref, name)(theirs, levels(ref, arm, n, name), method, eps)
            for t, (q, v) in zip((0.0, 0.7), np.random.default_rng(n).uniform(-0.4, 0.4, (2, 2, n)), strict=True):
                # Each level divides by singular values above its threshold, or without one by small singular values.
                close(law(t, q, speed * v), other(t, q, speed * v), tolerance=1e-9)


@pytest.mark.parametrize("method", ["exact", "clamp", "damped", "chiaverini"])
@pytest.mark.parametrize("n", [3, 6, 8])
def test_solvers_of_an_arm(n: int, method: str) -> None:
    """`ArmPrioritySolver` returns the reference's Jacobians and velocities for tasks of several kinds."""
    arm, theirs = driven_tree(n, 1)
    rng = np.random.default_rng(n)
    root = rng.normal(size=(n, n)) + 3 * np.eye(n)
    options: list[dict[str, Any]] = [{}, {"weight": root @ root.T}] + ([] if method == "exact" else [{"eps": 0.2}])
    for kinds in (("frame rows", "centre of mass"), ("axis", "relative", "limits")):
        ours, others = ([task(lib, kind, arm, np.random.default_rng(n)) for kind in kinds] for lib in (al, ref))
        for given in options:
            solver = al.PrioritySolver.for_arm(arm, ours, method=method, **given)
            assert isinstance(solver, al.ArmPrioritySolver)
            for q in rng.uniform(-1.0, 1.0, (3, n)):
                Js = [other.jacobian(theirs, q) for other in others]
                for mine, J in zip(solver.jacobians(q), Js, strict=True):
                    close(mine, J)
                velocities = [rng.normal(size=len(J)) for J in Js]
                rounding = 8 * ref.diagnosis.EPS * (1.0 + float(np.abs(q).sum()))
                # The levels divide by singular values down to 1e-3.
                close(solver.solve(q, velocities), ref.solve_priority(Js, velocities, method, rounding=rounding, **given).v, 1.0, 1e-8)
