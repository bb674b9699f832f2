"""The pictures of `docs/impedance.md`."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, INK, RED, Point, Sketch, direction

from armlet.figures import COLOURS

PAGE = "impedance.md"
LENGTHS = (1.15, 1.0, 0.75)


def chain(base: Point, tip: Point, last: float) -> list[Point]:
    """The joints of a planar arm of three links whose last link has an angle, degrees, with the elbow above."""
    wrist = np.asarray(tip) - direction(last, LENGTHS[2])
    reach = wrist - np.asarray(base)
    distance = np.linalg.norm(reach)
    a, b = LENGTHS[:2]
    inner = np.degrees(np.arccos((a**2 + distance**2 - b**2) / (2 * a * distance)))
    elbow = np.asarray(base) + direction(np.degrees(np.arctan2(reach[1], reach[0])) + inner, a)
    return [base, elbow, wrist, tip]


@drawing("impedance.svg", "An arm of three links whose tip hangs on a spring and a damper, and a second posture with the same tip", PAGE)
def postures(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 2.3))
    base, tip = (0.75, 0.55), (2.6, 0.95)
    now, better = chain(base, tip, -70.0), chain(base, tip, 5.0)
    sketch.foot(base)
    for start, end in pairwise(now):
        sketch.link(start, end)
    for start, end in pairwise(better):
        sketch.line([start, end], GREEN, 1.4, linestyle="--")
    for centre in better[1:-1]:
        sketch.joint(centre, GREEN, 0.055)
    for centre in now[:-1]:
        sketch.joint(centre)
    sketch.point(tip)
    target = np.add(tip, (1.3, 0.0))
    sketch.spring_and_damper(tip, target, RED)
    sketch.line([np.add(target, (0.0, 0.3)), np.add(target, (0.0, -0.3))], RED, 2.0)
    sketch.text(np.add(target, (0.2, 0.0)), "$x_d$", RED)
    sketch.text(np.add(tip, (0.65, 0.4)), "$K_m$", RED)
    sketch.text(np.add(tip, (0.65, -0.42)), "$D_m$", RED)
    sketch.text(np.add(tip, (-0.02, -0.24)), "$x$")
    middle = 0.5 * np.add(now[2], better[2])
    sketch.arrow(np.add(now[2], (-0.1, -0.12)), np.add(better[2], (0.06, 0.12)), GREEN, 1.4)
    sketch.text(np.add(middle, (0.2, -0.05)), r"$\tau_0$", GREEN)
    sketch.text(np.add(better[1], (-0.22, 0.1)), "$q_n$", GREEN)
    sketch.text(np.add(now[1], (0.0, 0.22)), "$q$", INK)


def distance(page: SimpleNamespace, run: Any, frame: str) -> Any:
    """The distance of a frame from its position at the start, mm."""
    return 1e3 * np.linalg.norm(page.arm.position(thin(run.q), frame) - page.arm.position(page.q0, frame), axis=1)


@result("impedance_run.svg", "Joint angles, and distances of elbow and tip from their positions at the start", PAGE)
def null_space(figure: Figure, page: SimpleNamespace) -> None:
    run = page.run

    def draw(joints: Axes, tip: Axes) -> None:
        for i in range(7):
            joints.plot(thin(run.t), (thin(run.q) - page.q0)[:, i], color=COLOURS[i], label=f"joint {i + 1}")
        joints.set_ylabel("$q - q_0$ (rad)")
        tip.plot(thin(run.t), distance(page, run, "link4"), color=GREEN, label="elbow")
        tip.plot(thin(run.t), distance(page, run, "tcp"), color=BLUE, linewidth=2.0, label="tip")
        tip.set(ylabel="distance (mm)", xlabel="time (s)")

    panels(figure, [2.1, 1.3], draw)


@result("impedance_damping.svg", "Distance of the tip from its target over time for three dampings", PAGE)
def damping(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for (name, run), colour in zip(page.back.items(), (RED, BLUE, GREEN), strict=True):
            error = 1e3 * np.linalg.norm(page.arm.position(thin(run.q), "tcp") - page.x_d - 0.02, axis=1)
            ax.plot(thin(run.t), error, color=colour, label=name)
        ax.set(ylabel="distance (mm)", xlabel="time (s)", ylim=(0.0, None))

    panels(figure, [2.0], draw)


@result("impedance_limit.svg", "Distance of the tip from its target while the elbow is pushed", PAGE)
def elbow(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        ax.axvspan(3.0, 6.0, color="0.9", label="push on\nthe elbow")
        ax.plot(thin(page.pushed.t), distance(page, page.pushed, "tcp"), color=RED, label="tip")
        ax.set(ylabel="distance (mm)", xlabel="time (s)", ylim=(0.0, None))

    panels(figure, [2.0], draw)
