"""The pictures of `docs/integration.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, INK, RED, Sketch

PAGE = "integration.md"


@drawing("integration.svg", "A curve, a step along its slope at the start, and a step along its slope in the middle", PAGE)
def slopes(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 2.5))
    left, width, low, high = 0.9, 3.3, 0.55, 2.1

    def curve(part: float) -> tuple[float, float]:
        return left + width * part, low + (high - low) * np.exp(-0.9 * part)

    def slope(part: float) -> float:
        return -0.9 * (high - low) * np.exp(-0.9 * part) / width

    sketch.arrow((0.5, 0.3), (4.95, 0.3), GREY, 1.0)
    sketch.arrow((0.5, 0.3), (0.5, 2.35), GREY, 1.0)
    sketch.text((4.85, 0.13), "$t$", GREY)
    sketch.text((0.33, 2.25), "$y$", GREY)
    sketch.line([curve(part) for part in np.linspace(-0.08, 1.18, 80)], INK, 2.0)
    start, end = np.array(curve(0.0)), np.array(curve(1.0))
    for part, label in ((0.0, "$t$"), (0.5, r"$t + \frac{h}{2}$"), (1.0, "$t + h$")):
        x = curve(part)[0]
        sketch.line([(x, 0.3), (x, curve(part)[1])], GREY, 0.8, linestyle=":")
        sketch.text((x, 0.13), label, GREY, 10.0)
    euler = start + np.array([width, width * slope(0.0)])
    half = start + 0.5 * (euler - start)
    # The slope of the differential equation at the point in the middle of the first step: y' = -0.9 (y - low) / width.
    middle = -0.9 * (half[1] - low) / width
    better = start + np.array([width, width * middle])
    sketch.arrow(start, euler, RED, 2.0)
    sketch.text(euler + np.array([0.25, -0.05]), "$h k_1$", RED)
    sketch.point(half, RED)
    sketch.arrow(half - np.array([0.35, 0.35 * middle]), half + np.array([0.35, 0.35 * middle]), GREEN, 1.2, "-")
    sketch.arrow(start, better, GREEN, 2.0)
    sketch.text(start + 0.6 * (better - start) + np.array([0.1, 0.22]), "$h k_2$", GREEN)
    sketch.point(start)
    sketch.point(end, BLUE)
    sketch.text(end + np.array([0.4, -0.24]), "$y(t + h)$", BLUE)


@result("integration_run.svg", "Error of the energy of a pendulum over time for three methods with equal numbers of evaluations", PAGE)
def energies(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for (method, run), colour in zip(page.runs.items(), (RED, GREEN, BLUE), strict=True):
            energy = 0.5 * run.y[:, 1] ** 2 - 9.81 * np.cos(run.y[:, 0])
            ax.semilogy(thin(run.t[1:]), thin(np.abs(energy - energy[0])[1:]), color=colour, label=method)
        ax.set(xlabel="time (s)", ylabel="energy error (J per kg m²)", ylim=(1e-6, 1e2))

    panels(figure, [2.4], draw)


@result("integration_limit.svg", "Solutions of a stiff equation with a step below the limit of stability, and with a step above it", PAGE)
def stiffness(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        seen = np.abs(page.fast.y[:, 0]) < 4.0
        last = len(seen) if seen.all() else int(np.argmin(seen))
        ax.plot(page.fast.t[:last], page.fast.y[:last, 0], color=RED, linewidth=0.8, label="rk4, 2.8 ms")
        ax.plot(thin(page.slow.t), thin(page.slow.y)[:, 0], color=GREEN, linewidth=2.0, label="rk4, 2.7 ms")
        ax.plot(page.implicit.t, page.implicit.y[:, 0], "o", color=BLUE, markersize=3.0, label="radau5")
        ax.set(xlabel="time (s)", ylabel="$y$ (1)", ylim=(-3.0, 3.0))

    panels(figure, [2.2], draw)
