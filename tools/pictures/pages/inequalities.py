"""The pictures of `docs/inequalities.md`."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from panels import panels
from registry import drawing, result
from sketch import BLUE, GREEN, INK, RED, Sketch, direction

PAGE = "inequalities.md"


@drawing("inequalities.svg", "An arm with a speed limit and two tasks, and a polygon of joint velocities with two lines", PAGE)
def polygon(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 2.5))
    # The arm: two long links and two short ones.
    joints = [np.array([0.5, 0.6])]
    for length, turn in zip((1.15, 1.15, 0.4, 0.4), (0.0, 90.0, 180.0, 203.0), strict=True):
        joints.append(joints[-1] + direction(turn, length))
    sketch.foot(joints[0])
    for start, end in pairwise(joints):
        sketch.link(start, end)
    for centre in joints[:-1]:
        sketch.joint(centre)
    sketch.point(joints[-1])
    sketch.text(np.add(joints[1], (0.0, -0.22)), r"$|v_2| \leq 0.5$ rad/s", GREEN)
    for at, label, colour, side in ((joints[4], "1", BLUE, (-0.02, 0.2)), (joints[2], "2", RED, (0.2, 0.0))):
        sketch.arrow(at, np.add(at, 0.32), colour, 2.0)
        sketch.text(np.add(at, 0.32) + np.array(side), label, colour)
    # The plane of two joint velocities.
    origin, unit = np.array([3.45, 1.25]), 0.72

    def at(x: float, y: float) -> NDArray[np.float64]:
        return origin + unit * np.array([x, y])

    corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 0.2), (0.2, 1.0), (-1.0, 1.0)]
    sketch.ax.add_patch(Polygon([at(*corner) for corner in corners], facecolor=GREEN + "22", edgecolor=GREEN, linewidth=1.6))
    for tip, label, shift in (((1.75, 0.0), "$v_1$", (0.05, 0.15)), ((0.0, 1.4), "$v_2$", (0.2, 0.0))):
        back = -1.2 * np.array(tip) / np.linalg.norm(tip)
        sketch.arrow(at(*back), at(*tip), "0.5", 0.9)
        sketch.text(np.add(at(*tip), shift), label, "0.4")
    sketch.line([at(-1.5, 1.25), at(1.8, -0.4)], BLUE, 2.0)
    sketch.line([at(0.5, -1.3), at(2.1, 0.3)], RED, 2.0)
    sketch.text(at(-1.62, 1.42), "task 1", BLUE)
    sketch.text(at(1.18, -1.42), "task 2", RED)
    sketch.line([at(1.0, 0.0), at(1.4, -0.4)], INK, 1.2, linestyle=":")
    sketch.point(at(1.0, 0.0), INK, 0.06)
    sketch.text(at(1.18, 0.24), "X", INK, 13.0)
    sketch.text(at(-0.5, -0.55), "limits", GREEN)


@result("inequalities_run.svg", "Velocity of joint 2 and velocity errors of both tasks over the commanded speed", PAGE)
def speeds(figure: Figure, page: SimpleNamespace) -> None:
    commanded = page.speed[:, 0]

    def draw(joint: Axes, errors: Axes) -> None:
        joint.plot(commanded, page.free.v[:, 1], "--", color=RED, label="no limit")
        joint.plot(commanded, page.bounded.v[:, 1], color=GREEN, linewidth=2.0, label="limit")
        joint.set_ylabel("$v_2$ (rad/s)")
        for residual, colour, name in zip(page.bounded.residuals, (BLUE, RED), ("tip", "elbow"), strict=True):
            errors.plot(commanded, np.linalg.norm(residual, axis=1), color=colour, label=name)
        errors.set(ylabel="error (m/s)", xlabel="commanded speed in each axis (m/s)")

    panels(figure, [1.5, 1.5], draw)


@result("inequalities_active.svg", "Velocity of joint 2 with its limit, and errors of tip and elbow, over time", PAGE)
def active(figure: Figure, page: SimpleNamespace) -> None:
    run, hold = page.limited, page.hold

    def draw(joint: Axes, errors: Axes) -> None:
        joint.axvspan(hold.start, hold.end, color=GREEN, alpha=0.2, linewidth=0.0, label="limit holds level 2")
        joint.plot(run.t, run.v[:, 1], color=GREEN, label="joint 2")
        joint.set_ylabel("$v_2$ (rad/s)")
        for name, colour, label in (("error_1", BLUE, "tip"), ("error_2", RED, "elbow")):
            errors.plot(run.t, run.monitors[name], color=colour, label=label)
        errors.set(ylabel="error (m)", xlabel="time (s)")

    panels(figure, [1.5, 1.5], draw)


@result("inequalities_limit.svg", "The tip velocities that the limits allow, a command, and two answers to it", PAGE)
def directions(figure: Figure, page: SimpleNamespace) -> None:
    # The limits are 0.5 rad/s to both sides, so each column of the matrix is an edge. Edges are sorted by their angle.
    edges = np.concatenate([page.J1.T, -page.J1.T])
    edges = edges[np.argsort(np.arctan2(edges[:, 1], edges[:, 0]))]
    corners = np.cumsum(edges, axis=0)
    corners -= corners.mean(axis=0)

    def draw(ax: Axes) -> None:
        ax.add_patch(Polygon(corners, facecolor=GREEN + "22", edgecolor=GREEN, label="within the\nlimits"))
        ax.plot(*np.array([[0.0, 0.0], page.ahead]).T, "--", color="0.4")
        ax.plot(*page.ahead, "o", color="0.2", label="command")
        ax.plot(*page.nearest, "s", color=RED, label="exact")
        ax.plot(*page.scaled, "D", color=BLUE, label="sns")
        ax.plot(*np.array([page.ahead, page.nearest]).T, ":", color=RED)
        ax.set(xlabel="velocity along x (m/s)", ylabel="along y (m/s)", aspect="equal", xlim=(-1.1, 1.4), ylim=(-0.95, 0.95))

    panels(figure, [2.4], draw)
