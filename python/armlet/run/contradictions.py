"""Warnings of runs in which torque limits contradict other limits of a `PriorityAcceleration`.

The torque limits hold, and the accelerations miss the other limits. The monitor `violation_0` is the norm of the missed accelerations. The
status of a run does not change, because it states how the run ended.
"""

from __future__ import annotations

import warnings

import numpy as np

from ..callers import level_of_caller
from .balances import is_quiet
from .recorded import Recorded

__all__ = ["warn_of_contradictions"]

#: Missed accelerations up to this one are rounding errors, rad/s^2 or m/s^2.
_ROUNDING = 1e-6


def warn_of_contradictions(caller: str, run: Recorded) -> None:
    """Warn once if the torque limits of a law contradict its other limits at records of a run, or of runs of a batch."""
    missed = run.monitors.get("violation_0")
    if is_quiet() or missed is None:
        return
    bad = np.asarray(missed) > _ROUNDING
    if not bad.any():
        return
    *row, first = np.unravel_index(int(np.argmax(bad)), bad.shape)
    rows = bad.any(axis=-1)
    runs = f" in {np.sum(rows)} of {np.size(rows)} runs (first bad index {int(np.argmax(rows))})" if np.ndim(rows) else ""
    count = f"{np.sum(bad[tuple(row)])} of {bad.shape[-1]} records from t = {run.t[first]:.4g} s on"
    warnings.warn(
        f"{caller}: torque limits contradict other limits{runs}: at {count}. The other limits are missed by up to "
        f"{np.nanmax(missed):.3g} rad/s^2 or m/s^2. run.active names the torques. A smaller a_max brakes earlier.",
        UserWarning,
        stacklevel=level_of_caller(),
    )
