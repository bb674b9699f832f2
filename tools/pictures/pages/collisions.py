"""The pictures of `docs/collisions.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, INK, RED, Sketch, direction

PAGE = "collisions.md"


@drawing("collisions.svg", "An arm that hits a wall, and the comparison of its momentum with the known torques", PAGE)
def obstacle(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 2.4))
    # The arm at the wall.
    base = np.array([0.5, 0.55])
    elbow = base + direction(62.0, 1.05)
    tip = elbow + direction(-20.0, 0.85)
    sketch.foot(base)
    for start, end in ((base, elbow), (elbow, tip)):
        sketch.link(start, end)
    for centre in (base, elbow):
        sketch.joint(centre)
    sketch.point(tip)
    sketch.ground((tip[0] + 0.06, tip[1]), 1.1, 90.0)
    sketch.arrow(np.add(tip, (-0.06, -0.06)), np.add(tip, (-0.75, -0.06)), RED, 2.2)
    sketch.text(np.add(tip, (-0.45, -0.26)), "$F$", RED)
    sketch.text(np.add(base, (0.36, 0.1)), r"$\tau$", GREEN)
    # The observer.
    sketch.block((2.75, 1.45), 0.85, 0.55, r"$p = M v$", BLUE)
    sketch.block((2.45, 0.35), 1.2, 0.6, r"$w$", GREEN)
    sketch.text((2.95, 1.13), "known torques", GREEN, 9.5)
    sketch.arrow((2.05, 0.65), (2.45, 0.65), GREEN)
    sketch.text((2.22, 0.83), r"$\tau$", GREEN)
    sketch.joint((4.15, 1.2), INK, 0.11)
    sketch.text((4.15, 1.2), "$-$", INK, 10.0, zorder=6.0)
    sketch.line([(3.6, 1.72), (4.15, 1.72)], GREY)
    sketch.arrow((4.15, 1.72), (4.15, 1.31), GREY)
    sketch.line([(3.65, 0.65), (4.15, 0.65)], GREY)
    sketch.arrow((4.15, 0.65), (4.15, 1.09), GREY)
    sketch.arrow((4.26, 1.2), (4.75, 1.2), RED)
    sketch.text((4.5, 1.38), "$K$", GREY)
    sketch.text((4.9, 1.2), "$r$", RED)


@result("collisions_run.svg", "Force of the wall with and without a reaction, and the residual of joint 1", PAGE)
def reaction(figure: Figure, page: SimpleNamespace) -> None:
    def draw(force: Axes, residual: Axes) -> None:
        force.plot(page.unaware.t, page.unaware.contact_force, color=RED, linestyle="--", label="no reaction")
        force.plot(page.run.t, page.run.contact_force, color=BLUE, label="stop")
        force.set(ylabel="wall force (N)", xlim=(0.45, 0.85))
        torque = -page.arm.jacobian(page.run.q, "link2")[:, 0, 0] * page.run.contact_force
        residual.plot(page.run.t, torque, color=RED, linewidth=1.0, label="of the wall")
        residual.plot(page.run.t, page.run.residual[:, 0], color=BLUE, label="residual")
        residual.axhline(0.5, color=GREY, linestyle=":", linewidth=1.0, label="threshold")
        residual.set(ylabel="joint 1 (N m)", xlabel="time (s)")

    panels(figure, [1.7, 1.7], draw)


@result("collisions_limit.svg", "Residual of joint 1 without contact, with and without an unknown load", PAGE)
def load(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        ax.plot(thin(page.alarm.t), thin(page.alarm.residual)[:, 0], color=RED, label="unknown load")
        ax.plot(thin(page.free.t), thin(page.free.residual)[:, 0], color=BLUE, label="no load")
        for side in (-0.5, 0.5):
            ax.axhline(side, color=GREY, linestyle=":", linewidth=1.0, label="threshold" if side > 0.0 else None)
        ax.set(ylabel="residual (N m)", xlabel="time (s)")

    panels(figure, [2.0], draw)
