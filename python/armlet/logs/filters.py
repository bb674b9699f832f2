"""Linear interpolation at equal intervals, and a low-pass filter without phase.

The filter is a Butterworth filter of order N that runs forwards and backwards. Its gain at the frequency f is

    g(f) = 1 / (1 + (tan(pi f T) / tan(pi f_c T))^(2 N)),    T = sample time,  f_c = cutoff,  g(f_c) = 1/2

The line through the first and the last sample passes unchanged. The difference to this line is continued as an odd function at both ends.
So the continued signal is periodic, and the filter multiplies its Fourier coefficients by g.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["interpolated", "low_pass"]

Array = NDArray[np.float64]


def interpolated(times: Array, t: Array, values: Array) -> Array:
    """Interpolate the columns of `values` (K, n), known at the times `t` (K,), linearly at `times`."""
    return np.stack([np.interp(times, t, column) for column in values.T], axis=1)


def low_pass(values: Array, period: float, cutoff: float, order: int) -> Array:
    """Filter the columns of `values` (K, n) with the sample time `period`, s, and the cutoff frequency, Hz."""
    count = len(values)
    if count < 3:
        return values.copy()
    line = values[0] + np.linspace(0.0, 1.0, count)[:, None] * (values[-1] - values[0])
    frequencies = np.fft.rfftfreq(2 * (count - 1))
    with np.errstate(over="ignore"):
        gain = 1.0 / (1.0 + (np.tan(np.pi * frequencies) / np.tan(np.pi * cutoff * period)) ** (2 * order))
    filtered = np.empty_like(values)
    for joint in range(values.shape[1]):
        deviation = values[:, joint] - line[:, joint]
        odd = np.concatenate([deviation, -deviation[-2:0:-1]])
        filtered[:, joint] = line[:, joint] + np.fft.irfft(gain * np.fft.rfft(odd), len(odd))[:count]
    return filtered
