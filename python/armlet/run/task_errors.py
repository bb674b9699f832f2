"""Distances and angles between the frames of a run's tasks and their targets:

    e_k(t) = |S_k (x_d,k(t) - p_k(q(t)))|,   S_k the position rows of task k
    phi_k(t) = |S_k log(R_d,k(t) R_k(q(t))')|,   S_k its orientation rows

`p_k` and `R_k` are the position (m) and rotation matrix of the task's frame. `x_d,k` and `R_d,k` are those of its target. They are in world
axes, and `'` is the transpose. The laws `CartesianImpedance`, `ElasticImpedance` and `ElasticTracking` have one task each. The tasks of a
priority law are its objects of the class `Task` that have a target and position or orientation rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core, rotations
from ..pose_curves import columns_of

__all__ = ["frame_errors", "orientation_errors", "position_errors", "stacked", "unstacked", "where_finite"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class _Aim:
    """The position rows or the orientation rows of one task: the name of its frame, and its target.

    `rows` are indices of x, y, z, and `places` are the indices of the same rows in the target. `turns` is true for orientation rows.
    """

    frame: str
    rows: tuple[int, ...]
    places: tuple[int, ...]
    target: Any
    turns: bool

    def at(self, t: Array) -> Array:
        """Return the target of the rows at the times `t`, (rows,) for a constant target or (K, rows), m or rad."""
        wanted = np.array([self.target(float(time))[0] for time in t]) if callable(self.target) else np.asarray(self.target)
        chosen: Array = wanted[..., list(self.places)]
        return chosen


def position_errors(laws: Sequence[Any], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    """Compute the distances between the tasks' frames and their targets, (K, tasks) or (B, K, tasks), m.

    Return None if no law has such tasks. Rows of laws with fewer tasks end with NaN.

    Args:
        laws, arms: one for all rows, or one per row.
        t: times, (K,) or (B, K), s.
        q: joint positions, (K, n) or (B, K, n), rad or m.
    """
    return _of_tasks([_aims(law, False) for law in laws], arms, t, q)


def orientation_errors(laws: Sequence[Any], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    """Compute the angles between the tasks' frames and their targets, (K, tasks) or (B, K, tasks), rad. See `position_errors`."""
    return _of_tasks([_aims(law, True) for law in laws], arms, t, q)


def _of_tasks(aims: list[list[_Aim]], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    if not any(aims) or not all(getattr(arm, "frame_names", ()) for arm in arms):
        return None
    if len(aims) == len(arms) == 1 and t.ndim == 1:
        return _errors(aims[0], arms[0], t, q)
    each = []
    for i, rows in enumerate(q):
        own = aims[i if len(aims) > 1 else 0], arms[i if len(arms) > 1 else 0]
        each.append(_errors(*own, t if t.ndim == 1 else t[i], rows) if own[0] else np.zeros((*rows.shape[:-1], 0)))
    return stacked(each).reshape(*q.shape[:-1], max(map(len, aims)))


def stacked(rows: Sequence[Array]) -> Array:
    """Return the rows as one array. The last axis of shorter rows ends with NaN."""
    width = max((row.shape[-1] for row in rows), default=0)
    if all(row.shape[-1] == width for row in rows):
        return np.array(rows)
    return np.array([np.concatenate([row, np.full((*row.shape[:-1], width - row.shape[-1]), np.nan)], axis=-1) for row in rows])


def unstacked(row: Array) -> Array | None:
    """Return a row of `stacked` without the columns that are NaN at its end. Return None if all of its numbers are NaN."""
    known = np.flatnonzero(~np.isnan(row).reshape(-1, row.shape[-1]).all(axis=0))
    return row[..., : known[-1] + 1] if len(known) else None


def frame_errors(arms: Sequence[Any], frame: str, q: Array, q_d: Array) -> Array:
    """Compute the distance between a frame at `q` and the same frame at the reference `q_d`, (K, 1) or (B, K, 1), m."""
    if len(arms) == 1:
        apart = _position(arms[0], q_d, frame) - _position(arms[0], q, frame)
        return np.asarray(np.linalg.norm(apart, axis=-1, keepdims=True), dtype=np.float64)
    return np.array([frame_errors([arm], frame, rows, wanted) for arm, rows, wanted in zip(arms, q, q_d, strict=True)])


def _aims(law: Any, turns: bool) -> list[_Aim]:
    """Return the position rows of each task of a law that has a target, or the orientation rows if `turns` is true."""
    law = law.law if isinstance(law, _core.Guarded) else law
    made = law.__getnewargs_ex__()[1] if hasattr(law, "__getnewargs_ex__") else {}
    given = [each.__getnewargs_ex__()[1] for each in _tasks(made["tasks"]) if type(each).__name__ == "Task"] if "tasks" in made else [made]
    aims = []
    for one in given:
        columns = columns_of(one.get("axes") or "xyz") if "frame" in one else []
        found = [(place, column % 3) for place, column in enumerate(columns) if (column > 2) == turns]
        if found and one.get("target") is not None:
            places, axes = zip(*found, strict=True)
            aims.append(_Aim(one["frame"], axes, places, one["target"], turns))
    return aims


def _tasks(levels: Sequence[Any]) -> list[Any]:
    """The tasks of all levels of a priority law. An entry may be a list of tasks, or of pairs of a task and its weight."""
    groups = [level if isinstance(level, (list, tuple)) else [level] for level in levels]
    return [entry[0] if isinstance(entry, tuple) else entry for group in groups for entry in group]


def _errors(aims: Sequence[_Aim], arm: Any, t: Array, q: Array) -> Array:
    parts = [(_rotation if aim.turns else _offset)(aim, arm, t, q) for aim in aims]
    return np.stack([np.linalg.norm(part, axis=-1) for part in parts], axis=-1)


def _offset(aim: _Aim, arm: Any, t: Array, q: Array) -> Array:
    apart: Array = aim.at(t) - _position(arm, q, aim.frame)[..., list(aim.rows)]
    return apart


def _rotation(aim: _Aim, arm: Any, t: Array, q: Array) -> Array:
    """Return the task's rows of `log(R_d R')`, rad. `R_d` has the target's rotation vector, with zeros in rows without a target."""
    wanted = np.zeros((*q.shape[:-1], 3))
    wanted[..., list(aim.rows)] = aim.at(t)
    R = where_finite(lambda q: arm.pose(q, aim.frame)[..., :3, :3], q)
    turn = rotations.after(rotations.of_vector(wanted), rotations.inverse(rotations.of_matrix(R)))
    apart: Array = rotations.vector(turn)[..., list(aim.rows)]
    return apart


def _position(arm: Any, q: Array, frame: str) -> Array:
    return where_finite(lambda q: arm.position(q, frame), q)


def where_finite(evaluate: Callable[[Array], Array], q: Array) -> Array:
    """Return `evaluate(q)`, with NaN in the rows where `q` is not finite. The functions of an arm refuse such values."""
    bad = np.asarray(~np.isfinite(q).all(axis=-1))
    found = evaluate(np.where(bad[..., None], 0.0, q))
    found[bad] = np.nan
    return found
