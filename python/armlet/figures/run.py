"""The figure of a run. Axes have units, a joint has the same colour in all panels, and true or desired values are dashed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .estimates import estimates
from .levels import levels
from .panels import (
    EXCESS,
    MOST,
    Joints,
    Panel,
    draw_excess,
    draw_input_limits,
    draw_limits,
    draw_lines,
    joint_names,
    legend_beside,
    of_joints,
)
from .style import COLOURS, legend_below, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..run.recorded import Recorded

__all__ = ["plot"]


def plot(run: Recorded, fig: Figure | None = None) -> NDArray[Any]:
    """Draw a run into `fig` (None: a new pyplot figure), with the panels that suit its law; returns the axes as an array.

    Raises:
        ImportError: matplotlib is not installed.
    """
    require("Run.plot")
    panels = _panels(run)
    columns = 2 if len(panels) == 4 else min(3, len(panels))
    rows = -(-len(panels) // columns)
    with sheet(fig, (4.0 * columns, 2.7 * rows + 0.5)) as figure:
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True)
        for ax, panel in zip(axes.flat, panels, strict=False):
            panel(ax, run)
        for ax in axes.flat[len(panels) :]:
            ax.set_visible(False)
        for last in range(max(0, len(panels) - columns), len(panels)):
            # The lowest panel of every column has the label, even if the last row is not full.
            axes.flat[last].set_xlabel("time (s)")
            axes.flat[last].tick_params(labelbottom=True)
        if run.q.shape[-1] <= MOST:
            _legend_of_joints(figure, run)
    result: NDArray[Any] = axes
    return result


def _panels(run: Recorded) -> list[Panel]:
    """The panels for which the run has data, from left to right and from top to bottom."""
    positions, velocities = of_joints(_position, run), of_joints(_velocity, run)
    if "residual_1" in run.monitors:
        return [*positions, *velocities, *levels(run)]
    panels = [*positions, *(velocities if run.desired() is None else of_joints(_error, run))]
    if run.position_error is not None:
        panels.append(_distance)
    if run.orientation_error is not None:
        panels.append(_turn)
    if run.contact_force is not None:
        panels.append(_contact)
    if run.tau is not None:
        panels += of_joints(_torque, run)
    if run.estimate is not None and run.estimate.shape[-1]:
        panels += estimates(run)
    # The figure has the Lyapunov function of the law and its balance, or else the energy and its balance.
    watched: dict[str, Panel] = {"lyapunov": _lyapunov, "lyapunov_balance": _lyapunov_balance}
    if "lyapunov" not in run.monitors:
        watched = {"energy": _energy, "energy_balance": _energy_balance}
    panels += [panel for name, panel in watched.items() if name in run.monitors]
    return panels


def _legend_of_joints(figure: Figure, run: Recorded) -> None:
    """Draw one legend below all panels: the colour of each joint, and the meaning of dashed and dotted lines."""
    from matplotlib.lines import Line2D

    entries = [Line2D([], [], color=COLOURS[i], label=name) for i, name in enumerate(joint_names(run))]
    if run.desired() is not None:
        entries.append(Line2D([], [], color="0.4", linestyle="--", linewidth=1.0, label="desired"))
    if any(line.get_gid() == "limit" for ax in figure.axes for line in ax.get_lines()):
        entries.append(Line2D([], [], color="0.4", linestyle=":", linewidth=1.0, label="limit"))
    if any(line.get_gid() == "excess" for ax in figure.axes for line in ax.get_lines()):
        entries.append(Line2D([], [], label="beyond limit", **EXCESS))
    legend_below(figure, entries, title="joint")


def _position(ax: Axes, run: Recorded, joints: Joints) -> None:
    draw_lines(ax, run, run.q, joints)
    desired = run.desired()
    if desired is not None:
        draw_lines(ax, run, desired[0], joints, linestyle="--", linewidth=1.0, alpha=0.8)
    draw_limits(ax, run, joints, "q_max", "q_min")
    draw_excess(ax, run, run.q, joints, "q_max", "q_min")
    ax.set_ylabel(f"position ({literal(run.units[joints[0]])})")
    ax.set_title("Joint positions")


def _error(ax: Axes, run: Recorded, joints: Joints) -> None:
    desired = run.desired()
    assert desired is not None
    draw_lines(ax, run, desired[0] - run.q, joints)
    ax.set_ylabel(f"error ({literal(run.units[joints[0]])})")
    ax.set_title(r"Tracking error $e = q_d - q$")


def _task_errors(ax: Axes, run: Recorded, errors: NDArray[Any], unit: str, what: str) -> None:
    count = errors.shape[-1]
    for i in range(count):
        ax.plot(run.t, errors[:, i], color=COLOURS[i % len(COLOURS)], label=f"task {i + 1}")
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel(unit)
    ax.set_title(f"{what} of {'the' if count == 1 else 'each'} frame from its target")
    legend_beside(ax)


def _distance(ax: Axes, run: Recorded) -> None:
    assert run.position_error is not None
    _task_errors(ax, run, run.position_error, "distance (m)", "Distance")


def _turn(ax: Axes, run: Recorded) -> None:
    assert run.orientation_error is not None
    _task_errors(ax, run, run.orientation_error, "angle (rad)", "Rotation")


def _contact(ax: Axes, run: Recorded) -> None:
    assert run.contact_force is not None
    ax.plot(run.t, run.contact_force, color=COLOURS[0])
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("force (N)")
    ax.set_title("Contact force, along the wall's normal")


def _velocity(ax: Axes, run: Recorded, joints: Joints) -> None:
    draw_lines(ax, run, run.v, joints)
    draw_limits(ax, run, joints, "v_max")
    draw_excess(ax, run, run.v, joints, "v_max")
    ax.set_ylabel(f"velocity ({literal(run.units[joints[0]])}/s)")
    ax.set_title("Joint velocities")


def _torque(ax: Axes, run: Recorded, joints: Joints) -> None:
    assert run.tau is not None
    unit = run.input_units[joints[0]]
    commanded = unit not in ("N", "N m")
    draw_lines(ax, run, run.tau, joints)
    limit = "v_max" if commanded else "effort"
    draw_input_limits(ax, run, joints, limit)
    draw_excess(ax, run, run.tau, joints, limit)
    ax.set_ylabel(f"input ({literal(unit)})")
    ax.set_title("Commanded velocities" if commanded else "Joint forces" if unit == "N" else "Joint torques")


def _lyapunov(ax: Axes, run: Recorded) -> None:
    values = run.monitors["lyapunov"]
    ax.plot(run.t, values, color=COLOURS[0])
    positive = values[values > 0]
    if len(positive) and positive.max() > 1e3 * positive.min():
        ax.set_yscale("log")
    elif len(positive):
        ax.set_ylim(0.0, 1.05 * positive.max())
    ax.set_ylabel(r"$V_1$ (J)")
    ax.set_title("Lyapunov function")


def _magnitude(ax: Axes, run: Recorded, name: str) -> None:
    values = np.abs(run.monitors[name])
    # A balance is exactly zero at the start, which a logarithmic axis cannot show.
    shown = values[np.isfinite(values) & (values > 0)]
    ax.semilogy(run.t, np.where(values > 0, values, np.nan), color=COLOURS[0], linewidth=0.9)
    if len(shown):
        # The axis extends a decade beyond the values on both sides, so that rounding errors do not look like a signal.
        ax.set_ylim(shown.min() / 10, 10 * shown.max())


def _lyapunov_balance(ax: Axes, run: Recorded) -> None:
    _magnitude(ax, run, "lyapunov_balance")
    ax.set_ylabel("balance (J)")
    ax.set_title(r"$|V_1(0) - V_1(t) - \int s^\mathsf{T} K_d s\,dt|$")


def _energy(ax: Axes, run: Recorded) -> None:
    ax.plot(run.t, run.monitors["energy"], color=COLOURS[0])
    ax.set_ylabel("energy (J)")
    ax.set_title("Energy")


def _energy_balance(ax: Axes, run: Recorded) -> None:
    _magnitude(ax, run, "energy_balance")
    ax.set_ylabel("balance (J)")
    ax.set_title(r"$|E(t) - E(0) - \int P\,dt|$")
