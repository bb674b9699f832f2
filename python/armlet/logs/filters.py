"""Linear interpolation at equal intervals, and a low-pass filter without phase.

The filter is a Butterworth filter of order N that runs forwards and backwards. Its gain at the frequency f is

    g(f) = 1 / (1 + (tan(pi f T) / tan(pi f_c T))^(2 N)),    T = sample time,  f_c = cutoff,  g(f_c) = 1/2

The line through the first and the last sample passes unchanged. The difference to this line is continued as an odd function at both ends.
So the continued signal is periodic, and the filter multiplies its Fourier coefficients by g.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["interpolated", "low_pass", "low_pass_rates"]

Array = NDArray[np.float64]


def interpolated(times: Array, t: Array, values: Array) -> Array:
    """Interpolate the columns of `values` (K, n), known at the times `t` (K,), linearly at `times`."""
    return np.stack([np.interp(times, t, column) for column in values.T], axis=1)


def low_pass(values: Array, period: float, cutoff: float, order: int) -> Array:
    """Filter the columns of `values` (K, n) with the sample time `period`, s, and the cutoff frequency, Hz."""
    count = len(values)
    if count < 3:
        return values.copy()
    line, gain = _line(values), _gain(count, period, cutoff, order)
    filtered = np.empty_like(values)
    for joint in range(values.shape[1]):
        odd = _odd(values[:, joint] - line[:, joint])
        filtered[:, joint] = line[:, joint] + np.fft.irfft(gain * np.fft.rfft(odd), len(odd))[:count]
    return filtered


def low_pass_rates(values: Array, period: float, cutoff: float, order: int) -> tuple[Array, Array, Array]:
    """Filter the columns of `values` (K, n), and return them with their first and second derivatives in time, (K, n) each."""
    filtered, first, second = (np.empty_like(values) for _ in range(3))
    count = len(values)
    gain, line, rates = _gain(count, period, cutoff, order), _line(values), 2j * np.pi * np.fft.rfftfreq(2 * (count - 1)) / period
    slope = (values[-1] - values[0]) / (period * (count - 1))
    for joint in range(values.shape[1]):
        spectrum = gain * np.fft.rfft(_odd(values[:, joint] - line[:, joint]))
        parts = [np.fft.irfft(rates**k * spectrum, 2 * (count - 1))[:count] for k in range(3)]
        filtered[:, joint], first[:, joint], second[:, joint] = line[:, joint] + parts[0], slope[joint] + parts[1], parts[2]
    return filtered, first, second


def _line(values: Array) -> Array:
    return np.asarray(values[0] + np.linspace(0.0, 1.0, len(values))[:, None] * (values[-1] - values[0]))


def _odd(deviation: Array) -> Array:
    return np.concatenate([deviation, -deviation[-2:0:-1]])


def _gain(count: int, period: float, cutoff: float, order: int) -> Array:
    frequencies = np.fft.rfftfreq(2 * (count - 1))
    return np.asarray(1.0 / (1.0 + (np.tan(np.pi * frequencies) / np.tan(np.pi * cutoff * period)) ** (2 * order)))
