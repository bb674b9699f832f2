"""Further limits of the timing of a path: limits that vary along the path, position limits, and limits of a frame's origin.

    limit(s) linear between knots;   p(s) = position(q(s)),   p' and p'' by central differences of fourth order in s

' is the derivative with respect to s. The core computes p' = J q' and p'' = J q'' + (dJ/ds) q' with the Jacobian J.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array

#: The step of the differences, as a fraction of the length of a smooth part of the path.
STEP = 1e-3
#: The number of samples of the path at which position limits are checked.
SAMPLES = 20001


def two_sided(limit: Any, n: int, s: Array, knots: Array) -> tuple[Array, Array]:
    """The lower and upper limits (K, n) at s (K,), from None, a scalar, (n,), (n, 2), (knots, n) or a function of s."""
    if callable(limit):
        limit = np.array([np.broadcast_to(limit(float(x)), (n,)) for x in knots])
    values = np.asarray(np.inf if limit is None else limit, dtype=np.float64)
    if values.shape == (n, 2):
        return np.broadcast_to(values[:, 0], (s.size, n)), np.broadcast_to(values[:, 1], (s.size, n))
    if values.ndim == 2:
        high = np.stack([np.interp(s, knots, column) for column in values.T], axis=1)
    else:
        high = np.broadcast_to(values, (s.size, n))
    return -high, high


def one_sided(limit: Any, s: Array, knots: Array) -> Array:
    """The upper limits (K,) at s (K,), from a scalar, (knots,) or a function of s."""
    return np.asarray(two_sided(np.reshape(limit, (-1, 1)) if np.ndim(limit) == 1 else limit, 1, s, knots)[1][:, 0])


def leaves_range(q: Callable[[Array], Array], ends: Array, q_min: ArrayLike | None, q_max: ArrayLike | None) -> bool:
    """Whether samples of the path are outside its position limits."""
    values = q(np.linspace(ends[0], ends[-1], SAMPLES))
    below = -np.inf if q_min is None else np.asarray(q_min, dtype=np.float64)
    above = np.inf if q_max is None else np.asarray(q_max, dtype=np.float64)
    slack = 1e-9 * (1.0 + np.abs(values))
    return bool(np.any(values < below - slack) or np.any(values > above + slack))


def tip_slopes(position: Callable[[Array], Array], s: Array, inside: tuple[float, float]) -> tuple[Array, Array]:
    """dp/ds and d2p/ds2 (K, 3) of the position p(s) at s (K,), by differences between the two ends `inside` of a smooth part."""
    h = STEP * (inside[1] - inside[0])
    at = np.clip(s, inside[0] + 2 * h, inside[1] - 2 * h)
    far, near, mid, on, last = (position(at + k * h) for k in (-2, -1, 0, 1, 2))
    first = (far - 8 * near + 8 * on - last) / (12 * h)
    second = (-far + 16 * near - 30 * mid + 16 * on - last) / (12 * h * h)
    # Near the ends, the differences are computed at `at` instead of s. Then the second derivative extrapolates the first one to s.
    return first + (s - at)[:, None] * second, second
