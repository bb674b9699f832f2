"""The figure of a batch: for each joint the median of the runs, and the range from the smallest to the largest value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .panels import joint_names
from .style import COLOURS, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..run.recorded import Recorded

__all__ = ["plot"]

#: Largest number of joints with a panel.
MOST = 8


def plot(batch: Recorded, fig: Figure | None = None) -> NDArray[Any]:
    """Draw the errors of a batch over time, or its positions if its laws have no reference of the joints.

    Args:
        batch: the batch, with records at common times.
        fig: a matplotlib figure for the drawing; None makes one with pyplot.

    Returns:
        The axes as an array. There is one panel for each of the first 8 joints.

    Raises:
        ImportError: matplotlib is not installed.
    """
    require("BatchRun.report")
    reference = batch.reference()
    values = batch.q if reference is None else np.broadcast_to(reference[0], batch.q.shape) - batch.q
    joints = range(min(values.shape[-1], MOST))
    columns = min(2, len(joints))
    rows = -(-len(joints) // columns)
    with sheet(fig, (4.0 * columns, 2.2 * rows + 0.4)) as figure:
        axes: NDArray[Any] = figure.subplots(rows, columns, squeeze=False, sharex=True)
        for ax in axes.flat[len(joints) :]:
            ax.set_visible(False)
        for ax, i, name in zip(axes.flat, joints, joint_names(batch), strict=False):
            known = values[np.isfinite(values[..., i]).all(axis=1), :, i]
            if len(known):
                ax.fill_between(batch.t, known.min(axis=0), known.max(axis=0), color=COLOURS[i], alpha=0.25, linewidth=0.0)
                ax.plot(batch.t, np.median(known, axis=0), color=COLOURS[i])
            ax.set_title(f"{'Position' if reference is None else 'Error'} of {literal(name)}")
            ax.set_ylabel(f"{'position' if reference is None else 'error'} ({literal(batch.units[i])})")
            ax.set_xlabel("time (s)")
    return axes
