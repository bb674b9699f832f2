"""Stability margins of a linear loop, from the eigenvalues of loops with a changed input.

    x' = A x + B w,   w = f u,   u = C x:   the loop is stable if A + B f C is

f is a diagonal matrix of ones, with one factor at joint i. The factor is a gain, e^(-j phi), or (2 + d) / (2 - d) with a complex d. In a
sampled loop, x' is the state at the next sample, and eigenvalues are stable inside of the unit circle. A search over a grid of factors
finds the first one with which the loop is not stable, and bisection its value.

The delay margin of a sampled loop is a whole number of periods: the loop with k further states that store past inputs.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .lagrange import Array

#: Factors of the grid from 1 to the largest gain, and to its inverse.
GAINS, LARGEST = 400, 1e4
#: Angles of the grid, and directions of d.
ANGLES, DIRECTIONS = 720, 180


def loop_gain(A: Array, B: Array, C: Array, w: float, period: float) -> NDArray[np.complex128]:
    """The loop gain L at one frequency, from the sensitivity S = I + C (s I - A - B C)^-1 B: L = S^-1 - I.

    For a period h > 0, s is e^(j w h).
    """
    s, one = np.exp(1j * w * period) if period else 1j * w, np.eye(B.shape[1], dtype=np.complex128)
    sensitivity = one + C @ np.linalg.inv(s * np.eye(len(A)) - A - B @ C) @ B
    return np.asarray(np.linalg.inv(sensitivity) - one, dtype=np.complex128)


def is_stable(A: Array, sampled: bool) -> bool:
    """Whether all eigenvalues are stable, except those of constant states."""
    values = np.linalg.eigvals(A)
    return bool(np.abs(values).max() < 1.0 + 1e-12) if sampled else bool(values.real.max() < 1e-9 * np.abs(values).max())


def border(stable: Callable[[float], bool], values: Array) -> float:
    """The value at which `stable` becomes false, between the last and the first values of the grid; the last value without a border."""
    bad = next((k for k, value in enumerate(values) if not stable(float(value))), None)
    if bad is None:
        return float(values[-1])
    low, high = float(values[max(bad - 1, 0)]), float(values[bad])
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return 0.5 * (low + high)


def loop_margins(A: Array, B: Array, C: Array, joint: int, *, sampled: bool = False) -> dict[str, float]:
    """Margins of one joint by name. A gain without a border is 1e4 or 1e-4."""
    n = B.shape[1]

    def with_factor(f: complex) -> bool:
        factors = np.eye(n, dtype=np.complex128)
        factors[joint, joint] = f
        return is_stable(np.asarray(A + B @ factors @ C), sampled)

    def with_disc(size: float) -> bool:
        turns = size * np.exp(1j * np.linspace(0.0, np.pi, DIRECTIONS))
        return all(with_factor((2.0 + d) / (2.0 - d)) for d in turns)

    return {
        "gain_low": border(with_factor, np.geomspace(1.0, 1.0 / LARGEST, GAINS)),
        "gain_high": border(with_factor, np.geomspace(1.0, LARGEST, GAINS)),
        "phase": border(lambda angle: with_factor(np.exp(-1j * angle)), np.linspace(0.0, np.pi, ANGLES)),
        "disc": border(with_disc, np.linspace(0.0, 1.999, 100)),
    }


def delayed(A: Array, B: Array, C: Array, joint: int, count: int) -> Array:
    """The matrix of a sampled loop with `count` further periods of delay at the input of one joint."""
    m, n = B.shape
    whole = np.zeros((m + count, m + count))
    others = np.eye(n)
    others[joint, joint] = float(count == 0)
    whole[:m, :m] = A + B @ others @ C
    if count:
        whole[:m, m + count - 1] = B[:, joint]
        whole[m, :m] = C[joint]
        whole[m + 1 :, m : m + count - 1] = np.eye(count - 1)
    return whole
