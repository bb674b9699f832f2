"""Tests of statistics for correlated residuals: a tail probability, the covariance of sums, and Holm's correction.

For scores `g_k` (d,) with the mean zero, the covariance of their sum has the form of Newey and West (1987). Its weights stay one for half
of the lags, so that the correlation within the filter's memory has its full weight:

    V = G_0 + sum_l w_l (G_l + G_l'),   G_l = sum_k g_k g_(k+l)',   w_l = min(1, 2 - 2 l/(L + 1))
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["covariance_of_sum", "f_tail", "holm"]

Array = NDArray[np.float64]

#: Terms of the continued fraction. It converges in about sqrt(max(a, b)) terms.
DEPTH = 200
#: Smallest eigenvalue of V relative to the variances of the scores.
LEAST = 0.05


def f_tail(value: float, count: int, degrees: float) -> float:
    """The probability that a variable with the F distribution of `count` and `degrees` degrees of freedom exceeds `value`."""
    if not value > 0.0:
        return 1.0
    return _incomplete_beta(0.5 * degrees, 0.5 * count, degrees / (degrees + count * value))


def _incomplete_beta(a: float, b: float, x: float) -> float:
    """The regularised incomplete beta function, by its continued fraction (Abramowitz and Stegun, 26.5.8)."""
    if x <= 0.0 or x >= 1.0:
        return float(x >= 1.0)
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - _incomplete_beta(b, a, 1.0 - x)
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)) / a
    fraction = 1.0
    for k in range(DEPTH, 0, -1):
        m = k // 2
        term = -(a + m) * (a + b + m) * x if k % 2 else m * (b - m) * x
        fraction = 1.0 + term / ((a + k) * (a + k - 1)) / fraction
    return min(1.0, front / fraction)


def covariance_of_sum(scores: Array, lags: int) -> Array:
    """The covariance V of the sum of the scores (K, d), which are correlated over fewer than `lags` samples.

    If V is hardly positive definite, all weights decrease from the first lag on.
    """
    own: Array = scores.T @ scores
    flat, falling = own.copy(), own.copy()
    for lag in range(1, min(lags, len(scores) - 1) + 1):
        shifted = scores[:-lag].T @ scores[lag:]
        weight = 2.0 - 2.0 * lag / (lags + 1)
        flat += min(1.0, weight) * (shifted + shifted.T)
        falling += 0.5 * weight * (shifted + shifted.T)
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    smallest = np.linalg.eigvalsh(flat / np.outer(scale, scale))[:1]
    return flat if np.all(smallest > LEAST) else falling


def holm(p: Sequence[float], level: float) -> NDArray[np.bool_]:
    """Which hypotheses with the probabilities `p` are refuted at the family `level`, after Holm (1979)."""
    order = np.argsort(p, kind="stable")
    bounds = level / np.arange(len(p), 0, -1)
    below = np.asarray(p)[order] <= bounds
    count = len(p) if below.all() else int(np.argmin(below))
    refuted = np.zeros(len(p), dtype=bool)
    refuted[order[:count]] = True
    return refuted
