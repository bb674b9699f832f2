"""Active rows of solutions of task priority, and the reasons why a level is not reached.

Row i of a level is active at or beyond a bound of `l_i <= a_i v <= u_i`. For level k, `J_k' w_k = -sum lambda_i a_i`. The sum is over the
active rows of the higher levels, with multipliers lambda_i. `w_k = J_k v - clip(J_k v, l_k, u_k)` are the violations. Level 0 has the
rows of the identity, with the bounds v_min and v_max. The functions read the dict that `rust/py/src/priority/details.rs` describes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import InputError
from .pickling import sealed

__all__ = ["Active"]

Array: TypeAlias = NDArray[np.float64]
Details: TypeAlias = dict[str, Any] | None
#: A gradient of violations below this fraction of its largest term is zero.
FLAT = 1e-10


@sealed
class Active(NamedTuple):
    """A row of a level at or beyond a bound, with its side and its multiplier.

    Attributes:
        row: index of the row in its level, from 0; for `limits` the index of the joint.
        side: "lower" or "upper".
        multiplier: of the first level that the row limits, >= 0 at an upper and <= 0 at a lower bound; 0 if it limits no level. For a
            violated row it is the violation.
        name: "joint 1" or "row 1", counted from 1.

    >>> import armlet as al
    >>> al.solve_priority([[[1.0]]], [[3.0]], v_max=2.0).limits
    [Active(row=0, side='upper', multiplier=1.0, name='joint 1')]
    """

    row: int
    side: str
    multiplier: float
    name: str


def violations(details: Details, residuals: Sequence[Array]) -> list[Array]:
    """The violations of each level, (..., rows_i), from the residuals of the tasks."""
    if details is None or details["violations"] is None:
        return [-residual for residual in residuals]
    return _levels(details["violations"], residuals)


def active(details: Details, v: Array, residuals: Sequence[Array]) -> list[list[Active]] | Callable[[int], list[list[Active]]]:
    """The active rows of each level; of a batch, a function of the index of a row."""

    def of(row: Any) -> list[list[Active]]:
        if details is None or details["violations"] is None:
            return [[] for _ in residuals]
        sides, multipliers = (_levels(details[name], residuals) for name in ("sides", "multipliers"))
        rows = [_rows(side[row], multiplier[row], "row") for side, multiplier in zip(sides, multipliers, strict=True)]
        return rows[details.get("limit_levels", 0) :]

    return of(()) if v.ndim == 1 else of


def limits(details: Details, v: Array, residuals: Sequence[Array]) -> list[Active] | Callable[[int], list[Active]]:
    """The joint velocities at a bound; of a batch, a function of the index of a row."""

    def of(row: Any) -> list[Active]:
        if details is None or details["violations"] is None:
            return []
        count = details.get("limit_levels", 0)
        if count:
            sides, multipliers = (_levels(details[name], residuals)[:count] for name in ("sides", "multipliers"))
            kinds = ("torque of joint", "joint")
            return [
                each for side, multiplier, kind in zip(sides, multipliers, kinds, strict=False) for each in _rows(side, multiplier, kind)
            ]
        if details["limits"] is None:
            return []
        return _rows(details["sides"][row][: v.shape[-1]], details["multipliers"][row][: v.shape[-1]], "joint")

    return of(()) if v.ndim == 1 else of


def changes(details: Details, v: Array) -> Any:
    """The number of changes of the active set."""
    if details is None:
        return 0 if v.ndim == 1 else np.zeros(v.shape[:-1], dtype=np.int64)
    return details["changes"]


def certificate(details: Details, v: Array) -> Any:
    """The largest residual of the optimality conditions, divided by their largest term."""
    if details is None:
        return np.nan if v.ndim == 1 else np.full(v.shape[:-1], np.nan)
    return details["certificate"]


def why(details: Details, v: Array, k: int) -> str:
    """One sentence: by how much level `k` is missed, and the rows of higher levels that stop it."""
    if details is None or details["levels"] is None:
        raise InputError("PrioritySolution.why: k has no use in a batch: expected the solution of a single stack")
    levels, above = details["levels"], details.get("limit_levels", 0)
    least, most = (0 if above > 1 else 1), len(levels) - above
    if not least <= k <= most:
        raise InputError(f"PrioritySolution.why: k is not a level: expected {least} to {most}, got {k}")
    n = v.size
    first = (np.zeros((0, n)), np.zeros(0), np.zeros(0)) if details["limits"] is None else (np.eye(n), *details["limits"])
    scales: Any = details.get("scales")
    number = k + above
    scaled = scales is not None and k > 0 and bool(scales[number - 1] < 1.0)
    missed, reasons = _core._priority_reasons([first, *levels], v, number, scaled)
    if scaled:
        return f"level {k} is scaled by {scales[number - 1]:.3g}: {_reasons(reasons, above, 'the direction of the command takes')}"
    if not missed.any():
        return f"level {k} is reached"
    rows = [f"row {i + 1} by {abs(missed[i]):.3g}" for i in np.flatnonzero(missed)]
    jacobian = levels[number - 1][0]
    if np.linalg.norm(missed @ jacobian) <= FLAT * np.linalg.norm(jacobian) * np.linalg.norm(missed):
        return f"level {k} misses {_listed(rows)}: no joint velocity reduces this, because its rows conflict or its Jacobian is singular"
    return f"level {k} misses {_listed(rows)}: {_reasons(reasons, above, 'damping near a singularity takes')}"


def _reasons(reasons: Sequence[tuple[int, int, int, float]], above: int, others: str) -> str:
    """The shares of single bounds, then those of the tasks of each level, then the rest. The first `above` levels are limits."""
    parts, tasks, total = [], dict[int, float](), 0.0
    for number, row, side, share in reasons:
        total += share
        level = max(number - above, 0)
        if side and abs(share) >= 0.005:
            kind = "row" if level else "torque of joint" if above and number == 1 else "joint"
            name = f"{kind} {row + 1}"
            parts.append(f"{name} at its {'upper' if side > 0 else 'lower'} bound (level {level}) takes {100 * share:.0f} %")
        elif not side:
            tasks[level] = tasks.get(level, 0.0) + share
    parts += [f"the tasks of level {level} take {100 * share:.0f} %" for level, share in sorted(tasks.items()) if abs(share) >= 0.005]
    if total < 0.995:
        parts.append(f"{others} {100 * (1 - total):.0f} %")
    return _listed(parts)


def _rows(sides: Array, multipliers: Array, kind: str) -> list[Active]:
    return [Active(int(i), "upper" if sides[i] > 0 else "lower", float(multipliers[i]), f"{kind} {i + 1}") for i in np.flatnonzero(sides)]


def _levels(values: Any, residuals: Sequence[Array]) -> list[Array]:
    """Divide the columns of `values` among the levels. Columns of joints come first."""
    rows = [residual.shape[-1] for residual in residuals]
    ends = np.cumsum(rows) + values.shape[-1] - sum(rows)
    return [values[..., end - m : end] for end, m in zip(ends, rows, strict=True)]


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
