"""An arm as lines between its joints, for films and environments. The arm may be any tree, in the plane or in space.

    p_j(q)  the origin of joint j,    s_j(q) = X_parent(q) X_parent(0)^-1 p_j(0),  the origin of joint j at q_j = 0

X_parent is the pose of the parent joint, or of the base. A *link* is a line from the parent's origin to `s_j`. A *slide* is a line from
`s_j` to `p_j`. It shows the motion of a prismatic joint, and has zero length for a revolute joint. Further lines connect the tip frame, and
frames of the outermost bodies, with their joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._core import Arm
from ..errors import InputError
from .style import COLOURS, require, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Lines", "Picture", "Skeleton", "Space"]

AXES = "xyz"
#: The default elevation and azimuth of the eye, degrees, for pictures in space.
VIEW = (22.0, -56.0)
DPI = 100
Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Lines:
    """The points of the drawing of an arm at K configurations, in world axes, m.

    Attributes:
        links, slides: both ends of each line, (K, lines, 2, 3).
        joints: origins of the joints, (K, joints, 3).
        tip: origin of the tip frame, (K, 3).
    """

    links: Array
    slides: Array
    joints: Array
    tip: Array

    def cloud(self) -> Array:
        """All points of the drawing, (points, 3), m."""
        return np.concatenate([part.reshape(-1, 3) for part in (self.links, self.slides, self.tip)])


class Skeleton:
    """The joints and frames of an arm that are drawn, with their parents."""

    def __init__(self, caller: str, arm: Arm) -> None:
        if arm.tip_frame is None:
            raise InputError(f"{caller}: arm has nothing to draw: expected an arm with frames that move, got {arm.frame_names}")
        self.arm, self.tip = arm, arm.frame_names.index(arm.tip_frame)
        self.parents = np.array(arm.file_joint_parents)
        inner = set(arm.file_joint_parents)
        frames = enumerate(arm.frame_joints)
        self.frames = [k for k, joint in frames if k == self.tip or (joint >= 0 and joint not in inner)]
        at_zero = arm.file_joint_poses(np.zeros(arm.n))
        carriers = np.concatenate([at_zero, np.eye(4)[None]])[self.parents]
        #: For each joint, its origin at q_j = 0 in the axes of its parent, m.
        self.places = (np.linalg.inv(carriers) @ at_zero)[:, :3, 3]

    def lines(self, q: Array) -> Lines:
        """The points of the drawing at joint positions q (K, n), rad or m."""
        poses = np.asarray(self.arm.file_joint_poses(q))
        carriers = np.concatenate([poses, np.broadcast_to(np.eye(4), (len(q), 1, 4, 4))], axis=1)[:, self.parents]
        origins = poses[..., :3, 3]
        before = np.einsum("kjab,jb->kja", carriers[..., :3, :3], self.places) + carriers[..., :3, 3]
        links = np.stack([carriers[..., :3, 3], before], axis=2)
        joints = [self.arm.frame_joints[k] for k in self.frames]
        ends = np.stack([np.asarray(self.arm.position(q, self.arm.frame_names[k])) for k in self.frames], axis=1)
        fingers = np.stack([origins[:, joints], ends], axis=2)
        slides = np.stack([before, origins], axis=2)
        return Lines(np.concatenate([links, fingers], axis=1), slides, origins, ends[:, self.frames.index(self.tip)])


class Space:
    """The axes of a drawing of an arm: a plane of two world axes, or space, with one scale for all axes.

    If all points are in a plane of two axes and `view` is None, the drawing is of that plane. Otherwise it is in space.

    Args:
        figure: the matplotlib figure to draw into.
        cloud: points that the drawing must contain, (points, 3), m.
        view: elevation and azimuth of the eye, degrees; None: the plane of the points if they have one, otherwise `VIEW`.
        margin: distance between the points and the limits of the axes, in parts of the size of the cloud.
    """

    def __init__(self, figure: Figure, cloud: Array, view: tuple[float, float] | None = None, margin: float = 0.05) -> None:
        from matplotlib.ticker import MaxNLocator

        spread = np.ptp(cloud, axis=0)
        thin = int(np.argmin(spread))
        flat = view is None and spread[thin] <= 1e-9 * max(spread.max(), 1.0)
        self.axes = [i for i in range(3) if not flat or i != thin]
        self.centre, reach = (cloud.max(axis=0) + cloud.min(axis=0)) / 2, (0.5 + margin) * spread.max() + 1e-3
        self.floor = self.centre[2] - reach
        axes: Any = figure.add_subplot(**({} if flat else {"projection": "3d"}))
        self.ax = axes
        for i, letter in zip(self.axes, "xyz", strict=False):
            self.ax.set(**{f"{letter}lim": (self.centre[i] - reach, self.centre[i] + reach), f"{letter}label": f"{AXES[i]} (m)"})
            getattr(self.ax, f"{letter}axis").set_major_locator(MaxNLocator(4))
        if flat:
            self.ax.set_aspect("equal")
        else:
            elevation, azimuth = VIEW if view is None else view
            # The zoom is smaller than the default, so that the label of the z axis is not cut off.
            axes.set_box_aspect((1.0, 1.0, 1.0), zoom=0.86)
            axes.view_init(elevation, azimuth)
        self.shadow = None if flat else self.line(color="0.85", linewidth=2.5)
        self.slides = self.line(color="0.45", linewidth=2.0)
        self.links = self.line(color=COLOURS[0], linewidth=3.5, solid_capstyle="round")

    def line(self, **style: Any) -> Any:
        """A new line without points."""
        return self.ax.plot(*([] for _ in self.axes), **style)[0]

    def put(self, line: Any, points: Array) -> None:
        """Set the points of a line, (points, 3), m."""
        columns = [points[:, i] for i in self.axes]
        if len(columns) == 3:
            line.set_data_3d(*columns)
        else:
            line.set_data(*columns)

    def write(self, point: Array, text: str, below: bool = False) -> None:
        """Write above or below a point, (3,), m, on the side of the middle of the drawing, where no text is cut off."""
        across = (point - self.centre)[self.axes[0]]
        if len(self.axes) == 3:
            # The horizontal axis of the picture.
            azimuth = np.radians(self.ax.azim)
            across = (point - self.centre) @ (-np.sin(azimuth), np.cos(azimuth), 0.0)
        side = "left" if across <= 0.0 else "right"
        padded = "\n".join(f"  {part}  " for part in text.split("\n"))
        above = "top" if below else "bottom"
        self.ax.text(*(point[i] for i in self.axes), padded, horizontalalignment=side, verticalalignment=above, fontsize=9)

    def put_arm(self, lines: Lines, k: int) -> None:
        """Set the points of the links, the slides and their shadow to those of configuration `k`."""
        links, slides = _broken(lines.links[k]), _broken(lines.slides[k])
        if self.shadow is not None:
            fallen = np.concatenate([links, slides])
            fallen[:, 2] = self.floor
            self.put(self.shadow, fallen)
        self.put(self.links, links)
        self.put(self.slides, slides)


class Picture(Space):
    """A picture of an arm that can be drawn repeatedly.

    Args:
        cloud: points that the picture must contain, (points, 3), m.
        size: width and height, pixels.
        view: elevation and azimuth of the eye, as in `Space`.
        figure: the matplotlib figure to draw into; None: a figure without a window.
    """

    def __init__(self, caller: str, cloud: Array, size: int, view: tuple[float, float] | None = None, figure: Figure | None = None) -> None:
        require(caller)
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        if figure is None:
            figure = Figure(dpi=DPI)
            FigureCanvasAgg(figure)
        with sheet(figure, (size / figure.dpi, size / figure.dpi)) as self.figure:
            super().__init__(self.figure, cloud, view)
            self.trace = self.line(color=COLOURS[1], linewidth=1.0)
            self.joints = self.line(color=COLOURS[0], marker="o", markersize=6.0, linestyle="none")
            self.targets = self.line(color=COLOURS[2], marker="o", markersize=9.0, linestyle="none", fillstyle="none", markeredgewidth=2.0)
            # The text belongs to the figure. A title of the axes would make the axes narrower in a small picture.
            self.title = self.figure.suptitle("t = 0.00 s", x=0.02, horizontalalignment="left", fontsize=10)
            # The layout is computed once, so that the axes do not move between pictures.
            self.figure.canvas.draw()
            self.figure.set_layout_engine("none")

    def show(self, lines: Lines, k: int, title: str, targets: Array | None = None) -> None:
        """Draw configuration `k`, the path of the tip from configuration 0 to `k`, and the points `targets`, (points, 3), m."""
        self.put_arm(lines, k)
        self.put(self.joints, lines.joints[k])
        self.put(self.trace, lines.tip[: k + 1])
        self.put(self.targets, np.zeros((0, 3)) if targets is None else targets)
        self.title.set_text(title)
        self.figure.canvas.draw()

    def pixels(self) -> NDArray[np.uint8]:
        """The picture as RGB bytes, (height, width, 3)."""
        canvas: Any = self.figure.canvas
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _broken(ends: Array) -> Array:
    """Convert lines (lines, 2, 3) to one line with gaps. A row of NaN is a gap."""
    gaps = np.full((len(ends), 1, 3), np.nan)
    return np.concatenate([ends, gaps], axis=1).reshape(-1, 3)
