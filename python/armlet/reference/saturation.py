"""Joint velocities within bounds, level by level ("sns"), and the bounds that follow from joint limits.

    level i:  J_i v = s v_i,  v = x + N z,  v_min <= v <= v_max,  N a null basis of the rows above,  the largest feasible s <= 1
    fixed joints F:  v(s) = x_F + N_F (J_i N_F)# (s v_i - J_i x_F),   x_F = x + N (E_F N)# (b_F - E_F x),   N_F = N null(E_F N)
    while s = 1 violates a bound   the joint with the smallest limit of s is added to F; among equal ones the fastest  (Flacco et al. 2015)
    at distance d from a limit     the largest u with  u dt <= d  and  u^2 <= 2 a d  (u > 0),  by bisection
    the same with u held for dt    the largest u with  u dt + u^2 / (2 a) <= d  (u > 0)

J_i and v_i are the Jacobian and the task velocity of the level, and x is the solution of the levels above. s is the scale of the level. E_F
are the rows of the unit matrix for the joints F, and b_F their bounds. null(A) is an orthonormal null basis, A# the pseudo-inverse of A. dt
is the sample time and a the braking deceleration. With a metric W the Jacobians are J W^-1/2, and `back` = W^-1/2 converts to joint
velocities.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .diagnosis import EPS, _above, _null_basis, projected_ranks
from .lagrange import Array

MOBILE = 1e-10  # a joint whose row in the remaining null space has a smaller norm cannot be fixed
NOISE = 64 * EPS  # the rounding error of v(s), relative to its largest terms, which cancel near singularities
EDGES = np.array([1e-13, 1e-11])  # the range, relative to the fastest joint, of the excess over a bound that counts as a rounding error
ALIKE = 1e-9  # scales whose relative difference is smaller count as equal


def _inverse(A: Array, rank: int) -> Array:
    """The pseudoinverse of A that uses its `rank` largest singular values."""
    U, sigma, V = np.linalg.svd(A, full_matrices=False)
    inverse: Array = (V[:rank].T / sigma[:rank]) @ U[:, :rank].T
    return inverse


def _scales(va: Array, vb: Array, lower: Array, upper: Array, noise: float) -> tuple[Array, Array]:
    """The interval of s with lower <= s va + vb <= upper, for each joint; (inf, -inf) if it is empty.

    `noise` is the size of rounding errors. Smaller rates `va` and smaller distances to a bound count as zero.
    """
    rate, above, below = (np.where(np.abs(x) <= noise, 0.0, x) for x in (va, upper - vb, vb - lower))
    still = np.where((above >= 0.0) & (below >= 0.0), np.inf, -np.inf)
    speed = np.where(rate == 0.0, 1.0, np.abs(rate))
    ahead, behind = np.where(rate > 0.0, above, below), np.where(rate > 0.0, below, above)
    return np.where(rate == 0.0, -still, -behind / speed), np.where(rate == 0.0, still, ahead / speed)


def _saturate(
    J: Array, v: Array, x: Array, N: Array, rank: int, cut: float, root: Array, bounds: tuple[Array, Array]
) -> tuple[Array, float]:
    """The solution of one level within bounds, in the coordinates of the metric, and the scale of the level."""
    lower, upper = bounds
    fixed: list[tuple[int, float]] = []
    best, scale = x, -1.0
    while True:
        rows = root[[joint for joint, _ in fixed]].reshape(-1, x.size)
        held = np.array([bound for _, bound in fixed])
        at = x + N @ (_inverse(rows @ N, len(fixed)) @ (held - rows @ x)) if fixed else x
        free = N @ _null_basis(rows @ N, len(fixed)) if fixed else N
        A = J @ free
        if np.count_nonzero(np.linalg.svd(A, compute_uv=False) > cut) < rank:
            break
        G = free @ _inverse(A, rank)
        va, vb = root @ (G @ v), root @ (at - G @ (J @ at))
        noise = NOISE * float(np.abs(va).max() + np.abs(vb).max())
        least, most = _scales(va, vb, lower, upper, noise)
        loose = [j for j in range(x.size) if j not in dict(fixed)]
        high = min([1.0, *most[loose]])
        if high >= 0.0 and high > scale:
            speed = root @ (at + G @ (high * v - J @ at))
            edge = np.clip(noise, *np.abs(speed).max() * EDGES)
            if np.all((speed >= lower - edge) & (speed <= upper + edge)):
                best, scale = np.linalg.solve(root, np.clip(speed, lower, upper)), high
        violating = [j for j in loose if least[j] > 1.0 or most[j] < 1.0]
        if not violating or free.shape[1] == 0:
            break
        tightest = min(most[violating])
        alike = [j for j in violating if most[j] == tightest or most[j] - tightest <= ALIKE * abs(tightest)]
        joint = max(alike, key=lambda j: abs(va[j]))
        bound = float(upper[joint] if va[joint] + vb[joint] > upper[joint] else lower[joint])
        if not np.isfinite(bound) or np.linalg.norm(root[joint] @ free) <= MOBILE * np.linalg.norm(root[joint]):
            break
        fixed.append((joint, bound))
    return best, max(scale, 0.0)


def solve_saturated(
    blocks: list[Array], targets: list[Array], root: Array, lower: Array, upper: Array, rounding: float
) -> tuple[Array, list[int], Array]:
    """The joint velocities within the bounds `lower` and `upper`, (n,), and the ranks and the scales of all levels.

    `blocks` are the Jacobians in the coordinates of the metric, and `targets` the task velocities. The matrix `root`, (n, n), converts
    these coordinates to joint velocities.
    """
    ranks = projected_ranks(blocks, rounding)
    x = np.linalg.solve(root, np.clip(0.0, lower, upper))
    scales, condition = [], 1.0
    for level, (J, v) in enumerate(zip(blocks, targets, strict=True)):
        N = _null_basis(_above(blocks, level), sum(ranks[:level]))
        cut = rounding * float(np.linalg.norm(J, 2)) * condition
        x, scale = _saturate(J, v, x, N, ranks[level], cut, root, (lower, upper))
        scales.append(scale)
        if ranks[level]:
            condition *= float(np.linalg.norm(J, 2) / np.linalg.svd(J @ N, compute_uv=False)[ranks[level] - 1])
    return np.clip(root @ x, lower, upper), ranks, np.array(scales)


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


def velocity_bounds(
    q: ArrayLike, q_min: ArrayLike, q_max: ArrayLike, v_max: ArrayLike, *, dt: float, a_max: ArrayLike | None = None
) -> tuple[Array, Array]:
    """The lower and upper velocity bounds (n,) from joint limits, for one sample of length dt, s."""
    given: list[Any] = [q, q_min, q_max, v_max, np.inf if a_max is None else a_max]
    columns = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in given))
    pairs = [joint_bounds(x, low, high, -v, v, dt, a) for x, low, high, v, a in zip(*columns, strict=True)]
    bounds = np.array(pairs).reshape(-1, 2)
    return bounds[:, 0], bounds[:, 1]
