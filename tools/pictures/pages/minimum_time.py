"""The pictures of `docs/minimum_time.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, RED, Sketch, direction

import armlet as al

PAGE = "minimum_time.md"


@drawing("minimum_time.svg", "A link hangs from a motor; its angle is measured from the downward vertical", PAGE)
def link(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 3.3))
    pivot, length, angle = np.array([2.2, 1.65]), 1.3, -25.0
    sketch.line([pivot, np.add(pivot, (0.0, -1.4))], GREY, 0.9, linestyle="--")
    for turn in (-90.0, 90.0):
        sketch.link(pivot, pivot + direction(turn, length), "0.7", 7.0, 0.3)
    sketch.text(np.add(pivot, (-0.3, -1.3)), r"$\theta_0$", GREY)
    sketch.text(np.add(pivot, (-0.3, 1.25)), r"$\theta_1$", GREY)
    sketch.link(pivot, pivot + direction(angle, length))
    mass = pivot + direction(angle, 0.95)
    sketch.centre_of_mass(mass)
    sketch.arrow(mass, np.add(mass, (0.0, -0.75)), GREEN, 1.8)
    sketch.text(np.add(mass, (0.28, -0.65)), "$m g_0$", GREEN)
    sketch.dimension(pivot + direction(angle + 90.0, 0.2), mass + direction(angle + 90.0, 0.2), "$d$", direction(angle + 90.0, 0.18))
    sketch.angle(pivot, 0.6, -90.0, angle, r"$\theta$")
    sketch.angle(pivot, 0.42, 95.0, 215.0, r"$\tau$", RED)
    sketch.joint(pivot)
    sketch.text((4.3, 2.5), "$|\\tau| \\leq \\tau_{max}$", RED)
    sketch.text((4.3, 2.1), "at rest at $\\theta_0$\nand at $\\theta_1$", GREY, 9.5, va="top")


@result("minimum_time_run.svg", "Angle and torque over time of the profile, the optimum and the weak motor", PAGE)
def lifts(figure: Figure, page: SimpleNamespace) -> None:
    profile = al.BangBang([0.0], [np.pi], page.profile.t_min)
    slow = np.linspace(0.0, page.profile.t_min, 400)
    q, _, a = (np.array(each) for each in zip(*(profile(t) for t in slow), strict=True))

    def draw(angle: Axes, torque: Axes) -> None:
        angle.plot(slow, q[:, 0], color=RED, label="profile")
        torque.plot(slow, a[:, 0] + np.sin(q[:, 0]), color=RED, label="profile")
        for name, best, colour in (("optimum", page.strong, BLUE), ("weak motor", page.weak, GREEN)):
            t = np.linspace(0.0, best.t, 400)
            made = best.profile(t)
            angle.plot(t, made[0], color=colour, label=name)
            torque.plot(t, made[3], color=colour, label=name)
        torque.axhline(1.0, color="0.4", linestyle=":", linewidth=1.0, label="$G$")
        angle.set_ylabel(r"$\theta$ (rad)")
        torque.set(ylabel=r"$\tau$ (N m)", xlabel="time (s)")

    panels(figure, [1.7, 1.7], draw)


@result("minimum_time_limit.svg", "Angle over time of the plan and of a link that is 2 percent heavier", PAGE)
def no_reserve(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for name, run, colour in (("plan", page.ends[1.0], GREEN), ("2 % heavier", page.ends[1.02], RED)):
            ax.plot(thin(run.t), thin(run.q)[:, 0], color=colour, label=name)
        ax.axhline(np.pi, color="0.4", linestyle=":", linewidth=1.0, label=r"$\theta_1$")
        ax.set(ylabel=r"$\theta$ (rad)", xlabel="time (s)")

    panels(figure, [2.0], draw)
