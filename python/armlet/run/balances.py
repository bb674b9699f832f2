"""Warnings of runs whose energy or Lyapunov balance has a large residual. Such a run is inaccurate, although its numbers are finite.

    E(t) - E(0) - int P dt = 0,   V1(0) - V1(t) - int s'Kd s dt = 0

`E` is the energy in J, and `P` the supplied power in W. `V1` is the Lyapunov function, `s` the sliding variable and `Kd` the damping gain
of an adaptive law, and `'` the transpose. The exact solution of the loop fulfils the first equation, so its residual is the error of the
integration method. It also fulfils the second one for a continuous law without projection, input bounds and external forces, whose model
has the structure of the plant. For options of the law that change the rate of `V1`, the integral includes their terms. With coarse steps
the residual of the first equation can be as large as the energy.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..callers import level_of_caller

__all__ = ["Balances", "energy_error", "is_quiet", "quiet", "together", "warn_of_balances"]

Array: TypeAlias = NDArray[np.float64]

#: Largest `energy_error` without a warning: a fraction of the largest energy stored or exchanged.
MOST_ENERGY = 0.1
#: Largest `energy_missing` without a warning, J. The rounding of an arm at rest causes smaller values.
LEAST_ENERGY = 1e-6
#: Largest `lyapunov_rise` without a warning, a multiple of the first value. In theory the Lyapunov function never rises.
MOST_RISE = 10.0
#: A warning requires a `lyapunov_error` above this fraction of the largest Lyapunov function, and also a rise above `MOST_RISE`.
MOST_LOST = 0.1


_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress the warnings about results of runs in this thread, for callers that report the metrics of the runs."""
    token = _QUIET.set(True)
    try:
        yield
    finally:
        _QUIET.reset(token)


def is_quiet() -> bool:
    """Return whether `quiet` suppresses the warnings about runs in this thread."""
    return _QUIET.get()


def energy_error(monitors: Mapping[str, Array]) -> Array | None:
    """Return the largest `energy_balance` as a fraction of the largest energy stored or exchanged, `()` or `(B,)`.

    The result is None if `monitors` has no energy balance or no records.
    """
    if "energy_balance" not in monitors or not monitors["energy_balance"].shape[-1]:
        return None
    energy, balance = monitors["energy"], monitors["energy_balance"]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        exchanged = energy - energy[..., :1] - balance
        most, missing = np.maximum(_largest(energy), _largest(exchanged)), _largest(balance)
        return np.where(missing > 0.0, missing / np.where(missing > 0.0, most, 1.0), missing)


@dataclass(frozen=True)
class Balances:
    """Residuals of the balances of runs, `()` or `(B,)` each; NaN if unknown. The core computes them together with the records.

    Attributes:
        energy_error: the largest `energy_balance` as a fraction of the largest energy stored or exchanged.
        energy_missing: the largest `energy_balance`, J.
        lyapunov_rise: the largest Lyapunov function as a multiple of its first value.
        lyapunov_error: the largest `lyapunov_balance` as a fraction of the largest Lyapunov function.
    """

    energy_error: float | Array
    energy_missing: float | Array
    lyapunov_rise: float | Array
    lyapunov_error: float | Array


def together(pieces: Sequence[Balances]) -> Balances:
    """Return the balances of a batch from those of its pieces, (B,) each."""
    names = [field.name for field in fields(Balances)]
    return Balances(**{name: np.concatenate([np.atleast_1d(getattr(piece, name)) for piece in pieces]) for name in names})


def warn_of_balances(caller: str, balances: Balances, ended: NDArray[np.bool_], undisturbed: bool) -> None:
    """Warn if a run reached its end, but the residual of a balance is too large for an accurate run.

    `ended`: whether each run reached its end, `()` or `(B,)`. `undisturbed`: whether the law acts at every instant, without input bounds
    and external forces. Only then does the theory predict that the Lyapunov function never rises.
    """
    if is_quiet():
        return
    given = (balances.energy_error, balances.energy_missing, balances.lyapunov_rise)
    error, missing, rise = (np.broadcast_to(x, np.shape(ended)) for x in given)
    bad = np.asarray(ended & (error > MOST_ENERGY) & (missing > LEAST_ENERGY))
    text = f"{missing[bad].max():.2g} J are missing, {error[bad].max():.2g} of the energy stored or exchanged" if bad.any() else ""
    found = [("energy balance", bad, text)]
    if undisturbed:
        bad = np.asarray(ended & (rise > MOST_RISE) & (balances.lyapunov_error > MOST_LOST))
        text = f"the Lyapunov function rises to {rise[bad].max():.2g} times its first value, but should never rise" if bad.any() else ""
        found.append(("Lyapunov balance", bad, text))
    for name, bad, text in found:
        if bad.any():
            runs = f" in {bad.sum()} of {bad.size} runs (first bad index {int(np.argmax(bad))})" if bad.ndim else ""
            series = name.lower().replace(" ", "_")
            advice = f'the steps are too coarse for this loop: reduce dt, or use an adaptive method (monitors["{series}"])'
            warnings.warn(f"{caller}: the {name} does not close{runs}: {text}; {advice}", UserWarning, stacklevel=level_of_caller())


def warn_of_force(caller: str, change: Sequence[float], dt: float) -> None:
    """Warn that fixed steps `dt` are too long for a force that changes between the two times `change`, s."""
    start, end = change
    advice = "reduce dt, use an adaptive method, or give the force as a list [(t_start, F), ...]"
    text = f"the force changes within {end - start:.3g} s at t = {start:.6g} s, which is too short for steps of {dt:g} s: {advice}"
    warnings.warn(f"{caller}: {text}", UserWarning, stacklevel=level_of_caller())


def _largest(values: Array) -> Array:
    result: Array = np.abs(np.nan_to_num(values, posinf=np.inf, neginf=-np.inf)).max(axis=-1)
    return result
