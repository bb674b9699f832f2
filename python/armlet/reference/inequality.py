"""Levels of rows with bounds, by enumeration of active sets, and the certificate of any solution.

    level k     min |w_k|^2,  w = A x - clip(A x, l, u),  with the w of higher levels
    candidates  min |E x - e|^2 + |C_S x - b_S|^2,   H_S x = h_S
    last level  the same with x = 0
    certificate A_k' w_k + sum lambda_i a_i = 0,  lambda_i >= 0 at upper, <= 0 at lower bounds

The feasible candidate with the smallest |w_k|^2 is the optimum, because the active rows are one of the sets S of rows. E are the tasks
(l = u) of the level, and e their commands. C are its other rows. H are the rows of higher levels that stay within bounds. The certificate
is the residual of non-negative least squares over the unit rows a_i of higher levels (Lawson and Hanson 1974). Multipliers of tasks are
free. The number of candidates grows exponentially, so that `solve_inequalities` is for small problems. A' is the transpose of A.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array

#: A level: its rows (m, n), its lower bounds (m,) and its upper bounds (m,).
Level = tuple[Array, Array, Array]
CUT = 1e-10  # singular values of unit rows below it count as zero
MET = 1e-14  # a candidate with a smaller violation, relative to the terms of the level, is the minimum
NOISE = 1e-9  # violations below this multiple of the row norm and the norm of x count as zero


class Inequalities(NamedTuple):
    """The solution x (n,), and the violations of each level."""

    x: Array
    violations: list[Array]


def solve_inequalities(levels: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]], weight: ArrayLike | None = None) -> Inequalities:
    """Solve levels `(A, lower, upper)`, the highest first. `weight` (n, n) is the metric of x."""
    stack = [_level(level) for level in levels]
    n = stack[0][0].shape[1]
    root = np.eye(n) if weight is None else np.linalg.cholesky(np.asarray(weight, dtype=np.float64)).T
    fixed: Level = (np.zeros((0, n)), np.zeros(0), np.zeros(0))
    x = np.zeros(n)
    for A, lower, upper in [*stack, (root, np.zeros(n), np.zeros(n))]:
        x = _minimum((A, lower, upper), fixed)
        w = violation((A, lower, upper), x)
        value = A @ x
        kept: Level = (A, np.where(w == 0, lower, value), np.where(w == 0, upper, value))
        fixed = (np.vstack([fixed[0], kept[0]]), np.r_[fixed[1], kept[1]], np.r_[fixed[2], kept[2]])
    return Inequalities(x, [violation(level, x) for level in stack])


def violation(level: Level, x: Array) -> Array:
    """The violations w = A x - clip(A x, l, u) (m,). Rounding errors are zero."""
    A, lower, upper = level
    w = A @ x - np.clip(A @ x, lower, upper)
    return np.where(np.abs(w) <= NOISE * np.linalg.norm(A, axis=1) * max(1.0, float(np.linalg.norm(x))), 0.0, w)


def certificate(levels: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]], x: Array) -> float:
    """The largest residual of the optimality conditions of all levels and of the smallest norm, relative to the largest term."""
    n, size = x.size, max(float(np.linalg.norm(x)), 1e-300)
    normals: list[Array] = []
    worst = 0.0
    for A, lower, upper in [*(_level(level) for level in levels), (np.eye(n), np.zeros(n), np.zeros(n))]:
        w, task = violation((A, lower, upper), x), lower == upper
        w = np.where(task, A @ x - lower, w)
        rows = np.linalg.norm(A, axis=1)
        scale = max(float(np.max(rows, initial=0.0)) * float(np.max(rows * size + np.abs(w), initial=0.0)), 1e-300)
        matrix = np.array(normals).reshape(-1, n).T
        worst = max(worst, float(np.linalg.norm(_nonnegative_residual(matrix, A.T @ w / scale))))
        at_upper = A @ x >= upper - NOISE * rows * size
        at_lower = A @ x <= lower + NOISE * rows * size
        for i in np.flatnonzero((rows > 0) & (task | (w != 0) | at_upper | at_lower)):
            free = task[i] or w[i] != 0 or (at_upper[i] and at_lower[i])
            sides = [1.0, -1.0] if free else [1.0] if at_upper[i] else [-1.0]
            normals += [side * A[i] / rows[i] for side in sides]
    return worst


def _level(level: tuple[ArrayLike, ArrayLike, ArrayLike]) -> Level:
    A, lower, upper = (np.asarray(part, dtype=np.float64) for part in level)
    return np.atleast_2d(A), np.atleast_1d(lower), np.atleast_1d(upper)


def _minimum(level: Level, fixed: Level) -> Array:
    """The feasible candidate with the smallest violation of the level."""
    A, lower, upper = level
    task = fixed[1] == fixed[2]
    best, goal = None, np.inf
    free = [_sides(fixed, int(i)) for i in np.flatnonzero(~task)]
    own = [_sides(level, int(i)) for i in np.flatnonzero(lower != upper)]
    for held in itertools.product(*free):
        H = [(fixed[0][i], fixed[1][i]) for i in np.flatnonzero(task)] + [side for side in held if side is not None]
        if sum(side is not None for side in held) > A.shape[1]:
            continue
        for pulled in itertools.product(*own):
            M = [(A[i], lower[i]) for i in np.flatnonzero(lower == upper)] + [side for side in pulled if side is not None]
            x = _least_squares(M, H, A.shape[1])
            if x is None or violation(fixed, x).any():
                continue
            size = float(np.sum((A @ x - np.clip(A @ x, lower, upper)) ** 2))
            if size < goal:
                best, goal = x, size
            if size <= (MET * (np.linalg.norm(A) * np.linalg.norm(x) + np.linalg.norm(np.clip(0.0, lower, upper)))) ** 2:
                return x
    assert best is not None, "the set of the higher levels is not empty"
    return best


def _sides(level: Level, i: int) -> list[tuple[Array, float] | None]:
    """The candidates of row i: not active, and at each finite bound."""
    A, lower, upper = level
    return [None, *((A[i], float(bound)) for bound in (lower[i], upper[i]) if np.isfinite(bound))]


def _least_squares(M: list[tuple[Array, float]], H: list[tuple[Array, float]], n: int) -> Array | None:
    """The x of the smallest norm with min |M x - m| among H x = h; None if the latter rows contradict each other."""
    x, N = np.zeros(n), np.eye(n)
    if H:
        rows, values = _unit(H)
        x = np.linalg.pinv(rows, rcond=CUT) @ values
        if np.abs(rows @ x - values).max() > NOISE * max(1.0, float(np.abs(values).max())):
            return None
        _, s, V = np.linalg.svd(rows)
        N = V[int((s > CUT).sum()) :].T
    if M and N.size:
        rows = np.array([row for row, _ in M])
        values = np.array([value for _, value in M]) - rows @ x
        x = x + N @ np.linalg.lstsq(rows @ N, values, rcond=CUT)[0]
    return x


def _unit(rows: list[tuple[Array, float]]) -> tuple[Array, Array]:
    """The rows divided by their norms. Rows of zeros are unchanged."""
    matrix = np.array([row for row, _ in rows])
    size = np.linalg.norm(matrix, axis=1)
    size = np.where(size > 0, size, 1.0)
    return matrix / size[:, None], np.array([value for _, value in rows]) / size


def _nonnegative_residual(B: Array, g: Array) -> Array:
    """The residual g + B lambda with the smallest norm, lambda >= 0."""
    chosen: list[int] = []
    weights = np.zeros(B.shape[1])
    for _ in range(20 * B.shape[1] + 20):
        residual = g + B @ weights
        descent = -B.T @ residual
        descent[chosen] = -np.inf
        if not descent.size or descent.max() <= 1e-13 * max(1.0, float(np.linalg.norm(g))):
            break
        chosen.append(int(descent.argmax()))
        for trial in _trials(B, g, chosen):
            steps = [weights[i] / (weights[i] - t) for i, t in zip(chosen, trial, strict=True) if t <= 0]
            step = min(steps, default=1.0)
            weights[chosen] += step * (trial - weights[chosen])
            if not steps:
                break
            chosen[:] = [i for i in chosen if weights[i] > 1e-15]
            weights[[i for i in range(weights.size) if i not in chosen]] = 0.0
    return np.asarray(g + B @ weights)


def _trials(B: Array, g: Array, chosen: list[int]) -> Iterator[Array]:
    """The least-squares weights of the chosen columns, again after each change of the list."""
    while chosen:
        yield np.asarray(np.linalg.lstsq(B[:, chosen], -g, rcond=CUT)[0], dtype=np.float64)
