"""Several runs in one figure: a column per joint, a row per quantity, and a colour and line style per run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import instance, shown
from ..border import border
from ..errors import InputError
from ..run.records import Run
from .style import COLOURS, legend_below, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["compare"]

DASHES = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))


@border
def compare(runs: Sequence[Run], labels: Sequence[str] | None = None, *, fig: Figure | None = None) -> NDArray[Any]:
    """Draw the errors and inputs of several runs, joint by joint. If a run has no desired motion, positions replace the errors of all runs.

    Args:
        runs: at least one run; all runs have joints with the same units.
        labels: one name per run; None: "1", "2", .. with the name of the law.
        fig: a matplotlib figure for the drawing; None makes one with pyplot.

    Returns:
        The axes, an array (2, n): the errors (or positions) above, rad or m, and the inputs below, N m or N. Under velocity control the
        inputs are in rad/s or m/s. The array is (1, n) if no run has inputs.

    Raises:
        InputError: there are no runs, the units of their joints differ, or the number of labels is not the number of runs.
        ImportError: matplotlib is not installed.

    Source: docs/scenarios.md.

    >>> import armlet as al
    >>> from matplotlib.figure import Figure
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> laws = [al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=kp, kd=20.0) for kp in (50.0, 100.0)]
    >>> runs = [al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=1.0, dt=1e-2) for law in laws]
    >>> al.compare(runs, ["soft", "stiff"], fig=Figure()).shape
    (2, 2)
    """
    if isinstance(runs, Run) or not isinstance(runs, Iterable):
        raise InputError(f"compare: runs is of the wrong type: expected a list of runs, got {shown(runs)}")
    given = [instance("compare", f"runs[{i}]", run, Run, "a run of simulate") for i, run in enumerate(runs)]
    if not given:
        raise InputError("compare: runs is empty: expected at least one run")
    if any(run.units != given[0].units for run in given):
        raise InputError(f"compare: runs are of different arms: expected joints in {given[0].units}, got {[run.units for run in given]}")
    names = (
        [f"{i + 1}: {run.law_name}" for i, run in enumerate(given)]
        if labels is None
        else [instance("compare", f"labels[{i}]", label, str, "a text") for i, label in enumerate(labels)]
    )
    if len(names) != len(given):
        raise InputError(f"compare: labels do not match the runs: expected {len(given)}, got {len(names)}")
    require("compare")
    errors = [_error(run) for run in given]
    by_error = all(error is not None for error in errors)
    n = len(given[0].units)
    with_tau = any(run.tau is not None for run in given)
    with sheet(fig, (max(4.5, 3.2 * n), 2.6 * (1 + with_tau) + 0.4)) as figure:
        axes = figure.subplots(1 + with_tau, n, squeeze=False, sharex=True)
        lines = []
        for k, run in enumerate(given):
            style = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)], "linewidth": 1.4}
            first = errors[k] if by_error else run.q
            assert first is not None
            for j in range(n):
                (line,) = axes[0, j].plot(run.t, first[:, j], **style)
                if run.tau is not None:
                    axes[1, j].plot(run.t, run.tau[:, j], **style)
            line.set_label(names[k] if labels is not None else literal(names[k]))
            lines.append(line)
        for j, unit in enumerate(given[0].units):
            axes[0, j].set_title(f"Joint {j + 1}")
            axes[0, j].set_ylabel(f"{'error' if by_error else 'position'} ({literal(unit)})")
            if with_tau:
                axes[1, j].set_ylabel(f"input ({literal(given[0].input_units[j])})")
            axes[-1, j].set_xlabel("time (s)")
        # The legend is outside of the axes, so that it covers no data.
        legend_below(figure, lines)
    result: NDArray[Any] = axes
    return result


def _error(run: Run) -> NDArray[np.float64] | None:
    reference = run.reference()
    return None if reference is None else np.asarray(reference[0] - run.q)
