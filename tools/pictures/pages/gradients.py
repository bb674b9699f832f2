"""The pictures of `docs/gradients.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels, thin
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, INK, RED, Sketch

PAGE = "gradients.md"


@drawing("gradients.svg", "A chain of states and a loss, with arrows for tangents forwards and for the adjoint backwards", PAGE)
def chain(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 1.65))
    places, height, box = (0.15, 1.4, 2.65), 0.6, 0.62
    for x, label in zip(places, ("$x_0$", "$x_1$", "$x_2$"), strict=True):
        sketch.block((x, height), box, 0.5, label)
    sketch.block((4.2, height), 0.85, 0.5, "loss $L$", RED)
    for x in places[:2]:
        sketch.arrow((x + box, height + 0.25), (x + 1.25, height + 0.25), INK)
        sketch.text((x + box + 0.31, height + 0.42), r"$\Phi$", INK)
        sketch.text((x + box + 0.31, height + 0.03), "$p$", GREY)
        sketch.arrow((x + box, height + 0.75), (x + 1.25, height + 0.75), GREEN, 2.0, bend=-0.25)
        sketch.arrow((x + 1.25, height - 0.25), (x + box, height - 0.25), RED, 2.0, bend=-0.25)
    sketch.text((3.52, height + 0.25), r"$\cdots$", INK, 15.0)
    sketch.arrow((3.75, height + 0.25), (4.2, height + 0.25), INK)
    for x, label, below in zip(places, ("$S_0$", "$S_1$", "$S_2$"), ("$l_0$", "$l_1$", "$l_2$"), strict=True):
        sketch.text((x + 0.31, height + 0.75), label, GREEN, 12.0)
        sketch.text((x + 0.31, height - 0.25), below, RED, 12.0)
    sketch.text((4.62, height + 0.75), "tangents", GREEN)
    sketch.text((4.62, height - 0.25), "adjoint", RED)
    sketch.arrow((3.2, height + 0.75), (4.05, height + 0.75), GREEN, 2.0)
    sketch.arrow((4.05, height - 0.25), (3.2, height - 0.25), RED, 2.0)


@result("gradients_run.svg", "Derivative of both joint angles by a gain, and a change of the gain, predicted and simulated", PAGE)
def prediction(figure: Figure, page: SimpleNamespace) -> None:
    def draw(slope: Axes, change: Axes) -> None:
        slopes = thin(page.run.sensitivity["law.kp"].q)
        moved = thin(page.stiffer.q - page.run.q)
        for joint, colour in enumerate((BLUE, RED)):
            slope.plot(thin(page.run.t), slopes[:, joint, 0], color=colour, label=f"joint {joint + 1}")
            change.plot(thin(page.run.t), 1e3 * moved[:, joint], color=colour, label=f"joint {joint + 1}")
            change.plot(thin(page.run.t), 1e3 * slopes[:, joint, 0], "--", color=colour)
        change.plot([], [], "--", color="0.4", label="predicted")
        slope.set_ylabel(r"$dq/dk_{p,1}$ (1/N m)")
        change.set(ylabel="change (mrad)", xlabel="time (s)")

    panels(figure, [1.6, 1.6], draw)


@result("gradients_limit.svg", "Predicted and actual difference of two chaotic swings over time", PAGE)
def chaos(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        ax.semilogy(thin(page.swing.t), thin(page.predicted), color=RED, label="predicted")
        ax.semilogy(thin(page.swing.t), thin(page.happened), color=BLUE, label="actual")
        ax.set(ylabel="difference (rad)", xlabel="time (s)", yticks=10.0 ** np.arange(-3, 6, 2))

    panels(figure, [2.0], draw)
