"""The pictures of `docs/identification.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels
from registry import drawing, result
from sketch import BLUE, GREEN, GREY, RED, Sketch, direction

PAGE = "identification.md"
LABELS = ("$mx_1 + l_1 m_2$", "$my_1$", "$I_1 + l_1^2 m_2$", "$mx_2$", "$my_2$", "$I_2$")
UNITS = ("kg m", "kg m", "kg m²", "kg m", "kg m", "kg m²")


@drawing("identification.svg", "Two links with centres of mass, and the way from a record to parameters", PAGE)
def record(figure: Figure) -> None:
    sketch = Sketch(figure, (5.2, 3.3))
    base = np.array([1.0, 1.75])
    elbow = base + direction(35.0, 1.6)
    tip = elbow + direction(-15.0, 1.35)
    sketch.foot(base)
    sketch.link(base, elbow, width=13.0)
    sketch.link(elbow, tip, width=11.0)
    sketch.centre_of_mass(base + direction(35.0, 0.85))
    sketch.centre_of_mass(elbow + direction(-15.0, 0.7))
    sketch.joint(base)
    sketch.joint(elbow)
    sketch.text(base + direction(35.0, 0.85) + np.array([-0.55, 0.24]), "$m_1, c_1, I_1$", RED)
    sketch.text(elbow + direction(-15.0, 0.7) + np.array([0.25, 0.32]), "$m_2, c_2, I_2$", RED)
    sketch.dimension(base + direction(-55.0, 0.2), elbow + direction(-55.0, 0.2), "$l_1$", direction(-55.0, 0.18))
    sketch.text((0.95, 0.72), "record", GREY, 9.5)
    sketch.text((0.95, 0.48), r"$q,\, v,\, a,\, \tau$")
    sketch.arrow((1.5, 0.5), (1.95, 0.5))
    sketch.block((1.95, 0.15), 1.5, 0.7, r"$\min |\tau - Y_b \beta|^2$", GREEN, 10.0)
    sketch.arrow((3.45, 0.5), (3.9, 0.5))
    sketch.text((4.45, 0.5), r"$\hat\beta \pm$ deviation", GREEN, 10.0)


@result("identification_run.svg", "Six base parameters: true values, data sheet, and estimates with error bars", PAGE)
def estimates(figure: Figure, page: SimpleNamespace) -> None:
    rows = np.arange(6)
    sheet, truth = page.guess.base_parameters().values, page.robot.base_parameters().values

    def draw(ax: Axes) -> None:
        ax.errorbar(
            page.found.values,
            rows,
            xerr=2.0 * page.found.deviations,
            fmt="o",
            color=BLUE,
            markersize=4,
            capsize=3,
            label="estimate ±\n2 deviations",
        )
        ax.plot(truth, rows, "x", color=RED, markersize=8, label="true")
        ax.plot(sheet, rows, "|", color="0.4", markersize=10, label="data sheet")
        ax.set_yticks(rows, [f"{label}  ({unit})" for label, unit in zip(LABELS, UNITS, strict=True)])
        ax.set(xlabel="value (unit of the row)", xlim=(-0.3, 2.3), ylim=(5.5, -0.5))

    panels(figure, [2.7], draw)


@result("identification_limit.svg", "Standard deviations of six parameters for three records", PAGE)
def deviations(figure: Figure, page: SimpleNamespace) -> None:
    rows = np.arange(6)
    times = np.linspace(0.0, 10.0, 1001)
    q, v, a = (np.array(each) for each in zip(*(page.best(t) for t in times), strict=True))
    regressor = page.guess.base_parameters().regressor(q, v, v, a).reshape(-1, 6) / 0.5
    optimised = np.sqrt(np.diag(np.linalg.inv(regressor.T @ regressor)))

    def draw(ax: Axes) -> None:
        for name, values, colour, marker in (
            ("slow", page.slow.deviations, RED, "s"),
            ("example", page.found.deviations, BLUE, "o"),
            ("optimised", optimised, GREEN, "D"),
        ):
            ax.plot(values, rows, marker, color=colour, markersize=5, label=name)
        ax.set_xscale("log")
        ax.set_yticks(rows, [f"{label}  ({unit})" for label, unit in zip(LABELS, UNITS, strict=True)])
        ax.set(xlabel="deviation (unit of the row)", ylim=(5.5, -0.5))

    panels(figure, [2.7], draw)
