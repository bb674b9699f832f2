"""Faults of recorded times and angles: dropped samples, jumps of the clock, uneven intervals and wrapped angles.

    period = median of the intervals d_k = t_(k+1) - t_k
    dropped samples:  d_k > 1.5 period;  round(d_k / period) - 1 samples are missing
    clock jump:       d_k <= 0, or the position continues as if one period had passed:  q_(k+1) - q_k = v_k period,  not v_k d_k
    wrapped angle:    |q_(k+1) - q_k| > pi, and the difference to one turn is below pi/2

An interval of 1.5 periods or more contains dropped samples, unless the clock jumped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Clock", "examined", "repaired", "unwrapped"]

Array = NDArray[np.float64]

#: An interval of more periods than this contains dropped samples, or the clock jumped.
GAP = 1.5
#: Relative deviation of an interval from the period above which the times are uneven.
UNEVEN = 1e-3
#: Dropped samples cannot be counted if 40 % of the intervals deviate from the period by more than 25 %.
IRREGULAR, SHARE = 0.25, 0.4


@dataclass(frozen=True)
class Clock:
    """What the times of a log show."""

    #: Median interval, s; NaN for a single sample.
    period: float
    #: Root mean square of the deviation of the intervals from the period, without gaps, s.
    jitter: float
    #: Whether an interval deviates from the period by more than 0.1 %.
    uneven: bool
    #: Whether the intervals are too irregular to count dropped samples.
    irregular: bool
    #: Number of samples that are missing.
    dropped: int
    #: Indices k of the intervals (k, k + 1) with missing samples, and of those at which the clock jumps.
    gaps: NDArray[np.intp]
    jumps: NDArray[np.intp]


def examined(t: Array, q: Array, start: float = 0.0) -> Clock:
    """Examine the times `t` (K,) of the positions `q` (K, n). `start` was subtracted from the values of the clock."""
    none = np.zeros(0, dtype=np.intp)
    if len(t) < 2:
        return Clock(float("nan"), 0.0, False, False, 0, none, none)
    intervals = np.diff(t)
    forward = intervals[intervals > 0.0]
    period = float(np.median(forward)) if len(forward) else float("nan")
    # Rounding of large clock values is not unevenness.
    resolution = 4.0 * np.spacing(np.abs(t).max() + abs(start))
    deviation = np.abs(intervals - period)
    irregular = bool(np.mean(deviation > IRREGULAR * period) >= SHARE)
    backward = intervals <= 0.0
    long = np.zeros_like(backward) if irregular else intervals > GAP * period
    jumps = backward.copy()
    if long.any():
        jumps[long] = _continues(q, intervals, period, np.flatnonzero(long))
    gaps = np.flatnonzero(long & ~jumps)
    ordinary = deviation[~long & ~backward]
    dropped = int(np.sum(np.round(intervals[gaps] / period) - 1.0))
    uneven = bool((ordinary > UNEVEN * period + resolution).any())
    jitter = float(np.sqrt(np.mean(ordinary**2))) if len(ordinary) else 0.0
    return Clock(period, jitter, uneven, irregular, dropped, gaps, np.flatnonzero(jumps))


def _continues(q: Array, intervals: Array, period: float, places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether the positions continue across each interval of `places` as if one period had passed.

    The velocity is that of the intervals before and after. A joint decides if its motion in the interval would exceed its usual changes
    of velocity and its noise by a factor of ten.
    """
    if len(q) < 8:
        return np.zeros(len(places), dtype=bool)
    usual = np.quantile(np.abs(np.diff(q, 2, axis=0)), 0.95, axis=0) + np.spacing(np.abs(q).max(axis=0))
    before, after = np.maximum(places - 1, 0), np.minimum(places + 1, len(intervals) - 1)
    rate = 0.5 * (np.diff(q, axis=0)[before] / intervals[before, None] + np.diff(q, axis=0)[after] / intervals[after, None])
    change = q[places + 1] - q[places]
    moved = np.abs(rate) * (intervals[places, None] - period) > 10.0 * usual
    near: NDArray[np.bool_] = np.abs(change - rate * period) <= 2.0 * usual
    return np.asarray(near.all(axis=1) & moved.any(axis=1))


def repaired(t: Array, clock: Clock) -> Array:
    """The times with one period in place of each interval at which the clock jumps."""
    intervals = np.diff(t)
    intervals[clock.jumps] = clock.period
    shift = np.concatenate([[0.0], np.cumsum(intervals - np.diff(t))])
    return np.asarray(t + shift)


def unwrapped(q: Array, turns: NDArray[np.bool_]) -> tuple[Array, NDArray[np.intp]]:
    """Return positions (K, n) without wraps, and the number of wraps of each joint. `turns` (n,) marks joints that turn."""
    step = np.diff(q, axis=0)
    counts = np.zeros(q.shape[1], dtype=np.intp)
    large = turns & (np.abs(step) > np.pi)
    if not large.any():
        return q, counts
    turn = np.where(large, np.round(step / (2.0 * np.pi)), 0.0)
    # A step far from a whole turn is a fault of the sensor, not a wrap.
    turn[np.abs(step - 2.0 * np.pi * turn) > 0.5 * np.pi] = 0.0
    counts = np.count_nonzero(turn, axis=0)
    offset = np.zeros_like(q)
    np.cumsum(turn, axis=0, out=offset[1:])
    return q - 2.0 * np.pi * offset, counts
