"""The filtered samples of a log, at a reduced rate and without gaps and ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..logs.filters import interpolated, low_pass, low_pass_rates
from ..logs.log import Log

__all__ = ["NAME", "Samples", "samples_of"]

Array = NDArray[np.float64]

NAME = "fit_log"
#: The default cutoff, Hz, and the largest share of the sample rate.
CUTOFF, SHARE = 10.0, 0.1
#: Order of the filter, its memory in periods of the cutoff, and samples per period of the cutoff after decimation.
ORDER, MEMORY, DENSITY = 2, 2.0, 4.0


@dataclass(frozen=True)
class Samples:
    """Filtered samples at a reduced rate, without gaps and ends."""

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    #: Filtered positions, velocities and accelerations at every time of the log, and the indices of the samples in them.
    motion: tuple[Array, Array, Array]
    rows: NDArray[np.intp]
    period: float
    cutoff: float

    def filtered(self, column: Array) -> Array:
        """The samples of a column, known at every time of the log, after the filter."""
        return low_pass(column, self.period, self.cutoff, ORDER)[self.rows]

    def sampled(self, function: Callable[..., Array], *series: Array) -> Array:
        """The samples of a function of series that are known at every time of the log."""
        return function(*(each[self.rows] for each in series))


def samples_of(log: Log, cutoff: float | None, delay: float = 0.0) -> Samples:
    """The samples of a log. A torque acts `delay` seconds after the time at which it was recorded.

    Raises:
        InputError: the log is too short, or the cutoff is too high.
    """
    period = log.report.period
    if not len(log.t) > 2 or not period > 0.0:
        raise InputError(f"{NAME}: log is too short: expected at least three samples, got {len(log.t)}")
    even = log.resample(period) if log.report.uneven or log.report.gaps or len(log.report.clock_jumps) else log
    frequency = min(CUTOFF, SHARE / period) if cutoff is None else cutoff
    if not frequency * period < 0.25:
        most = f"less than a quarter of the sample rate, {0.25 / period:g} Hz"
        raise InputError(f"{NAME}: cutoff is too high: expected {most}, got {frequency:g}")
    assert even.tau is not None
    q, v, a = low_pass_rates(even.q, period, frequency, ORDER)
    torques = interpolated(even.t - delay, even.t, even.tau) if delay else even.tau
    tau = low_pass(torques, period, frequency, ORDER)
    memory = MEMORY / frequency
    used = (even.t >= even.t[0] + memory + max(delay, 0.0)) & (even.t <= even.t[-1] - memory + min(delay, 0.0))
    for start, missing in log.report.gaps:
        used &= (even.t <= start - memory) | (even.t >= start + (missing + 1) * period + memory) | (missing <= 2)
    stride = max(1, math.floor(1.0 / (DENSITY * frequency * period)))
    rows = np.flatnonzero(used)[::stride]
    return Samples(even.t[rows], q[rows], v[rows], a[rows], tau[rows], (q, v, a), rows, period, frequency)
