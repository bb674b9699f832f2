"""Parts of schematic drawings: links, joints, springs, walls, arrows, boxes. Lengths are units of the drawing, angles are degrees.

A label is text or TeX between dollar signs. matplotlib draws it as outlines, so a drawing looks the same in every browser, without fonts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, FancyBboxPatch, Polygon, Rectangle, Wedge
from numpy.typing import NDArray

from armlet.figures import COLOURS

__all__ = ["BLUE", "DARK", "GREEN", "GREY", "INK", "RED", "Point", "Sketch", "direction"]

BLUE, RED, GREEN = COLOURS[0], COLOURS[1], COLOURS[2]
INK, GREY, DARK = "0.15", "0.5", "#444444"
Point = Sequence[float] | NDArray[np.float64]


def direction(angle: float, length: float = 1.0) -> NDArray[np.float64]:
    """The vector of a length at an angle from the x axis."""
    return length * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])


class Sketch:
    """A drawing in the rectangle from (0, 0) to `size`. A unit is an inch of the figure."""

    def __init__(self, figure: Figure, size: tuple[float, float]) -> None:
        figure.set_size_inches(size)
        self.ax: Axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.ax.set(xlim=(0.0, size[0]), ylim=(0.0, size[1]), aspect="equal")
        self.ax.axis("off")

    def text(self, at: Point, label: str, colour: str = INK, size: float = 11.0, **style: Any) -> None:
        """A label whose centre is `at`."""
        self.ax.text(*at, label, **({"color": colour, "fontsize": size, "ha": "center", "va": "center"} | style))

    def line(self, points: Sequence[Point] | NDArray[np.float64], colour: str = INK, width: float = 1.2, **style: Any) -> None:
        """A line through points."""
        self.ax.plot(*np.asarray(points, dtype=float).T, color=colour, linewidth=width, solid_capstyle="round", **style)

    def arrow(self, start: Point, end: Point, colour: str = INK, width: float = 1.4, style: str = "-|>", bend: float = 0.0) -> None:
        """An arrow. With `bend` it is an arc, whose height is this fraction of half its length."""
        arrow = FancyArrowPatch(
            tuple(start), tuple(end), arrowstyle=style, mutation_scale=11.0, color=colour, linewidth=width, shrinkA=0.0, shrinkB=0.0,
            connectionstyle=f"arc3,rad={bend}", zorder=4.0,
        )  # fmt: skip
        self.ax.add_patch(arrow)

    def angle(self, centre: Point, radius: float, start: float, end: float, label: str, colour: str = INK, out: float = 0.17) -> None:
        """An arc with an arrow head at its end, and its label outside of its middle."""
        low, high = min(start, end), max(start, end)
        self.ax.add_patch(Arc(tuple(centre), 2 * radius, 2 * radius, theta1=low, theta2=high, color=colour, linewidth=1.0))
        sign = 1.0 if end > start else -1.0
        tip = np.asarray(centre) + direction(end, radius)
        self.arrow(tip - direction(end + 90.0 * sign, 0.02), tip, colour, 0.8)
        self.text(np.asarray(centre) + direction(0.5 * (start + end), radius + out), label, colour)

    def link(self, start: Point, end: Point, colour: str = BLUE, width: float = 9.0, alpha: float = 0.35) -> None:
        """A link: a broad line between two joints."""
        self.line([start, end], colour, width, alpha=alpha, zorder=1.0)

    def joint(self, at: Point, colour: str = INK, radius: float = 0.075) -> None:
        """A revolute joint."""
        self.ax.add_patch(Circle(tuple(at), radius, facecolor="white", edgecolor=colour, linewidth=1.4, zorder=3.0))

    def point(self, at: Point, colour: str = INK, radius: float = 0.045) -> None:
        """A small disc, such as the tip of an arm."""
        self.ax.add_patch(Circle(tuple(at), radius, color=colour, zorder=3.5))

    def centre_of_mass(self, at: Point, radius: float = 0.085) -> None:
        """The symbol of a centre of mass: a disc in quarters."""
        self.ax.add_patch(Circle(tuple(at), radius, facecolor="white", edgecolor=INK, linewidth=1.0, zorder=3.0))
        for start in (0.0, 180.0):
            self.ax.add_patch(Wedge(tuple(at), radius, start, start + 90.0, color=INK, zorder=3.1))

    def ground(self, at: Point, width: float = 0.7, angle: float = 0.0) -> None:
        """A fixed surface through `at`, with hatches on the side below. `angle` turns it."""
        along, below = direction(angle), direction(angle - 90.0)
        centre = np.asarray(at, dtype=float)
        self.line([centre - 0.5 * width * along, centre + 0.5 * width * along], INK, 1.6)
        for place in np.arange(-0.5 * width + 0.06, 0.5 * width + 0.01, 0.12):
            start = centre + place * along
            self.line([start, start + 0.1 * below - 0.08 * along], INK, 0.8)

    def foot(self, at: Point) -> None:
        """The base of an arm: a triangle below the joint `at`, on the ground."""
        x, y = at
        corners = [(x, y), (x - 0.19, y - 0.3), (x + 0.19, y - 0.3)]
        self.ax.add_patch(Polygon(corners, facecolor="0.9", edgecolor=INK, linewidth=1.2, zorder=0.9))
        self.ground((x, y - 0.3), 0.62)

    def spring(self, start: Point, end: Point, turns: int = 5, colour: str = INK, height: float = 0.09, width: float = 1.2) -> None:
        """A spring between two points."""
        a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        along = (b - a) / np.linalg.norm(b - a)
        across = np.array([-along[1], along[0]])
        inner = np.linspace(0.2, 0.8, 2 * turns + 1)
        zigzag = [a + f * (b - a) + height * (0.0 if i in (0, 2 * turns) else (-1.0) ** i) * across for i, f in enumerate(inner)]
        self.line([a, *zigzag, b], colour, width)

    def damper(self, start: Point, end: Point, colour: str = INK, height: float = 0.09) -> None:
        """A damper between two points: a piston in a cylinder."""
        a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        along = (b - a) / np.linalg.norm(b - a)
        across = height * np.array([-along[1], along[0]])
        left, piston, right = a + 0.35 * (b - a), a + 0.52 * (b - a), a + 0.65 * (b - a)
        self.line([a, left], colour)
        self.line([right + across, left + across, left - across, right - across], colour)
        self.line([piston + 0.8 * across, piston - 0.8 * across], colour)
        self.line([piston, b], colour)

    def spring_and_damper(self, start: Point, end: Point, colour: str = INK, gap: float = 0.17) -> None:
        """A spring above a damper between two points."""
        a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        along = (b - a) / np.linalg.norm(b - a)
        across = gap * np.array([-along[1], along[0]])
        left, right = a + 0.12 * (b - a), b - 0.12 * (b - a)
        self.line([a, left], colour)
        self.line([right, b], colour)
        for fork in (left, right):
            self.line([fork + across, fork - across], colour)
        self.spring(left + across, right + across, colour=colour)
        self.damper(left - across, right - across, colour=colour)

    def block(self, corner: Point, width: float, height: float, label: str = "", colour: str = BLUE, size: float = 11.0) -> None:
        """A box of a diagram with its label."""
        pad = 0.05
        box = FancyBboxPatch(
            (corner[0] + pad, corner[1] + pad), width - 2 * pad, height - 2 * pad, boxstyle=f"round,pad={pad}",
            facecolor=colour + "18", edgecolor=colour, linewidth=1.3, zorder=2.0,
        )  # fmt: skip
        self.ax.add_patch(box)
        if label:
            self.text((corner[0] + 0.5 * width, corner[1] + 0.5 * height), label, size=size, zorder=5.0)

    def box(self, corner: Point, width: float, height: float, colour: str = BLUE, alpha: float = 0.35) -> None:
        """A filled rectangle, such as the carriage of a prismatic joint."""
        self.ax.add_patch(Rectangle(tuple(corner), width, height, facecolor=colour, alpha=alpha, edgecolor="none", zorder=1.0))

    def axes(self, at: Point, labels: tuple[str, str] = ("$x$", "$y$"), length: float = 0.45, angle: float = 0.0) -> None:
        """The axes of a frame with their labels."""
        origin = np.asarray(at, dtype=float)
        for label, turn in zip(labels, (0.0, 90.0), strict=True):
            tip = origin + direction(angle + turn, length)
            self.arrow(origin, tip, GREY, 1.0)
            self.text(tip + direction(angle + turn, 0.13), label, GREY, 10.0)

    def dimension(self, start: Point, end: Point, label: str, shift: Point = (0.0, 0.16)) -> None:
        """A distance with arrow heads at both ends, and its label beside its middle."""
        self.arrow(start, end, GREY, 0.9, "<|-|>")
        self.text(0.5 * (np.asarray(start) + np.asarray(end)) + np.asarray(shift), label)
