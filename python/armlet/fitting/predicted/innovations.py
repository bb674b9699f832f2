"""One-step predictions of recorded positions, by an observer with a constant gain:

    e_k = y_k - C x_k - o,   x_(k+1) = F(x_k + L e_k, p)

`y` are positions of links, and of motors if they were recorded, and `o` are offsets of the encoders. `L` is the steady-state gain of the
Kalman filter of the mean linear system with the transition `Phi`. Torques and encoders have white noise. About states
near the trajectory the recursion is linear, so one pass returns the innovations and their exact derivatives by the values:

    S_(k+1) = Phi_k (I - L C) S_k + G_k - Phi_k L do/dp,   de_k/dp = -C S_k - do/dp
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .transitions import Transitions

__all__ = ["Innovations", "Noise", "innovations", "kalman_gain", "memory_of"]

Array = NDArray[np.float64]

#: Steps of the doubling of the Riccati equation. Each squares the error.
DOUBLINGS = 60


@dataclass(frozen=True)
class Noise:
    """Covariances of the noise of the torques, mapped to the states (d, d), and of the encoders (y, y)."""

    Q: Array
    R: Array


@dataclass(frozen=True)
class Innovations:
    """Innovations (K, y), their derivatives by the values (K, y, P), and the states after the correction, (K, d)."""

    error: Array
    slopes: Array
    states: Array


def kalman_gain(Phi: Array, C: Array, noise: Noise) -> Array:
    """The steady-state gain `L`, (d, y), of the filter of `x_(k+1) = Phi x_k + w_k`, `y_k = C x_k + r_k`.

    The structured doubling algorithm solves the Riccati equation of the covariance `P` (Anderson and Moore, Optimal Filtering, 1979,
    chapter 6). Then `L = P C' (C P C' + R)^-1`.
    """
    A, G, H = Phi.T.copy(), C.T @ np.linalg.solve(noise.R, C), noise.Q.copy()
    eye = np.eye(len(A))
    for _ in range(DOUBLINGS):
        W = eye + G @ H
        left, right = np.linalg.solve(W, A), np.linalg.solve(W, G)
        step = A.T @ H @ left
        G, H, A = G + A @ right @ A.T, H + step, A @ left
        G, H = 0.5 * (G + G.T), 0.5 * (H + H.T)
        if np.abs(step).max() <= 1e-12 * np.abs(H).max():
            break
    # The cross-covariance of state and measurement, and the covariance of the innovations.
    return np.asarray(np.linalg.solve(C @ H @ C.T + noise.R, C @ H).T)


def memory_of(Phi: Array, C: Array, L: Array) -> float:
    """The number of samples after which an error of the observer has decreased to 1/e."""
    radius = float(np.abs(np.linalg.eigvals(Phi @ (np.eye(len(Phi)) - L @ C))).max())
    return float(-1.0 / np.log(min(max(radius, 1e-3), 1.0 - 1e-9)))


def innovations(
    steps: Transitions,
    about: Array,
    y: Array,
    C: Array,
    L: Array,
    start: Array,
    offset: Array,
    by_offset: Array,
    restarts: NDArray[np.intp],
) -> Innovations:
    """The innovations of the observer whose transitions `steps` were computed about the states `about`, (K - 1, d).

    Args:
        steps: K - 1 transitions.
        about: the states about which they are linear.
        y: K measurements, (K, y).
        C: rows that select the measured states, (y, d).
        L: gain of the observer, (d, y).
        start: first state, before its correction, (d,).
        offset, by_offset: offset of the measurements, (y,), and its derivative by the values, (y, P).
        restarts: indices of intervals after which the observer starts again at the state in `F`.
    """
    count, d = y.shape[0], start.size
    values = by_offset.shape[1]
    closed = steps.Phi @ (np.eye(d) - L @ C)
    rest = np.empty((count - 1, d, 1 + values))
    corrected = (y[:-1] - offset) @ L.T - about
    rest[:, :, 0] = steps.F + np.einsum("kij,kj->ki", steps.Phi, corrected)
    rest[:, :, 1:] = steps.G
    if np.any(by_offset):
        rest[:, :, 1:] -= steps.Phi @ (L @ by_offset)
    closed[restarts] = 0.0
    rest[restarts, :, 0], rest[restarts, :, 1:] = steps.F[restarts], 0.0
    first = np.zeros((d, 1 + values))
    first[:, 0] = start
    Z = _recursion(closed, rest, first)
    measured = C @ Z
    error = y - offset - measured[:, :, 0]
    return Innovations(error, -measured[:, :, 1:] - by_offset, Z[:, :, 0] + error @ L.T)


def _recursion(A: Array, b: Array, first: Array) -> Array:
    """The matrices `Z_(k+1) = A_k Z_k + b_k` from `Z_0 = first`, (K + 1, d, m).

    All segments of the recursion start at zero and run at once, with the products of their `A_k`. Then the starts follow one by one.
    """
    count, d, m = b.shape
    length = max(1, int(np.sqrt(0.3 * count)))
    segments = -(-count // length)
    missing = segments * length - count
    A = np.concatenate([A, np.zeros((missing, d, d))]).reshape(segments, length, d, d)
    b = np.concatenate([b, np.zeros((missing, d, m))]).reshape(segments, length, d, m)
    own, products = np.empty((segments, length, d, m)), np.empty((segments, length, d, d))
    own[:, 0], products[:, 0] = b[:, 0], A[:, 0]
    for k in range(1, length):
        own[:, k] = A[:, k] @ own[:, k - 1] + b[:, k]
        products[:, k] = A[:, k] @ products[:, k - 1]
    starts = np.empty((segments, d, m))
    starts[0] = first
    for k in range(1, segments):
        starts[k] = products[k - 1, -1] @ starts[k - 1] + own[k - 1, -1]
    own += products @ starts[:, None]
    return np.concatenate([first[None], own.reshape(-1, d, m)[:count]])
