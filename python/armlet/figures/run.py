"""Figures of runs: every axis carries its unit, a joint keeps its colour in all panels, and true or desired values are dashed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .style import COLOURS, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..run.recorded import Recorded

__all__ = ["plot"]


def plot(run: Recorded, fig: Figure | None = None) -> NDArray[Any]:
    """Draw the figure of `run`'s law into `fig` (None: a new pyplot figure); returns the axes as an array.

    Raises:
        ImportError: matplotlib is not installed.
    """
    require("Run.plot")
    panels = _panels(run)
    columns = 2 if len(panels) == 4 else min(3, len(panels))
    rows = -(-len(panels) // columns)
    with sheet(fig, (4.0 * columns, 2.9 * rows)) as figure:
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True)
        for ax, panel in zip(axes.flat, panels, strict=False):
            panel(ax, run)
        for ax in axes.flat[len(panels) :]:
            ax.set_visible(False)
        for last in range(max(0, len(panels) - columns), len(panels)):
            # The lowest panel of every column, also where the last row is not full.
            axes.flat[last].set_xlabel("time (s)")
            axes.flat[last].tick_params(labelbottom=True)
    result: NDArray[Any] = axes
    return result


def _panels(run: Recorded) -> list[Any]:
    """The panels that this run has data for, in reading order."""
    if "residual_1" in run.monitors:
        return [_position, _velocity, _level_errors, _level_residuals]
    panels: list[Any] = [_position]
    if run.desired() is not None:
        panels.append(_error)
    else:
        panels.append(_velocity)
    if run.position_error is not None:
        panels.append(_distance)
    if run.tau is not None:
        panels.append(_torque)
    if run.estimate is not None and run.estimate.shape[-1]:
        panels.append(_estimate)
    # One identity per figure: the Lyapunov function where the law has one, the energy elsewhere.
    watched = {"lyapunov": _lyapunov, "lyapunov_balance": _lyapunov_balance}
    if "lyapunov" not in run.monitors:
        watched = {"energy": _energy, "energy_balance": _energy_balance}
    panels += [panel for name, panel in watched.items() if name in run.monitors]
    return panels


def _lines(ax: Axes, t: NDArray[Any], values: NDArray[Any], labels: list[str], **style: Any) -> None:
    for i in range(values.shape[-1]):
        ax.plot(t, values[:, i], color=COLOURS[i % len(COLOURS)], label=labels[i], **style)


def _joints(symbol: str, units: tuple[str, ...]) -> list[str]:
    """Legend texts; joints of different kinds carry their own unit."""
    mixed = len(set(units)) > 1
    return [rf"${symbol}_{{{i + 1}}}$" + (f" ({literal(unit)})" if mixed else "") for i, unit in enumerate(units)]


def _axis(name: str, units: tuple[str, ...]) -> str:
    return f"{name} ({literal(', '.join(dict.fromkeys(units)))})"


def _legend(ax: Axes, columns: int | None = None) -> None:
    """A legend above the data, never over it."""
    handles, labels = ax.get_legend_handles_labels()
    if 1 < len(handles) <= 12:
        ax.margins(y=0.08)
        low, high = ax.get_ylim()
        if ax.get_yscale() == "linear":
            ax.set_ylim(low, high + 0.22 * (high - low))
        else:
            ax.set_ylim(low, high * (high / low) ** 0.22)
        ax.legend(handles, labels, loc="upper right", ncols=columns or min(4, len(handles)), handlelength=1.4, columnspacing=1.0)


def _position(ax: Axes, run: Recorded) -> None:
    _lines(ax, run.t, run.q, _joints("q", run.units))
    desired = run.desired()
    if desired is not None:
        _lines(ax, run.t, desired[0], [""] * run.q.shape[1], linestyle="--", linewidth=1.0, alpha=0.8)
        ax.plot([], [], color="0.4", linestyle="--", linewidth=1.0, label="desired")
    ax.set_ylabel(_axis("position", run.units))
    ax.set_title("Joint positions")
    _legend(ax)


def _error(ax: Axes, run: Recorded) -> None:
    desired = run.desired()
    assert desired is not None
    _lines(ax, run.t, desired[0] - run.q, _joints("e", run.units))
    ax.set_ylabel(_axis("error", run.units))
    ax.set_title(r"Tracking error $e = q_d - q$")
    _legend(ax)


def _distance(ax: Axes, run: Recorded) -> None:
    assert run.position_error is not None
    count = run.position_error.shape[-1]
    _lines(ax, run.t, run.position_error, [f"task {i + 1}" for i in range(count)])
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("distance (m)")
    ax.set_title("Distance of the frame from its target" if count == 1 else "Distance of each frame from its target")
    _legend(ax)


def _velocity(ax: Axes, run: Recorded) -> None:
    units = tuple(f"{unit}/s" for unit in run.units)
    _lines(ax, run.t, run.v, _joints("v", units))
    ax.set_ylabel(_axis("velocity", units))
    ax.set_title("Joint velocities")
    _legend(ax)


def _torque(ax: Axes, run: Recorded) -> None:
    assert run.tau is not None
    units = run.input_units
    commanded = units[:1] not in (("N",), ("N m",))
    _lines(ax, run.t, run.tau, _joints("u" if commanded else r"\tau", units))
    ax.set_ylabel(_axis("input", units))
    ax.set_title("Commanded velocities" if commanded else "Joint forces and torques" if len(set(units)) > 1 else "Joint torques")
    _legend(ax)


def _estimate(ax: Axes, run: Recorded) -> None:
    assert run.estimate is not None
    count = run.estimate.shape[-1]
    if run.law_name in ("PID", "CartesianImpedance"):
        wrench = run.law_name == "CartesianImpedance"
        _lines(ax, run.t, run.estimate, [f"$w_{{{i + 1}}}$" for i in range(count)])
        ax.set_ylabel("N, N m" if wrench else ", ".join(dict.fromkeys(run.input_units)))
        ax.set_title("Integral wrench" if wrench else "Integral torques")
        _legend(ax)
        return
    # Behind the estimate a composite law keeps its filters.
    estimate = run.estimate[..., : run._estimated]
    count = estimate.shape[-1]
    links = run.q.shape[-1]
    if count > 12 and count >= 10 * links:
        # Ten parameters per link are too many to be told apart: one colour per link, and no true values, to which they need not go.
        for link in range(links):
            lines = ax.plot(
                run.t, estimate[:, 10 * link : 10 * link + 10], color=COLOURS[link % len(COLOURS)], linewidth=0.8, alpha=0.8
            )
            lines[0].set_label(f"link {link + 1}")
        if count > 10 * links:
            lines = ax.plot(run.t, estimate[:, 10 * links :], color="0.4", linestyle="--", linewidth=0.8)
            lines[0].set_label("rotors, friction")
        ax.set_ylabel("parameters (kg, kg m, kg m²)" if count == 10 * links else "parameters (SI)")
        ax.set_title("Parameter estimates, ten per link")
        _legend(ax)
        return
    _lines(ax, run.t, estimate, [rf"$\hat{{a}}_{{{i + 1}}}$" for i in range(count)])
    if run.parameters is not None and run.parameters.shape == (count,):
        for i, value in enumerate(run.parameters):
            # Shifted dashes, so that equal parameters do not hide each other.
            ax.axhline(value, color=COLOURS[i % len(COLOURS)], linestyle=(4 * i, (4, 4)), linewidth=1.0, alpha=0.8)
        ax.plot([], [], color="0.4", linestyle="--", linewidth=1.0, label="true")
    ax.set_ylabel("parameter (SI)")
    ax.set_title("Parameter estimates")
    _legend(ax)


def _lyapunov(ax: Axes, run: Recorded) -> None:
    values = run.monitors["lyapunov"]
    ax.plot(run.t, values, color=COLOURS[0])
    positive = values[values > 0]
    if len(positive) and positive.max() > 1e3 * positive.min():
        ax.set_yscale("log")
    else:
        ax.set_ylim(bottom=0.0)
    ax.set_ylabel(r"$V_1$ (J)")
    ax.set_title("Lyapunov function")


def _magnitude(ax: Axes, run: Recorded, name: str) -> None:
    values = np.abs(run.monitors[name])
    # A balance starts at exactly zero, which a logarithmic axis cannot hold.
    shown = values[np.isfinite(values) & (values > 0)]
    ax.semilogy(run.t, np.where(values > 0, values, np.nan), color=COLOURS[0], linewidth=0.9)
    if len(shown):
        # A decade of air on both sides, so that rounding does not look like a signal.
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


def _levels(ax: Axes, run: Recorded, name: str) -> None:
    """One line per level of priority, on a logarithmic axis that spans sixteen decades at most."""
    shown = np.concatenate([values[values > 0] for key, values in run.monitors.items() if key.startswith(name)])
    for level in range(sum(key.startswith(name) for key in run.monitors)):
        values = run.monitors[f"{name}_{level + 1}"]
        ax.semilogy(run.t, np.where(values > 0, values, np.nan), color=COLOURS[level % len(COLOURS)], label=f"level {level + 1}")
    if len(shown):
        ax.set_ylim(max(shown.min() / 10, 1e-16 * shown.max()), 3 * shown.max())
    _legend(ax)


def _level_errors(ax: Axes, run: Recorded) -> None:
    _levels(ax, run, "error")
    ax.set_ylabel("error (m, rad)")
    ax.set_title(r"$|e_i|$ per level of priority")


def _level_residuals(ax: Axes, run: Recorded) -> None:
    _levels(ax, run, "residual")
    ax.set_ylabel("residual (m/s, rad/s)")
    ax.set_title(r"$|v_i - J_i u|$ per level of priority")
