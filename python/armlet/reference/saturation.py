"""Joint velocities within bounds that keep the direction of every command ("sns"), and the bounds that follow from joint limits.

    level i:  r = U U' v_i,  U the leading left vectors of J_i N,  N a null basis of the rows of the levels above
              min |J_i x - s r|  over x and 0 <= s <= 1,  then the largest s;  both hold for the lower levels
    last      the smallest |x|
    at distance d from a limit     the largest u with  u dt <= d  and  u^2 <= 2 a d  (u > 0),  by bisection
    the same with u held for dt    the largest u with  u dt + u^2 / (2 a) <= d  (u > 0)
    acceleration held for dt       the largest u at its end with  (v + u) dt/2 + sum of the next samples <= d,  by bisection

J_i and v_i are the Jacobian and the task velocity of the level. x are the velocities, v_min <= x <= v_max. s is the scale of the level.
Every minimum is found by enumeration of the joints at their bounds (`inequality`), which is slow from about six joints on. dt is the
sample time and a the braking deceleration. With a metric W the Jacobians are J W^-1/2, and `root` = W^-1/2
converts to joint velocities. U' is the transpose of U.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .diagnosis import _above, _null_basis, projected_ranks
from .inequality import Level, _minimum
from .lagrange import Array


def solve_saturated(
    blocks: list[Array], targets: list[Array], root: Array, lower: Array, upper: Array, rounding: float
) -> tuple[Array, list[int], Array]:
    """The joint velocities within the bounds `lower` and `upper`, (n,), and the ranks and the scales of all levels.

    `blocks` are the Jacobians in the coordinates of the metric, and `targets` the task velocities. The matrix `root`, (n, n), converts
    these coordinates to joint velocities.
    """
    ranks, n = projected_ranks(blocks, rounding), root.shape[0]
    scales = []
    # The last coordinate is s, which is between 0 and 1.
    fixed: Level = (np.eye(n + 1), np.r_[lower, 0.0], np.r_[upper, 1.0])
    fixed[0][:n, :n] = root
    one: Level = (np.eye(n + 1)[n:], np.ones(1), np.ones(1))
    for level, (J, v) in enumerate(zip(blocks, targets, strict=True)):
        N = _null_basis(_above(blocks, level), sum(ranks[:level]))
        U = np.linalg.svd(J @ N, full_matrices=False)[0][:, : ranks[level]]
        rows, none = np.c_[J, -U @ (U.T @ v)], np.zeros(len(J))
        distance = rows @ _minimum((rows, none, none), fixed)
        z = _minimum(one, _with_tasks(fixed, rows, distance))
        scales.append(z[n])
        fixed = _with_tasks(fixed, np.c_[J, none], J @ z[:n])
    x = _minimum((np.eye(n + 1), np.zeros(n + 1), np.zeros(n + 1)), fixed)[:n]
    return np.clip(root @ x, lower, upper), ranks, np.array(scales)


def _with_tasks(level: Level, rows: Array, values: Array) -> Level:
    """A level with additional tasks."""
    return np.vstack([level[0], rows]), np.r_[level[1], values], np.r_[level[2], values]


def _fastest(d: float, dt: float, a: float, held: bool) -> float:
    """The largest velocity at the distance d from a limit, for a sample time dt and a braking deceleration a; it may be negative.

    If it is `held`, the joint brakes only after the time dt.
    """
    if np.isinf(d):
        return np.inf
    low, high = -abs(d) / dt - 1.0, abs(d) / dt + 1.0
    while low < (middle := 0.5 * (low + high)) < high:
        allowed = middle * dt <= d and (middle <= 0.0 or middle * middle / (2.0 * a) + (middle * dt if held else 0.0) <= d)
        low, high = (middle, high) if allowed else (low, middle)
    return low


def joint_bounds(
    q: float, q_min: float, q_max: float, v_min: float, v_max: float, dt: float, a_max: float, held: bool = False
) -> tuple[float, float]:
    """The velocity bounds of one joint.

    Outside of a limit, the joint must return, at a speed from which it can stop before the other limit.
    """
    lower = min(max(-_fastest(q - q_min, dt, a_max, held), v_min), v_max)
    upper = min(max(_fastest(q_max - q, dt, a_max, held), v_min), v_max)
    if lower <= upper:
        return lower, upper
    return (upper, upper) if q < q_min else (lower, lower)


def _after_sample(d: float, v: float, dt: float, a: float) -> float:
    """The largest velocity towards a limit after a sample, from which samples of deceleration stop the joint at the limit.

    The distance of each sample is added. A velocity away from the limit ends in one sample.
    """
    if np.isinf(d):
        return np.inf

    def distance(w: float) -> float:
        total = (v + w) * dt / 2
        if w <= 0.0:
            return total + w * dt / 2
        while w > 0.0:
            after = max(w - a * dt, 0.0)
            total, w = total + (w + after) * dt / 2, after
        return total

    high = abs(d) / dt + abs(v) + 1.0
    low = -high
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if distance(middle) <= d else (low, middle)
    return low


def joint_bounds_of_sample(
    q: float, v: float, q_min: float, q_max: float, v_min: float, v_max: float, dt: float, a_max: float
) -> tuple[float, float]:
    """The bounds of one joint's acceleration for a sample, after which it can still stop within its limits."""
    lower = min(max(-_after_sample(q - q_min, -v, dt, a_max), v_min), v_max)
    upper = min(max(_after_sample(q_max - q, v, dt, a_max), v_min), v_max)
    if lower > upper:
        lower = upper = upper if q < q_min else lower
    return float(np.clip((lower - v) / dt, -a_max, a_max)), float(np.clip((upper - v) / dt, -a_max, a_max))


def velocity_bounds(
    q: ArrayLike, q_min: ArrayLike, q_max: ArrayLike, v_max: ArrayLike, *, dt: float, a_max: ArrayLike | None = None
) -> tuple[Array, Array]:
    """The lower and upper velocity bounds (n,) from joint limits, for one sample of length dt, s."""
    given: list[Any] = [q, q_min, q_max, v_max, np.inf if a_max is None else a_max]
    columns = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in given))
    pairs = [joint_bounds(x, low, high, -v, v, dt, a) for x, low, high, v, a in zip(*columns, strict=True)]
    bounds = np.array(pairs).reshape(-1, 2)
    return bounds[:, 0], bounds[:, 1]
