"""The pictures of `docs/adaptive.md`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, DARK, GREEN, GREY, INK, RED, Sketch, direction

PAGE = "adaptive.md"


@drawing("adaptive.svg", "A robot with a sliding and a turning joint, seen from above, and the loop of law, estimate and arm", PAGE)
def robot(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 4.1))
    # The robot: a carriage on rails, and a link with its centre of mass.
    for y in (2.35, 2.75):
        sketch.line([(0.3, y), (4.9, y)], GREY, 2.0)
    sketch.ground((0.3, 2.55), 0.5, -90.0)
    sketch.box((1.55, 2.2), 0.7, 0.7)
    joint = np.array([1.9, 2.55])
    sketch.link(joint, joint + direction(35.0, 1.75))
    sketch.joint(joint)
    sketch.centre_of_mass(joint + direction(35.0, 1.05))
    sketch.text(joint + direction(35.0, 1.05) + (-0.12, 0.22), "?", RED, 14.0)
    sketch.text((1.72, 3.07), "?", RED, 14.0)
    sketch.line([joint, np.add(joint, (1.5, 0.0))], GREY, 0.9, linestyle="--")
    sketch.angle(joint, 0.72, 0.0, 35.0, "$q_2$")
    sketch.dimension((0.3, 1.98), (1.9, 1.98), "$q_1$", (0.0, -0.15))
    # The desired motion, drawn as the robot of another time.
    ghost = joint - (0.75, 0.0)
    sketch.line([ghost, ghost + direction(70.0, 1.35)], RED, 1.3, linestyle="--")
    sketch.joint(ghost, RED, 0.06)
    sketch.text(ghost + direction(70.0, 1.35) + (0.33, 0.02), r"$q_d(t)$", RED)
    sketch.text((4.25, 3.3), "masses, centre of\nmass and inertia\nare unknown", GREY, 9.5)
    # The loop.
    sketch.block((0.95, 0.85), 1.45, 0.6, r"$\tau = Y\hat\pi + K_d s$", BLUE, 10.5)
    sketch.block((3.2, 0.85), 0.9, 0.6, "arm", DARK, 10.5)
    sketch.block((1.55, 0.12), 1.75, 0.52, r"$\dot{\hat\pi} = \Gamma\, Y^\mathsf{T} s$", GREEN, 10.5)
    sketch.arrow((0.2, 1.15), (0.95, 1.15))
    sketch.text((0.45, 1.32), r"$q_d(t)$", RED)
    sketch.arrow((2.4, 1.15), (3.2, 1.15))
    sketch.text((2.8, 1.32), r"$\tau$")
    sketch.arrow((4.1, 1.15), (4.95, 1.15))
    sketch.text((4.36, 1.3), "$q, v$")
    sketch.line([(4.7, 1.15), (4.7, 0.38)], INK, 1.4)
    sketch.arrow((4.7, 0.38), (3.3, 0.38))
    sketch.line([(1.55, 0.38), (1.25, 0.38)], GREEN, 1.4)
    sketch.arrow((1.25, 0.38), (1.25, 0.85), GREEN)
    sketch.text((1.08, 0.55), r"$\hat\pi$", GREEN)
    sketch.line([(4.7, 1.15), (4.7, 1.66), (1.67, 1.66)], INK, 1.4)
    sketch.arrow((1.67, 1.66), (1.67, 1.45))


def errors(ax: Axes, t: Any, e: Any, names: tuple[str, ...], units: str, colours: tuple[str, ...]) -> None:
    """Curves of tracking errors with one unit."""
    for column, name, colour in zip(e.T, names, colours, strict=True):
        ax.plot(t, column, color=colour, label=name)
    ax.set_ylabel(units)


@result("adaptive_run.svg", "Tracking errors, estimates and Lyapunov function of the first run", PAGE)
def tracking(figure: Figure, page: SimpleNamespace) -> None:
    run, arm = page.run, page.arm
    t, every = run.t, slice(None, None, max(1, len(run.t) // 800))
    e = np.array([page.motion(time)[0] for time in t]) - run.q

    def draw(metres: Axes, radians: Axes, estimates: Axes, energy: Axes) -> None:
        errors(metres, t[every], e[every, :1], ("$e_1$",), "error (m)", (BLUE,))
        errors(radians, t[every], e[every, 1:], ("$e_2$",), "error (rad)", (RED,))
        for i, (name, unit, colour) in enumerate((("$\\pi_1$", "kg", BLUE), ("$\\pi_2$", "kg m", RED), ("$\\pi_3$", "kg m²", GREEN))):
            estimates.plot(t[every], run.estimate[every, i], color=colour, label=f"{name} ({unit})")
            estimates.axhline(arm.parameters[i], color=colour, linestyle="--", linewidth=1.0)
        estimates.plot([], [], color="0.4", linestyle="--", linewidth=1.0, label="true")
        estimates.set_ylabel("estimate (SI)")
        energy.plot(t[every], run.monitors["lyapunov"][every], color=INK, label="$V_1$")
        energy.set(ylabel="$V_1$ (J)", xlabel="time (s)", ylim=(0.0, None))

    panels(figure, [1.25, 1.25, 1.6, 1.35], draw)


@result("adaptive_drift.svg", "Estimate of the mass of a robot at rest with a noisy velocity, with leakage and without", PAGE)
def drift(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for (leakage, run), colour, name in zip(page.held.items(), (RED, BLUE), ("no leakage", r"$\sigma = 0.02$"), strict=True):
            ax.plot(thin(run.t), thin(run.estimate)[:, 0], color=colour, label=name)
            level = 0.1 * run.t if leakage == 0.0 else np.full_like(run.t, 1.0)
            ax.plot(thin(run.t), thin(level), color="0.4", linestyle=":", label="(8)" if leakage == 0.0 else "balance of (9)")
        ax.set(xlabel="time (s)", ylabel=r"estimate $\hat\pi_1$ (kg)", ylim=(0.0, None))

    panels(figure, [2.1], draw)


@result("adaptive_limit.svg", "Tracking errors and errors of the estimates for an exciting motion and for one short motion", PAGE)
def excitation(figure: Figure, page: SimpleNamespace) -> None:
    true = page.arm.parameters

    def draw(error: Axes, estimate: Axes) -> None:
        for name, run, motion, colour in (
            ("sines", page.run, page.motion, BLUE),
            ("one short\nmotion", page.short, page.reach, RED),
        ):
            t = thin(run.t)
            e = np.array([motion(time)[0] for time in t]) - thin(run.q)
            error.semilogy(t, np.abs(e[:, 1]), color=colour, label=name)
            estimate.plot(t, np.linalg.norm(thin(run.estimate) - true, axis=1) / np.linalg.norm(true), color=colour, label=name)
        error.set(ylabel="$|e_2|$ (rad)", ylim=(1e-6, 3.0))
        estimate.set(ylabel=r"$|\hat\pi - \pi| \; / \; |\pi|$  (1)", xlabel="time (s)", ylim=(0.0, None))

    panels(figure, [1.6, 1.6], draw)
