"""Random trees, made with armlet and with the reference, and random bodies and gains."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

# The reference adds n^2 traces of products of 4 x 4 matrices, which adds rounding errors of the largest entry.
TOLERANCE = 1e-12


def close(got: Array, want: Array, scale: float = 1.0, tolerance: float = TOLERANCE) -> None:
    """Assert that all differences are within `tolerance` times the largest number, or times `scale` if this is larger."""
    assert got.shape == want.shape
    assert float(np.abs(got - want).max(initial=0.0)) <= tolerance * max(scale, float(np.abs(want).max(initial=0.0)))


def definite(rng: np.random.Generator, n: int, scale: float) -> Array:
    """Return a symmetric positive definite matrix (n, n) with a condition number below about 100."""
    root = rng.standard_normal((n, n))
    return np.asarray(scale * (root @ root.T / n + 0.3 * np.eye(n)))


def body(rng: np.random.Generator) -> Array:
    """Return the parameters (10,) of six point masses and a small ball: physically consistent with a margin."""
    phi = np.array([0.1, 0, 0, 0, 0.02, 0, 0.02, 0, 0, 0.02])
    for m, x, y, z in np.column_stack([rng.uniform(0.2, 0.4, 6), rng.uniform(-0.3, 0.3, (6, 3))]):
        phi += m * np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    return phi


def random_joints(rng: np.random.Generator, n: int) -> list[dict[str, Any]]:
    """Return a list of joints of a tree: `n` moving joints and some fixed ones.

    The inertias are those of random mass points, so they are physically consistent.
    """
    joints: list[dict[str, Any]] = []
    moving = 0
    while moving < n:
        fixed = bool(joints) and rng.random() < 0.2
        points, masses = 0.2 * rng.normal(size=(5, 3)), rng.uniform(0.1, 0.5, 5)
        second = np.einsum("k,ki,kj->ij", masses, points, points)
        inertia = np.trace(second) * np.eye(3) - second
        above = len(joints) - 1 if rng.random() < 0.6 else int(rng.integers(-1, len(joints))) if joints else -1
        joints.append(
            {
                "type": "fixed" if fixed else "P" if rng.random() < 0.3 else "R",
                "axis": rng.normal(size=3) if rng.random() < 0.6 else np.eye(3)[rng.integers(3)],
                "rpy": rng.uniform(-3.0, 3.0, 3),
                "xyz": 0.3 * rng.normal(size=3),
                "phi": np.concatenate([[masses.sum()], masses @ points, inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]]),
                "parent": above,
                "name": f"j{len(joints)}",
            }
        )
        moving += not fixed
    return joints


def both(n: int, seed: int) -> tuple[al.Arm, Any, Array, list[dict[str, Any]]]:
    """Return the arm, the reference, the index of each of the arm's joints in the reference's order, and the list of joints.

    The reference keeps the order of the list.
    """
    rng = np.random.default_rng([n, seed])
    joints, gravity, armature = random_joints(rng, n), 5.0 * rng.normal(size=3), rng.uniform(0.0, 0.3, n)
    moving = [joint["name"] for joint in joints if joint["type"] != "fixed"]
    for joint in joints:
        if joint["type"] != "fixed":
            joint["armature"] = armature[moving.index(joint["name"])]
    arm = al.Arm.from_chain(joints, gravity=gravity)
    reference = ref.Arm.from_chain(joints, gravity=gravity)
    return arm, reference, np.array([moving.index(name) for name in arm.joint_names]), joints


def driven_tree(n: int, seed: int) -> tuple[al.Arm, Any]:
    """Return a tree from each library, with damping, Coulomb friction and limits. Both have the same order of joints."""
    rng = np.random.default_rng([n, seed, 7])
    joints, gravity = random_joints(rng, n), 5.0 * rng.normal(size=3)
    for joint in joints:
        if joint["type"] != "fixed":
            joint |= {"armature": rng.uniform(0.0, 0.3), "damping": rng.uniform(0.0, 2.0), "friction": rng.uniform(0.0, 1.0)}
            joint |= {"lower": rng.uniform(-2.0, -0.5), "upper": rng.uniform(0.5, 2.0), "velocity": rng.uniform(0.5, 3.0)}
    arm = al.Arm.from_chain(joints, gravity=gravity)
    places = {str(joint["name"]): index for index, joint in enumerate(joints)}
    # The order is depth first, as in the arm: each joint follows its parent, and siblings keep the order of the list.
    order = sorted(range(len(joints)), key=lambda index: ancestry(joints, index))
    joints = [joints[index] | {"parent": order.index(joints[index]["parent"]) if joints[index]["parent"] >= 0 else -1} for index in order]
    theirs = ref.Arm.from_chain(joints, gravity=gravity)
    frames = [places[str(joint["name"])] for joint in joints]
    theirs.frames = {f"link{frames[k] + 1}": theirs.frames[f"link{k + 1}"] for k in range(len(joints))}
    assert theirs.joint_names == arm.joint_names
    return arm, theirs


def ancestry(joints: list[dict[str, Any]], index: int) -> list[int]:
    """Return the indices of the joints from the base to this joint."""
    above = joints[index]["parent"]
    return ([] if above < 0 else ancestry(joints, above)) + [index]
