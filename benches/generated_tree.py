"""Joints, placements and inertial parameters of an arm, read from its URDF. Arms are chains and trees on a fixed base."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import armlet as al

Matrix = NDArray[np.float64]


def snap(values: ArrayLike) -> Matrix:
    """Round values within 1e-12 of 0, 1 or -1 to these numbers, so that CasADi simplifies their products."""
    values = np.asarray(values, float)
    whole = np.round(values)
    return np.where((np.abs(values - whole) < 1e-12) & (np.abs(whole) <= 1), whole + 0.0, values)


@dataclass
class Joint:
    """A joint, its placement in the frame of the parent joint at q = 0, and the body that it moves.

    `parent` is -1 if the parent is the base.
    """

    name: str
    prismatic: bool
    parent: int
    rotation: Matrix
    offset: Matrix
    axis: Matrix
    phi: Matrix


def numbers(text: str | None) -> Matrix:
    return np.array([float(each) for each in (text or "0 0 0").split()])


def placement(joint: ET.Element) -> tuple[Matrix, Matrix]:
    """Rotation and offset of a URDF joint's origin: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    origin = joint.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles := numbers(origin.get("rpy"))), np.cos(angles)
    rotation = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return snap(rotation), numbers(origin.get("xyz"))


class Tree:
    """The arm of a URDF: joints in the order of `arm.joint_names`, inertial parameters, gravity, motor inertias."""

    def __init__(self, arm: al.Arm) -> None:
        root = ET.fromstring(arm.to_urdf()[0])
        self.n, self.names = arm.n, list(arm.joint_names)
        self.above = {joint.find("child").get("link"): joint for joint in root.findall("joint")}  # type: ignore[union-attr]
        by_name = {joint.get("name"): joint for joint in self.above.values()}
        phis = np.asarray(arm.parameters, float).reshape(self.n, 10)
        self.joints = [self._joint(by_name[name], phi) for name, phi in zip(self.names, phis, strict=True)]
        self.gravity = np.asarray(arm.gravity_vector, float)
        self.armature = np.asarray(arm.limits["armature"], float)

    def _joint(self, found: ET.Element, phi: Matrix) -> Joint:
        rotation, offset = placement(found)
        parent, above, shift = self.attachment(found.find("parent").get("link"))  # type: ignore[union-attr,arg-type]
        prismatic, axis = found.get("type") == "prismatic", numbers(found.find("axis").get("xyz"))  # type: ignore[union-attr]
        return Joint(str(found.get("name")), prismatic, parent, snap(above @ rotation), snap(above @ offset + shift), snap(axis), phi)

    @property
    def serial(self) -> bool:
        return all(joint.parent == i - 1 for i, joint in enumerate(self.joints))

    def attachment(self, link: str) -> tuple[int, Matrix, Matrix]:
        """The index of the joint that moves a link (-1: none), and the placement of the link in the frame of that joint."""
        rotation, offset = np.eye(3), np.zeros(3)
        while (joint := self.above.get(link)) is not None and joint.get("type") == "fixed":
            above, shift = placement(joint)
            rotation, offset = above @ rotation, above @ offset + shift
            link = joint.find("parent").get("link")  # type: ignore[union-attr,assignment]
        return (-1 if joint is None else self.names.index(str(joint.get("name")))), rotation, offset


def made(parents: list[int]) -> al.Arm:
    """A tree of equal links of 0.25 m, with axes alternating between z, y and x.

    `parents` are the parents of the joints, -1 for the base.
    """
    turns = ([0, 0, 1], [0, 1, 0], [1, 0, 0])
    return al.Arm.from_chain(
        {
            "type": "R",
            "axis": turns[i % 3],
            "xyz": [0.25 if parent >= 0 else 0.0, 0.02 * (i % 4), 0.0],
            "rpy": [0.1 * (i % 3), 0.0, 0.2 * (i % 5) - 0.4],
            "parent": parent,
            "phi": [1.0, 0.125, 0.0, 0.01, 0.01, 0.0, 0.03, -0.002, 0.0, 0.03],
        }
        for i, parent in enumerate(parents)
    )


def branched(trunk: int, branches: int, length: int) -> list[int]:
    """Parents of the joints of a tree: a trunk from the base, and at its end `branches` branches of `length` joints each."""
    parents = list(range(-1, trunk - 1))
    for _ in range(branches):
        start = len(parents)
        parents += [trunk - 1, *range(start, start + length - 1)]
    return parents
