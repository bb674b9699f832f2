"""Panels of the levels of priority: errors and residuals of tasks, one panel per unit, and bounds that hold levels."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..pose_curves import columns_of
from .panels import Panel, legend_beside
from .style import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..run.active_limits import LimitHold
    from ..run.recorded import Recorded

__all__ = ["levels", "rows_by_unit"]

#: The unit of a norm of rows whose units are not known or differ.
EITHER = "m or rad"
#: The largest number of bounds in a panel.
BANDS = 10


def levels(run: Recorded) -> list[Panel]:
    """The panels of errors and of residuals, and that of active bounds. A panel of errors has the levels of one unit."""
    units = _units(run)
    held = [_bands] if _holds(run) else []
    groups = {unit: [i for i, each in enumerate(units) if each == unit] for unit in dict.fromkeys(units)}
    quantities = (("error", "", r"Errors $|e_i|$ of the levels"), ("residual", "/s", r"Residuals $|v_i - J_i u|$ of the levels"))
    panels: list[Panel] = [
        partial(_levels, name=name, chosen=chosen, unit=" or ".join(part + per for part in unit.split(" or ")), title=title)
        for name, per, title in quantities
        for unit, chosen in groups.items()
    ]
    return [*panels, *held]


def rows_by_unit(axes: str, units: tuple[str, str]) -> dict[str, list[int]]:
    """The rows of the letters of `axes` by unit: that of positions, `units[0]`, or that of rotations, `units[1]`."""
    found: dict[str, list[int]] = {}
    for row, column in enumerate(columns_of(axes)):
        found.setdefault(units[column > 2], []).append(row)
    return found


def _units(run: Recorded) -> list[str]:
    count = sum(name.startswith("residual_") for name in run.monitors)
    law = run._laws[0]
    law = law.law if isinstance(law, _core.Guarded) else law
    tasks = law.__getnewargs_ex__()[1].get("tasks", ()) if law is not None else ()
    return [_unit(task, run) for task in tasks] if len(tasks) == count else [EITHER] * count


def _unit(task: Any, run: Recorded) -> str:
    """The unit of the norm of a task's error, or of the errors of all tasks of a level."""
    if isinstance(task, (list, tuple)):
        units = {_unit(entry[0] if isinstance(entry, tuple) else entry, run) for entry in task}
        return units.pop() if len(units) == 1 else EITHER
    made = task.__getnewargs_ex__()[1] if hasattr(task, "__getnewargs_ex__") else {}
    if isinstance(task, _core.AxisTask):
        return "rad"
    found = rows_by_unit(made["axes"], ("m", "rad")) if "axes" in made else dict.fromkeys(run.units)
    return next(iter(found)) if len(found) == 1 else EITHER


def _levels(ax: Axes, run: Recorded, name: str, chosen: list[int], unit: str, title: str) -> None:
    """Draw one line per level, on a logarithmic axis of at most about sixteen decades."""
    series = {level: run.monitors[f"{name}_{level + 1}"] for level in chosen}
    positive = np.concatenate([values[values > 0] for values in series.values()])
    for level, values in series.items():
        shown = np.where(values > 0, values, np.nan)
        ax.semilogy(run.t, shown, color=COLOURS[level % len(COLOURS)], label=f"level {level + 1}")
    if len(positive):
        ax.set_ylim(max(positive.min() / 10, 1e-16 * positive.max()), 3 * positive.max())
    ax.set_ylabel(f"{name} ({unit})")
    ax.set_title(title)
    legend_beside(ax)


def _bands(ax: Axes, run: Recorded) -> None:
    """Draw one row per bound, with a band while the bound holds a level. The rows are the bounds that hold levels for the longest time."""
    holds = _holds(run)
    times: dict[tuple[str, str], float] = {}
    for name, side, _, start, end in holds:
        times[name, side] = times.get((name, side), 0.0) + end - start
    longest = sorted(times, key=lambda bound: -times[bound])[:BANDS]
    rows = [bound for bound in times if bound in longest]
    numbers = sorted({hold.level for hold in holds if (hold.name, hold.side) in rows})
    height = 0.8 / len(numbers)
    for k, level in enumerate(numbers):
        for row, bound in enumerate(rows):
            spans = [(hold.start, hold.end - hold.start) for hold in holds if (hold.name, hold.side, hold.level) == (*bound, level)]
            place = row - 0.4 + k * height, height
            ax.broken_barh(spans, place, color=COLOURS[(level - 1) % len(COLOURS)], label=f"level {level}" if row == 0 else None)
    ax.set_yticks(range(len(rows)), [f"{name}, {side}" for name, side in rows])
    # A row is at most a quarter of the panel high.
    space = max(0.0, 0.5 * (4 - len(rows)))
    ax.set_ylim(len(rows) - 0.5 + space, -0.5 - space)
    ax.grid(visible=False, axis="y")
    held = f"level {numbers[0]}" if len(numbers) == 1 else "a level"
    ax.set_title(f"Bounds that hold {held}" + (f", the longest {BANDS} of {len(times)}" if len(times) > BANDS else ""))
    legend_beside(ax)


def _holds(run: Recorded) -> list[LimitHold]:
    """The bounds that hold a level. None are known in a run from a file."""
    return getattr(run, "active", None) or []
