"""The figure of a run. Axes have units, a joint has the same colour in all panels, and true or desired values are dashed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .style import COLOURS, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..run.recorded import Recorded

__all__ = ["plot"]


Panel: TypeAlias = Callable[["Axes", "Recorded"], None]

#: The largest number of joints in a panel. There are more colours, so each joint of a panel has a different colour.
MOST = 7
#: The ten parameters of a link by kind: their indices, the name and unit of the kind, and the line style of each component.
KINDS = (
    ((0,), "masses", "kg", ""),
    ((1, 2, 3), "first moments", "kg m", ": x solid, y dashed, z dotted"),
    ((4, 6, 9), "moments of inertia", "kg m²", ": x solid, y dashed, z dotted"),
    ((5, 7, 8), "products of inertia", "kg m²", ": xy solid, xz dashed, yz dotted"),
)
STROKES = ("-", "--", ":", "-.")


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
    positions, velocities = _of_joints(_position, run), _of_joints(_velocity, run)
    if "residual_1" in run.monitors:
        return [*positions, *velocities, _level_errors, _level_residuals]
    panels = [*positions, *(velocities if run.desired() is None else _of_joints(_error, run))]
    if run.position_error is not None:
        panels.append(_distance)
    if run.orientation_error is not None:
        panels.append(_turn)
    if run.contact_force is not None:
        panels.append(_contact)
    if run.tau is not None:
        panels += _of_joints(_torque, run)
    if run.estimate is not None and run.estimate.shape[-1]:
        panels += _estimates(run)
    # The figure has the Lyapunov function of the law and its balance, or else the energy and its balance.
    watched: dict[str, Panel] = {"lyapunov": _lyapunov, "lyapunov_balance": _lyapunov_balance}
    if "lyapunov" not in run.monitors:
        watched = {"energy": _energy, "energy_balance": _energy_balance}
    panels += [panel for name, panel in watched.items() if name in run.monitors]
    return panels


def _of_joints(draw: Callable[[Axes, Recorded, slice], None], run: Recorded) -> list[Panel]:
    """One panel for all joints, or several panels with legends for more than `MOST` joints."""

    def panel(ax: Axes, run: Recorded, joints: slice) -> None:
        draw(ax, run, joints)
        if joints.stop - joints.start < run.q.shape[-1]:
            ax.set_title(f"{ax.get_title(loc='left')}, {joints.start + 1} to {joints.stop}")
            names = _names(run)[joints]
            for line, name in zip(ax.get_lines(), names, strict=False):
                line.set_label(name)
            _legend(ax)

    n = run.q.shape[-1]
    starts = range(0, n, -(-n // -(-n // MOST)))
    return [partial(panel, joints=slice(start, min(start + starts.step, n))) for start in starts]


def _names(run: Recorded) -> list[str]:
    """The labels of the joints: their numbers, and their names if the arm is available, such as `1 shoulder`."""
    names = getattr(run.arm, "joint_names", None) or [""] * run.q.shape[-1]
    return [f"{i + 1} {literal(name).strip()}".strip() for i, name in enumerate(names)]


def _legend_of_joints(figure: Figure, run: Recorded) -> None:
    """Draw one legend above all panels: the colour of each joint, and the meaning of dashed and dotted lines."""
    from matplotlib.lines import Line2D

    entries = [Line2D([], [], color=COLOURS[i], label=name) for i, name in enumerate(_names(run))]
    if run.desired() is not None:
        entries.append(Line2D([], [], color="0.4", linestyle="--", linewidth=1.0, label="desired"))
    if any(line.get_gid() == "limit" for ax in figure.axes for line in ax.get_lines()):
        entries.append(Line2D([], [], color="0.4", linestyle=":", linewidth=1.0, label="limit"))
    figure.legend(handles=entries, loc="outside upper center", ncols=min(len(entries), 7), title="joint", handlelength=1.4)


def _lines(ax: Axes, t: NDArray[Any], values: NDArray[Any], labels: list[str] | None = None, **style: Any) -> None:
    for i in range(values.shape[-1]):
        ax.plot(t, values[:, i], color=COLOURS[i % len(COLOURS)], label=labels[i] if labels else None, **style)


def _limits(ax: Axes, run: Recorded, joints: slice, upper: str, lower: str | None = None) -> None:
    """Draw dotted lines at the limits that the run approaches. Distant limits would compress the curves."""
    if run.limits is None:
        return
    low, high = ax.get_ylim()
    room = 0.5 * (high - low)
    least = -run.limits[upper] if lower is None else run.limits[lower]
    for bounds in (run.limits[upper], least):
        for i, bound in enumerate(bounds[joints]):
            if low - room < bound < high + room:
                ax.axhline(bound, color=COLOURS[i], linestyle=":", linewidth=1.0, gid="limit")


def _axis(name: str, units: tuple[str, ...]) -> str:
    return f"{name} ({literal(', '.join(dict.fromkeys(units)))})"


def _legend(ax: Axes) -> None:
    """Draw the legend to the right of the panel, where it covers no data, if it has 2 to 12 entries."""
    handles, labels = ax.get_legend_handles_labels()
    if 1 < len(handles) <= 12:
        ax.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.2, borderpad=0.0)


def _position(ax: Axes, run: Recorded, joints: slice) -> None:
    _lines(ax, run.t, run.q[:, joints])
    desired = run.desired()
    if desired is not None:
        _lines(ax, run.t, desired[0][:, joints], linestyle="--", linewidth=1.0, alpha=0.8)
    _limits(ax, run, joints, "q_max", "q_min")
    ax.set_ylabel(_axis("position", run.units[joints]))
    ax.set_title("Joint positions")


def _error(ax: Axes, run: Recorded, joints: slice) -> None:
    desired = run.desired()
    assert desired is not None
    _lines(ax, run.t, (desired[0] - run.q)[:, joints])
    ax.set_ylabel(_axis("error", run.units[joints]))
    ax.set_title(r"Tracking error $e = q_d - q$")


def _task_errors(ax: Axes, run: Recorded, errors: NDArray[Any], unit: str, what: str) -> None:
    count = errors.shape[-1]
    _lines(ax, run.t, errors, [f"task {i + 1}" for i in range(count)])
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel(unit)
    ax.set_title(f"{what} of {'the' if count == 1 else 'each'} frame from its target")
    _legend(ax)


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


def _velocity(ax: Axes, run: Recorded, joints: slice) -> None:
    _lines(ax, run.t, run.v[:, joints])
    _limits(ax, run, joints, "v_max")
    ax.set_ylabel(_axis("velocity", tuple(f"{unit}/s" for unit in run.units[joints])))
    ax.set_title("Joint velocities")


def _torque(ax: Axes, run: Recorded, joints: slice) -> None:
    assert run.tau is not None
    units = run.input_units
    commanded = units[:1] not in (("N",), ("N m",))
    _lines(ax, run.t, run.tau[:, joints])
    _limits(ax, run, joints, "v_max" if commanded else "effort")
    ax.set_ylabel(_axis("input", units[joints]))
    ax.set_title("Commanded velocities" if commanded else "Joint forces and torques" if len(set(units)) > 1 else "Joint torques")


def _estimates(run: Recorded) -> list[Panel]:
    """The panels of the state of the law: estimates or an integral."""
    assert run.estimate is not None
    if run.law_name in ("PID", "CartesianImpedance"):
        return [] if _has_filters_alone(run._laws[0]) else [_integral]
    # The state of a composite law consists of the estimate and then of filter states. Only the estimate is drawn.
    count = run.estimate[..., : run._estimated].shape[-1]
    links = _links(run)
    if count <= 12 or count < 10 * links:
        return [_estimate]
    beside: list[Panel] = [_rotors_and_friction] if count > 10 * links else []
    return [*(partial(_bodies, kind=kind) for kind in KINDS), *beside]


def _has_filters_alone(law: Any) -> bool:
    """Whether the state of a PID law has no integral."""
    return isinstance(law, _core.PID) and law.__getnewargs_ex__()[1].get("ki") is None


def _integral(ax: Axes, run: Recorded) -> None:
    assert run.estimate is not None
    wrench = run.law_name == "CartesianImpedance"
    # The state of a PID law consists of the integral and then of filter states. Only the integral is drawn.
    integral = run.estimate if wrench else run.estimate[..., : run.q.shape[-1]]
    _lines(ax, run.t, integral, [f"$w_{{{i + 1}}}$" for i in range(integral.shape[-1])])
    ax.set_ylabel("N, N m" if wrench else ", ".join(dict.fromkeys(run.input_units)))
    ax.set_title("Integral wrench" if wrench else "Integral torques")
    _legend(ax)


def _links(run: Recorded) -> int:
    """The number of bodies of the arm. If the run has true parameters, it is a tenth of the number of these parameters.

    Otherwise it follows from the number of estimated parameters. There are ten per body, and then one per coordinate for each kind of joint
    parameter, such as damping.
    """
    assert run.estimate is not None
    count, n = run.estimate[..., : run._estimated].shape[-1], run.q.shape[-1]
    if run.parameters is not None and 10 <= run.parameters.shape[-1] <= count:
        return int(run.parameters.shape[-1]) // 10
    return next((links for links in range(n, count // 10 + 1) if (count - 10 * links) in (0, n, 2 * n, 3 * n, 4 * n)), n)


def _bodies(ax: Axes, run: Recorded, kind: tuple[tuple[int, ...], str, str, str]) -> None:
    """Draw the estimates of one kind of parameters, with a colour per link and a line style per component.

    True values are not drawn, because the estimates need not converge to them.
    """
    assert run.estimate is not None
    places, what, unit, components = kind
    for link in range(_links(run)):
        own = run.estimate[:, 10 * link : 10 * link + 10]
        for place, stroke in zip(places, STROKES, strict=False):
            ax.plot(run.t, own[:, place], color=COLOURS[link % len(COLOURS)], linestyle=stroke, linewidth=1.0, alpha=0.9)
    ax.set_ylabel(f"{what} ({unit})")
    ax.set_title(f"Estimates{components}")


def _rotors_and_friction(ax: Axes, run: Recorded) -> None:
    assert run.estimate is not None
    n = run.q.shape[-1]
    beside = run.estimate[:, 10 * _links(run) : run._estimated]
    for i in range(beside.shape[-1]):
        ax.plot(run.t, beside[:, i], color=COLOURS[i % n % len(COLOURS)], linestyle=STROKES[i // n], linewidth=1.0)
    ax.set_ylabel("parameters (SI)")
    ax.set_title("Estimates: rotors, friction")


def _estimate(ax: Axes, run: Recorded) -> None:
    assert run.estimate is not None
    estimate = run.estimate[..., : run._estimated]
    count = estimate.shape[-1]
    _lines(ax, run.t, estimate, [rf"$\hat{{a}}_{{{i + 1}}}$" for i in range(count)])
    if run.parameters is not None and run.parameters.shape == (count,):
        for i, value in enumerate(run.parameters):
            # The dashes of odd and even parameters are shifted by half a period, so that the lines of two equal neighbours are both
            # visible.
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


def _levels(ax: Axes, run: Recorded, name: str) -> None:
    """Draw one line per level of priority, on a logarithmic axis of at most about sixteen decades."""
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
