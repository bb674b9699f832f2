"""Distances and angles between the frames of a run's tasks and their targets:

    e_k(t) = |S_k (x_d,k(t) - p_k(q(t)))|,   S_k the position rows of task k
    phi_k(t) = |S_k log(R_d,k(t) R_k(q(t))')|,   S_k its orientation rows

`CartesianImpedance`, `ElasticImpedance` and `ElasticTracking` have one task each. The priority laws have every
`Task` with such rows and a target.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import rotations
from ..pose_curves import columns_of

__all__ = ["frame_errors", "orientation_errors", "position_errors", "where_finite"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class _Aim:
    """A frame, rows of its position or orientation as indices of xyz, and their places among the rows of the target."""

    frame: str
    rows: tuple[int, ...]
    places: tuple[int, ...]
    target: Any
    turns: bool

    def at(self, t: Array) -> Array:
        """The target of these rows, (rows,) or (K, rows)."""
        wanted = np.array([self.target(float(time))[0] for time in t]) if callable(self.target) else np.asarray(self.target)
        chosen: Array = wanted[..., list(self.places)]
        return chosen


def position_errors(laws: Sequence[Any], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    """The distances of the tasks' frames, (K, tasks) or (B, K, tasks), m; None if the laws have no tasks, or different numbers of them.

    Args:
        laws, arms: one for all rows, or one per row.
        t: (K,) or (B, K).
        q: (K, n) or (B, K, n).
    """
    return _of_tasks([_aims(law, False) for law in laws], arms, t, q)


def orientation_errors(laws: Sequence[Any], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    """The same for the angles between the tasks' frames and their targets, rad."""
    return _of_tasks([_aims(law, True) for law in laws], arms, t, q)


def _of_tasks(aims: list[list[_Aim]], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    if not aims[0] or any(len(each) != len(aims[0]) for each in aims) or not all(getattr(arm, "frame_names", ()) for arm in arms):
        return None
    if len(aims) == len(arms) == 1 and t.ndim == 1:
        return _errors(aims[0], arms[0], t, q)
    each = []
    for i, rows in enumerate(q):
        own = aims[i if len(aims) > 1 else 0], arms[i if len(arms) > 1 else 0]
        each.append(_errors(*own, t if t.ndim == 1 else t[i], rows))
    return np.array(each).reshape(*q.shape[:-1], len(aims[0]))


def frame_errors(arms: Sequence[Any], frame: str, q: Array, q_d: Array) -> Array:
    """The distance between a frame and its place at the joints' reference, (K, 1) or (B, K, 1), m."""
    if len(arms) == 1:
        apart = _position(arms[0], q_d, frame) - _position(arms[0], q, frame)
        return np.asarray(np.linalg.norm(apart, axis=-1, keepdims=True), dtype=np.float64)
    return np.array([frame_errors([arm], frame, rows, wanted) for arm, rows, wanted in zip(arms, q, q_d, strict=True)])


def _aims(law: Any, turns: bool) -> list[_Aim]:
    """The tasks of a law with rows of position, or of orientation."""
    made = law.__getnewargs_ex__()[1] if hasattr(law, "__getnewargs_ex__") else {}
    given = [each.__getnewargs_ex__()[1] for each in made["tasks"] if type(each).__name__ == "Task"] if "tasks" in made else [made]
    aims = []
    for one in given:
        columns = columns_of(one.get("axes") or "xyz") if "frame" in one else []
        found = [(place, column % 3) for place, column in enumerate(columns) if (column > 2) == turns]
        if found and one.get("target") is not None:
            places, axes = zip(*found, strict=True)
            aims.append(_Aim(one["frame"], axes, places, one["target"], turns))
    return aims


def _errors(aims: Sequence[_Aim], arm: Any, t: Array, q: Array) -> Array:
    parts = [(_rotation if aim.turns else _offset)(aim, arm, t, q) for aim in aims]
    return np.stack([np.linalg.norm(part, axis=-1) for part in parts], axis=-1)


def _offset(aim: _Aim, arm: Any, t: Array, q: Array) -> Array:
    apart: Array = aim.at(t) - _position(arm, q, aim.frame)[..., list(aim.rows)]
    return apart


def _rotation(aim: _Aim, arm: Any, t: Array, q: Array) -> Array:
    """`log(R_d R')` in the rows of the task; rows that have no target are zero in the rotation vector of `R_d`."""
    wanted = np.zeros((*q.shape[:-1], 3))
    wanted[..., list(aim.rows)] = aim.at(t)
    R = where_finite(lambda q: arm.pose(q, aim.frame)[..., :3, :3], q)
    turn = rotations.after(rotations.of_vector(wanted), rotations.inverse(rotations.of_matrix(R)))
    apart: Array = rotations.vector(turn)[..., list(aim.rows)]
    return apart


def _position(arm: Any, q: Array, frame: str) -> Array:
    return where_finite(lambda q: arm.position(q, frame), q)


def where_finite(evaluate: Callable[[Array], Array], q: Array) -> Array:
    """`evaluate(q)`; NaN where joint positions are NaN, which the arm refuses."""
    bad = np.asarray(~np.isfinite(q).all(axis=-1))
    found = evaluate(np.where(bad[..., None], 0.0, q))
    found[bad] = np.nan
    return found
