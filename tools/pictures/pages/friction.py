"""The pictures of `docs/friction.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, INK, RED, Sketch, direction

PAGE = "friction.md"


@drawing("friction.svg", "A body on a rough surface that a spring pulls, and the friction torque over the speed", PAGE)
def rough(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 2.4))
    # A body on bristles, pulled by a spring.
    sketch.ground((1.25, 0.55), 2.1)
    for x in np.arange(0.5, 1.3, 0.1):
        sketch.line([(x, 0.55), np.array([x, 0.55]) + direction(66.0, 0.2)], GREY, 1.0)
    sketch.block((0.4, 0.73), 0.95, 0.62, "$M$", BLUE)
    sketch.spring((1.35, 1.04), (2.2, 1.04), colour=RED)
    sketch.line([(2.2, 1.3), (2.2, 0.78)], RED, 2.0)
    sketch.text((1.78, 1.3), "$k_p$", RED)
    sketch.text((2.2, 1.47), "target", RED, 9.5)
    sketch.arrow((0.95, 0.42), (0.35, 0.42), GREEN, 1.8)
    sketch.text((0.65, 0.22), r"$\tau_f$", GREEN)
    # The friction curve: an interval at rest, a fall, a level.
    origin = np.array([3.85, 1.15])
    sketch.arrow(origin - (1.15, 0.0), origin + np.array([1.2, 0.0]), GREY, 1.0)
    sketch.arrow(origin - (0.0, 1.0), origin + np.array([0.0, 1.1]), GREY, 1.0)
    v = np.linspace(0.0, 1.0, 60)
    h = 0.45 + 0.4 * np.exp(-((v / 0.25) ** 2))
    for sign in (-1.0, 1.0):
        sketch.line(np.column_stack([origin[0] + sign * v, origin[1] + sign * h]), GREEN, 2.0)
    sketch.line([np.subtract(origin, (0.0, 0.85)), np.add(origin, (0.0, 0.85))], GREEN, 3.5)
    sketch.text(np.add(origin, (1.15, -0.18)), "$v$", GREY)
    sketch.text(np.add(origin, (0.22, 1.05)), r"$\tau_f$", GREY)
    sketch.text(np.add(origin, (-0.2, 0.83)), "$F_s$", INK)
    sketch.text(np.add(origin, (0.95, 0.63)), "$F_c$", INK)
    sketch.text(np.add(origin, (-0.62, 0.4)), "stuck", GREEN, 9.5)


@result("friction_run.svg", "Angle and friction torque of a joint under PD control", PAGE)
def stops_short(figure: Figure, page: SimpleNamespace) -> None:
    run = page.run

    def draw(angle: Axes, torque: Axes) -> None:
        angle.plot(run.t, run.q[:, 0], color=BLUE, label="angle")
        angle.axhline(1.0, color=RED, linestyle="--", linewidth=1.0, label="target")
        # The moment of rest is located a rounding error beyond zero velocity, where the sign of the friction changes.
        moving = (run.v[:, 0] == 0.0) | (np.abs(run.v[:, 0]) > 1e-6)
        torque.plot(run.t[moving], run.friction[moving, 0], color=GREEN, label=r"$\tau_f$")
        torque.plot(run.t, 10.0 * (1.0 - run.q[:, 0]), color=RED, linestyle="--", linewidth=1.0, label="$k_p e$")
        angle.set_ylabel("angle (rad)")
        torque.set(ylabel="torque (N m)", xlabel="time (s)", ylim=(0.0, 2.5))

    panels(figure, [1.7, 1.7], draw)


@result("friction_compensation.svg", "Errors of three compensations while moving and at rest, and the jumps of their torque", PAGE)
def compensation(figure: Figure, page: SimpleNamespace) -> None:
    names = list(page.compensations)
    place = np.arange(len(names))

    def draw(error: Axes, jump: Axes) -> None:
        for made, shift, colour, name in ((page.moving, -0.2, BLUE, "moving"), (page.resting, 0.2, RED, "at rest")):
            error.bar(place + shift, [made[each][0] for each in names], 0.38, color=colour, label=name)
            jump.bar(place + shift, [made[each][1] for each in names], 0.38, color=colour, label=name)
        error.set_ylabel("error (rad)")
        jump.set(ylabel="jump (N m)", xticks=place, xticklabels=names)
        jump.grid(visible=False, axis="x")
        error.grid(visible=False, axis="x")

    panels(figure, [1.5, 1.5], draw)


@result("friction_limit.svg", "Angle over time with integral action: the joint jumps around its target", PAGE)
def hunting(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        ax.plot(thin(page.hunting.t, 2000), thin(page.hunting.q, 2000)[:, 0], color=BLUE, label="PID")
        ax.axhline(1.0, color=RED, linestyle="--", linewidth=1.0, label="target")
        ax.set(ylabel="angle (rad)", xlabel="time (s)", ylim=(0.8, 1.2))

    panels(figure, [2.0], draw)
