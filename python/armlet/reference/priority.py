"""Prioritised velocities from plain matrices.

    exact       q_dot = J1# p1_dot + (J2 P1)# (p2_dot - J2 J1# p1_dot),  P1 = I - J1# J1, level after level      (SPEC (5))
                here:  min |J_i (x + N y) - v_i|, min |y|,  N an orthonormal null basis of all rows above,
                with as many singular values of J_i N as  rank(rows down to i) - rank(rows above)
    clamp       A_i = J_i P_{i-1},  x += A_i+ (v_i - J_i x),  R_i = I - A_i+ A_i,  P_i = (P_{i-1} R_i^2 P_{i-1})^1/2
                A+ = A' phi(A A'),  phi(mu) = 1/max(mu, eps^2) on the eigenvalues
    damped      the same with x += A_i' (A_i A_i' + lambda^2)^-1 (v_i - J_i x),  lambda = eps (1 - prod min(1, sigma/eps))
    chiaverini  x = sum_i N_i N_i' J_i+ v_i,  J_i+ clamped, N_i as in exact                                (Chiaverini 1997)

Ranks count singular values of stacked rows above rounding * sigma_max, each block first divided by its own norm, because
tasks have different units. No singular value of a projected Jacobian is ever compared with the projected Jacobian itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array

EPS = float(np.finfo(np.float64).eps)


class Solution(NamedTuple):
    """v (n,), the residuals v_i - J_i v per level, and the ranks of the projected Jacobians."""

    v: Array
    residuals: list[Array]
    ranks: list[int]


class Diagnosis(NamedTuple):
    """Ranks of each block, of the stack, of each block projected on the null space above; overlap; kind."""

    ranks: list[int]
    stacked_rank: int
    projected_ranks: list[int]
    overlap: int
    kind: str


def _blocks(jacobians: Sequence[ArrayLike]) -> list[Array]:
    return [np.atleast_2d(np.asarray(J, dtype=np.float64)) for J in jacobians]


def _unit(J: Array) -> Array:
    """The block on its own scale; a zero block stays zero."""
    size = np.linalg.norm(J)
    return J / size if size > 0.0 else J


def _rank(rows: Array, rounding: float) -> int:
    if rows.size == 0:
        return 0
    sigma = np.linalg.svd(rows, compute_uv=False)
    return int(np.count_nonzero(sigma > rounding * max(float(sigma[0]), np.finfo(np.float64).tiny)))


def _null_basis(rows: Array, rank: int) -> Array:
    """Orthonormal columns that span the null space of rows whose rank is known."""
    n = rows.shape[1]
    basis: Array = np.eye(n) if rows.size == 0 else np.linalg.svd(rows)[2][rank:].T
    return basis


def diagnose_priority(jacobians: Sequence[ArrayLike], rounding: float = 8 * EPS) -> Diagnosis:
    """Ranks by the rule rank(stack) - rank(rows above); rounding is the relative error of the entries."""
    blocks = _blocks(jacobians)
    n = blocks[0].shape[1]
    stack = [_rank(np.vstack([_unit(J) for J in blocks[: i + 1]]), rounding) for i in range(len(blocks))]
    ranks = [_rank(J, rounding) for J in blocks]
    overlap = sum(ranks) - stack[-1]
    names = []
    if stack[-1] < min(sum(ranks), n):
        names.append("algorithmic")
    if any(rank < J.shape[0] for rank, J in zip(ranks, blocks, strict=True)):
        names.append("kinematic")
    projected = [after - before for before, after in zip([0, *stack], stack, strict=False)]
    return Diagnosis(ranks, stack[-1], projected, overlap, "+".join(names) or "regular")


def solve_exact(jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], rounding: float = 8 * EPS) -> Solution:
    """The exact hierarchy: lexicographic least squares, least norm at each level."""
    blocks, targets, _ = _problem(jacobians, velocities, 1.0)
    ranks = diagnose_priority(blocks, rounding).projected_ranks
    x = np.zeros(blocks[0].shape[1])
    for level, (J, target) in enumerate(zip(blocks, targets, strict=True)):
        N = _null_basis(_above(blocks, level), sum(ranks[:level]))
        left, sigma, right = np.linalg.svd(J @ N, full_matrices=False)
        keep = slice(0, ranks[level])
        x = x + N @ (right[keep].T @ ((left[:, keep].T @ (target - J @ x)) / sigma[keep]))
    return Solution(x, [v - J @ x for J, v in zip(blocks, targets, strict=True)], ranks)


def clamp_inverse(A: Array, eps: float) -> Array:
    """A' phi(A A'): singular values below eps are inverted as sigma / eps^2.

    The eigenvectors U of A A' only split the rows U'A into the two sorts; those above eps are inverted by QR, because
    dividing by eigenvalues would square the condition number (primary residual 1e-12 instead of 1e-14).
    """
    mu, U = np.linalg.eigh(A @ A.T)
    rows = U.T @ A
    large = mu >= eps * eps
    Q, R = np.linalg.qr(rows[large].T)
    inverse: Array = Q @ np.linalg.solve(R.T, U[:, large].T) + (rows[~large].T / (eps * eps)) @ U[:, ~large].T
    return inverse


def default_eps(jacobians: Sequence[ArrayLike]) -> list[float]:
    """0.02 of each level's largest row norm (1 for a block of zeros, which asks for nothing)."""
    sizes = [float(np.linalg.norm(J, axis=1).max(initial=0.0)) for J in _blocks(jacobians)]
    return [0.02 * size if size > 0.0 else 1.0 for size in sizes]


def damped_inverse(A: Array, eps: float) -> Array:
    """A' (A A' + lambda^2)^-1 with damping that vanishes where every singular value is at least eps."""
    mu = np.maximum(np.linalg.eigvalsh(A @ A.T)[::-1][: min(A.shape)], 0.0)
    damping = eps * (1.0 - float(np.prod(np.sqrt(np.minimum(1.0, mu / (eps * eps))))))
    if damping == 0.0:
        return clamp_inverse(A, eps)
    # The stacked least-squares form: the normal equations would square the condition number.
    m, k = A.shape
    inverse: Array = np.linalg.lstsq(np.vstack([A, damping * np.eye(k)]), np.vstack([np.eye(m), np.zeros((k, m))]), rcond=None)[0]
    return inverse


def solve_clamp(
    jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], eps: float | Sequence[float] | None = None, damped: bool = False
) -> Solution:
    """The continuous map; equals the exact one where every singular value is at least eps."""
    blocks, targets, levels = _problem(jacobians, velocities, eps)
    n = blocks[0].shape[1]
    x, d, V = np.zeros(n), np.ones(n), np.eye(n)  # P = V diag(d) V'
    for J, target, e in zip(blocks, targets, levels, strict=True):
        # Working in V keeps the answer out of the rows above even where A is rounding noise over eps^2.
        A = (J @ V) * d
        inverse = clamp_inverse(A, e)
        x = x + V @ ((damped_inverse(A, e) if damped else inverse) @ (target - J @ x))
        _, d, rows = np.linalg.svd((np.eye(d.size) - inverse @ A) @ (V * d).T, full_matrices=False)
        alive = d > 8 * n * EPS
        d, V = d[alive], rows[alive].T
    return Solution(x, [v - J @ x for J, v in zip(blocks, targets, strict=True)], diagnose_priority(blocks).projected_ranks)


def solve_chiaverini(
    jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], eps: float | Sequence[float] | None = None, rounding: float = 8 * EPS
) -> Solution:
    """Each level solved alone and projected; nothing projected is inverted."""
    blocks, targets, levels = _problem(jacobians, velocities, eps)
    ranks = diagnose_priority(blocks, rounding).projected_ranks
    x = np.zeros(blocks[0].shape[1])
    for level, (J, target, e) in enumerate(zip(blocks, targets, levels, strict=True)):
        N = _null_basis(_above(blocks, level), sum(ranks[:level]))
        x = x + N @ (N.T @ (clamp_inverse(J, e) @ target))
    return Solution(x, [v - J @ x for J, v in zip(blocks, targets, strict=True)], ranks)


def _problem(
    jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], eps: float | Sequence[float] | None
) -> tuple[list[Array], list[Array], list[float]]:
    blocks = _blocks(jacobians)
    targets = [np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in velocities]
    levels = default_eps(blocks) if eps is None else [float(e) for e in np.broadcast_to(np.asarray(eps, dtype=np.float64), len(blocks))]
    return blocks, targets, levels


def _above(blocks: list[Array], level: int) -> Array:
    """The rows above a level, each block on its own scale."""
    return np.vstack([np.zeros((0, blocks[0].shape[1])), *[_unit(block) for block in blocks[:level]]])


def solve_priority(
    jacobians: Sequence[ArrayLike],
    velocities: Sequence[ArrayLike],
    method: str = "clamp",
    eps: float | Sequence[float] | None = None,
    rounding: float | None = None,
) -> Solution:
    """Joint velocities (n,) for levels J_i v = v_i in falling priority; method "exact", "clamp", "damped" or "chiaverini"."""
    relative = 8 * EPS if rounding is None else rounding
    if method == "exact":
        return solve_exact(jacobians, velocities, relative)
    if method in ("clamp", "damped"):
        return solve_clamp(jacobians, velocities, eps, damped=method == "damped")
    if method == "chiaverini":
        return solve_chiaverini(jacobians, velocities, eps, relative)
    raise ValueError(f"solve_priority: method is unknown: expected one of exact, clamp, damped, chiaverini, got {method!r}")


# s2, s3, s4 different from zero (None: any) -> class and the ranks of J1, J2, J_E, J2 P1
MACRO_MICRO_CLASSES: tuple[tuple[bool, bool | None, bool, str, tuple[int, int, int, int]], ...] = (
    (True, None, True, "R", (2, 2, 4, 2)),
    (True, None, False, "A", (2, 2, 3, 1)),
    (False, None, True, "S2", (2, 1, 3, 1)),
    (False, True, False, "AS", (2, 1, 2, 0)),
    (False, False, False, "D", (1, 1, 2, 1)),
)


def macro_micro_class(q: ArrayLike, angle_tol: float = 1e-9) -> tuple[str, tuple[int, int, int, int]]:
    """SPEC system 2's table for the planar 4R with tasks at the tips of links 4 and 2; multiples of pi count as zero."""
    moved = np.abs(np.sin(np.asarray(q, dtype=np.float64)[1:])) > angle_tol
    for s2, s3, s4, name, ranks in MACRO_MICRO_CLASSES:
        if s2 == moved[0] and s4 == moved[2] and (s3 is None or s3 == moved[1]):
            return name, ranks
    raise AssertionError("the table covers every sign pattern")
