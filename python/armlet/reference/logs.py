"""Preparation of logs.

    low-pass:  Butterworth poles p_k = w_c exp(i pi (2k + N - 1) / (2N)),  w_c = 2/T tan(pi f_c T),  s = 2/T (z - 1)/(z + 1)
               each pole is the recursion  y_k = d y_(k-1) + g (x_k + x_(k-1)),  d = (2/T + p)/(2/T - p),  g = -p/(2/T - p)
               forwards and then backwards over the odd continuation of the signal
    wraps:     the angle of exp(i q_(k+1)) / exp(i q_k) is the shortest turn
    samples:   missing times are whole multiples of the period after the time before

The functions process one sample after another.
"""

from itertools import pairwise

import numpy as np

from .lagrange import Array

__all__ = ["continued", "low_pass", "missing_samples", "resampled"]


def low_pass(values: Array, period: float, cutoff: float, order: int) -> Array:
    """Filter the columns of values (K, n) forwards and backwards, with a recursion for each pole."""
    count = len(values)
    ramp = np.linspace(0.0, 1.0, count)[:, None]
    line = (1.0 - ramp) * values[0] + ramp * values[-1]
    odd = np.concatenate([values - line, (line - values)[-2:0:-1]])
    # After enough periods the recursion no longer depends on its start.
    slowest = max(abs(decay) for decay, _ in _sections(period, cutoff, order))
    periods = 1 + int(np.ceil(-40.0 / np.log(slowest) / len(odd)))
    signal = np.tile(odd, (2 * periods + 1, 1)).astype(complex)
    for _ in range(2):
        signal = _recursion(signal, period, cutoff, order)[::-1]
    start = periods * len(odd)
    return np.asarray(line + signal[start : start + count].real)


def _sections(period: float, cutoff: float, order: int) -> list[tuple[complex, complex]]:
    """The numbers d and g of each pole."""
    rate = 2.0 / period
    corner = rate * np.tan(np.pi * cutoff * period)
    poles = [corner * np.exp(1j * np.pi * (2 * k + order - 1) / (2 * order)) for k in range(1, order + 1)]
    return [((rate + pole) / (rate - pole), -pole / (rate - pole)) for pole in poles]


def _recursion(signal: Array, period: float, cutoff: float, order: int) -> Array:
    for decay, gain in _sections(period, cutoff, order):
        before, made = signal[0], signal[0]
        rows = []
        for row in signal:
            made = decay * made + gain * (row + before)
            before = row
            rows.append(made)
        signal = np.array(rows)
    return signal


def resampled(times: Array, t: Array, values: Array) -> Array:
    """Interpolate values (K, n) linearly: the mean of both neighbours, weighted by the distance to the other one."""
    rows = []
    for time in times:
        k = max(i for i in range(len(t)) if t[i] <= time)
        k = min(k, len(t) - 2)
        rows.append(((t[k + 1] - time) * values[k] + (time - t[k]) * values[k + 1]) / (t[k + 1] - t[k]))
    return np.array(rows)


def continued(q: Array) -> Array:
    """Continue angles (K,) by the shortest turn from each sample to the next one."""
    turns = [0.0, *(float(np.angle(np.exp(1j * b) / np.exp(1j * a))) for a, b in pairwise(q))]
    return np.asarray(q[0] + np.cumsum(turns))


def missing_samples(t: Array, period: float) -> int:
    """Count the multiples of the period from t_0 on that no time is near."""
    present = {round((time - t[0]) / period) for time in t}
    return len(set(range(max(present) + 1)) - present)
