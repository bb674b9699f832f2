"""The pictures of `docs/priority.md`."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, INK, RED, Sketch, direction

PAGE = "priority.md"
LINKS = (1.1, 0.95, 0.6)


def elbows(wrist: NDArray[np.float64], base: NDArray[np.float64], up: bool) -> NDArray[np.float64]:
    """The joint between the first two links of the drawing."""
    reach = wrist - base
    distance = float(np.linalg.norm(reach))
    inner = np.degrees(np.arccos((LINKS[0] ** 2 + distance**2 - LINKS[1] ** 2) / (2 * LINKS[0] * distance)))
    return base + direction(float(np.degrees(np.arctan2(reach[1], reach[0]))) + (inner if up else -inner), LINKS[0])


@drawing("priority.svg", "An arm with two tasks, and two lines in the plane of two joint velocities", PAGE)
def lines(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 2.5))
    base, tip = np.array([0.45, 0.5]), np.array([1.95, 1.5])
    for last, colour in ((-15.0, INK), (70.0, GREEN)):
        wrist = tip - direction(last, LINKS[2])
        joints = [base, elbows(wrist, base, up=True), wrist, tip]
        for start, end in pairwise(joints):
            if colour == INK:
                sketch.link(start, end)
            else:
                sketch.line([start, end], GREEN, 1.3, linestyle="--")
        for centre in joints[1:-1]:
            sketch.joint(centre, colour, 0.075 if colour == INK else 0.055)
        if colour == INK:
            sketch.arrow(wrist, wrist + direction(120.0, 0.45), RED, 2.0)
            sketch.text(wrist + direction(120.0, 0.6), "2", RED)
    sketch.foot(base)
    sketch.joint(base)
    sketch.point(tip)
    sketch.arrow(tip, tip + direction(20.0, 0.5), BLUE, 2.0)
    sketch.text(tip + direction(20.0, 0.65), "1", BLUE)
    # The plane of two joint velocities: the line of task 1, its nearest point, and a step along it to the line of task 2.
    origin, unit = np.array([3.35, 0.75]), 0.8

    def at(x: float, y: float) -> NDArray[np.float64]:
        return origin + unit * np.array([x, y])

    for end, label, shift in ((at(1.95, 0.0), "joint 1", (-0.1, -0.17)), (at(0.0, 1.85), "joint 2", (0.36, 0.0))):
        sketch.arrow(origin - 0.3 * (end - origin), end, "0.5", 0.9)
        sketch.text(np.add(end, shift), label, "0.4", 9.0)
    sketch.line([at(-0.5, 1.35), at(2.1, 0.05)], BLUE, 2.0)
    sketch.line([at(1.1, -0.5), at(1.6, 1.5)], RED, 2.0)
    sketch.text(at(-0.4, 1.6), "task 1", BLUE)
    sketch.text(at(1.75, 1.65), "task 2", RED)
    near = np.array([0.44, 0.88])
    meeting = np.array([1.33333, 0.43333])
    sketch.arrow(origin, at(*near), INK, 1.8)
    sketch.text(at(0.02, 0.52), r"$J_1^\sharp v_1$", INK)
    sketch.arrow(at(*near), at(*meeting), GREEN, 2.4)
    sketch.text(at(0.98, 0.82), "$P_1 z$", GREEN)
    sketch.point(at(*meeting), INK, 0.06)
    sketch.text(at(1.52, 0.62), "$v$", INK, 12.0)


@result("priority_run.svg", "Final postures of the arm for both orders of two tasks, and the task errors over time", PAGE)
def orders(figure: Figure, page: SimpleNamespace) -> None:
    def posture(ax: Axes, q: Any, style: str, label: str, colour: str) -> None:
        corners = [[0.0, 0.0], *(page.arm.position(q, f"link{i + 1}")[:2] for i in range(4))]
        ax.plot(*np.transpose(corners), style, color=colour, marker="o", markersize=3.5, label=label)

    def draw(arms: Axes, tip: Axes, elbow: Axes) -> None:
        posture(arms, page.start, "-", "start", "0.6")
        posture(arms, page.runs[0].q[-1], "-", "tip first", BLUE)
        posture(arms, page.runs[1].q[-1], "--", "elbow first", RED)
        arms.plot(0.2, 1.0, "x", color=INK, markersize=8, markeredgewidth=2.0, label="target of\nthe tip")
        arms.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(-0.6, 1.9), ylim=(-0.1, 1.95))
        for run, style, colour, place, name in zip(page.runs, ("-", "--"), (BLUE, RED), (0, 1), ("tip first", "elbow first"), strict=True):
            errors = [run.monitors["error_1"], run.monitors["error_2"]]
            for ax, error in ((tip, errors[place]), (elbow, errors[1 - place])):
                ax.plot(thin(run.t), thin(error), style, color=colour, label=name)
        tip.sharex(elbow)
        tip.tick_params(labelbottom=False)
        tip.set_ylabel("tip error (m)")
        elbow.set(ylabel="elbow error (m)", xlabel="time (s)")

    panels(figure, [2.6, 1.3, 1.3], draw, share=False)


@result("priority_limit.svg", "Joint speed of two methods over the angle of joint 4, near a singularity", PAGE)
def pole(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for method, colour in (("exact", RED), ("clamp", BLUE)):
            ax.semilogy(page.q4, np.linalg.norm(page.paths[method].v, axis=1), color=colour, label=method)
        ax.set(xlabel="$q_4$ (rad)", ylabel="joint speed (rad/s)")

    panels(figure, [2.0], draw)
