"""Joint velocities for tasks with priorities, from matrices.

    exact       x = J_1# v_1 + (J_2 P_1)# (v_2 - J_2 J_1# v_1),  P_1 = 1 - J_1# J_1, level after level
                here:  min |J_i (x + N y) - v_i|, min |y|,  N an orthonormal null basis of all rows above,
                with  rank(rows down to i) - rank(rows above)  singular values of J_i N
    clamp       A_i = J_i P_{i-1},  x += A_i+ (v_i - J_i x),  R_i = 1 - A_i+ A_i,  P_i = (P_{i-1} R_i^2 P_{i-1})^1/2
                A+ = A' phi(A A'),   phi(mu) = 1/max(mu, eps^2) on the eigenvalues
    damped      as clamp, but x += A_i' (A_i A_i' + lambda^2)^-1 (v_i - J_i x),  lambda = eps (1 - prod min(1, sigma/eps))
    chiaverini  x = sum_i N_i N_i' J_i+ v_i,  J_i+ as in clamp, N_i as in exact                            (Chiaverini 1997)
    sns         the x of the smallest norm within bounds that has the largest scale s of each level, J_i x = s v_i (see `saturation`)
    weight      min x'Wx: x is W^-1/2 times the result of the methods above for the Jacobians J_i W^-1/2

x are the joint velocities, J_i and v_i the Jacobian and the task velocity of level i, and sigma the singular values of A_i. A' is the
transpose of A, and A# its pseudo-inverse. `diagnosis` computes the ranks.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .diagnosis import EPS, _above, _blocks, _null_basis, projected_ranks
from .lagrange import Array
from .saturation import solve_saturated


class Solution(NamedTuple):
    """Joint velocities v (n,). For each level i: the residual v_i - J_i v, the rank of the projected Jacobian, and the scale of v_i."""

    v: Array
    residuals: list[Array]
    ranks: list[int]
    scales: Array


def solve_exact(jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], rounding: float = 8 * EPS) -> Solution:
    """Joint velocities by the method "exact", for the tasks J_i v = v_i of `jacobians` and `velocities`.

    Each level solves its least-squares problem in the null space of the levels above, with the smallest norm. `rounding` is the relative
    error of the Jacobians.
    """
    blocks, targets, _ = _problem(jacobians, velocities, 1.0)
    ranks = projected_ranks(blocks, rounding)
    x = np.zeros(blocks[0].shape[1])
    for level, (J, target) in enumerate(zip(blocks, targets, strict=True)):
        N = _null_basis(_above(blocks, level), sum(ranks[:level]))
        left, sigma, right = np.linalg.svd(J @ N, full_matrices=False)
        keep = slice(0, ranks[level])
        x = x + N @ (right[keep].T @ ((left[:, keep].T @ (target - J @ x)) / sigma[keep]))
    return _solution(x, blocks, targets, ranks)


def clamp_inverse(A: Array, eps: float) -> Array:
    """The clamped inverse A' phi(A A'): a singular value sigma below eps is inverted as sigma / eps^2.

    The eigenvectors U of A A' only divide the rows U'A into two sets. A QR decomposition inverts the rows with singular values from eps on.
    Division by eigenvalues would square the condition number.
    """
    mu, U = np.linalg.eigh(A @ A.T)
    rows = U.T @ A
    large = mu >= eps * eps
    Q, R = np.linalg.qr(rows[large].T)
    inverse: Array = Q @ np.linalg.solve(R.T, U[:, large].T) + (rows[~large].T / (eps * eps)) @ U[:, ~large].T
    return inverse


def default_eps(jacobians: Sequence[ArrayLike]) -> list[float]:
    """The default eps of each level: 0.02 times its largest row norm, or 1 for a block of zeros."""
    sizes = [float(np.linalg.norm(J, axis=1).max(initial=0.0)) for J in _blocks(jacobians)]
    return [0.02 * size if size > 0.0 else 1.0 for size in sizes]


def damped_inverse(A: Array, eps: float) -> Array:
    """The damped inverse A' (A A' + lambda^2)^-1. Its damping lambda is zero if every singular value is at least eps."""
    # The singular values come from an SVD. The roots of the eigenvalues of A A' would be 1e-8 |A| for a zero singular value.
    damping = eps * (1.0 - float(np.prod(np.minimum(1.0, np.linalg.svd(A, compute_uv=False) / eps))))
    if damping == 0.0:
        return clamp_inverse(A, eps)
    # Least squares with stacked rows: the normal equations would square the condition number.
    m, k = A.shape
    inverse: Array = np.linalg.lstsq(np.vstack([A, damping * np.eye(k)]), np.vstack([np.eye(m), np.zeros((k, m))]), rcond=None)[0]
    return inverse


def solve_clamp(
    jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], eps: float | Sequence[float] | None = None, damped: bool = False
) -> Solution:
    """Joint velocities by the method "clamp", or "damped" if `damped`.

    They depend continuously on the Jacobians, and equal those of "exact" if every singular value of the projected Jacobians is at least
    eps.
    """
    blocks, targets, levels = _problem(jacobians, velocities, eps)
    n = blocks[0].shape[1]
    x, d, V = np.zeros(n), np.ones(n), np.eye(n)  # P = V diag(d) V'
    for J, target, e in zip(blocks, targets, levels, strict=True):
        # The velocity of this level is a combination of columns of V. So it does not disturb previous levels, even if A is only
        # a rounding error.
        A = (J @ V) * d
        inverse = clamp_inverse(A, e)
        x = x + V @ ((damped_inverse(A, e) if damped else inverse) @ (target - J @ x))
        _, d, rows = np.linalg.svd((np.eye(d.size) - inverse @ A) @ (V * d).T, full_matrices=False)
        alive = d > 8 * n * EPS
        d, V = d[alive], rows[alive].T
    return _solution(x, blocks, targets, projected_ranks(blocks, 8 * EPS))


def solve_chiaverini(
    jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], eps: float | Sequence[float] | None = None, rounding: float = 8 * EPS
) -> Solution:
    """Joint velocities by the method "chiaverini": each level is solved alone, and its solution is then projected.

    The projection is on the null space of the levels above. No projected Jacobian is inverted.
    """
    blocks, targets, levels = _problem(jacobians, velocities, eps)
    ranks = projected_ranks(blocks, rounding)
    x = np.zeros(blocks[0].shape[1])
    for level, (J, target, e) in enumerate(zip(blocks, targets, levels, strict=True)):
        N = _null_basis(_above(blocks, level), sum(ranks[:level]))
        x = x + N @ (N.T @ (clamp_inverse(J, e) @ target))
    return _solution(x, blocks, targets, ranks)


def _problem(
    jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], eps: float | Sequence[float] | None
) -> tuple[list[Array], list[Array], list[float]]:
    blocks = _blocks(jacobians)
    targets = [np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in velocities]
    levels = default_eps(blocks) if eps is None else [float(e) for e in np.broadcast_to(np.asarray(eps, dtype=np.float64), len(blocks))]
    return blocks, targets, levels


def _solution(x: Array, blocks: list[Array], targets: list[Array], ranks: list[int], scales: Array | None = None) -> Solution:
    residuals = [v - J @ x for J, v in zip(blocks, targets, strict=True)]
    return Solution(x, residuals, ranks, np.ones(len(blocks)) if scales is None else scales)


def solve_priority(
    jacobians: Sequence[ArrayLike],
    velocities: Sequence[ArrayLike],
    method: str = "clamp",
    eps: float | Sequence[float] | None = None,
    rounding: float | None = None,
    *,
    weight: ArrayLike | None = None,
    v_min: ArrayLike | None = None,
    v_max: ArrayLike | None = None,
) -> Solution:
    """Joint velocities (n,) for levels J_i v = v_i, the highest priority first.

    `method` is "exact", "clamp", "damped", "chiaverini" or "sns". `weight` (n, n) is the metric of joint velocities. `v_min` and `v_max`,
    scalar or (n,), are the bounds of "sns".
    """
    relative = 8 * EPS if rounding is None else rounding
    blocks, targets, _ = _problem(jacobians, velocities, 1.0)
    values, U = np.linalg.eigh(np.eye(blocks[0].shape[1]) if weight is None else np.asarray(weight, dtype=np.float64))
    root: Array = np.eye(values.size) if weight is None else (U / np.sqrt(values)) @ U.T  # W^-1/2
    scaled = [J @ root for J in blocks]
    if method == "exact":
        found = solve_exact(scaled, targets, relative)
    elif method in ("clamp", "damped"):
        found = solve_clamp(scaled, targets, eps, damped=method == "damped")
    elif method == "chiaverini":
        found = solve_chiaverini(scaled, targets, eps, relative)
    elif method == "sns":
        lower, upper = _bounds(v_min, v_max, values.size)
        v, ranks, scales = solve_saturated(scaled, targets, root, lower, upper, relative)
        return _solution(v, blocks, targets, ranks, scales)
    else:
        raise ValueError(f"solve_priority: method is unknown: expected one of exact, clamp, damped, chiaverini, sns, got {method!r}")
    return _solution(root @ found.v, blocks, targets, found.ranks)


def _bounds(v_min: ArrayLike | None, v_max: ArrayLike | None, n: int) -> tuple[Array, Array]:
    """The lower and upper bounds (n,). A missing bound is minus the other bound."""
    if v_min is None and v_max is None:
        raise ValueError("solve_priority: v_max is missing: expected bounds for method sns")
    upper = -np.asarray(v_min, dtype=np.float64) if v_max is None else np.asarray(v_max, dtype=np.float64)
    lower = -upper if v_min is None else np.asarray(v_min, dtype=np.float64)
    return np.broadcast_to(lower, (n,)), np.broadcast_to(upper, (n,))
