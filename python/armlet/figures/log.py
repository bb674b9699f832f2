"""The figures of a log and of its fit: positions, velocities and torques over time; measured and fitted torques.

References are dashed, and gaps are grey.
"""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .panels import Joints, Panel, draw_lines, joint_names, of_joints
from .style import COLOURS, legend_below, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot", "plot_fit"]

_TITLES = {"q": "Joint positions", "v": "Joint velocities", "tau": "Joint torques", "theta": "Motor positions"}


def plot(log: Any, fig: Figure | None = None) -> NDArray[Any]:
    """Draw an `armlet.Log` into `fig` (None: a new pyplot figure); returns the axes as an array.

    Raises:
        ImportError: matplotlib is not installed.
    """
    require("Log.plot")
    from matplotlib.lines import Line2D

    # The panels of a run need its times, positions, units and joints.
    shown: Any = SimpleNamespace(t=log.t, q=log.q, units=log.units, arm=SimpleNamespace(joint_names=log.names))
    panels: list[Panel] = []
    for name in _TITLES:
        if getattr(log, name) is not None or name in log.references:
            panels += of_joints(partial(_series, log=log, name=name), shown)
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    with sheet(fig, (5.0 * columns, 2.7 * rows + 0.5)) as figure:
        axes: NDArray[Any] = figure.subplots(rows, columns, squeeze=False, sharex=True)
        for ax, panel in zip(axes.flat, panels, strict=False):
            panel(ax, shown)
        for ax in axes.flat[len(panels) :]:
            ax.set_visible(False)
        for ax in axes.flat[max(0, len(panels) - columns) : len(panels)]:
            ax.set_xlabel("time (s)")
            ax.tick_params(labelbottom=True)
        if log.n <= len(COLOURS):
            entries = [Line2D([], [], color=COLOURS[i], label=name) for i, name in enumerate(joint_names(shown))]
            if log.references:
                entries.append(Line2D([], [], color="0.4", linestyle="--", linewidth=1.0, label="desired"))
            legend_below(figure, entries, title="joint")
    return axes


def _series(ax: Axes, shown: Any, joints: Joints, log: Any, name: str) -> None:
    """Draw a series and its reference, and mark the gaps between samples."""
    values, desired = getattr(log, name), log.references.get(name)
    if values is not None:
        draw_lines(ax, shown, values, joints)
    if desired is not None:
        draw_lines(ax, shown, desired, joints, linestyle="--", linewidth=1.0, alpha=0.8)
    for t, count in log.report.gaps[:100]:
        end = log.t[min(int(np.searchsorted(log.t, t, side="right")), len(log.t) - 1)]
        ax.axvspan(t, end, color="0.5", alpha=0.3, linewidth=0.0, gid=f"gap of {count}")
    unit = log.units[joints[0]]
    labels = {"q": f"position ({unit})", "v": f"velocity ({unit}/s)", "tau": f"torque ({'N m' if unit == 'rad' else 'N'})"}
    ax.set_ylabel(literal(labels.get(name, f"position ({unit})")))
    ax.set_title(_TITLES[name])


def plot_fit(fit: Any, fig: Figure | None = None) -> NDArray[Any]:
    """Draw an `armlet.LogFit` into `fig` (None: a new pyplot figure); returns the axes as an array, (n, 1).

    Raises:
        ImportError: matplotlib is not installed.
    """
    require("LogFit.plot")
    with sheet(fig, (8.0, 1.8 * len(fit.joints) + 0.8)) as figure:
        axes: NDArray[Any] = figure.subplots(len(fit.joints), 1, squeeze=False, sharex=True)
        for i, ax in enumerate(axes[:, 0]):
            lines = [ax.plot(fit.t, fit.measured[:, i], color="0.6", label="measured")[0]]
            lines += ax.plot(fit.t, fit.measured[:, i] - fit.residual[:, i], color=COLOURS[0], linewidth=1.0, label="model")
            lines += ax.plot(fit.t, fit.residual[:, i], color=COLOURS[1], linewidth=0.8, label="residual")
            unit = "N" if fit.arm.joint_types[i] == "prismatic" else "N m"
            ax.set_ylabel(f"torque ({unit})" if unit == "N m" else f"force ({unit})")
            ax.set_title(literal(fit.joints[i]))
        axes[-1, 0].set_xlabel("time (s)")
        legend_below(figure, lines)
    return axes
