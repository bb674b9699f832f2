"""The figure of the derivatives of a run with respect to a named number, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .style import COLOURS, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot"]

#: The rows of the figure: the series, and its label.
ROWS = (("q", "position"), ("v", "velocity"), ("tau", "input"))
# The largest number of lines in a panel, which is the number of distinct colours.
MOST = len(COLOURS)


def plot(one: Any, fig: Figure | None = None) -> NDArray[Any]:
    """Draw the derivatives over time: a column per joint, and rows for position, velocity and input; returns the axes, (3, n).

    If the number has more entries than there are colours, only the entries with the largest effect on the positions are drawn.

    Args:
        one: the `Sensitivity` of a run.
        fig: a matplotlib figure to draw into; None makes one with pyplot.

    Raises:
        ImportError: matplotlib is not installed.
        InputError: the derivatives belong to a batch.
    """
    require("Sensitivity.plot")
    if one.q.ndim != 3:
        raise InputError("Sensitivity.plot: these are derivatives of a batch: expected the derivatives of one row, batch[i].sensitivity")
    n, size = one.q.shape[1:]
    entries = np.sort(np.argsort(-np.abs(one.q).max(axis=(0, 1)), kind="stable")[:MOST])
    places = list(np.ndindex(one.shape))
    names = ["" if not places[j] else f"[{', '.join(map(str, places[j]))}]" for j in entries]
    with sheet(fig, (2.2 + 2.6 * n, 6.4)) as figure:
        axes: NDArray[Any] = figure.subplots(len(ROWS), n, squeeze=False, sharex=True)
        for row, (series, label) in zip(axes, ROWS, strict=True):
            values = getattr(one, series)
            for i, ax in enumerate(row):
                for k, j in enumerate(entries):
                    ax.plot(one.t, values[:, i, j], color=COLOURS[k])
                ax.set_ylabel(f"d {label} / d parameter (SI)" if i == 0 else "(SI)")
        for i, ax in enumerate(axes[0]):
            ax.set_title(f"joint {i + 1}")
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        shown = f"{len(entries)} of {size} entries of " if len(entries) < size else ""
        figure.legend(
            axes[0, 0].get_lines(),
            [literal(one.name + name) for name in names],
            title=literal(shown + one.name),
            loc="outside right upper",
            frameon=False,
        )
    return axes
