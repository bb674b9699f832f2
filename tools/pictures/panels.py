"""Parts of figures of numbers. They have one width, so that their text is readable on a phone."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from armlet.figures.style import sheet

__all__ = ["panels", "thin"]

#: The width of figures, inches. A phone of 390 pixels shows them at three quarters of their size, so their text is larger than elsewhere.
WIDTH = 4.8
LARGER = {"font.size": 10, "axes.labelsize": 10, "xtick.labelsize": 9.5, "ytick.labelsize": 9.5, "legend.fontsize": 9.5}


def panels(figure: Figure, heights: list[float], draw: Any, share: bool = True) -> None:
    """Create one panel above another with these heights, inches, in the package's style, and call `draw` with them."""
    with sheet(figure, (WIDTH, sum(heights))) as made, matplotlib.rc_context(LARGER):
        axes: NDArray[Any] = made.subplots(len(heights), 1, squeeze=False, sharex=share, height_ratios=heights)[:, 0]
        for ax in axes:
            ax.set_axisbelow(True)
        draw(*axes)
        for ax in axes:
            _legend(ax)
        made.align_ylabels(axes)


def _legend(ax: Axes) -> None:
    """The legend to the right of the panel, where it covers no data."""
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        ax.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.2, borderpad=0.0, frameon=False)


def thin(values: NDArray[np.float64], count: int = 600) -> NDArray[np.float64]:
    """At most `count` rows of an array, at equal distances."""
    return values[:: max(1, len(values) // count)]
