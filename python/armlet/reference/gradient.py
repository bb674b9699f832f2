"""Derivatives of runs by difference quotients. A run is a function of an array of numbers, and four more runs give each derivative.

    df/dp = (8 (f(p + d) - f(p - d)) - (f(p + 2 d) - f(p - 2 d))) / (12 d) + O(d^4)

f is the run and d the step. The code does not depend on laws or plants, and uses only values of f.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array


def sensitivity(run: Callable[[Array], Array], value: ArrayLike, size: ArrayLike | None = None, step: float = 1e-3) -> Array:
    """The derivatives of the array `run(value)` with respect to the entries of `value`, as a last axis.

    The steps of the central differences are `step * size`. If `size` is None, it is the magnitude of each entry, or 1 if the entry is zero.
    For a smooth run, the truncation error is of the order `step**4`.
    """
    at = np.array(value, dtype=np.float64)
    sizes = np.broadcast_to(np.where(at == 0.0, 1.0, np.abs(at)) if size is None else np.asarray(size, dtype=np.float64), at.shape)
    columns = []
    for index in np.ndindex(at.shape):
        d = step * float(sizes[index])
        moved = [at.copy() for _ in range(4)]
        for other, by in zip(moved, (-2.0, -1.0, 1.0, 2.0), strict=True):
            other[index] += by * d
        below2, below, above, above2 = (np.asarray(run(other)) for other in moved)
        columns.append((8.0 * (above - below) - (above2 - below2)) / (12.0 * d))
    return np.stack(columns, axis=-1)


def gradient(loss: Callable[[Array], float], value: ArrayLike, size: ArrayLike | None = None, step: float = 1e-3) -> Array:
    """The derivatives of the number `loss(value)` with respect to the entries of `value`, in the shape of `value`.

    `size` and `step` are those of `sensitivity`.
    """
    return sensitivity(lambda at: np.asarray(loss(at)), value, size, step).reshape(np.shape(value))


def fit(
    run: Callable[[Array], Array], measured: ArrayLike, value: ArrayLike, deviation: ArrayLike | None = None, steps: int = 20
) -> tuple[Array, Array]:
    """The `value`, (P,), with the least sum of squares of (run(value) - measured) / deviation, and its standard deviations, (P,).

    The method is Gauss-Newton with normal equations. `deviation` is the standard deviation of each measured number. If it is None, all
    measured numbers have the same deviation, which is estimated from the residuals.
    """
    data = np.asarray(measured, dtype=np.float64).ravel()
    sigma = np.ones_like(data) if deviation is None else np.broadcast_to(deviation, np.shape(measured)).ravel()
    at = np.array(value, dtype=np.float64)
    for _ in range(steps):
        slopes = sensitivity(lambda number: np.asarray(run(number)).ravel(), at) / sigma[:, None]
        left = (np.asarray(run(at)).ravel() - data) / sigma
        at = at - np.linalg.solve(slopes.T @ slopes, slopes.T @ left)
    slopes = sensitivity(lambda number: np.asarray(run(number)).ravel(), at) / sigma[:, None]
    left = (np.asarray(run(at)).ravel() - data) / sigma
    variance = 1.0 if deviation is not None else float(left @ left) / (len(data) - len(at))
    return at, np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes)))
