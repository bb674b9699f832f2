"""The recorded torque between the samples: constant pieces, and how they move with the delay.

A sampled law holds its torque. A torque with the delay `d` that was recorded at `t_i` acts from `t_i + d` to `t_(i+1) + d`. In the sample
interval from `t_k` to `t_(k+1)`, the torque is constant between these switching times. A torque that is not held is linear between its
records. Then the piece is the whole interval, with the mean of the torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Piece", "pieces_of", "without_gaps"]

Array = NDArray[np.float64]

#: Switching times that are closer to a sample than this fraction of the period coincide with it, unless the delay is fitted.
CLOSE = 1e-6


@dataclass(frozen=True)
class Piece:
    """A part of each of K sample intervals with a constant torque.

    `length` (K,) and `torque` (K, n); derivatives by the delay: `moves` of the length and `rate` of the torque, None for zero.
    """

    length: Array
    torque: Array
    moves: Array | None = None
    rate: Array | None = None


def without_gaps(t: Array, tau: Array, period: float) -> tuple[Array, Array]:
    """Times and torques of the records, with interpolated torques in place of lost samples."""
    missing = np.maximum(np.round(np.diff(t) / period).astype(int) - 1, 0)
    if not missing.any():
        return t, tau
    first = np.repeat(np.arange(len(t) - 1), missing + 1)
    place = np.arange(len(first)) - np.repeat(np.concatenate([[0], np.cumsum(missing + 1)[:-1]]), missing + 1)
    share = place / (missing[first] + 1.0)
    times = np.append(t[first] + share * (t[first + 1] - t[first]), t[-1])
    torques = np.concatenate([tau[first] + share[:, None] * (tau[first + 1] - tau[first]), tau[-1:]])
    return times, torques


def pieces_of(t: Array, records: tuple[Array, Array], delay: float, held: bool, moving: bool) -> list[Piece]:
    """The pieces of the intervals between the times `t`, (K + 1,). `moving` states whether the delay is fitted."""
    times, torques = records
    if held:
        return _held(t, times + delay, torques, moving)
    ends = _integral(times, torques, t - delay)
    length = np.diff(t)
    at = np.stack([np.interp(t - delay, times, column) for column in torques.T], axis=1)
    rate = -np.diff(at, axis=0) / length[:, None] if moving else None
    return [Piece(length, np.diff(ends, axis=0) / length[:, None], None, rate)]


def _held(t: Array, switches: Array, torques: Array, moving: bool) -> list[Piece]:
    close = CLOSE * float(np.median(np.diff(t)))
    # A delay that grows from zero moves the switch at a sample into the interval after it.
    first = np.searchsorted(switches, t[:-1] - close if moving else t[:-1] + close)
    last = np.searchsorted(switches, t[1:] - close)
    count = np.maximum(last - first, 0)
    pieces = []
    for piece in range(int(count.max(initial=0)) + 1):
        inside, ends = piece <= count, piece < count
        before, after = np.clip(first + piece - 1, 0, len(switches) - 1), np.clip(first + piece, 0, len(switches) - 1)
        begin = np.maximum(switches[before], t[:-1]) if piece else t[:-1]
        end = np.where(ends, np.maximum(switches[after], t[:-1]), t[1:])
        moves = ends.astype(np.float64) - float(piece > 0)
        length = np.where(inside, end - begin, 0.0)
        pieces.append(Piece(length, torques[before], np.where(inside, moves, 0.0) if moving else None))
    return pieces


def _integral(times: Array, torques: Array, at: Array) -> Array:
    """The integral of the linear interpolation from `times[0]` to `at`, (K, n). Outside of its times the torque is constant."""
    steps = np.diff(times)[:, None]
    whole = np.concatenate([np.zeros((1, torques.shape[1])), np.cumsum(0.5 * steps * (torques[1:] + torques[:-1]), axis=0)])
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    inside = np.clip(at, times[0], times[-1])
    left = (inside - times[k])[:, None]
    slope = (torques[k + 1] - torques[k]) / steps[k]
    outside = (at - inside)[:, None] * np.where((at < times[0])[:, None], torques[0], torques[-1])
    return np.asarray(whole[k] + left * torques[k] + 0.5 * left**2 * slope + outside)
