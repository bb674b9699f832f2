"""Parts of the figure of a run: the joints of a panel, their names and colours, limits and legends."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..run.speeds import excess, positive
from .style import COLOURS, literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..run.recorded import Recorded

__all__ = [
    "EXCESS",
    "MOST",
    "Joints",
    "Panel",
    "draw_excess",
    "draw_input_limits",
    "draw_limits",
    "draw_lines",
    "joint_names",
    "legend_beside",
    "numbered",
    "of_joints",
]

#: The indices of the joints of a panel.
Joints: TypeAlias = list[int]
Panel: TypeAlias = Callable[["Axes", "Recorded"], None]

#: The largest number of joints in a panel. There are more colours, so each joint of a panel has a different colour.
MOST = 7
#: A position beyond a limit by less than this number, rad or m, is at the limit, up to the error of a run.
SLACK = 1e-6
#: The style of values beyond a limit.
EXCESS: dict[str, Any] = {"color": "red", "linewidth": 4.0, "marker": ".", "alpha": 0.3}


def of_joints(draw: Callable[[Axes, Recorded, Joints], None], run: Recorded) -> list[Panel]:
    """The panels of a quantity of the joints. A panel has joints of one unit, and at most `MOST` joints.

    Joints have one legend for the whole figure, or a legend in each panel for an arm of more than `MOST` joints.
    """
    units = run.units
    groups = [[i for i, each in enumerate(units) if each == unit] for unit in dict.fromkeys(units)]
    parts = [part.tolist() for group in groups for part in np.array_split(group, -(-len(group) // MOST))]

    def panel(ax: Axes, run: Recorded, joints: Joints) -> None:
        draw(ax, run, joints)
        if len(units) > MOST:
            whole = joints[-1] - joints[0] == len(joints) - 1 > 0
            numbers = f"{joints[0] + 1} to {joints[-1] + 1}" if whole else ", ".join(str(i + 1) for i in joints)
            ax.set_title(f"{ax.get_title(loc='left')}, {numbers}")
            names = joint_names(run)
            for line, i in zip(ax.get_lines(), joints, strict=False):
                line.set_label(names[i])
            legend_beside(ax)

    return [partial(panel, joints=joints) for joints in parts]


def joint_names(run: Recorded) -> list[str]:
    """The labels of the joints of a run, as in `numbered`. If the arm is not available: the numbers."""
    return numbered(getattr(run.arm, "joint_names", None) or [""] * run.q.shape[-1])


def numbered(names: Sequence[str]) -> list[str]:
    """The labels of joints: their numbers and their names, such as `1 shoulder`. If all names have numbers: the names."""
    names = [literal(name).strip() for name in names]
    if all(re.search(r"\d", name) for name in names):
        return names
    return [f"{i + 1} {name}".strip() for i, name in enumerate(names)]


def _colours(run: Recorded, joints: Joints) -> list[str]:
    """The colours of the joints of a panel. In the figure of an arm of at most `MOST` joints, a joint has one colour."""
    return [COLOURS[i if run.q.shape[-1] <= MOST else k] for k, i in enumerate(joints)]


def draw_lines(ax: Axes, run: Recorded, values: NDArray[Any], joints: Joints, **style: Any) -> None:
    """Draw the columns `joints` of `values`, (K, n), over time."""
    for i, colour in zip(joints, _colours(run, joints), strict=True):
        ax.plot(run.t, values[:, i], color=colour, **style)


def draw_limits(ax: Axes, run: Recorded, joints: Joints, upper: str, lower: str | None = None) -> None:
    """Draw dotted lines at the limits that the run approaches. A note above the panel names the nearest of the other limits.

    Lines at distant limits would compress the curves.
    """
    if run.limits is not None:
        most = run.limits[upper]
        _draw_bounds(ax, run, joints, -most if lower is None else run.limits[lower], most)


def draw_input_limits(ax: Axes, run: Recorded, joints: Joints, upper: str) -> None:
    """Draw the smallest limits of the input, as in `draw_limits`: those of the arm, of the run and of the law."""
    law = getattr(run._laws[0], "__getnewargs_ex__", None)
    given = [None if run.limits is None else run.limits[upper], run._tau_max, law()[1].get("tau_max") if law else None]
    n = run.q.shape[-1]
    limits = [np.broadcast_to(np.asarray(each, dtype=np.float64), (n,)) for each in given if each is not None]
    if limits:
        most = np.min(limits, axis=0)
        _draw_bounds(ax, run, joints, -most, most)


def _draw_bounds(ax: Axes, run: Recorded, joints: Joints, least: NDArray[Any], most: NDArray[Any]) -> None:
    low, high = ax.get_ylim()
    room = 0.5 * (high - low)
    distant: Sequence[list[float]] = [], []
    for side, bounds in enumerate((least, most)):
        for i, colour in zip(joints, _colours(run, joints), strict=True):
            if low - room < bounds[i] < high + room:
                ax.axhline(bounds[i], color=colour, linestyle=":", linewidth=1.0, gid="limit")
            elif np.isfinite(bounds[i]):
                distant[side].append(bounds[i])
    notes = [f"\N{LESS-THAN OR EQUAL TO} {max(distant[0]):.3g}"] if distant[0] else []
    notes += [f"\N{GREATER-THAN OR EQUAL TO} {min(distant[1]):.3g}"] if distant[1] else []
    if notes:
        ax.set_title(f"limits not drawn: {', '.join(notes)}".replace("-", "\N{MINUS SIGN}"), loc="right", fontsize=7, color="0.35")


def draw_excess(ax: Axes, run: Recorded, values: NDArray[Any], joints: Joints, upper: str, lower: str | None = None) -> None:
    """Mark the records at which a column of `values`, (K, n), passes a limit of the arm. Without `lower`, the limits are symmetric."""
    if run.limits is None:
        return
    if lower is None:
        beyond = excess(values, positive(run.limits[upper]))
    else:
        beyond = (values > run.limits[upper] + SLACK) | (values < run.limits[lower] - SLACK)
    for i in joints:
        if beyond[:, i].any():
            ax.plot(run.t, np.where(beyond[:, i], values[:, i], np.nan), zorder=1.5, gid="excess", **EXCESS)


def legend_beside(ax: Axes) -> None:
    """Draw the legend to the right of the panel, where it covers no data, if it has 2 to 12 entries."""
    handles, labels = ax.get_legend_handles_labels()
    if 1 < len(handles) <= 12:
        ax.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.2, borderpad=0.0)
