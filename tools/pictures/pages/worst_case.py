"""The pictures of `docs/worst_case.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, RED, Sketch

PAGE = "worst_case.md"


@drawing("worst_case.svg", "A box of two values with level curves of the margin, starts, and steps to the worst corner", PAGE)
def box(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 3.2))
    low, high = np.array([1.0, 0.7]), np.array([4.4, 2.8])
    x, y = np.meshgrid(np.linspace(low[0], high[0], 80), np.linspace(low[1], high[1], 60))
    margin = -((x - 1.6) ** 2) / 6.0 - (y - 1.2) ** 2 / 3.0 - 0.08 * x * y
    sketch.ax.contour(x, y, margin, levels=8, colors="0.8", linewidths=0.9)
    sketch.ax.add_patch(Rectangle(tuple(low), *(high - low), fill=False, edgecolor="0.15", linewidth=1.4))
    starts = np.array([[1.4, 2.4], [1.9, 1.0], [2.4, 1.9], [3.0, 1.2], [3.3, 2.2], [3.9, 0.95], [1.2, 1.5], [2.7, 2.6]])
    sketch.ax.plot(*starts.T, "o", color=BLUE, markersize=4)
    for start, middle in ((starts[2], (3.3, 2.5)), (starts[3], (4.1, 1.8))):
        sketch.arrow(start, middle, GREEN)
        sketch.arrow(middle, high - 0.06, GREEN)
    sketch.ax.plot(*high, "*", color=RED, markersize=15, zorder=5)
    sketch.text(high + np.array([0.05, 0.24]), "worst case found", RED)
    sketch.text(((low[0] + high[0]) / 2, 0.4), "payload", GREY)
    sketch.text((0.7, (low[1] + high[1]) / 2), "start error", GREY, rotation=90)


@result("worst_case_run.svg", "Error of the second joint over time, nominal and in the worst case", PAGE)
def errors(figure: Figure, page: SimpleNamespace) -> None:
    nominal = page.scenario.run()

    def draw(ax: Axes) -> None:
        for name, run, colour in (("nominal", nominal, GREEN), ("worst case", page.w.run, RED)):
            error = np.abs(run.q - run.desired()[0]).max(axis=1)
            ax.plot(thin(run.t), thin(error[:, None])[:, 0], color=colour, label=name)
        ax.axhline(0.25, color="0.4", linestyle=":", linewidth=1.0, label="bound")
        ax.set(xlabel="time (s)", ylabel="largest error (rad)")

    panels(figure, [2.0], draw)


@result("worst_case_limit.svg", "Smallest margin over the number of runs with different seeds of the noise", PAGE)
def seeds(figure: Figure, page: SimpleNamespace) -> None:
    lowest = np.minimum.accumulate(page.many.tried["margin"])

    def draw(ax: Axes) -> None:
        ax.step(np.arange(1, len(lowest) + 1), lowest, where="post", color=BLUE)
        ax.set(xscale="log", xlabel="runs (1)", ylabel="smallest margin (1)")

    panels(figure, [1.9], draw)
