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


@result("minimum_time_swing.svg", "Energy over the angle: pushes from the start and from behind it, and the potential energy", PAGE)
def energies(figure: Figure, page: SimpleNamespace) -> None:
    limit, best = 0.72, page.swing[0.72].best
    theta = np.linspace(-1.2, np.pi + 0.2, 400)
    turn = best.theta_turn
    from_turn = theta[theta >= turn]
    stall = np.argmax((1.0 - np.cos(theta) > limit * theta) & (theta > 0.5))

    def draw(ax: Axes) -> None:
        ax.fill_between(theta, -1.2, -np.cos(theta), color="0.88", linewidth=0.0)
        ax.plot(theta, -np.cos(theta), color="0.3", label="$V$")
        at_start = theta[(theta >= 0.0) & (theta <= theta[stall])]
        ax.plot(at_start, -1.0 + limit * at_start, color=RED, label="push from\nthe start")
        ax.plot(theta[stall], -np.cos(theta[stall]), "x", color=RED, markersize=8, markeredgewidth=2.0)
        push = -np.cos(turn) + limit * (from_turn - turn)
        brake = 1.0 + limit * (np.pi - from_turn)
        seen = from_turn <= np.pi
        ax.plot(from_turn[seen], np.minimum(push, brake)[seen], color=BLUE, label="push from\nbehind, brake")
        back = theta[(theta >= turn) & (theta <= 0.0)]
        ax.plot(back, np.minimum(-1.0 - limit * back, -np.cos(turn) + limit * (back - turn)), color=BLUE, linestyle="--", label="back")
        ax.plot(turn, -np.cos(turn), "o", color=BLUE)
        ax.set(xlabel=r"$\theta$ (rad)", ylabel="energy (J)", ylim=(-1.2, 1.6), xlim=(-1.2, np.pi + 0.2))

    panels(figure, [2.4], draw)


@result("minimum_time_limit.svg", "Angle over time of the plan and of a link that is 2 percent heavier", PAGE)
def no_reserve(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for name, run, colour in (("plan", page.ends[1.0], GREEN), ("2 % heavier", page.ends[1.02], RED)):
            ax.plot(thin(run.t), thin(run.q)[:, 0], color=colour, label=name)
        ax.axhline(np.pi, color="0.4", linestyle=":", linewidth=1.0, label=r"$\theta_1$")
        ax.set(ylabel=r"$\theta$ (rad)", xlabel="time (s)")

    panels(figure, [2.0], draw)
