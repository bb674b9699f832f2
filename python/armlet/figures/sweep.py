"""The figure of a sweep: a metric over the first two quantities that vary. A point is a run, and a grey cross is a run without a value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import choice
from ..errors import InputError
from ..run.metrics import PER_JOINT, PER_RUN, PER_TASK, Metrics
from ..status import Status, having
from .style import COLOURS, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot"]

# A positive quantity that spreads over more than this factor is drawn on a logarithmic scale.
SPREAD = 8.0


def plot(table: Mapping[str, NDArray[Any]], quantity: str | None = None, fig: Figure | None = None) -> Axes:
    """Draw the metric `quantity` (None: the first metric) into `fig` (None: a new pyplot figure); returns the axes."""
    require("SweepTable.plot")
    from matplotlib.ticker import LogFormatter

    names = list(table)
    at = names.index("status")
    varied = [name for name in names[1:at] if table[name].dtype.kind in "if"]
    metrics = [name for name in names[at + 1 :] if name != "error"]
    if not varied or not metrics:
        raise InputError("SweepTable.plot: there is nothing to draw: expected a number that varies, and a metric")
    quantity = metrics[0] if quantity is None else choice("SweepTable.plot", "quantity", quantity, metrics)
    # A figure of the caller keeps its size and layout.
    with sheet(fig, (6.4, 4.6) if fig is None else None) as figure:
        ax: Axes = figure.subplots()
        good = having(table["status"], Status.SUCCESS) & np.isfinite(table[quantity])
        x, value = table[varied[0]], table[quantity]
        size = float(np.clip(3e4 / len(x), 2.0, 25.0))
        if len(varied) == 1:
            ax.scatter(x[good], value[good], s=size, color=COLOURS[0])
            ax.set(xlabel=f"{literal(varied[0])} (SI)", ylabel=_label(quantity), yscale=_scale(value[good]))
            failed = np.full(np.sum(~good), np.nanmax(value[good], initial=0.0))
        else:
            points = ax.scatter(
                x[good], table[varied[1]][good], c=value[good], s=size, cmap="viridis", norm=_scale(value[good]), rasterized=True
            )
            figure.colorbar(points, ax=ax, label=_label(quantity))
            ax.set(xlabel=f"{literal(varied[0])} (SI)", ylabel=f"{literal(varied[1])} (SI)", yscale=_scale(table[varied[1]]))
            failed = table[varied[1]][~good]
        ax.set_xscale(_scale(x))
        if len(failed):
            ax.scatter(x[~good], failed, s=size, color="0.7", marker="x", linewidths=0.8, zorder=0)
        for axis in (ax.xaxis, ax.yaxis):
            if axis.get_scale() == "log":
                # Labels such as 20 are easier to read than 2 x 10^1.
                axis.set_major_formatter(LogFormatter())
                axis.set_minor_formatter(LogFormatter())
        # The meaning of the crosses is in the title, where it covers no point.
        ax.set_title(f"{len(x):,} runs" + (f"; grey crosses: {len(failed):,} without a value" if len(failed) else ""))
    return ax


def _scale(values: NDArray[Any]) -> str:
    known = values[np.isfinite(values)]
    return "log" if len(known) and known.min() > 0.0 and known.max() > SPREAD * known.min() else "linear"


def _label(quantity: str) -> str:
    """The label of a metric: its name and its unit, such as "rad or m". The unit of an unknown name is "SI"."""
    name = quantity.rstrip("0123456789")
    unit = Metrics({}, ("rad or m",), ("N m or N",)).unit(name) if name in (*PER_JOINT, *PER_TASK, *PER_RUN) else "SI"
    return literal(quantity) + (f" ({unit})" if unit != "1" else "")
