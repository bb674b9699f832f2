"""Pictures of the exam: the PR robot of exercise 1, and figures 2 and 4 of exercise 4, which show acceleration and gravity over time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import armlet as al

__all__ = ["exam_figures", "pr_robot"]


def pr_robot(ax: Any, q: tuple[float, float] = (0.9, 0.8), length: float = 0.7) -> None:
    """Draw the PR robot from above: joint 1 slides along x by q1, link 2 is rotated by q2 from the -y axis.

    With these coordinates `B = m2 d2`: the mass of link 2 times the distance of its centre of mass from joint 2.
    """
    from ..figures.style import COLOURS

    slide, angle = q
    tip = np.array([slide + length * math.sin(angle), -length * math.cos(angle)])
    ax.plot([-0.1, 1.7], [0.0, 0.0], color="0.6", linewidth=3, zorder=1)
    ax.add_patch(_box(slide))
    ax.plot([slide, tip[0]], [0.0, tip[1]], color=COLOURS[0], linewidth=6, solid_capstyle="round", zorder=3)
    ax.plot(slide, 0.0, "o", color="white", markeredgecolor="0.25", markersize=9, zorder=4)
    ax.plot(*(0.55 * tip + 0.45 * np.array([slide, 0.0])), "o", color="black", markersize=6, zorder=4)
    ax.plot([slide, slide], [0.0, -0.85], color="0.5", linestyle=":", linewidth=1.0)
    arc = np.linspace(0.0, angle, 40)
    ax.plot(slide + 0.45 * np.sin(arc), -0.45 * np.cos(arc), color=COLOURS[1], linewidth=1.2)
    ax.text(slide + 0.5 * math.sin(angle / 2), -0.5 * math.cos(angle / 2), "$q_2$", color=COLOURS[1], ha="center", va="top")
    ax.annotate("", (slide, 0.25), (0.0, 0.25), arrowprops={"arrowstyle": "<->", "color": COLOURS[1]})
    ax.text(slide / 2, 0.28, "$q_1$", color=COLOURS[1], ha="center", va="bottom")
    ax.set_aspect("equal")
    ax.set_xlim(-0.2, 1.8)
    ax.set_ylim(-1.0, 0.5)
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y (m)")
    ax.set_title("PR robot from above (dot: centre of mass of link 2)", loc="left", fontsize=9)
    ax.spines[["top", "right"]].set_visible(False)


def _box(x: float) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.14, -0.1), 0.28, 0.2, facecolor="0.85", edgecolor="0.25", zorder=2)


def exam_figures(figure: Any, gravity_moment: float = 1.5) -> None:
    """Draw figures 2 and 4 over time: position, velocity and acceleration; inertial torque, gravity torque and their sum.

    The motion is the exam's motion in its shortest time, with I = 1 kg m^2, tau_max = 1 N m, and `gravity_moment` in N m.
    """
    from ..figures.style import COLOURS

    start, end = -math.pi / 2, math.pi / 2
    T = al.bang_bang_time(start, end, 1.0, gravity_moment, 1.0).t_min
    link, motion = al.pendulum(1.0, gravity_moment), al.BangBang([start], [end], T)
    # The acceleration jumps in the middle of the motion, so the two halves are drawn separately.
    halves = [np.linspace(0.0, np.nextafter(T / 2, 0.0), 200), np.linspace(T / 2, np.nextafter(T, 0.0), 200)]
    profile, torque = figure.subplots(2, 1, sharex=True)
    for half, times in enumerate(halves):
        q, v, a = (np.array(x) for x in zip(*(motion(t) for t in times), strict=True))
        inertial, gravity = link.inverse_dynamics(q, v, a) - link.gravity(q), link.gravity(q)
        for ax, lines in (
            (profile, ((q, r"$\theta$ (rad)"), (v, r"$\dot\theta$ (rad/s)"), (a, r"$\ddot\theta$ (rad/s²)"))),
            (torque, ((inertial, r"$I\ddot\theta$"), (gravity, r"$G\sin\theta$"), (inertial + gravity, r"$\tau$"))),
        ):
            for k, (values, name) in enumerate(lines):
                ax.plot(times, values, color=COLOURS[k], linewidth=2.0, label=None if half else name)
    for limit in (-1.0, 1.0):
        torque.axhline(limit, color="0.4", linestyle="--", linewidth=1.0, label=r"$\pm\tau_{\max}$" if limit > 0 else None)
    profile.set_title(f"Figure 2: symmetric profile, T = {T:.3f} s", loc="left", fontsize=10)
    torque.set_title(f"Figure 4: gravity torque against inertial torque, G = {gravity_moment:g} N m", loc="left", fontsize=10)
    torque.set_xlabel("time (s)")
    torque.set_ylabel("torque (N m)")
    profile.set_ylabel("motion (SI)")
    for ax in (profile, torque):
        ax.grid(alpha=0.3, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
