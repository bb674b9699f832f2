"""The picture of `docs/fit.md`."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from panels import panels
from registry import result
from sketch import BLUE, GREEN

PAGE = "fit.md"


@result("fit_residual.svg", "Residual over velocity: two falling lines with a jump at zero, and a cloud with Coulomb friction", PAGE)
def residuals(figure: Figure, page: SimpleNamespace) -> None:
    def draw(ax: Axes) -> None:
        for fit, colour, label in ((page.lie, BLUE, "no Coulomb\nfriction"), (page.fit, GREEN, "with Coulomb\nfriction")):
            ax.plot(np.interp(fit.t[::3], page.t, page.v[:, 0]), fit.residual[::3, 0], ".", color=colour, markersize=3, label=label)
        ax.set(xlabel="velocity of joint 1 (rad/s)", ylabel="residual (N m)")

    panels(figure, [2.6], draw)
