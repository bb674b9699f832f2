"""The residuals and the contact of a `Guarded` law's observer, computed from the recorded state of the law.

The state is `[inner law, w, R]`. A reaction adds `[c, s, y_c c, r_c c]`. `r` is the residual, `w` the momentum that the observer predicts,
and `R` the integral of `r`. `c` is the duration of the sampling period that begins at the contact, s, and 0 before the contact. `s` is the
time since the contact, s. `y_c` and `r_c` are the position and the residual at the contact.

    sampled loop      r = (R_k - R_(k-1)) / (t_k - t_(k-1)),   R_k the value at the record k
    continuous loop   r = K (M v - w),   K the gain of the observer, M v the momentum
    contact           at the time t - s, with the residual r_c
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..arguments import brief
from ..border import bordered
from ..pickling import sealed
from .task_errors import where_finite

__all__ = ["Contact", "contact_states", "residuals", "touched_joints"]

Array: TypeAlias = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True, eq=False, repr=False)
class Contact:
    """The contact to which a `Guarded` law reacted. For a batch the fields are arrays with a first axis B.

    >>> import numpy as np
    >>> import armlet as al
    >>> al.Contact(time=0.25, joint=1, residual=np.array([2.0, 3.0])).joint
    1
    """

    #: Time at which the reaction began, s; NaN without contact.
    time: Any
    #: Index of the touched link's joint, determined from `residual`; -1 without contact.
    joint: Any
    #: Residual of the observer at the time of the contact, (n,) or (B, n), N m or N; NaN without contact.
    residual: Array

    def __post_init__(self) -> None:
        runs = _core.numbers("Contact", "time", self.time, (), ("B",)).shape
        _core.numbers("Contact", "joint", self.joint, runs)
        _core.numbers("Contact", "residual", self.residual, (*runs, "n"))

    def __repr__(self) -> str:
        return brief(self)


def residuals(laws: Sequence[Any], t: Array, q: Array, v: Array, estimate: Array | None, sampled: bool) -> Array | None:
    """Return the residuals at the K records, (K, n) or (B, K, n), N m or N. Return None for laws without an observer and if K = 1."""
    law = laws[0]
    if not isinstance(law, _core.Guarded) or estimate is None or estimate.ndim != q.ndim or q.shape[-2:-1] != t.shape[-1:] or len(t.T) < 2:
        return None
    n = q.shape[-1]
    w, summed = (estimate[..., law._first + k * n : law._first + (k + 1) * n] for k in (0, 1))
    if sampled:
        found = np.zeros_like(q)
        found[..., 1:, :] = np.diff(summed, axis=-2) / np.diff(t)[..., None]
        return found
    if len(laws) == 1:
        return _instant(law, q, v, w)
    return np.array([_instant(*row) for row in zip(laws, q, v, w, strict=True)])


def _instant(law: Any, q: Array, v: Array, w: Array) -> Array:
    arm = law.observer.arm

    def residual(state: Array) -> Array:
        q, v, w = np.split(state, 3, axis=-1)
        found: Array = (np.einsum("...ij,...j->...i", arm.mass_matrix(q), v) - w) @ law._gain.T
        return found

    return where_finite(residual, np.concatenate([q, v, w], axis=-1))


def touched_joints(laws: Sequence[Any], residual: Array | None) -> NDArray[np.int64] | None:
    """Return the index of the touched link's joint at each record, (K,) or (B, K): -1 without contact.

    Return None for laws without an observer or without thresholds.
    """
    if residual is None or any(law.observer.threshold is None for law in laws):
        return None
    if len(laws) == 1:
        return _touched(laws[0], residual)
    return np.array([_touched(*row) for row in zip(laws, residual, strict=True)])


def _touched(law: Any, residual: Array) -> NDArray[np.int64]:
    finite = np.isfinite(residual).all(axis=-1, keepdims=True)
    joints: NDArray[np.int64] = np.asarray(law.touched(np.where(finite, residual, 0.0)), dtype=np.int64)
    return joints


def contact_states(laws: Sequence[Any], t: Array, estimate: Array | None, batch: bool) -> Array | None:
    """Return time, joint and residual of the contact, (2 + n,) or (B, 2 + n). Return None for laws without a reaction.

    Without contact the time and the residual are NaN, and the joint is -1.
    """
    law = laws[0]
    if not isinstance(law, _core.Guarded) or law.reaction is None or estimate is None:
        return None
    n = law.arm.n
    last = estimate if estimate.ndim == 1 + batch else estimate[..., -1, :]
    count, since = (last[..., law._first + 2 * n + k] for k in (0, 1))
    latched = last[..., law._first + 3 * n + 2 :]
    there = np.asarray(count > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = np.where(there[..., None], latched / count[..., None], np.nan)
    time = np.where(there, t[..., -1] - since, np.nan)
    rows = [law if len(laws) == 1 else laws[i] for i in range(len(last))] if batch else [law]
    joints = [each.touched(r) if np.isfinite(r).all() else -1 for each, r in zip(rows, np.atleast_2d(residual), strict=True)]
    joint = np.array(joints if batch else joints[0], dtype=np.float64)
    state: Array = np.concatenate([time[..., None], joint[..., None], residual], axis=-1)
    return state
