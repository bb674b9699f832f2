"""How far the frames of a run's tasks are from their targets:

    e_k(t) = |S_k (x_d,k(t) - p_k(q(t)))|,   S_k the position rows of task k

Tasks are those of `CartesianImpedance`, `ElasticImpedance` and `ElasticTracking`, one each, and those of the priority laws that are a
`Task` with position rows and a target.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["frame_errors", "position_errors"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class _Aim:
    """A frame, its position rows as indices of xyz, and where they stand among the rows of the target."""

    frame: str
    rows: tuple[int, ...]
    places: tuple[int, ...]
    target: Any

    def at(self, t: Array) -> Array:
        """The target of the position rows, (rows,) or (K, rows)."""
        wanted = np.array([self.target(float(time))[0] for time in t]) if callable(self.target) else np.asarray(self.target)
        chosen: Array = wanted[..., list(self.places)]
        return chosen


def position_errors(laws: Sequence[Any], arms: Sequence[Any], t: Array, q: Array) -> Array | None:
    """The errors of the tasks, (K, tasks) or (B, K, tasks), m; None where the laws have none, or differing numbers of them.

    Args:
        laws, arms: one for all rows, or one per row.
        t: (K,) or (B, K).
        q: (K, n) or (B, K, n).
    """
    if not _aims(laws[0]):
        return None
    aims = [_aims(law) for law in laws]
    if any(len(each) != len(aims[0]) for each in aims) or not all(getattr(arm, "frame_names", ()) for arm in arms):
        return None
    if len(aims) == len(arms) == 1 and t.ndim == 1:
        return _errors(aims[0], arms[0], t, q)
    each = []
    for i, rows in enumerate(q):
        own = aims[i if len(aims) > 1 else 0], arms[i if len(arms) > 1 else 0]
        each.append(_errors(*own, t if t.ndim == 1 else t[i], rows))
    return np.array(each).reshape(*q.shape[:-1], len(aims[0]))


def frame_errors(arms: Sequence[Any], frame: str, q: Array, q_d: Array) -> Array:
    """The distance of a frame from where it should be by the joints' reference, (K, 1) or (B, K, 1), m."""
    if len(arms) == 1:
        apart = _position(arms[0], q_d, frame) - _position(arms[0], q, frame)
        return np.asarray(np.linalg.norm(apart, axis=-1, keepdims=True), dtype=np.float64)
    return np.array([frame_errors([arm], frame, rows, wanted) for arm, rows, wanted in zip(arms, q, q_d, strict=True)])


def _aims(law: Any) -> list[_Aim]:
    made = law.__getnewargs_ex__()[1] if hasattr(law, "__getnewargs_ex__") else {}
    given = [each.__getnewargs_ex__()[1] for each in made["tasks"] if type(each).__name__ == "Task"] if "tasks" in made else [made]
    aims = []
    for one in given:
        rows = _rows(one.get("axes") or "xyz") if "frame" in one else []
        found = [(place, "xyz".index(row)) for place, row in enumerate(rows) if row in "xyz"]
        if found and one.get("target") is not None:
            places, axes = zip(*found, strict=True)
            aims.append(_Aim(one["frame"], axes, places, one["target"]))
    return aims


def _rows(axes: str) -> list[str]:
    """`"xy rz"` as x, y, rz."""
    return re.findall("r?[xyz]", axes)


def _errors(aims: Sequence[_Aim], arm: Any, t: Array, q: Array) -> Array:
    parts = [aim.at(t) - _position(arm, q, aim.frame)[..., list(aim.rows)] for aim in aims]
    return np.stack([np.linalg.norm(part, axis=-1) for part in parts], axis=-1)


def _position(arm: Any, q: Array, frame: str) -> Array:
    """NaN where the joints are no numbers, which the arm refuses."""
    bad = np.asarray(~np.isfinite(q).all(axis=-1))
    p: Array = arm.position(np.where(bad[..., None], 0.0, q), frame)
    p[bad] = np.nan
    return p
