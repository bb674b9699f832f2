"""Panels for the state of a law: the parameter estimates of an adaptive law, or an integral."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from .. import _core
from .levels import rows_by_unit
from .panels import Joints, Panel, draw_lines, legend_beside, of_joints
from .style import COLOURS, literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..run.recorded import Recorded

__all__ = ["estimates"]

#: The ten parameters of a link by kind: their indices, the name and unit of the kind, and the line style of each component.
KINDS = (
    ((0,), "masses", "kg", ""),
    ((1, 2, 3), "first moments", "kg m", ": x solid, y dashed, z dotted"),
    ((4, 6, 9), "moments of inertia", "kg m²", ": x solid, y dashed, z dotted"),
    ((5, 7, 8), "products of inertia", "kg m²", ": xy solid, xz dashed, yz dotted"),
)
STROKES = ("-", "--", ":", "-.")


def estimates(run: Recorded) -> list[Panel]:
    """The panels of the state of the law: estimates or an integral."""
    assert run.estimate is not None
    if run.law_name == "CartesianImpedance":
        return _wrenches(run)
    if run.law_name == "PID":
        return [] if _has_filters_alone(run._laws[0]) else of_joints(_integral, run)
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


def _integral(ax: Axes, run: Recorded, joints: Joints) -> None:
    assert run.estimate is not None
    # The state of a PID law consists of the integral and then of filter states. Only the integral is drawn.
    draw_lines(ax, run, run.estimate, joints)
    unit = run.input_units[joints[0]]
    ax.set_ylabel(f"integral ({literal(unit)})")
    ax.set_title("Integral forces" if unit == "N" else "Integral torques")


def _wrenches(run: Recorded) -> list[Panel]:
    """The panels of the integral wrench: forces and torques have different units."""
    assert run.estimate is not None
    law = run._laws[0]
    axes = None if law is None else law.__getnewargs_ex__()[1].get("axes") or "xyz"
    groups = {"N or N m": list(range(run.estimate.shape[-1]))} if axes is None else rows_by_unit(axes, ("N", "N m"))
    return [partial(_wrench, rows=rows, unit=unit) for unit, rows in groups.items()]


def _wrench(ax: Axes, run: Recorded, rows: list[int], unit: str) -> None:
    assert run.estimate is not None
    for i in rows:
        ax.plot(run.t, run.estimate[:, i], color=COLOURS[i % len(COLOURS)], label=f"$w_{{{i + 1}}}$")
    ax.set_ylabel(f"integral wrench ({unit})")
    ax.set_title({"N": "Integral forces", "N m": "Integral torques"}.get(unit, "Integral wrench"))
    legend_beside(ax)


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


def _parameter_names(run: Recorded) -> list[str]:
    """The names of the estimated parameters. The list is empty for a run without a law, such as one that was read from a file."""
    return [literal(name) for name in getattr(run._laws[0], "parameter_names", ())]


def _estimate(ax: Axes, run: Recorded) -> None:
    assert run.estimate is not None
    estimate = run.estimate[..., : run._estimated]
    count = estimate.shape[-1]
    names = _parameter_names(run) or [rf"$\hat{{a}}_{{{i + 1}}}$" for i in range(count)]
    for i, name in enumerate(names):
        ax.plot(run.t, estimate[:, i], color=COLOURS[i % len(COLOURS)], label=name)
    if run.parameters is not None and run.parameters.shape == (count,):
        for i, value in enumerate(run.parameters):
            # The dashes of odd and even parameters are shifted by half a period, so that the lines of two equal neighbours are both
            # visible.
            ax.axhline(value, color=COLOURS[i % len(COLOURS)], linestyle=(4 * i, (4, 4)), linewidth=1.0, alpha=0.8)
        ax.plot([], [], color="0.4", linestyle="--", linewidth=1.0, label="true")
    ax.set_ylabel("parameter (SI)")
    ax.set_title("Parameter estimates")
    legend_beside(ax)
