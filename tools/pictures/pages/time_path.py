"""The pictures of `docs/time_path.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, INK, RED, Sketch, direction

import armlet as al

PAGE = "time_path.md"


@drawing("time_path.svg", "An arm whose tip follows a curve through three waypoints, with the path position s along the curve", PAGE)
def curve(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 3.25))
    base, lengths = np.array([0.9, 0.6]), (1.35, 1.08)

    def joints(q: list[float]) -> tuple[np.ndarray, np.ndarray]:
        elbow = base + direction(np.degrees(q[0]), lengths[0])
        return elbow, elbow + direction(np.degrees(q[0] + q[1]), lengths[1])

    path = al.time_path(al.planar_arm([0.5, 0.4]), [[0.0, 0.0], [0.5, 0.8], [1.2, 0.3]], tau_max=[20.0, 8.0])
    points = np.array([joints(path.path(s)[0])[1] for s in np.linspace(0.0, 1.0, 80)])
    sketch.line(points, RED, 2.0)
    for s, label, shift in ((0.0, "$s = 0$", (0.0, -0.22)), (1.0, "$s = 1$", (0.0, 0.2))):
        end = joints(path.path(s)[0])[1]
        sketch.point(end, RED)
        sketch.text(np.add(end, shift), label, RED)
    elbow, tip = joints(path.path(0.45)[0])
    sketch.foot(base)
    sketch.link(base, elbow)
    sketch.link(elbow, tip)
    sketch.joint(base)
    sketch.joint(elbow)
    ahead = joints(path.path(0.5)[0])[1] - tip
    sketch.arrow(tip, tip + 0.75 * ahead / np.linalg.norm(ahead), GREEN, 2.0)
    sketch.text(np.add(tip, (0.42, 0.42)), r"$\dot s$ = ?", GREEN, 12.0)
    sketch.point(tip)
    sketch.text(np.add(base, (0.42, -0.02)), r"$\tau_1$", INK)
    sketch.text(np.add(elbow, (0.3, -0.08)), r"$\tau_2$", INK)
    sketch.text((4.3, 2.9), r"$|\tau_i| \leq \tau_{max,i}$", GREY)


@result("time_path_run.svg", "Torques and speeds as fractions of their limits, and path speed over path position", PAGE)
def timing(figure: Figure, page: SimpleNamespace) -> None:
    t = np.linspace(0.0, page.p.duration, len(page.q))
    slope = np.abs(page.p.path(page.p.s)[1])

    def draw(parts: Axes, speed: Axes) -> None:
        for i, colour in enumerate((BLUE, RED)):
            parts.plot(t, page.tau[:, i] / [20.0, 8.0][i], color=colour, label=f"torque {i + 1}")
            parts.plot(t, page.v[:, i] / 4.0, color=colour, linestyle="--", label=f"speed {i + 1}")
        for bound in (-1.0, 1.0):
            parts.axhline(bound, color="0.4", linestyle=":", linewidth=1.0)
        parts.set(xlabel="time (s)", ylabel="part of limit (1)", ylim=(-1.15, 1.15))
        speed.plot(page.p.s, page.p.s_dot, color=GREEN, label="timing")
        speed.plot(page.p.s, (4.0 / slope).min(axis=1), color="0.4", linestyle=":", label="speed limit")
        speed.set(xlabel="path position $s$ (1)", ylabel=r"$\dot s$ (1/s)", ylim=(0.0, 5.0))

    panels(figure, [2.1, 2.0], draw, share=False)


@result("time_path_top.svg", "Path speed of the fastest motion and the maximum-velocity curve", PAGE)
def top(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        highest = np.sqrt(page.top)
        ax.fill_between(page.s, highest, 14.0, color=RED, alpha=0.12, linewidth=0.0)
        ax.plot(page.s, highest, color=RED, label="maximum-\nvelocity curve")
        ax.plot(page.turn.s, page.turn.s_dot, color=GREEN, linewidth=2.0, label="fastest\nmotion")
        ax.set(xlabel="path position $s$ (1)", ylabel=r"$\dot s$ (1/s)", ylim=(0.0, 14.0), xlim=(0.0, 1.0))

    panels(figure, [2.3], draw)


@result("time_path_limit.svg", "Gravity torque along the path against the torque limit", PAGE)
def gravity(figure: Figure, page: SimpleNamespace) -> None:
    s = np.linspace(0.0, 1.0, 200)
    q = (1.0 - s)[:, None] * page.reach[0] + s[:, None] * page.reach[1]

    def draw(ax: Axes) -> None:
        ax.plot(s, page.arm.gravity(q)[:, 0], color=BLUE, label="gravity $g_1$")
        ax.axhline(2.0, color=RED, linestyle=":", label="limit")
        ax.fill_between(s, 2.0, np.maximum(page.arm.gravity(q)[:, 0], 2.0), color=RED, alpha=0.2, linewidth=0.0)
        ax.set(xlabel="path position $s$ (1)", ylabel="torque (N m)", ylim=(0.0, None))

    panels(figure, [2.0], draw)
