"""The pictures of `docs/elastic.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, DARK, GREEN, GREY, INK, RED, Sketch, direction

import armlet as al

PAGE = "elastic.md"


@drawing("elastic.svg", "An arm whose tip hangs on a spring and a damper, and a joint as two bodies with a spring between them", PAGE)
def joint(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 3.45))
    # The arm, and the spring and damper that its tip shall feel.
    base = np.array([0.6, 1.75])
    elbow = base + direction(48.0, 1.35)
    tip = elbow + direction(-8.0, 1.2)
    sketch.foot(base)
    sketch.link(base, elbow)
    sketch.link(elbow, tip)
    for centre in (base, elbow):
        sketch.joint(centre)
    sketch.point(tip)
    target = tip + np.array([1.35, 0.0])
    sketch.spring_and_damper(tip, target, RED)
    sketch.line([np.add(target, (0.0, 0.3)), np.add(target, (0.0, -0.3))], RED, 2.0)
    sketch.text(np.add(target, (0.2, 0.0)), "$x_d$", RED)
    sketch.text(0.5 * (tip + target) + (0.0, 0.4), "$K_m$", RED)
    sketch.text(0.5 * (tip + target) + (0.0, -0.42), "$D_m$", RED)
    sketch.text(np.add(tip, (-0.05, 0.24)), "$x$")
    sketch.arrow(tip, np.add(tip, (-0.1, -0.75)), GREEN, 1.8)
    sketch.text(np.add(tip, (-0.28, -0.6)), "$F$", GREEN)
    # One joint: motor, spring, link.
    sketch.line([(0.35, 0.42), (4.85, 0.42)], GREY, 1.0)
    sketch.block((0.95, 0.44), 1.0, 0.6, "motor $B$", DARK)
    sketch.block((3.15, 0.44), 1.0, 0.6, "link", BLUE)
    sketch.spring((1.95, 0.74), (3.15, 0.74))
    sketch.text((2.55, 1.0), "$K_J$")
    sketch.arrow((0.3, 0.74), (0.95, 0.74), RED, 1.8)
    sketch.text((0.55, 0.94), r"$\tau$", RED)
    sketch.arrow((4.8, 0.74), (4.15, 0.74), GREEN, 1.8)
    sketch.text((4.5, 0.97), r"$J^\mathsf{T} F$", GREEN)
    for x, label in ((1.45, r"$\theta$"), (3.65, "$q$")):
        sketch.line([(x, 0.42), (x, 0.3)], INK, 1.0)
        sketch.arrow((x, 0.22), (x + 0.45, 0.22), INK, 1.0)
        sketch.text((x - 0.12, 0.2), label)


@result("elastic_run.svg", "Displacement of the tip and joint torques while a force pushes", PAGE)
def push(figure: Figure, page: SimpleNamespace) -> None:
    t, run = thin(page.run.t), page.run
    x = 1e3 * (page.arm.position(thin(run.q), "link2")[:, :2] - page.x_d)
    spring = page.K_J * (thin(run.theta) - thin(run.q))

    def draw(tip: Axes, torque: Axes) -> None:
        for k, colour in enumerate((BLUE, RED)):
            tip.plot(t, x[:, k], color=colour, label=f"${'xy'[k]} - {'xy'[k]}_d$")
            tip.plot([0.5, 4.5], [1e3 * page.F[k] / page.K_m[k]] * 2, color=colour, linestyle="--", linewidth=1.0)
            torque.plot(t, spring[:, k], color=colour, label=rf"$\tau_{{J,{k + 1}}}$")
        tip.plot([], [], color="0.4", linestyle="--", linewidth=1.0, label="$F/K_m$")
        tip.set_ylabel("displacement (mm)")
        torque.set(ylabel="torque (N m)", xlabel="time (s)")

    panels(figure, [2.0, 1.6], draw)


@result("elastic_stiffness.svg", "Largest stable stiffness of one joint over the damping at the link", PAGE)
def stiffest(figure: Figure, page: SimpleNamespace) -> None:
    d = np.linspace(0.0, 200.0, 201)
    limit = al.stiffness_limit(page.M, page.K, page.light, d)

    def draw(ax: Axes) -> None:
        ax.fill_between(d, 0.0, np.maximum(limit, 0.0), color=GREEN, alpha=0.15, linewidth=0.0, label="stable")
        ax.plot(d, np.maximum(limit, 0.0), color=GREEN, linewidth=2.0, label="limit")
        ax.plot(d, page.K * (1.0 + d / page.D_0), color=BLUE, linestyle="--", label="(8)")
        ax.axhline(page.K, color="0.4", linestyle=":", label="$K_J$")
        ax.set(xlabel="damping $d$ (N m s/rad)", ylabel="stiffness $k$ (N m/rad)", ylim=(0.0, 6500.0), xlim=(0.0, 200.0))

    panels(figure, [2.1], draw)


@result("elastic_limit.svg", "Distance of the tip from the base: it stops at the length of the arm", PAGE)
def out_of_reach(figure: Figure, page: SimpleNamespace) -> None:
    run = page.stretched
    distance = np.linalg.norm(page.arm.position(thin(run.q), "link2"), axis=1)
    wanted = np.linalg.norm(page.x_d + page.pull / page.K_m)

    def draw(ax: Axes) -> None:
        ax.plot(thin(run.t), distance, color=BLUE, label="tip")
        ax.axhline(0.9, color="0.4", linestyle=":", label="length\nof the arm")
        ax.plot([0.5, run.t[-1]], [wanted] * 2, color=RED, linestyle="--", label=r"$x_E$ of (6)")
        ax.set(ylabel="distance (m)", xlabel="time (s)", ylim=(0.0, None))

    panels(figure, [2.3], draw)
