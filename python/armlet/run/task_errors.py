"""How far the frames of a run's tasks are from their targets:

    e_k(t) = |S_k (x_d,k(t) - p_k(q(t)))|,   S_k the position rows of task k
    phi_k(t) = |S_k log(R_d,k(t) R_k(q(t))')|,   S_k its orientation rows

Tasks are those of `CartesianImpedance`, `ElasticImpedance` and `ElasticTracking`, one each, and those of the priority laws that are a
`Task` with such rows and a target.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["frame_errors", "orientation_errors", "position_errors"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class _Aim:
    """A frame, rows of its position or orientation as indices of xyz, and where they stand among the rows of the target."""

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
    """The distances of the tasks' frames, (K, tasks) or (B, K, tasks), m; None where the laws have none, or differing numbers of them.

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
    """The distance of a frame from where it should be by the joints' reference, (K, 1) or (B, K, 1), m."""
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
        rows = re.findall("r?[xyz]", one.get("axes") or "xyz") if "frame" in one else []
        found = [(place, "xyz".index(row[-1])) for place, row in enumerate(rows) if row.startswith("r") == turns]
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
    R = _finite(lambda q: arm.pose(q, aim.frame)[..., :3, :3], q)
    apart: Array = _rotation_vector(_rotation_matrix(wanted) @ np.swapaxes(R, -1, -2))[..., list(aim.rows)]
    return apart


def _rotation_matrix(r: Array) -> Array:
    """Of rotation vectors (..., 3), by Rodrigues' formula."""
    angle = np.linalg.norm(r, axis=-1)[..., None, None]
    K = np.zeros((*r.shape[:-1], 3, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = r[..., 0], r[..., 1], r[..., 2]
    K -= np.swapaxes(K, -1, -2)
    found: Array = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * K @ K
    return found


def _rotation_vector(R: Array) -> Array:
    """Of rotation matrices (..., 3, 3): twice the vector part of the quaternion, stretched to the angle."""
    trace = np.trace(R, axis1=-2, axis2=-1)
    diagonal = np.diagonal(R, axis1=-2, axis2=-1)
    # The symmetric matrix whose largest eigenvector is the quaternion (Bar-Itzhack 2000); no formula has to be chosen by case.
    N = np.zeros((*R.shape[:-2], 4, 4))
    N[..., :3, :3] = R + np.swapaxes(R, -1, -2)
    for i in range(3):
        N[..., i, i] = 2.0 * diagonal[..., i] - trace
    axis = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1)
    N[..., :3, 3] = N[..., 3, :3] = axis
    N[..., 3, 3] = trace
    bad = ~np.isfinite(N).all(axis=(-2, -1))
    N[bad] = 0.0
    quaternion = np.linalg.eigh(N)[1][..., -1]
    quaternion *= np.where(quaternion[..., 3:] < 0.0, -1.0, 1.0)
    half = np.arctan2(np.linalg.norm(quaternion[..., :3], axis=-1), quaternion[..., 3])[..., None]
    found: Array = 2.0 * quaternion[..., :3] / np.sinc(half / np.pi)
    found[bad] = np.nan
    return found


def _position(arm: Any, q: Array, frame: str) -> Array:
    return _finite(lambda q: arm.position(q, frame), q)


def _finite(evaluate: Callable[[Array], Array], q: Array) -> Array:
    """NaN where the joints are no numbers, which the arm refuses."""
    bad = np.asarray(~np.isfinite(q).all(axis=-1))
    found = evaluate(np.where(bad[..., None], 0.0, q))
    found[bad] = np.nan
    return found
