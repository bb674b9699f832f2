"""Warnings of laws whose commands pass the speed limits of the arm.

The method "sns" of priority laws keeps these limits, and the other methods do so with `limits=True`. Near a singularity or with a target
out of reach, commands may otherwise exceed the limits by a factor of hundreds. `limits=False` omits the warning. The compared speed is
the input of a plant under velocity control, and the velocity of the joints under a `PriorityAcceleration`. Only finite limits above zero
are compared.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..callers import level_of_caller
from .balances import is_quiet
from .recorded import Array, Recorded

__all__ = ["commands_speeds", "excess", "input_ratio", "positive", "speed_limits", "speed_ratio", "warn_of_speeds"]

#: A speed passes its limit if it exceeds the limit by more than this fraction. Rounding of a command at its bound is smaller.
MARGIN = 1e-6


def speed_limits(run: Recorded) -> Array | None:
    """The speed limits of the joints, (n,) or (B, n), rad/s or m/s, infinite for joints without a limit; None for an unknown arm."""
    return None if run.limits is None else positive(run.limits["v_max"])


def excess(speeds: Array, limits: Array) -> NDArray[np.bool_]:
    """Whether each of the speeds (.., n) passes its limit."""
    return np.asarray(np.abs(speeds) > (1.0 + MARGIN) * limits)


def input_ratio(run: Recorded, tau_peak: Array) -> Array:
    """The largest input `tau_peak` (.., n) of a joint divided by the arm's limit of it, (..); NaN without a finite limit above zero."""
    if run.limits is None:
        return np.full(tau_peak.shape[:-1], np.nan)
    limits = np.broadcast_to(positive(run.limits["v_max" if commands_speeds(run) else "effort"]), tau_peak.shape)
    # An infinite limit has the ratio zero.
    result: Array = np.where(np.isfinite(limits).any(axis=-1), (tau_peak / limits).max(axis=-1), np.nan)
    return result


def commands_speeds(run: Recorded) -> bool:
    """Whether the input of the plant is a velocity."""
    return run.input_units == tuple(f"{unit}/s" for unit in run.units)


def speed_ratio(run: Recorded) -> Array | None:
    """Each recorded speed that passes its limit, divided by the limit, else zero; (.., K, n). None for a run whose law commands no speeds.

    Of a batch with `keep="metrics"`, K is 1, and the speeds are the largest inputs of each run.
    """
    law = run._laws[0]
    while isinstance(law, _core.Guarded):
        law = law.law
    if commands_speeds(run):
        speeds = np.asarray(run.stats["tau_peak"])[..., None, :] if "tau_peak" in run.stats else run.tau
    else:
        speeds = run.v if isinstance(law, _core.PriorityAcceleration) or run.law_name == "PriorityAcceleration" else None
    limits = speed_limits(run)
    if speeds is None or limits is None:
        return None
    limits = np.broadcast_to(limits[..., None, :], speeds.shape)
    return np.where(excess(speeds, limits), np.abs(speeds) / limits, 0.0)


def warn_of_speeds(caller: str, run: Recorded) -> None:
    """Warn once if commands of a run, or of runs of a batch, pass the arm's own speed limits."""
    ratio = None if is_quiet() or _ignores_limits(run) else speed_ratio(run)
    if ratio is None or not ratio.any():
        return
    bad = ratio.any(axis=(-2, -1))
    *row, _, joint = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    limits = speed_limits(run)
    assert limits is not None  # otherwise there is no ratio
    limit, unit = float((limits[tuple(row)] if limits.ndim > 1 else limits)[joint]), f"{run.units[joint]}/s"
    runs = f" in {np.sum(bad)} of {np.size(bad)} runs (first bad index {int(np.argmax(bad))})" if np.ndim(bad) else ""
    text = f"{ratio.max() * limit:.4g} {unit} of {run.arm.joint_names[joint]}, whose limit is {limit:.4g} {unit}"
    advice = "tau_max bounds the commands"
    if run.law_name.startswith("Priority"):
        advice = "limits=True of the law keeps the limits, and limits=False omits this warning"
    warnings.warn(f"{caller}: commands pass the arm's speed limits{runs}: {text}; {advice}", UserWarning, stacklevel=level_of_caller())


def _ignores_limits(run: Recorded) -> bool:
    """Whether the law of a run, or all laws of a batch, ignore the arm's limits on request."""
    laws = [law for law in run._laws if isinstance(law, (_core.PriorityVelocity, _core.PriorityAcceleration))]
    return bool(laws) and all(law.__getnewargs_ex__()[1].get("limits") is False for law in laws)


def positive(limits: Array) -> Array:
    """The limits that are finite and above zero; the others are infinite."""
    result: Array = np.where((limits > 0.0) & np.isfinite(limits), limits, np.inf)
    return result
