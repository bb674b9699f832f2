"""The drawing of an arm: shapes fixed to its frames, from the robot file or as plain links.

    X_WS = X_WF X_FS,   X_WF = arm.pose(q, frame),  X_FS the pose of the shape in its frame

X_WF is the pose of the frame in the axes of the arm's base. `urdf` makes the shapes of a robot file, and `planar_links` those of
`al.planar_arm`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

import armlet as al

__all__ = ["BLUE", "GREY", "ORANGE", "Shape", "between", "planar_links"]

Array: TypeAlias = NDArray[np.float64]
Colour: TypeAlias = tuple[int, int, int]

# Colours of Okabe and Ito, as in figures.
BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
GREY: Colour = (130, 134, 140)


@dataclass(frozen=True)
class Shape:
    """A shape fixed to the frame `frame`, or to the ground if it is None.

    `size` depends on `kind`, in m. "box": (x, y, z). "cylinder": (radius, length) along z. "sphere": (radius,). "capsule": (radius, length)
    along z, with the origin in the middle. "mesh": scale factors (x, y, z), and `path` is the file.
    """

    frame: str | None
    kind: str
    size: tuple[float, ...]
    pose: Array = field(default_factory=lambda: np.eye(4))
    colour: Colour = GREY
    path: str = ""


def between(frame: str | None, start: Iterable[float], end: Iterable[float], radius: float, colour: Colour = GREY) -> Shape:
    """A capsule from `start` to `end`, (3,) each, m, both in `frame`."""
    a, b = np.array([*start], dtype=np.float64), np.array([*end], dtype=np.float64)
    length = float(np.linalg.norm(b - a))
    pose = np.eye(4)
    pose[:3, 3] = 0.5 * (a + b)
    if length > 0.0:
        z = (b - a) / length
        # x is perpendicular to z. The basis vector of the smallest entry of z is never parallel to z.
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
        x /= np.linalg.norm(x)
        pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return Shape(frame, "capsule", (radius, length), pose, colour)


def planar_links(arm: al.Arm, lengths: Sequence[float], radius: float) -> list[Shape]:
    """Shapes of the links of `al.planar_arm`, whose frames are at the link tips, and of its base."""
    links = [
        between(frame, (-length, 0.0, 0.0), (0.0, 0.0, 0.0), radius, BLUE if i % 2 == 0 else ORANGE)
        for i, (frame, length) in enumerate(zip(arm.frame_names, lengths, strict=True))
    ]
    return [Shape(None, "sphere", (1.6 * radius,)), *links]
