"""The figure of an arm at one configuration: links, joints with their axes, and named frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from .._core import Arm
from ..arguments import choice, entries, finite
from .panels import numbered
from .skeleton import Array, Skeleton, Space
from .style import COLOURS, legend_below, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["show"]

#: Width and height, inches.
SIZE = (5.5, 5.8)
#: The length of the axes of a frame, and half the length of the axis of a joint, in parts of the size of the arm.
FRAME, HALF = 0.11, 0.06
#: Frames of other branches have no label if they are so close to one that has, in parts of the size of the arm.
CLOSE = 0.2
#: Joints after the last colour have lighter bars. More joints than `MOST` have one colour and no legend.
MOST = 2 * len(COLOURS)
#: The index of the world frame beside the indices of frames.
ORIGIN = -1
#: The colours of the axes x, y and z of a frame.
FRAME_COLOURS = ("#CC0000", "#008800", "#0000CC")


def show(arm: Arm, q: ArrayLike, frames: Any = None, view: ArrayLike | None = None, fig: Figure | None = None) -> Axes:
    """Draw the arm at the positions `q`. `Arm.show` describes the arguments and the errors."""
    at = finite("Arm.show", "q", _core.numbers("Arm.show", "q", q, (arm.n,)))
    eye = None if view is None else finite("Arm.show", "view", _core.numbers("Arm.show", "view", view, (2,)))
    skeleton = Skeleton("Arm.show", arm)
    require("Arm.show")
    lines = skeleton.lines(at[None])
    size = float(np.ptp(lines.cloud(), axis=0).max())
    names = _outermost(skeleton, at, CLOSE * size) if frames is None else _chosen(arm, frames)
    poses = {name: np.asarray(arm.pose(at, name)) for name in names}
    cloud = np.concatenate([np.zeros((1, 3)), lines.cloud(), *(pose[None, :3, 3] for pose in poses.values())])
    with sheet(fig, SIZE) as figure:
        space = Space(figure, cloud, None if eye is None else (eye[0], eye[1]), FRAME)
        space.put_arm(lines, 0)
        handles = _draw_joints(space, arm, at, lines.joints[0], HALF * size)
        _draw_frame(space, np.eye(4), FRAME * size, "W", below=True)
        for pose, together in _by_place(poses, 1e-3 * size):
            _draw_frame(space, pose, FRAME * size, "\n".join(literal(name) for name in together))
        legend_below(figure, handles, title="joint")
    axes: Axes = space.ax
    return axes


def _chosen(arm: Arm, frames: Any) -> list[str]:
    """The names of the argument `frames`."""
    listed = [frames] if isinstance(frames, str) else entries("Arm.show", "frames", frames, len(arm.frame_names))
    return [choice("Arm.show", f"frames[{i}]", name, arm.frame_names) for i, name in enumerate(listed)]


def _outermost(skeleton: Skeleton, q: Array, near: float) -> list[str]:
    """The tip frame, and the last frame of each other branch.

    A frame that is within `near` (m) of the origin or of a frame of the result is omitted.
    """
    arm = skeleton.arm
    places = {k: np.asarray(arm.position(q, arm.frame_names[k])) for k in skeleton.frames} | {ORIGIN: np.zeros(3)}
    chosen = [ORIGIN, skeleton.tip]
    # The last frame of a joint is usually the outermost one.
    for k in reversed(skeleton.frames):
        drawn = arm.frame_joints[k] in (arm.frame_joints[other] for other in chosen if other != ORIGIN)
        if not drawn and all(np.linalg.norm(places[k] - places[other]) > near for other in chosen):
            chosen.append(k)
    return [arm.frame_names[k] for k in chosen if k != ORIGIN]


def _draw_joints(space: Space, arm: Arm, q: Array, origins: Array, half: float) -> list[Any]:
    """Draw a dot at each joint, and a bar along its axis. The result has an entry of the legend per joint."""
    handles = []
    for i, (name, label) in enumerate(zip(arm.joint_names, numbered(arm.joint_names), strict=True)):
        joint = arm.file_joint_names.index(name)
        if joint not in arm.frame_joints:
            continue
        column = np.asarray(arm.jacobian(q, arm.frame_names[arm.frame_joints.index(joint)]))[:, i]
        axis = column[:3] if arm.joint_types[i] == "prismatic" else column[3:]
        style = {"color": COLOURS[i % len(COLOURS)], "alpha": 1.0 if i < len(COLOURS) else 0.5} if arm.n <= MOST else {"color": "0.35"}
        space.put(space.line(linewidth=4.5, solid_capstyle="butt", **style), origins[joint] + half * np.outer((-1.0, 1.0), axis))
        dot = space.line(marker="o", markersize=5.5, linestyle="none", **style)
        space.put(dot, origins[joint][None])
        dot.set_label(label)
        handles.append(dot)
    return handles if arm.n <= MOST else []


def _draw_frame(space: Space, pose: Array, length: float, name: str, below: bool = False) -> None:
    """Draw the axes of a frame, and write its name beside its origin."""
    for axis, colour in zip(pose[:3, :3].T, FRAME_COLOURS, strict=True):
        space.put(space.line(color=colour, linewidth=1.6), pose[:3, 3] + length * np.outer((0.0, 1.0), axis))
    space.write(pose[:3, 3], name, below)


def _by_place(poses: dict[str, Array], near: float) -> list[tuple[Array, list[str]]]:
    """Frames with one origin have one label. The axes of the first are drawn."""
    found: list[tuple[Array, list[str]]] = []
    for name, pose in poses.items():
        same = [names for other, names in found if np.linalg.norm(other[:3, 3] - pose[:3, 3]) <= near]
        if same:
            same[0].append(name)
        else:
            found.append((pose, [name]))
    return found
